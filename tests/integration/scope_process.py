"""`rtcfctl scope` as a process, and what somebody asks of it."""

import http.client
import json
import signal
import subprocess
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for
from rtcf.closing import Closing


class ScopeProcess(Closing):
    """A scope of a daemon; ends at the end of its `with`."""

    def __init__(self, daemon: Daemon, *arguments: str) -> None:
        log = self.log = Path(tempfile.mkdtemp(dir=daemon.folder)) / "said"
        environment = daemon.environment() | {"XDG_STATE_HOME": str(daemon.folder / "home")}
        for display in ("DISPLAY", "WAYLAND_DISPLAY"):
            environment.pop(display, None)
        with log.open("wb") as to:
            self.process = subprocess.Popen(
                [str(BUILD_TREE / "bin" / "rtcfctl"), "scope", *arguments],
                env=environment, stdin=subprocess.DEVNULL, stdout=to, stderr=to,
                # Where tests run in the background Ctrl-C is ignored.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
            )  # fmt: skip

        def said() -> str:
            assert self.process.poll() is None, log.read_text()
            text = log.read_text()
            return text if "token=" in text and text.endswith("\n") else ""

        self.said: str = wait_for(said, "the scope's address")
        self.address = self.said.split()[0]
        self.port = urlsplit(self.address).port or 0
        self.token = self.address.partition("token=")[2]

    def close(self) -> None:
        self.process.send_signal(signal.SIGINT)
        self.process.wait(DEADLINE_S)

    def ask(
        self, path: str, method: str = "GET", body: str | None = None, *, token: str | None = None,
        **headers: str,
    ) -> tuple[int, bytes]:  # fmt: skip
        """Return status and body of an answer; of no other headers than these.

        `_` in the name of a header is `-`; an empty token says none.
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

    def told(self, path: str, method: str = "GET", body: str | None = None) -> Any:
        """Return what an answer tells in JSON."""
        status, text = self.ask(path, method, body)
        assert status == 200, text
        return json.loads(text)
