"""Upgrade and reinstallation: loops run on until an administrator restarts rtcfd."""

from typing import Any

import pytest
from machine import Machine, wait_for
from rtcf_service import Service

# The same packages again, with a higher version.
HIGHER = r"""
set -e
for deb in /debs/*.deb; do
  dpkg-deb --raw-extract $deb /srv/up
  version=$(dpkg-deb --field $deb Version)
  sed -i "s/\b$version\b/$version+upgrade/g" /srv/up/DEBIAN/control
  find /srv/up -name '*.py' -exec touch {} +
  dpkg-deb -Znone --build /srv/up /upgrade/ >/dev/null
  rm -r /srv/up
done
"""


@pytest.fixture(scope="module")
def higher(machine: Machine) -> str:
    machine.shell(f"mkdir /upgrade; {HIGHER}")
    return "/upgrade/*.deb"


def runs_on(service: Service, before: dict[str, Any], daemon: int) -> None:
    after = service.status()
    assert service.pid == daemon
    assert (after["pid"], after["realtime_tid"]) == (before["pid"], before["realtime_tid"])
    assert after["state"] == "running"
    wait_for(lambda: service.iteration() > int(after["iteration"]), "cycles")


def test_a_reinstallation_leaves_the_loop_alone(service: Service) -> None:
    before, daemon = service.load_and_start(), service.pid
    service.machine.shell("apt-get install --yes --quiet --reinstall /debs/rtcfd_*.deb")
    runs_on(service, before, daemon)


def test_an_upgrade_leaves_the_loop_alone_until_the_restart(service: Service, higher: str) -> None:
    before, daemon = service.load_and_start(), service.pid
    assert "restart pending" not in service.ctl("status").stdout
    service.machine.shell(f"apt-get install --yes --quiet {higher}")
    runs_on(service, before, daemon)
    assert "restart pending: rtcfd was upgraded" in service.ctl("status").stdout
    # What is new works with what is old.
    service.ctl("load", "rtcf_examples", "Identity", "--name", "new")

    service.systemctl("restart", "rtcfd.service")
    assert service.pid != daemon
    assert "restart pending" not in service.ctl("status").stdout
    assert service.status()["components"] == 2
