"""The caller on whose behalf the current task works.

admission.py sets it for the task of each call; tasks that this one creates inherit it.
"""

import time
from contextvars import ContextVar
from dataclasses import dataclass, field

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Tuning

# Metadata of a call: CLOCK_MONOTONIC of the caller, which is on this machine.
ASKED_KEY = "rtcf-asked-ns"


@dataclass(frozen=True)
class Caller:
    """A peer, its right, and the time of its request."""

    peer: Peer
    level: Level
    tuning: Tuning | None = None  # the parameter rules that bind it; None: no rule does
    asked_ns: int = field(default_factory=time.monotonic_ns)


_caller: ContextVar[Caller | None] = ContextVar("caller", default=None)


def enter(caller: Caller) -> None:
    """Note that this task, from here on, serves a call of this caller."""
    _caller.set(caller)


def current() -> Caller | None:
    """Return the caller of the current call; None: rtcfd acts on its own."""
    return _caller.get()


def asked_ns() -> int:
    """Return the time of the current request, CLOCK_MONOTONIC in ns."""
    caller = _caller.get()
    return time.monotonic_ns() if caller is None else caller.asked_ns


def name() -> str:
    """Return the caller's user name, or "rtcfd" if rtcfd acts on its own."""
    caller = _caller.get()
    return "rtcfd" if caller is None else caller.peer.user
