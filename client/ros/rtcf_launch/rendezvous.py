"""Where a runner of a launch is: rt_runner writes it to the parameter server, beside its own
private parameters, where launchers and tools find it.  It says so as soon as it starts, then
without a socket, so that launchers know whom to wait for."""

import os
import socket
from dataclasses import dataclass
from pathlib import Path

import rtcf

from rtcf_launch.master import Master

NAME = "rtcf_runner"  # of the private parameter


@dataclass(frozen=True)
class Meeting:
    """A runner that is held by an rt_runner, or will be."""

    socket: str  # of its rtcfd; empty = it is just starting
    runner: str  # its name there
    token: str  # of the hold
    host: str
    pid: str = ""  # of rt_runner
    launch: str = ""  # pid of who has started it: roslaunch

    @property
    def starting(self) -> bool:
        """Tell whether it cannot be used yet."""
        return not self.socket


def host() -> str:
    """Return the name of this host."""
    return socket.gethostname()


def meeting(runner: str, socket_path: str = "", token: str = "") -> Meeting:
    """Return what this process says of its runner."""
    return Meeting(socket_path, runner, token, host(), str(os.getpid()), str(os.getppid()))


def announce(master: Master, node: str, meeting: Meeting) -> None:
    """Say where the runner of a node is."""
    master.set(f"{node}/{NAME}", vars(meeting))


def withdraw(master: Master, node: str) -> None:
    """Say it no more."""
    master.delete(f"{node}/{NAME}")


def find(master: Master, node: str) -> Meeting | None:
    """Return where the runner of a node is said to be; it may have gone without a word."""
    found = master.parameter(f"{node}/{NAME}")
    try:
        meeting = Meeting(**found)
    except TypeError:
        return None
    return meeting if all(isinstance(each, str) for each in vars(meeting).values()) else None


def nodes(master: Master) -> list[str]:
    """Return the nodes that have said where their runners are."""
    end = f"/{NAME}/host"
    return sorted(name.removesuffix(end) for name in master.names() if name.endswith(end))


def alive(meeting: Meeting) -> bool:
    """Tell whether the runner is held, or about to be, as it is said; only of this host."""
    if meeting.starting:
        try:
            return "rt_runner" in Path(f"/proc/{int(meeting.pid)}/cmdline").read_text()
        except (OSError, ValueError):
            return False
    try:
        with rtcf.Client(meeting.socket) as client:
            (status,) = client.get_status(meeting.runner).runners
    except rtcf.RtcfError:
        return False
    return bool(status.hold == meeting.token)
