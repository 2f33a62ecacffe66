"""How an executor is called: its binary, its socket, its environment."""

import os
from dataclasses import dataclass
from pathlib import Path

from rtcfd.common.refusals import FailedPrecondition

# What belongs to rtcfd alone: an executor that answered systemd in its name
# would lie about the daemon.
_OWN_VARIABLES = ("NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID", "LISTEN_FDS", "LISTEN_PID",
                  "LISTEN_FDNAMES")  # fmt: skip

# sizeof(sockaddr_un::sun_path) - 1, see unix(7).
MAX_SOCKET_PATH = 107


@dataclass(frozen=True)
class ExecutorCommand:
    """Where the executor binary is, and the folder of the executors' sockets."""

    binary: Path
    folder: Path

    def prepare(self) -> None:
        """Make the socket folder, which only our user may enter, and check the binary."""
        if not os.access(self.binary, os.X_OK):
            raise FailedPrecondition(
                f"no executor at {self.binary}: install it, or name one with --executor"
            )
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = self.folder.lstat()
        if found.st_uid != os.geteuid():
            raise FailedPrecondition(
                f"{self.folder} belongs to user {found.st_uid}, not to {os.geteuid()}: "
                "remove it, or choose another --runtime-dir"
            )
        self.folder.chmod(0o700)

    def socket(self, runner: str) -> Path:
        """Return the path of the socket that a runner's executor listens on."""
        path = self.folder / f"{runner}.sock"
        if len(os.fsencode(path)) > MAX_SOCKET_PATH:
            raise FailedPrecondition(
                f"{path} is longer than the {MAX_SOCKET_PATH} characters of a unix socket's path: "
                "choose a shorter --runtime-dir"
            )
        return path

    def arguments(self, runner: str) -> list[str]:
        """Return the command line."""
        return [str(self.binary), "--runner", runner, "--socket", str(self.socket(runner))]

    @staticmethod
    def environment() -> dict[str, str]:
        """Return ours (ROS_MASTER_URI, ROS_IP, ROS_HOSTNAME …) without what is rtcfd's alone."""
        return {name: value for name, value in os.environ.items() if name not in _OWN_VARIABLES}
