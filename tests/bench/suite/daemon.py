"""rtcfd of the build tree, started for one benchmark in its own folder."""

import os
import subprocess
import tempfile
import time
from pathlib import Path
from types import TracebackType

import rtcf
from processes import Failed
from setting import Setting

_DEADLINE_S = 60.0


class Daemon:
    """A running rtcfd, stopped at the end of the `with` block."""

    def __init__(self, setting: Setting, ros: bool = False) -> None:
        self._setting = setting
        self._ros = ros

    def __enter__(self) -> "Daemon":
        self._folder = tempfile.TemporaryDirectory(prefix="rtcf-bench-")
        folder = Path(self._folder.name)
        self.socket = folder / "s"
        config = folder / "rtcfd.toml"
        # No process listens at this port, so the node waits for a master all the time.
        ros = "master_uri = 'http://localhost:1'" if self._ros else "enabled = false"
        config.write_text(f"[runner.ros]\n{ros}\n")
        self._log = (folder / "log").open("w")
        self.process = subprocess.Popen(
            [
                *(self.program("rtcfd"), "--foreground", "--socket", str(self.socket)),
                *("--config", str(config), "--state-dir", str(folder / "state")),
            ],
            stderr=self._log,
            env={**os.environ, "ROS_HOSTNAME": "localhost"},
            start_new_session=True,
        )
        deadline = time.monotonic() + _DEADLINE_S
        while "ready;" not in (folder / "log").read_text():
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise Failed(f"rtcfd does not start: {(folder / 'log').read_text().strip()}")
            time.sleep(0.01)
        self.client = rtcf.Client(self.socket)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.client.close()
        self.process.terminate()
        try:
            self.process.wait(_DEADLINE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._log.close()
        self._folder.cleanup()

    def program(self, name: str) -> str:
        """Return the path of a program of rtcf."""
        return str(self._setting.build / "bin" / name)

    def call(self, *arguments: str) -> None:
        """Call rtcfctl."""
        done = subprocess.run(
            [self.program("rtcfctl"), *arguments],
            env={**os.environ, "RTCF_SOCKET": str(self.socket)},
            capture_output=True,
            text=True,
            timeout=_DEADLINE_S,
            check=False,
        )
        if done.returncode != 0:
            raise Failed(f"rtcfctl {' '.join(arguments)}: {done.stderr.strip()}")

    @property
    def executor(self) -> int:
        """Return the process id of the default runner's executor."""
        return int(self.client.get_status().runners[0].pid)

    @property
    def servers(self) -> list[int]:
        """Return the process ids of rtcfd and the executor."""
        return [self.process.pid, self.executor]
