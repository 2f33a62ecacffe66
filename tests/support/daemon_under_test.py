"""A rtcfd of the build tree in its own folder, with the peer executor."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, WARM, wait_for
from warm_start import WarmProcess


class DaemonUnderTest:
    """rtcfd as a process, with its folders and its log."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.socket = folder / "control.sock"
        self.state = folder / "state"
        self.packages = folder / "lib"
        self.log_file = folder / "log"
        self.executor = folder / "executor"
        self.process: WarmProcess | None = None
        self.environment: dict[str, str] = {}
        self.settings = folder / "rtcfd.toml"
        self.graphs = folder / "graphs.d"
        peer = Path(__file__).with_name("peer_executor.py")
        self.executor.write_text(
            "#!/bin/sh\n"
            f'[ "$1" = --check-settings ] && exec {BUILD_TREE}/bin/rtcf-executor "$@"\n'
            # Skip the build tree's own libraries: each would start Python for nothing.
            f'case "$*" in *--describe\\ {BUILD_TREE}/*) exit 1 ;; esac\n'
            f'PYTHONPATH={BUILD_TREE}/python exec {sys.executable} {peer} "$@"\n'
        )
        self.executor.chmod(0o755)

    def package(self, name: str, library: str = "main", **contents: Any) -> Path:
        """Write a library of a package; return its path."""
        file = self.packages / name / f"{library}.so"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(contents))
        return file

    def start_service(self) -> "DaemonUnderTest":
        """Start rtcfd as systemd does."""
        self.settings.touch()
        self.graphs.mkdir(exist_ok=True)
        return self.start(
            *("--runtime-dir", str(self.folder / "run"), "--config", str(self.settings)),
            *("--graphs-dir", str(self.graphs)),
            foreground=False,
        )

    def start(self, *options: str, foreground: bool = True) -> "DaemonUnderTest":
        """Start rtcfd and wait until it is ready."""
        with self.log_file.open("ab") as log:
            begin = len(self.log())
            words = [
                *(["--foreground"] if foreground else []),
                *("--socket", str(self.socket), "--state-dir", str(self.state)),
                *("--path", str(self.packages), "--executor", str(self.executor)),
                *options,
            ]
            environment = os.environ | self.environment
            self.process = WARM.start("rtcfd", words, environment, 1, log.fileno())
        wait_for(lambda: "ready;" in self.log()[begin:] or self.process_ended(), "rtcfd")
        return self

    def process_ended(self) -> bool:
        return self.process is not None and self.process.poll() is not None

    def log(self) -> str:
        return self.log_file.read_text()

    def client(self) -> rtcf.Client:
        return rtcf.Client(self.socket)

    def ctl(self, *arguments: str, wrapper: Sequence[str] = ()) -> subprocess.CompletedProcess[str]:
        """Run rtcfctl; `wrapper` is a command that runs it."""
        environment = {**os.environ, "RTCF_SOCKET": str(self.socket)}
        if not wrapper:
            return WARM.run("rtcfctl", arguments, environment, DEADLINE_S)
        return subprocess.run(
            [*wrapper, str(BUILD_TREE / "bin" / "rtcfctl"), *arguments],
            env=environment,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
        )

    def ctl_process(self, *arguments: str) -> subprocess.Popen[str]:
        """Start a call of rtcfctl."""
        return subprocess.Popen(
            [str(BUILD_TREE / "bin" / "rtcfctl"), *arguments],
            env={**os.environ, "RTCF_SOCKET": str(self.socket)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def executor_pid(self, runner: str = "") -> int:
        with self.client() as client:
            return int(client.get_status(runner or "rt_runner").runners[0].pid)

    def saved(self, runner: str = "rt_runner") -> dict[str, Any]:
        """Return the state on disk."""
        document: dict[str, Any] = json.loads((self.state / f"{runner}.json").read_text())
        return document

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """Send a signal and return the exit status."""
        assert self.process is not None
        self.process.send_signal(number)
        return self.process.wait(DEADLINE_S)
