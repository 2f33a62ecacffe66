"""A rtcfd for a test that asks for one."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_under_test import DaemonUnderTest


@pytest.fixture
def stopped_daemon(tmp_path: Path) -> Iterator[DaemonUnderTest]:
    """One that a test starts itself."""
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
        daemon.end()


@pytest.fixture
def daemon(stopped_daemon: DaemonUnderTest) -> DaemonUnderTest:
    return stopped_daemon.start()


@pytest.fixture
def client(daemon: DaemonUnderTest) -> Iterator[rtcf.Client]:
    with daemon.client() as client:
        yield client
