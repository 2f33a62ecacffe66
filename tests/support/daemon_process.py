"""rtcfd of the build tree as a process, in a folder of the test."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rtcf
from warm_start import WarmProcess, WarmStart

BUILD_TREE = Path(str(rtcf.__file__)).parents[2]
WARM = WarmStart(BUILD_TREE)
DEADLINE_S = 60.0
_BETWEEN_S = 0.005
_POLL_S = 0.01

# Without real-time rights the loops run degraded, since these tests measure no time.
NO_ROS = "[runner.ros]\nenabled = false\n"


def with_ros(master_uri: str, whitelist: str) -> str:
    """Return settings for a ROS node that drops no messages for slow subscribers."""
    return f"[runner.ros]\nmaster_uri = '{master_uri}'\nwhitelist = '{whitelist}'\nqueue = 100000\n"


def wait_for(condition: Callable[[], Any], what: str, deadline_s: float = DEADLINE_S) -> Any:
    """Return the condition's result once it is true; fail after the deadline."""
    deadline = time.monotonic() + deadline_s
    while not (result := condition()):
        assert time.monotonic() < deadline, f"waited {deadline_s:g} s for {what}"
        time.sleep(_POLL_S)
    return result


def wait_until_it_is(wanted: Any, ask: Callable[[], Any], what: str) -> None:
    """Wait until `ask` returns `wanted`; after the deadline, fail with the last answer."""
    deadline = time.monotonic() + DEADLINE_S
    while (found := ask()) != wanted:
        assert time.monotonic() < deadline, f"{what}: {found!r} is not {wanted!r}"
        time.sleep(_POLL_S)


def signal_twice(process: subprocess.Popen[Any], number: signal.Signals) -> None:
    """Signal a process twice, as timeout(1) does, which signals the process and its group."""
    process.send_signal(number)
    time.sleep(_BETWEEN_S)
    process.send_signal(number)


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    """Stop a process as a debugger does: within the block, none of its threads runs."""

    def stands() -> bool:
        try:
            threads = [each.read_text() for each in Path(f"/proc/{pid}/task").glob("*/stat")]
        except OSError:
            return False  # a thread has just ended
        # A thread in an uninterruptible wait for a disk counts: it stops before it returns.
        return all(text.rpartition(")")[2].split()[0] in "TD" for text in threads)

    os.kill(pid, signal.SIGSTOP)
    try:
        # The signal stops the thread that receives it first, which then stops the others.
        wait_for(stands, f"process {pid} to stop")
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def clean_environment() -> dict[str, str]:
    """Return the environment without the caller's ROS, rtcfd and Python settings."""
    ours = ("ROS", "RTCF_SOCKET", "PYTHONPATH", "CMAKE_PREFIX_PATH")
    return {name: value for name, value in os.environ.items() if not name.startswith(ours)}


class Daemon:
    """An rtcfd process with its folder and log."""

    def __init__(
        self,
        folder: Path,
        settings: str = NO_ROS,
        *,
        arguments: Sequence[str] = (),
        wrapper: Sequence[str] = (),
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """`arguments` are rtcfd's; `wrapper` is a command that runs it."""
        # A short folder, unlike pytest's: the path of a unix socket has at most 107 characters.
        self.socket = folder / "s"
        self.log_file = folder / "log"
        self.pid = 0
        self.folder = folder
        self._settings = settings
        self._arguments = arguments
        self._wrapper = wrapper
        self._environment = {"ROS_HOSTNAME": "localhost"} | dict(environment or {})
        self._process: subprocess.Popen[bytes] | WarmProcess | None = None

    def start(self) -> None:
        """Start it and wait until it is ready."""
        settings = self.folder / "rtcfd.toml"
        settings.write_text(self._settings)
        with self.log_file.open("ab") as log:
            begin = log.tell()
            words = [
                "--foreground",
                *("--socket", str(self.socket), "--config", str(settings)),
                *("--state-dir", str(self.folder / "state")),
                *self._arguments,
            ]
            environment = clean_environment() | self._environment
            # In its own session, like a terminal's foreground job in its process group.
            process: subprocess.Popen[bytes] | WarmProcess
            if self._wrapper:
                process = subprocess.Popen(
                    [*self._wrapper, str(BUILD_TREE / "bin" / "rtcfd"), *words],
                    env=environment,
                    stderr=log,
                    start_new_session=True,
                )
            else:
                process = WARM.start("rtcfd", words, environment, 1, log.fileno(), session=True)
        self._process, self.pid = process, process.pid

        def ready() -> bool:
            assert not self.ended, self.log()
            return b"ready;" in self.log_file.read_bytes()[begin:]

        wait_for(ready, "rtcfd")

    def ctl(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run rtcfctl."""
        return WARM.run("rtcfctl", arguments, self.environment(), DEADLINE_S)

    def run(self, *command: str) -> subprocess.CompletedProcess[str]:
        """Run a command with rtcfctl on its PATH, connected to this daemon."""
        return subprocess.run(
            command,
            env=self.environment(),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )

    def environment(self) -> dict[str, str]:
        """Return the environment for commands that connect to this daemon."""
        path = f"{BUILD_TREE / 'bin'}:{os.environ['PATH']}"
        return clean_environment() | {"RTCF_SOCKET": str(self.socket), "PATH": path}

    def log(self) -> str:
        """Return its whole log, including earlier starts."""
        return self.log_file.read_text()

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """Stop it; return the exit status."""
        assert self._process is not None
        self._process.send_signal(number)
        return self._process.wait(DEADLINE_S)

    def press_ctrl_c(self) -> int:
        """Interrupt the whole process group, as a terminal does; return the exit status."""
        assert self._process is not None
        os.killpg(self._process.pid, signal.SIGINT)
        return self._process.wait(DEADLINE_S)

    @property
    def ended(self) -> bool:
        """Return whether it has ended."""
        return self._process is None or self._process.poll() is not None


def is_gone(pid: int) -> bool:
    """Return whether a process has ended; a zombie has."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True
