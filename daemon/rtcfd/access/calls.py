"""Every call of rtcf.v1.Control: which right it takes, and how large its messages may be.

A call that is not in the table takes an administrator; a test sees to it that
none is missing.
"""

import enum
from dataclasses import dataclass

from rtcf.v1 import runner_pb2


class Level(enum.IntEnum):
    """Rights, each with those before it; as `Right` of the protocol."""

    NONE = 1
    OBSERVE = 2  # see everything, change nothing
    TUNE = 3  # set parameters
    OPERATE = 4  # run what is there: loops, loop breaks
    ADMIN = 5  # decide what is there: load code, make runners, settings

    @property
    def word(self) -> str:
        """Return it as the settings write it."""
        return self.name.lower()

    @property
    def right(self) -> "runner_pb2.Right":
        """Return it as the protocol writes it."""
        return self.value  # type: ignore[return-value]


WORDS = {level.word: level for level in Level}

# Bytes of one request message.
_NAMES = 16 * 1024  # a handful of names
_LISTS = 1024 * 1024  # names of many components
_ANY = 16 * 1024 * 1024  # a graph, a recording: what gRPC takes


@dataclass(frozen=True)
class Call:
    """One call."""

    right: Level
    largest: int = _NAMES


UNKNOWN = Call(Level.ADMIN)

CALLS = {
    "GetStatus": Call(Level.OBSERVE),
    "ListRunners": Call(Level.OBSERVE),
    "ListComponents": Call(Level.OBSERVE),
    "GetComponent": Call(Level.OBSERVE),
    "GetOrder": Call(Level.OBSERVE),
    "ListConnections": Call(Level.OBSERVE),
    "ListTypes": Call(Level.OBSERVE),
    "GetStatistics": Call(Level.OBSERVE),
    "WatchStatistics": Call(Level.OBSERVE),
    "GetHistory": Call(Level.OBSERVE),
    "WatchEvents": Call(Level.OBSERVE),
    "WatchLogs": Call(Level.OBSERVE, _LISTS),
    "WatchPorts": Call(Level.OBSERVE),
    "ListIncidents": Call(Level.OBSERVE),
    "ReadIncident": Call(Level.OBSERVE),
    "TakeIncident": Call(Level.OPERATE),
    "DeleteIncidents": Call(Level.ADMIN, _LISTS),
    "SetParameters": Call(Level.TUNE, _LISTS),
    "UndoParameters": Call(Level.TUNE),
    "Start": Call(Level.OPERATE),
    "Stop": Call(Level.OPERATE),
    "Step": Call(Level.OPERATE),
    "Replay": Call(Level.OPERATE, _ANY),
    "SetBreaks": Call(Level.OPERATE, _LISTS),
    "WritePort": Call(Level.OPERATE),
    "ResetState": Call(Level.OPERATE),
    "SetState": Call(Level.OPERATE, _LISTS),
    "TakeSnapshot": Call(Level.OPERATE),
    "RestoreSnapshot": Call(Level.OPERATE, _ANY),
    "Release": Call(Level.OPERATE, _LISTS),
    "ResetStatistics": Call(Level.OPERATE),
    "RestartRunner": Call(Level.OPERATE),
    "Load": Call(Level.ADMIN, _ANY),
    "Unload": Call(Level.ADMIN, _LISTS),
    "Replace": Call(Level.ADMIN, _ANY),
    "Apply": Call(Level.ADMIN, _ANY),
    "AddRunner": Call(Level.ADMIN),
    "SetRunner": Call(Level.ADMIN),
    "RemoveRunner": Call(Level.ADMIN),
    "HoldRunner": Call(Level.ADMIN),
    "LeaseComponent": Call(Level.ADMIN, _ANY),
    "Reload": Call(Level.ADMIN),
}


def of(method: str) -> Call:
    """Return what a method takes."""
    return CALLS.get(method, UNKNOWN)
