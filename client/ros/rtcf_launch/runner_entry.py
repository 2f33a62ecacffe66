"""The entry of a runner on the ROS parameter server, by which launchers and tools find the runner.

rt_runner writes it beside its private parameters: without a socket when rt_runner starts, so that
launchers wait, and with a socket when rt_runner holds the lease on the runner.
"""

import os
import socket
from dataclasses import dataclass
from pathlib import Path

import rtcf

from rtcf_launch.master import Master

NAME = "rtcf_runner"  # of the private parameter


@dataclass(frozen=True)
class RunnerEntry:
    """A runner that rt_runner holds, or is about to hold."""

    socket: str  # of its rtcfd; empty = rt_runner is starting
    runner: str  # its name there
    token: str  # of the hold
    host: str
    pid: str = ""  # of rt_runner
    launch: str = ""  # pid of the parent of rt_runner: roslaunch

    @property
    def starting(self) -> bool:
        """Whether the runner is not ready yet."""
        return not self.socket


def host() -> str:
    """Return the name of this host."""
    return socket.gethostname()


def own_entry(runner: str, socket_path: str = "", token: str = "") -> RunnerEntry:
    """Return the entry of a runner of this process."""
    return RunnerEntry(socket_path, runner, token, host(), str(os.getpid()), str(os.getppid()))


def announce(master: Master, node: str, entry: RunnerEntry) -> None:
    """Write the entry of a node's runner."""
    master.set(f"{node}/{NAME}", vars(entry))


def withdraw(master: Master, node: str) -> None:
    """Remove the entry of a node's runner."""
    master.delete(f"{node}/{NAME}")


def find(master: Master, node: str) -> RunnerEntry | None:
    """Return the entry of a node's runner; it may be left over from a runner that died."""
    found = master.parameter(f"{node}/{NAME}")
    try:
        entry = RunnerEntry(**found)
    except TypeError:
        return None
    return entry if all(isinstance(each, str) for each in vars(entry).values()) else None


def nodes(master: Master) -> list[str]:
    """Return the nodes whose runners have entries."""
    end = f"/{NAME}/host"
    return sorted(name.removesuffix(end) for name in master.names() if name.endswith(end))


def alive(entry: RunnerEntry) -> bool:
    """Return whether rt_runner still holds the runner or is starting; for this host only."""
    if entry.starting:
        try:
            return "rt_runner" in Path(f"/proc/{int(entry.pid)}/cmdline").read_text()
        except (OSError, ValueError):
            return False
    try:
        with rtcf.Client(entry.socket) as client:
            (status,) = client.get_status(entry.runner).runners
    except rtcf.RtcfError:
        return False
    return bool(status.hold == entry.token)
