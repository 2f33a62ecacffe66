"""Fixtures: a daemon, a client, a ROS master and a browser."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from browser import Browser
from daemon_process import NO_ROS, Daemon, with_ros
from launch_processes import Launching
from ros_processes import Master
from rtcf.v1 import runner_pb2


@pytest.fixture
def settings() -> str:
    """Return the settings of `daemon`; modules may override them."""
    return NO_ROS


@pytest.fixture
def daemon(tmp_path: Path, settings: str) -> Iterator[Daemon]:
    """Yield an rtcfd whose loops have no ROS node."""
    daemon = Daemon(tmp_path, settings)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


@pytest.fixture
def client(daemon: Daemon) -> Iterator[rtcf.Client]:
    """Yield a client of `daemon`."""
    with rtcf.Client(daemon.socket) as client:
        yield client


@pytest.fixture
def running(daemon: Daemon, client: rtcf.Client) -> Iterator[Daemon]:
    """Yield `daemon` with a running loop of two components."""
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave", parameters=["rate:=1.0"]))
    client.load(rtcf.component("rtcf_examples", "Mimo", name="mimo"))
    client.start()
    yield daemon
    client.stop()


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Master]:
    """Yield a ROS master on its own port, shared by the tests of a module."""
    master = Master(tmp_path_factory.mktemp("master"))
    master.start()
    yield master
    master.end()


@pytest.fixture
def launching(tmp_path: Path, master: Master) -> Iterator[Launching]:
    """Yield a starter of launch nodes at the module's master; end the nodes afterwards."""
    launching = Launching(master, tmp_path)
    launching.forget()
    yield launching
    launching.end()


@pytest.fixture(scope="module")
def chromium(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """Yield a headless browser, shared by the tests of a module."""
    with Browser(tmp_path_factory.mktemp("browser")) as browser:
        yield browser


@pytest.fixture
def ros_daemon(tmp_path: Path, master: Master) -> Iterator[tuple[Daemon, rtcf.Client]]:
    """Yield a daemon without mapped connections, and its client."""
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
        yield daemon, client
    daemon.end()
