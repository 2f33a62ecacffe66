"""rtcfctl and rtcfd from a process that has imported them: half of their processor time is imports.

    WARM.start("rtcfctl", ["status"], environment, out, err).wait()

Each program is forked from a process of its own, which this process starts at the first call, and
which ends with it. It behaves as the one in build/bin except for its command line in /proc. Tests
of the start itself call that one.
"""

import array
import json
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
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
            os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it unless it has ended."""
        self.send_signal(signal.SIGKILL)


class WarmStart:
    """The processes of this one that fork programs, one per program."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._servers: dict[tuple[str, str, tuple[tuple[str, str], ...]], socket.socket] = {}

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
        descriptors = array.array("i", [out, err, its.fileno()])
        with self._lock, its:
            self._server(program, environment).sendmsg(
                [json.dumps(request).encode()],
                [(socket.SOL_SOCKET, socket.SCM_RIGHTS, descriptors)],
            )
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
                process.send_signal(signal.SIGKILL)
                process.wait()
                raise
            for each in (out, err):
                each.seek(0)
            return subprocess.CompletedProcess([program, *words], status, out.read(), err.read())

    def _server(self, program: str, environment: Mapping[str, str]) -> socket.socket:
        build = Path(sys.modules["rtcf"].__file__ or "").parents[2]
        special = {name: value for name, value in environment.items() if name.startswith(_LOCALE)}
        key = (program, str(build), tuple(sorted(special.items())))
        if key not in self._servers:
            mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with its:
                subprocess.Popen(
                    ["/usr/bin/python3", "-I", _SERVER, program, build, str(its.fileno())],
                    env=dict(environment),
                    pass_fds=[its.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                )
            self._servers[key] = mine
        return self._servers[key]


WARM = WarmStart()
