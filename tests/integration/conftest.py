"""rtcfd and the executor of the build tree, without ROS, in a folder of a test's own."""

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf

BUILD_TREE = Path(str(rtcf.__file__)).parents[2]
DEADLINE_S = 30.0
_POLL_S = 0.01

NO_ROS = "[runner]\nfrequency_hz = 2000\n[runner.ros]\nenabled = false\n"


def wait_for(condition: Callable[[], Any], what: str) -> Any:
    """Return the condition's result when it is true; fail after the deadline."""
    deadline = time.monotonic() + DEADLINE_S
    while not (result := condition()):
        assert time.monotonic() < deadline, f"waited {DEADLINE_S:g} s for {what}"
        time.sleep(_POLL_S)
    return result


class Daemon:
    """rtcfd as a process, its folder and its log."""

    def __init__(self, folder: Path) -> None:
        self.socket = folder / "control.sock"
        self.log_file = folder / "log"
        self._folder = folder
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it is ready."""
        settings = self._folder / "rtcfd.toml"
        settings.write_text(NO_ROS)
        with self.log_file.open("ab") as log:
            begin = log.tell()
            self._process = subprocess.Popen(
                [
                    *(str(BUILD_TREE / "bin" / "rtcfd"), "--foreground"),
                    *("--socket", str(self.socket), "--config", str(settings)),
                    *("--state-dir", str(self._folder / "state")),
                ],
                stderr=log,
            )
        wait_for(lambda: "ready;" in self.log()[begin:], "rtcfd")

    def log(self) -> str:
        return self.log_file.read_text()

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End it; return the exit status."""
        assert self._process is not None
        self._process.send_signal(number)
        return self._process.wait(DEADLINE_S)

    @property
    def ended(self) -> bool:
        return self._process is None or self._process.poll() is not None


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    daemon = Daemon(tmp_path)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


@pytest.fixture
def client(daemon: Daemon) -> Iterator[rtcf.Client]:
    with rtcf.Client(daemon.socket) as client:
        yield client
