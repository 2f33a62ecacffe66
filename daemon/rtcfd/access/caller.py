"""Who makes the call that is being served, for what is done in its name.

Set by admission.py for the task of each call, and of what that begins.
"""

import time
from contextvars import ContextVar
from dataclasses import dataclass, field

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.access.tuning import Tuning

# Metadata of a call: CLOCK_MONOTONIC of the caller, which is on this machine.
ASKED_KEY = "rtcf-asked-ns"


@dataclass(frozen=True)
class Caller:
    """A peer, what it may do, and since when it waits for its answer."""

    peer: Peer
    level: Level
    tuning: Tuning | None = None  # which parameters it may set; None: all, if any
    asked_ns: int = field(default_factory=time.monotonic_ns)


_caller: ContextVar[Caller | None] = ContextVar("caller", default=None)


def enter(caller: Caller) -> None:
    """From here on this task serves a call of this caller."""
    _caller.set(caller)


def current() -> Caller | None:
    """Return who makes the call that is being served; None: rtcfd itself acts."""
    return _caller.get()


def asked_ns() -> int:
    """Return when the call that is being served was asked for, on CLOCK_MONOTONIC."""
    caller = _caller.get()
    return time.monotonic_ns() if caller is None else caller.asked_ns


def name() -> str:
    """Return who acts, for people."""
    caller = _caller.get()
    return "rtcfd" if caller is None else caller.peer.user
