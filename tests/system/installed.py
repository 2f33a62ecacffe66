"""Calls of installed programs, for the tests in this folder."""

import subprocess
from pathlib import Path

import pytest


def run(*command: str) -> subprocess.CompletedProcess[str]:
    """Run a command; what it said is in the failure if it fails."""
    done = subprocess.run(command, text=True, capture_output=True, timeout=120, check=False)
    if done.returncode != 0:
        pytest.fail(f"{' '.join(command)}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return done


class Daemon:
    """An installed rtcfd, run without systemd, and the rtcfctl that talks to it."""

    def __init__(self, folder: Path) -> None:
        self._socket = folder / "control.sock"
        self._process = subprocess.Popen(
            ["/usr/bin/rtcfd", "--foreground", "--socket", str(self._socket),
             "--config", "/etc/rtcfd/rtcfd.toml", "--realtime", "preferred"]
        )  # fmt: skip

    def ctl(self, *arguments: str) -> str:
        """Call rtcfctl and return its output."""
        return run("/usr/bin/rtcfctl", "--socket", str(self._socket), *arguments).stdout

    def wait_until_it_serves(self) -> None:
        """Return as soon as a client gets an answer."""
        for _ in range(100):
            if self._process.poll() is not None:
                pytest.fail(f"rtcfd ended with status {self._process.returncode}")
            if self._socket.exists():
                return
            try:
                self._process.wait(0.1)
            except subprocess.TimeoutExpired:
                continue
        pytest.fail("rtcfd did not serve within 10 s")

    def end(self) -> int:
        """Ask it to end, and return its exit status."""
        self._process.terminate()
        return self._process.wait(30)
