"""The processes of the demo: a private ROS master, a private rtcfd, ROS nodes.

All their files are in one temporary folder.  Each process runs in a session of
its own: Ctrl-C reaches the demo alone, which then ends the processes by pid, in
reverse order.
"""

import contextlib
import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

_END_TIMEOUT_S = 20.0
_POLL_S = 0.02
_LAST_LINES = 15


class Failure(Exception):
    """The demo cannot continue; the text is shown to the user."""


class Child:
    """One process, with a log of its standard error and a thread that reads its output."""

    def __init__(
        self, name: str, command: list[str], environment: dict[str, str], folder: Path
    ) -> None:
        self.name = name
        self.newest: dict[str, Any] = {}  # the last line of JSON it printed
        self._log = folder / f"{name.replace(' ', '-')}.log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                command,
                env=environment,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=log,
                start_new_session=True,
            )
        self.pid = self._process.pid
        self._reader = threading.Thread(target=self._read, name=f"reads {name}")
        self._reader.start()

    def check(self) -> None:
        """Raise Failure if it has ended."""
        status = self._process.poll()
        if status is not None:
            raise Failure(f"{self.name} ended with status {status}:\n{self.log_tail()}")

    def log_tail(self) -> str:
        """Return the end of its log."""
        return "\n".join(self._log.read_text(errors="replace").splitlines()[-_LAST_LINES:])

    def end(self, number: signal.Signals) -> str:
        """End the process by a signal; return an error text, empty if it ended in order."""
        if self._process.poll() is None:
            self._process.send_signal(number)
        error = ""
        try:
            status = self._process.wait(_END_TIMEOUT_S)
            if status not in (0, -number):
                error = f"{self.name} ended with status {status}:\n{self.log_tail()}"
        except subprocess.TimeoutExpired:
            error = f"{self.name} did not end within {_END_TIMEOUT_S:g} s and was killed"
            self._process.kill()
            self._process.wait()
        self._reader.join()
        return error

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                # Skip lines that are not JSON: roscore prints text.
                with contextlib.suppress(ValueError):
                    found = json.loads(line)
                    if isinstance(found, dict):
                        self.newest = found


class Processes:
    """All children and their folder."""

    def __init__(self, build: Path) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="rtcf-demo-"))
        self.socket = self.folder / "control.sock"
        self.master_uri = f"http://localhost:{_free_port()}"
        self._build = build
        self._children: list[tuple[Child, signal.Signals]] = []
        # Drop the settings of any ROS or Python environment in the caller's shell.
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("ROS", "PYTHON", "RTCF"))}
        self._environment = kept | {
            "ROS_MASTER_URI": self.master_uri,
            "ROS_HOSTNAME": "localhost",
            "ROS_HOME": str(self.folder / "ros"),
            "ROS_LOG_DIR": str(self.folder / "ros" / "log"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }

    def start_master(self) -> Child:
        """Start roscore and return when it answers."""
        import rosgraph

        port = self.master_uri.rpartition(":")[2]
        child = self._start("ROS master", ["/usr/bin/roscore", "-p", port], signal.SIGINT)
        self.wait_until(lambda: bool(rosgraph.is_master_online(self.master_uri)), "the ROS master")
        return child

    def start_rtcfd(self) -> Child:
        """Start rtcfd and return when it serves."""
        command = [
            *(str(self._build / "bin" / "rtcfd"), "--foreground", "--socket", str(self.socket)),
            *("--state-dir", str(self.folder / "state")),
        ]
        child = self._start("rtcfd", command, signal.SIGTERM)
        self.wait_until(self.socket.exists, "rtcfd")
        return child

    def start_node(self, name: str, program: Path) -> Child:
        """Start a ROS node."""
        return self._start(name, ["/usr/bin/python3", str(program)], signal.SIGTERM)

    def wait_until(self, condition: Callable[[], bool], name: str, timeout_s: float = 30.0) -> None:
        """Return when the condition holds; raise Failure if a child ends or at the timeout.

        `name` describes the condition in the error text.
        """
        deadline = time.monotonic() + timeout_s
        while not condition():
            self.check()
            if time.monotonic() > deadline:
                logs = "".join(f"\n{c.name}: {c.log_tail()}" for c, _ in self._children)
                raise Failure(f"waited {timeout_s:g} s for {name}{logs}")
            time.sleep(_POLL_S)

    def check(self) -> None:
        """Raise Failure if a child has ended."""
        for child, _ in self._children:
            child.check()

    def end(self) -> list[str]:
        """End all processes and remove the folder; return the error texts."""
        errors = []
        while self._children:
            child, number = self._children.pop()
            if error := child.end(number):
                errors.append(error)
        if self.socket.exists():
            errors.append("rtcfd did not remove its socket")
        shutil.rmtree(self.folder)
        return errors

    def _start(self, name: str, command: list[str], number: signal.Signals) -> Child:
        child = Child(name, command, self._environment, self.folder)
        self._children.append((child, number))
        return child


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])
