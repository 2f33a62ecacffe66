"""rtcfctl and rtcfd from a process that has imported them: half of their processor time is imports.

    WarmStart(build_tree).start("rtcfctl", ["status"], environment, out, err).wait()

Each program is forked from a process of its own, which this process starts at the first call, and
which ends with it. It behaves as the one in build/bin except for its command line in /proc. Tests
of the start itself call that one.
"""

import json
import os
import signal
import socket
import subprocess
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import time_table

_SERVER = Path(__file__).with_name("warm_server.py")
# Python reads these before it runs the first line of a program.
_LOCALE = ("LANG", "LC_")


class WarmProcess:
    """A program that was forked; similar to subprocess.Popen."""

    def __init__(self, answers: socket.socket) -> None:
        """`answers` receives its process id, and later its status and processor time."""
        self._answers = answers
        self.returncode: int | None = None
        self.pid = int(self._answer())

    def _answer(self) -> str:
        text = self._answers.recv(100).decode()
        assert text, "the process that forks programs has ended"
        return text

    def poll(self) -> int | None:
        """Return the status, or None while it runs."""
        try:
            return self.wait(0.0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; return the status, negative for a signal."""
        if self.returncode is None:
            self._answers.settimeout(timeout)
            try:
                status, processor_s = self._answer().split()
            except (BlockingIOError, TimeoutError):
                raise subprocess.TimeoutExpired([str(self.pid)], timeout or 0.0) from None
            self._answers.close()
            self.returncode = int(status)
            time_table.count(float(processor_s))
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it a signal unless it has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):  # it has ended since
                os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it unless it has ended."""
        self.send_signal(signal.SIGKILL)


class WarmStart:
    """The processes of this one that fork programs, one per program and locale."""

    def __init__(self, build_tree: Path) -> None:
        self._build_tree = build_tree
        self._lock = threading.Lock()
        self._servers: dict[tuple[str, tuple[tuple[str, str], ...]], socket.socket] = {}

    def start(
        self,
        program: str,
        words: Sequence[str],
        environment: Mapping[str, str],
        out: int,
        err: int,
        *,
        session: bool = False,
    ) -> WarmProcess:
        """Start a program of build/bin with these descriptors, in its own session if asked."""
        mine, its = socket.socketpair()
        request = {
            "words": [os.fspath(word) for word in words],
            "environment": dict(environment),
            "folder": os.getcwd(),
            "session": session,
        }
        with self._lock, its:
            server = self._server(program, environment)
            socket.send_fds(server, [json.dumps(request).encode()], [out, err, its.fileno()])
        return WarmProcess(mine)

    def run(
        self, program: str, words: Sequence[str], environment: Mapping[str, str], timeout: float
    ) -> subprocess.CompletedProcess[str]:
        """Run a program of build/bin, as subprocess.run() does with captured output."""
        with open(os.memfd_create("out"), "w+") as out, open(os.memfd_create("err"), "w+") as err:
            process = self.start(program, words, environment, out.fileno(), err.fileno())
            try:
                status = process.wait(timeout)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                raise
            for each in (out, err):
                each.seek(0)
            return subprocess.CompletedProcess([program, *words], status, out.read(), err.read())

    def _server(self, program: str, environment: Mapping[str, str]) -> socket.socket:
        locale = sorted(each for each in environment.items() if each[0].startswith(_LOCALE))
        key = (program, tuple(locale))
        if key not in self._servers:
            mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with its:
                arguments = [program, str(self._build_tree), str(its.fileno())]
                subprocess.Popen(
                    ["/usr/bin/python3", "-I", str(_SERVER), *arguments],
                    env=dict(environment),
                    pass_fds=[its.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                )
            self._servers[key] = mine
        return self._servers[key]
