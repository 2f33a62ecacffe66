"""`rtcfctl scope` as a process, requests to it, and loops to show."""

import http.client
import json
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for
from rtcf.connection import Closing
from rtcf.v1 import graph_pb2, runner_pb2


@contextmanager
def looping(
    folder: Path, components: Sequence[graph_pb2.ComponentSpec], frequency_hz: float | None = None
) -> Iterator[Daemon]:
    """Run a daemon with a loop of components within the block."""
    daemon = Daemon(folder)
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            if frequency_hz is not None:
                client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency_hz))
            client.apply(components)
            client.start()
        yield daemon
    finally:
        daemon.end()


class ScopeProcess(Closing):
    """A scope of a daemon; ends with its `with` block."""

    def __init__(
        self, daemon: Daemon, *arguments: str, display: Mapping[str, str] | None = None
    ) -> None:
        """`display` is an environment with a display and its browser."""
        log = self.log = Path(tempfile.mkdtemp(dir=daemon.folder)) / "said"
        environment = daemon.environment() | {"XDG_STATE_HOME": str(daemon.folder / "home")}
        for each in ("DISPLAY", "WAYLAND_DISPLAY"):
            environment.pop(each, None)
        environment |= display or {}
        with log.open("wb") as to:
            self.process = subprocess.Popen(
                [str(BUILD_TREE / "bin" / "rtcfctl"), "scope", *arguments],
                env=environment, stdin=subprocess.DEVNULL, stdout=to, stderr=to,
            )  # fmt: skip

        def said() -> str:
            assert self.process.poll() is None, log.read_text()
            text = log.read_text()
            return text if "token=" in text and text.endswith("\n") else ""

        self.said: str = wait_for(said, "the scope's address")
        self._told = len(self.said)
        self.address = self.said.split()[0]
        self.port = urlsplit(self.address).port or 0
        self.token = self.address.partition("token=")[2]

    def news(self) -> str:
        """Return its output since the last call."""
        said = self.log.read_text()
        news, self._told = said[self._told :], len(said)
        return news

    def close(self) -> None:
        self.process.send_signal(signal.SIGINT)
        self.process.wait(DEADLINE_S)

    def ask(
        self, path: str, method: str = "GET", body: str | None = None, *, token: str | None = None,
        **headers: str,
    ) -> tuple[int, bytes]:  # fmt: skip
        """Return status and body of an answer to a request with only these headers.

        `_` in the name of a header stands for `-`; an empty token sends none.
        """
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=DEADLINE_S)
        try:
            connection.putrequest(
                method, path, skip_host="Host" in headers, skip_accept_encoding=True
            )
            given = {name.replace("_", "-"): value for name, value in headers.items()}
            if token != "":
                given["Authorization"] = f"Bearer {token or self.token}"
            if body is not None:
                given["Content-Length"] = str(len(body.encode()))
            for name, value in given.items():
                connection.putheader(name, value)
            connection.endheaders(None if body is None else body.encode())
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def raw(self, data: bytes, patience_s: float = DEADLINE_S) -> tuple[int, bytes]:
        """Send any bytes; return status and body of the answer; status 0 if none arrives."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=patience_s) as connection:
            answer = http.client.HTTPResponse(
                connection, method=data.split(b" ")[0].decode("latin1")
            )
            try:
                connection.sendall(data)
                answer.begin()
                return answer.status, answer.read()
            except (http.client.HTTPException, OSError):
                return 0, b""

    def session(self) -> str:
        """Return a new session."""
        return str(self.told("/api/session", "POST")["session"])

    def told(self, path: str, method: str = "GET", body: str | None = None) -> Any:
        """Return the JSON content of an answer."""
        status, text = self.ask(path, method, body)
        assert status == 200, text
        return json.loads(text)
