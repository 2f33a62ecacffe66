"""The booted machine of the system tests, with rtcf's packages installed."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from machine import Machine
from rtcf_service import Service

DEBS = Path(os.environ.get("RTCF_DEBS", Path(__file__).parents[2] / "build" / "deb"))
collect_ignore = ["virtual"]  # run in another machine; see run-virtual
# Tests that change the packages themselves run last, in this order.
_LAST = ("test_upgrade", "test_purge", "test_debian_upgrade")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Fail if not started by tests/system/run, and order the files."""
    if "RTCF_SYSTEM_ROOT" not in os.environ:
        raise pytest.UsageError("these tests boot a Debian: run them by tests/system/run")
    order = {name: place for place, name in enumerate(_LAST, start=1)}
    items.sort(key=lambda item: order.get(item.path.stem, 0))


@pytest.fixture(scope="session")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    """Yield a booted Debian without rtcf's packages, but with their dependencies."""
    folder = tmp_path_factory.mktemp("machine")
    root = Path(os.environ["RTCF_SYSTEM_ROOT"])
    machine = Machine(root, os.environ["RTCF_SYSTEM_NAME"], folder)
    machine.boot()
    yield machine
    machine.stop()


@pytest.fixture(scope="session")
def machine(bare: Machine) -> Machine:
    """Yield the Debian with rtcf's packages installed as an administrator does."""
    bare.path("/debs").mkdir()
    for deb in DEBS.glob("*.deb"):
        if "-dbgsym_" not in deb.name:
            bare.path(f"/debs/{deb.name}").write_bytes(deb.read_bytes())
    log = "/var/log/rtcf-install.log"
    install = f"apt-get install --yes --quiet /debs/*.deb >{log} 2>&1"
    bare.shell(f"{install} || {{ tail --lines=20 {log}; exit 1; }}")
    for user in ("alice", "bob", "carol", "mallory"):
        bare.run("useradd", "--create-home", user)
    for user in ("alice", "bob", "carol"):
        bare.run("adduser", "--quiet", user, "rtcf")
    return bare


@pytest.fixture
def service(machine: Machine) -> Iterator[Service]:
    """Yield the running service in the state after its installation; restore its settings."""
    service = Service(machine)
    service.reset()
    yield service
    service.reset()
