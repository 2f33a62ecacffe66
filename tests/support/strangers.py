"""Other users of this machine, for tests that run as root."""

import os
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from daemon_process import BUILD_TREE
from daemon_under_test import DaemonUnderTest

STRANGER = 54321  # an unused uid
root_only = pytest.mark.skipif(os.geteuid() != 0, reason="requires root to act as another user")


@contextmanager
def open_to_strangers(rules: str) -> Iterator[DaemonUnderTest]:
    """Run a daemon that other users can connect to, in a folder that they can enter."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)
        daemon = DaemonUnderTest(folder)
        daemon.settings.write_text(rules)
        daemon.start("--config", str(daemon.settings))
        daemon.socket.chmod(0o666)
        try:
            yield daemon
        finally:
            daemon.end()


@contextmanager
def stranger(
    program: str, *arguments: str, user: str = str(STRANGER)
) -> Iterator["subprocess.Popen[str]"]:
    """Run Python as another user."""
    process = subprocess.Popen(
        ["setpriv", f"--reuid={user}", "--clear-groups", "--",
         "/usr/bin/python3", "-c", program, *arguments],
        stdout=subprocess.PIPE, stdin=subprocess.PIPE, text=True,
        env={"PYTHONPATH": str(BUILD_TREE / "python")},
    )  # fmt: skip
    try:
        yield process
    finally:
        process.kill()
        process.communicate()
