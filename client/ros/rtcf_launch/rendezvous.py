"""Where a runner of a launch is: rt_runner writes it to the parameter server, beside its own
private parameters, where launchers and tools find it."""

import socket
from dataclasses import dataclass

import rtcf

from rtcf_launch.master import Master

NAME = "rtcf_runner"  # of the private parameter


@dataclass(frozen=True)
class Meeting:
    """A runner that is held by an rt_runner."""

    socket: str  # of its rtcfd
    runner: str  # its name there
    token: str  # of the hold
    host: str


def host() -> str:
    """Return the name of this host."""
    return socket.gethostname()


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


def alive(meeting: Meeting) -> bool:
    """Tell whether the runner is held as it is said; only of a runner on this host."""
    try:
        with rtcf.Client(meeting.socket) as client:
            (status,) = client.get_status(meeting.runner).runners
    except rtcf.RtcfError:
        return False
    return bool(status.hold == meeting.token)
