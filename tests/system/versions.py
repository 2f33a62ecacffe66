"""Packages of another version, and an rtcfd of another protocol."""

from machine import Machine

_PACKAGE = "/usr/lib/python3/dist-packages/rtcfd"

# Copies of packages with a version that ends in {suffix}, and with the files of rtcfd changed.
_COPY = r"""
set -e
mkdir -p {into}
for deb in {debs}/*.deb; do
  dpkg-deb --raw-extract $deb /srv/up
  version=$(dpkg-deb --field $deb Version)
  sed -i "s/\b$version\b/$version+{suffix}/g" /srv/up/DEBIAN/control
  find /srv/up -name '*.py' -exec touch {{}} +
  if [ -d /srv/up{package} ]; then
    {change}
    (cd /srv/up; find * -path DEBIAN -prune -o -type f -print0 | xargs -0 md5sum >DEBIAN/md5sums)
  fi
  dpkg-deb -Znone --build /srv/up {into}/ >/dev/null
  rm -r /srv/up
done
"""

_NEXT = r"""
    sed -i 's/^VERSION = "\(.*\)"/VERSION = "\1+upgrade"/' /srv/up{package}/__init__.py
    sed -i 's/^PROTOCOL = .*/PROTOCOL = {protocol}/' /srv/up{package}/executor/link.py
"""

# As by compiling again.
_OTHER_BUILD = r"""
    python3 -c '
from pathlib import Path
from rtcfd.common.build_id import build_id
program = Path("/srv/up/usr/lib/rtcf/rtcf-executor")
present = bytes.fromhex(build_id(program))
program.write_bytes(program.read_bytes().replace(present, bytes(len(present))))
'
"""


def protocol(machine: Machine) -> int:
    """Return the protocol version of the installed rtcfd."""
    text = machine.path(f"{_PACKAGE}/executor/link.py").read_text()
    (line,) = [line for line in text.splitlines() if line.startswith("PROTOCOL = ")]
    return int(line.partition("= ")[2])


def speak(machine: Machine, number: int) -> None:
    """Set the protocol version of the installed rtcfd, from its next start on."""
    machine.shell(f"sed -i 's/^PROTOCOL = .*/PROTOCOL = {number}/' {_PACKAGE}/executor/link.py")


def make_higher(machine: Machine, debs: str, into: str) -> str:
    """Create packages of a higher version whose rtcfd speaks the next protocol; return their
    files."""
    change = _NEXT.format(package=_PACKAGE, protocol=protocol(machine) + 1)
    return _copy(machine, debs, into, "upgrade", change)


def make_revision(machine: Machine, debs: str, into: str) -> str:
    """Create packages of a higher Debian revision, whose sources are the same; return their
    files."""
    return _copy(machine, debs, into, "again", _OTHER_BUILD)


def _copy(machine: Machine, debs: str, into: str, suffix: str, change: str) -> str:
    machine.shell(
        _COPY.format(debs=debs, into=into, suffix=suffix, package=_PACKAGE, change=change)
    )
    return f"{into}/*.deb"
