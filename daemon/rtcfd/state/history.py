"""The parameter history of a runner: the last changes, with their authors and times.

Part of its Desired; store.py keeps it on disk.  Number and bytes are limited in total,
and for each component, so that a component that is tuned all day does not displace the
others.  Changes at one cycle boundary are dropped together, since undo restores all or none
of them; the newest ones stay, however many and large.
"""

import json
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import graph_pb2

from rtcfd.common.regular_files import PARSE_ERRORS

MOST_OF_A_COMPONENT = 200
MOST = 4000
# String values may be long.
MOST_BYTES_OF_A_COMPONENT = 1024 * 1024
MOST_BYTES = 8 * 1024 * 1024

# The `how` of a value that was sent to an executor, which died before its response.
UNANSWERED = "set, unanswered"

Value = graph_pb2.ParameterValue


@dataclass(frozen=True)
class ParameterChange:
    """A change of one parameter.  Changes at one cycle boundary have the same number."""

    number: int
    time_ns: int  # since 1970
    component: str  # full name
    parameter: str
    before: Value | None  # None: it did not exist, or is not known
    value: Value
    who: str  # author, for messages
    # "set", "undo", "load", "replace", "apply", "restore", "dynamic_reconfigure", UNANSWERED
    how: str
    takes_back: int = 0  # number of the change that it undoes; 0 = none


_Key = tuple[int, str]  # number and component of simultaneous changes


@dataclass
class _Kept:
    """The changes kept of one component."""

    keys: deque[_Key] = field(default_factory=deque)  # oldest first
    count: int = 0
    bytes: int = 0

    @property
    def too_large(self) -> bool:
        return self.count > MOST_OF_A_COMPONENT or self.bytes > MOST_BYTES_OF_A_COMPONENT


class History:
    """The changes, oldest first."""

    def __init__(self) -> None:
        self._changes: dict[_Key, list[ParameterChange]] = {}
        self._kept: dict[str, _Kept] = {}  # by component
        self._count = 0
        self._bytes = 0
        self._bytes_on_disk = 0
        self._last = 0  # number of the newest change
        self._new: list[ParameterChange] = []  # not on disk yet
        self._on_disk = 0  # lines in the file

    def note(
        self,
        component: str,
        changes: Iterable[tuple[str, Value | None, Value]],
        who: str,
        how: str,
        takes_back: int = 0,
    ) -> int:
        """Add changes of one component's parameters: name, value before, new value.

        Returns their number.
        """
        self._last += 1
        now = time.time_ns()
        for name, before, value in changes:
            change = ParameterChange(
                self._last, now, component, name, before, value, who, how, takes_back
            )
            self._put(change)
            self._new.append(change)
        self._trim(component)
        return self._last

    def of(self, component: str = "", parameter: str = "") -> list[ParameterChange]:
        """Return the changes of a component, or of all, and of a parameter, or of all."""
        keys = self._keys(component) if component else self._changes
        chosen = [
            each
            for key in keys
            for each in self._changes[key]
            if not parameter or each.parameter == parameter
        ]
        return sorted(chosen, key=lambda each: each.number)

    def to_take_back(self, component: str) -> list[ParameterChange]:
        """Return the last change of a component that is not undone, with all its parameters.

        Empty if there is none.
        """
        changes = [self._changes[key] for key in self._keys(component)]
        undone = {each[0].takes_back for each in changes}
        for each in reversed(changes):
            first = each[0]
            if not first.takes_back and first.number not in undone and first.how != UNANSWERED:
                return list(each)
        return []

    def to_write(self) -> tuple[list[ParameterChange], bool]:
        """Return the changes to write, and whether they replace the file instead of being appended.

        From then on they count as written.
        """
        changes, self._new = self._new, []
        more = sum(map(_size, changes))
        anew = (
            self._on_disk + len(changes) > 2 * MOST or self._bytes_on_disk + more > 2 * MOST_BYTES
        )
        if anew:
            changes = self.of()
            more = sum(map(_size, changes))
            self._on_disk = self._bytes_on_disk = 0
        self._on_disk += len(changes)
        self._bytes_on_disk += more
        return changes, anew

    def not_written(self) -> None:
        """Note that the result of to_write() was not written: the next one has all changes."""
        self._on_disk = 2 * MOST + 1

    def read(self, text: str) -> None:
        """Load changes from text(); skips invalid lines, as a power cut leaves them."""
        for line in text.splitlines():
            self._on_disk += 1
            self._bytes_on_disk += len(line)
            try:
                change = _change(line)
            except PARSE_ERRORS:
                continue
            self._put(change)
            self._trim(change.component)
            self._last = max(self._last, change.number)

    def _keys(self, component: str) -> Iterable[_Key]:
        kept = self._kept.get(component)
        return () if kept is None else kept.keys

    def _put(self, change: ParameterChange) -> None:
        key = (change.number, change.component)
        kept = self._kept.setdefault(change.component, _Kept())
        if key not in self._changes:
            self._changes[key] = []
            kept.keys.append(key)
        self._changes[key].append(change)
        self._add(kept, 1, _size(change))

    def _trim(self, component: str) -> None:
        """Drop the oldest changes above the limits; `component` has the newest ones."""
        kept = self._kept.get(component)
        while kept is not None and kept.too_large and len(kept.keys) > 1:
            self._drop(kept.keys[0])
        while (self._count > MOST or self._bytes > MOST_BYTES) and len(self._changes) > 1:
            self._drop(next(iter(self._changes)))

    def _drop(self, key: _Key) -> None:
        kept = self._kept[key[1]]
        kept.keys.popleft()  # the oldest of all is the oldest of its component
        changes = self._changes.pop(key)
        self._add(kept, -len(changes), -sum(map(_size, changes)))
        if not kept.keys:
            del self._kept[key[1]]

    def _add(self, kept: _Kept, count: int, size: int) -> None:
        kept.count += count
        kept.bytes += size
        self._count += count
        self._bytes += size


def text(changes: Iterable[ParameterChange]) -> str:
    """Return changes as text for read().  On any thread."""
    return "".join(_line(each) for each in changes)


def _size(change: ParameterChange) -> int:
    before = 0 if change.before is None else int(change.before.ByteSize())
    # 200: names, time and numbers.
    return 200 + len(change.component) + before + int(change.value.ByteSize())


def _line(change: ParameterChange) -> str:
    fields: dict[str, Any] = dict(vars(change))
    for name in ("before", "value"):
        if fields[name] is not None:
            fields[name] = json_format.MessageToDict(fields[name], preserving_proto_field_name=True)
    return json.dumps(fields) + "\n"


def _change(line: str) -> ParameterChange:
    fields = json.loads(line)
    for name in ("before", "value"):
        if fields[name] is not None:
            fields[name] = json_format.ParseDict(fields[name], Value())
    change = ParameterChange(**fields)
    if type(change.number) is not int or not isinstance(change.component, str):
        raise ValueError("not a change")
    return change
