"""rtcfd of the build tree as a process, in a folder of a test's own."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rtcf

BUILD_TREE = Path(str(rtcf.__file__)).parents[2]
DEADLINE_S = 60.0
_POLL_S = 0.01

# Degraded where there are no rights: what is tested here is not how long things take.
NO_ROS = "[runner.ros]\nenabled = false\n"


def with_ros(master_uri: str, whitelist: str) -> str:
    """Return settings for a ROS node that loses nothing to a slow subscriber."""
    return f"[runner.ros]\nmaster_uri = '{master_uri}'\nwhitelist = '{whitelist}'\nqueue = 100000\n"


def wait_for(condition: Callable[[], Any], what: str, deadline_s: float = DEADLINE_S) -> Any:
    """Return the condition's result when it is true; fail after the deadline."""
    deadline = time.monotonic() + deadline_s
    while not (result := condition()):
        assert time.monotonic() < deadline, f"waited {deadline_s:g} s for {what}"
        time.sleep(_POLL_S)
    return result


def wait_until_it_is(wanted: Any, ask: Callable[[], Any], what: str) -> None:
    """Return when the answer is the one wanted; fail after the deadline, and show the last one."""
    deadline = time.monotonic() + DEADLINE_S
    while (found := ask()) != wanted:
        assert time.monotonic() < deadline, f"{what}: {found!r} is not {wanted!r}"
        time.sleep(_POLL_S)


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    """Stop a process as a debugger does: inside, none of its threads runs any more."""

    def stands() -> bool:
        try:
            threads = [each.read_text() for each in Path(f"/proc/{pid}/task").glob("*/stat")]
        except OSError:
            return False  # one has just ended
        # One that waits in the kernel for a disk stands, too: it stops before it returns.
        return all(text.rpartition(")")[2].split()[0] in "TD" for text in threads)

    os.kill(pid, signal.SIGSTOP)
    try:
        # The signal stops the thread that takes it first, and that one the others.
        wait_for(stands, f"process {pid} to stand still")
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def clean_environment() -> dict[str, str]:
    """Return ours without any other ROS, rtcfd or Python that the caller may have set up."""
    ours = ("ROS", "RTCF_SOCKET", "PYTHONPATH", "CMAKE_PREFIX_PATH")
    return {name: value for name, value in os.environ.items() if not name.startswith(ours)}


class Daemon:
    """rtcfd, its folder and its log."""

    def __init__(
        self,
        folder: Path,
        settings: str = NO_ROS,
        *,
        arguments: Sequence[str] = (),
        wrapper: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """`arguments` are rtcfd's, `wrapper` is a command that runs it."""
        # Short, as pytest's folders are not, and a unix socket's path has 107 characters.
        self.socket = folder / "s"
        self.log_file = folder / "log"
        self.pid = 0
        self.folder = folder
        self._settings = settings
        self._arguments = arguments
        self._wrapper = wrapper
        self._environment = {"ROS_HOSTNAME": "localhost"} | dict(environment or {})
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it and wait until it is ready."""
        settings = self.folder / "rtcfd.toml"
        settings.write_text(self._settings)
        with self.log_file.open("ab") as log:
            begin = log.tell()
            # In a session of its own, as a terminal's foreground job is in a process group.
            self._process = subprocess.Popen(
                [
                    *self._wrapper,
                    *(str(BUILD_TREE / "bin" / "rtcfd"), "--foreground"),
                    *("--socket", str(self.socket), "--config", str(settings)),
                    *("--state-dir", str(self.folder / "state")),
                    *self._arguments,
                ],
                env=clean_environment() | self._environment,
                stderr=log,
                start_new_session=True,
            )
        self.pid = self._process.pid

        def ready() -> bool:
            assert not self.ended, self.log()
            return "ready;" in self.log()[begin:]

        wait_for(ready, "rtcfd")

    def ctl(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Call rtcfctl."""
        return self.run("rtcfctl", *arguments)

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command with rtcfctl on its PATH and this daemon as the one it talks to."""
        return subprocess.run(
            command,
            env=self.environment(),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )

    def environment(self) -> dict[str, str]:
        """Return the environment of a command that is to talk to this daemon."""
        path = f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}"
        return clean_environment() | {"RTCF_SOCKET": str(self.socket), "PATH": path}

    def log(self) -> str:
        """Return all it has logged, of earlier starts too."""
        return self.log_file.read_text()

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End it; return the exit status."""
        assert self._process is not None
        self._process.send_signal(number)
        return self._process.wait(DEADLINE_S)

    def press_ctrl_c(self) -> int:
        """Do what a terminal does: interrupt the whole process group; return the exit status."""
        assert self._process is not None
        os.killpg(self._process.pid, signal.SIGINT)
        return self._process.wait(DEADLINE_S)

    @property
    def ended(self) -> bool:
        """Tell whether it runs no more."""
        return self._process is None or self._process.poll() is not None
