#!/bin/bash
# In the virtual machine: installs the packages and runs the tests of this folder.
set -euo pipefail
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin
export DEBIAN_FRONTEND=noninteractive PYTHONDONTWRITEBYTECODE=1
udevadm settle
apt-get install --yes --quiet ./debs/*.deb
mkdir -p /usr/lib/rtcf-components/rtcf_faults
cp ./*.so /usr/lib/rtcf-components/rtcf_faults/
mapfile -t arguments <arguments
cd tests
exec /usr/bin/python3 -m pytest -p no:cacheprovider -v "${arguments[@]}" .
