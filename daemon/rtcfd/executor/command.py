"""The command lines of an executor: to run a loop, and to check settings."""

import contextlib
import hashlib
import os
import signal
import stat
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rtcf.v1 import errors_pb2, runner_pb2

from rtcfd.common.errors import FailedPrecondition

# Variables for rtcfd alone: an executor that used them would report to systemd in the
# daemon's name.
_OWN_VARIABLES = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID", "LISTEN_FDS", "LISTEN_PID",
                  "LISTEN_FDNAMES")  # fmt: skip

# sizeof(sockaddr_un::sun_path) - 1, see unix(7).
MAX_SOCKET_PATH = 107

# Of --check-settings.
_CHECK_TIMEOUT_S = 10.0
_REJECTED = 1
_BEGIN = "rtcf-executor: "
_MAX_LENGTH = 1500  # characters of the error, which may quote the longest allowed expression


@dataclass(frozen=True)
class ExecutorCommand:
    """The executor binary, and the folders of the executors' sockets."""

    binary: Path
    folder: Path
    # The folder of the sockets for direct stops, without rtcfd, and its mode.
    stop_folder: Path | None = None
    stop_mode: int = 0o700
    mark: Callable[[str], Path | None] = lambda runner: None  # see Store.mark
    private: bool = False  # not the system daemon
    claims_folder: Path | None = None  # where loops claim their CPUs

    def prepare(self) -> None:
        """Create the folders and check the binary."""
        if not os.access(self.binary, os.X_OK):
            raise FailedPrecondition(
                f"no executor at {self.binary}: install it, or name one with --executor",
                errors_pb2.REASON_DAEMON_FAILED,
            )
        self.close_folders()

    def close_folders(self) -> None:
        """Restrict the folders: other users may enter only the folder of direct stops.

        systemd resets the modes of all of them with each command of the unit that it runs.
        """
        self.make_folder()
        if self.stop_folder is not None:
            _make(self.stop_folder, self.stop_mode)
        if self.claims_folder is not None:
            _make(self.claims_folder, 0o700)

    def make_folder(self) -> None:
        """Create the folder of the executors' sockets, and restrict it to our user."""
        _make(self.folder, 0o700)

    @property
    def lock_file(self) -> Path:
        """The file that RuntimeLock locks."""
        return self.folder / "lock"

    def remove_folders(self) -> None:
        """Remove our folders if they are empty.  Only for the holder of the RuntimeLock."""
        for folder in (self.stop_folder, self.claims_folder):
            # Several daemons may share the folder of claims, which is elsewhere then.
            if folder is not None and folder.parent == self.folder.parent:
                with contextlib.suppress(OSError):
                    folder.rmdir()
        with contextlib.suppress(OSError):
            # Last: from now on another rtcfd may make the folders again.
            self.lock_file.unlink(missing_ok=True)
            self.folder.rmdir()

    def socket(self, runner: str) -> Path:
        """Return the path of the socket that a runner's executor listens on."""
        return _checked(self.folder / f"{runner}.sock")

    def sockets(self, runner: str) -> list[Path]:
        """Return the paths of all sockets that a runner's executor listens on."""
        stop = [self.stop_folder / runner] if self.stop_folder is not None else []
        return [self.socket(runner), *stop]

    def arguments(self, runner: str) -> list[str]:
        """Return the command line."""
        line = [str(self.binary), "--runner", runner, "--socket", str(self.socket(runner))]
        if name := self.daemon_name():
            line += ["--daemon", name]
        if self.stop_folder is not None:
            line += ["--stop-socket", str(_checked(self.stop_folder / runner))]
        if mark := self.mark(runner):
            line += ["--resume-mark", str(mark)]
        if self.claims_folder is not None:
            line += ["--cpu-claims", str(self.claims_folder)]
        return line

    def daemon_name(self) -> str:
        """Return a name that no other daemon of this machine has; empty for the system daemon."""
        if not self.private:
            return ""
        # Made from the folder: the same after a restart, and two daemons cannot share a folder.
        folder = hashlib.sha256(os.fsencode(self.folder.absolute())).hexdigest()
        return f"u{os.geteuid()}_{folder[:6]}"

    @staticmethod
    def environment() -> dict[str, str]:
        """Return our environment (ROS_MASTER_URI, ROS_IP …) without the variables for rtcfd.

        Also without empty names of this machine, which roscpp would advertise.
        """
        return {
            name: value
            for name, value in os.environ.items()
            if name not in _OWN_VARIABLES and (value or name not in ("ROS_HOSTNAME", "ROS_IP"))
        }


def settings_error(binary: Path, settings: runner_pb2.RunnerSettings) -> str:
    """Return why an executor would reject the settings, in one line; empty = it accepts them, or
    there is no executor to ask.

    Asks it in a process of its own that runs no loop.  So regular expressions, and other values
    that only the executor understands, are checked by the code that will use them.  Blocks.
    """
    try:
        asked = subprocess.run(
            [binary, "--check-settings"],
            input=settings.SerializeToString(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=ExecutorCommand.environment(),
            timeout=_CHECK_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    if asked.returncode < 0:
        return f"an executor crashes with it ({signal.Signals(-asked.returncode).name})"
    if asked.returncode != _REJECTED:
        return ""  # an executor of another version, or no executor
    said = asked.stderr.decode(errors="replace").partition(_BEGIN)[2]
    return " ".join(said.split())[:_MAX_LENGTH]  # an expression may have any characters


def claims_folder_of_user(fallback: Path) -> Path:
    """Return the folder in which the loops of all private daemons of our user claim CPUs.

    Returns `fallback`, which the daemon uses alone, if the shared folder cannot be created or
    belongs to another user.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    if runtime and _is_ours(Path(runtime)):  # su keeps the variable of the first user
        return Path(runtime) / "rtcf-cpus"
    folder = Path(tempfile.gettempdir()) / f"rtcf-cpus-{os.geteuid()}"
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        found = folder.lstat()
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
            return fallback
    except OSError:
        return fallback
    return folder


def _is_ours(folder: Path) -> bool:
    try:
        found = folder.stat()
    except OSError:
        return False
    return found.st_uid == os.geteuid() and os.access(folder, os.W_OK)


def _make(folder: Path, mode: int) -> None:
    folder.mkdir(mode=mode, parents=True, exist_ok=True)
    found = folder.lstat()
    if found.st_uid != os.geteuid():
        raise FailedPrecondition(
            f"{folder} belongs to user {found.st_uid}, not to {os.geteuid()}: "
            "remove it, or choose another --runtime-dir",
            errors_pb2.REASON_DAEMON_FAILED,
        )
    folder.chmod(mode)


def _checked(path: Path) -> Path:
    if len(os.fsencode(path)) > MAX_SOCKET_PATH:
        raise FailedPrecondition(
            f"{path} is longer than the {MAX_SOCKET_PATH} characters of a unix socket's path: "
            "choose a shorter --runtime-dir",
            errors_pb2.REASON_NAME_INVALID,
        )
    return path
