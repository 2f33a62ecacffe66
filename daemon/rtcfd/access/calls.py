"""The calls of rtcf.v1.Control, each with its required right and the limits of its request.

A call that is missing here requires the right to administer; a test checks that
none is missing.
"""

import enum
from dataclasses import dataclass
from typing import Any

from rtcf.v1 import errors_pb2, runner_pb2
from rtcf_shared.printable import printable

from rtcfd.common.errors import InvalidArgument


class Level(enum.IntEnum):
    """Rights; each includes those before it.  The numbers are those of `Right` in the protocol."""

    NONE = 1
    OBSERVE = 2  # see everything, change nothing
    TUNE = 3  # set parameters
    OPERATE = 4  # run the loaded graph: start and stop loops, set loop breaks and values
    ADMIN = 5  # change the graph and the machine: load code, add runners, change settings

    @property
    def word(self) -> str:
        """The name of this right in the settings."""
        return self.name.lower()

    @property
    def right(self) -> "runner_pb2.Right":
        """The enumerator of this right in the protocol."""
        return self.value  # type: ignore[return-value]


WORDS = {level.word: level for level in Level}

# Largest request messages, in bytes.
_NAMES = 16 * 1024  # a handful of names
_LISTS = 1024 * 1024  # names of many components
_ANY = 16 * 1024 * 1024  # a graph or a recording: the limit of rtcfd's gRPC servers
# Longest texts in requests, in characters.
LONGEST_NAME = 255  # the limit of ROS
LONGEST_TEXT = 4096  # remaps, expressions, URIs
LONGEST_VALUE = 64 * 1024  # string parameters
LONGEST_MESSAGE = _LISTS  # values of inputs: a trajectory of 1024 points for 7 joints has 550 KB
_NAME_FIELDS = frozenset(
    {
        "runner", "component", "components", "package", "type", "name", "ns", "port", "run_id",
        "token", "holder",
    }
)  # fmt: skip
_LONGEST = {  # by type of message
    "rtcf.v1.ParameterValue": LONGEST_VALUE,
    "rtcf.v1.WritePortRequest": LONGEST_MESSAGE,
}
_BULK = frozenset({"rtcf.v1.RecordedMessage"})


@dataclass(frozen=True)
class Call:
    """The requirements of one call."""

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
    "WatchPorts": Call(Level.OBSERVE, _LISTS),
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
    "WritePort": Call(Level.OPERATE, _LISTS),
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
    """Return the requirements of a method."""
    return CALLS.get(method, UNKNOWN)


def check_texts(message: Any) -> None:
    """Raise InvalidArgument if a text in a request, at any depth, is too long, or not one line.

    The names of holders, which other users see, become printable.

    Names go into look-ups, suggestions, log records and errors.  The cost of each grows with their
    length, so this comes before all other work.
    """
    full_name = message.DESCRIPTOR.full_name
    if full_name in _BULK:
        return
    for field, value in message.ListFields():
        if field.message_type is not None:
            # `value` is one message or a list of messages.
            for each in [value] if hasattr(value, "DESCRIPTOR") else value:
                check_texts(each)
        elif field.cpp_type == field.CPPTYPE_STRING and field.type == field.TYPE_STRING:
            longest = (
                LONGEST_NAME
                if field.name in _NAME_FIELDS
                else _LONGEST.get(full_name, LONGEST_TEXT)
            )
            for text in [value] if isinstance(value, str) else value:
                if len(text) > longest:
                    raise InvalidArgument(
                        f"{field.name} of {len(text)} characters is too long: at most {longest} "
                        f"({text[:40]}…)",
                        errors_pb2.REASON_TEXT_TOO_LONG,
                        field=field.name,
                    )
                if field.name == "reason" and not text.isprintable():
                    raise InvalidArgument(
                        f"{field.name} {text[:40]!a} has unprintable characters: write one "
                        "line without them",
                        errors_pb2.REASON_NAME_INVALID,
                        field=field.name,
                    )
            if field.name == "holder":  # a name for messages, for example from a process title
                message.holder = printable(value)
