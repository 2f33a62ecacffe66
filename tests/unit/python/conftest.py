"""Fixtures: a rtcfd, as a process or within the test's process."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_under_test import DaemonUnderTest
from rtcfd_in_process import Machine, Rtcfd


@pytest.fixture
def stopped_daemon(tmp_path: Path) -> Iterator[DaemonUnderTest]:
    """Yield a rtcfd that the test starts itself."""
    daemon = DaemonUnderTest(tmp_path)
    daemon.package(
        "demo",
        types={
            "Fine": "fine",
            "Refused": "refused",
            "Crashes": "crashes",
            "Slow": "slow",
            "Logs": "logs",
            "Chatters": "chatters",
        },
    )
    yield daemon
    if daemon.process is not None and daemon.process.poll() is None:
        try:
            daemon.end()
        finally:
            daemon.process.kill()  # a hanging process


@pytest.fixture
def daemon(stopped_daemon: DaemonUnderTest) -> DaemonUnderTest:
    return stopped_daemon.start()


@pytest.fixture
def client(daemon: DaemonUnderTest) -> Iterator[rtcf.Client]:
    with daemon.client() as client:
        yield client


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Yield the executors of a rtcfd within the test's process."""
    machine = Machine()
    machine.install(monkeypatch)
    return machine


@pytest.fixture
def rtcfd(tmp_path: Path, machine: Machine) -> Callable[[], Rtcfd]:
    """Return a function that creates a rtcfd within the test's process, the next life of one."""
    library = tmp_path / "lib" / "demo" / "main.so"
    library.parent.mkdir(parents=True)
    library.write_text(json.dumps({"types": {"Fine": "fine"}}))
    return lambda: Rtcfd(tmp_path, tmp_path / "lib", machine)
