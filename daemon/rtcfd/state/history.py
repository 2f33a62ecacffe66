"""Who set which parameter to what, and when: the last changes of one runner's components.

Part of its Desired; store.py keeps it on disk.  Bounded by component, so that
one that is tuned all day leaves the others theirs, and in all: in number and
in bytes.
"""

import json
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import graph_pb2

from rtcfd.common.nonsense import NONSENSE

MOST_OF_A_COMPONENT = 200
MOST = 4000
# Texts may be long. The newest that was changed at once stays, however large.
MOST_BYTES_OF_A_COMPONENT = 1024 * 1024
MOST_BYTES = 8 * 1024 * 1024

# How a value was set that an executor took and did not answer for, as it died.
UNANSWERED = "set, unanswered"

Value = graph_pb2.ParameterValue


@dataclass(frozen=True)
class Change:
    """Of one parameter.  Those that were made at one cycle boundary have one number."""

    number: int
    time_ns: int  # since 1970
    component: str  # full name
    parameter: str
    before: Value | None  # None: it was not there, or is not known
    value: Value
    who: str  # for people
    # "set", "undo", "load", "replace", "apply", "restore", "dynamic_reconfigure", UNANSWERED
    how: str
    takes_back: int = 0  # the number of what it undoes; 0 = nothing


class History:
    """The changes, oldest first."""

    def __init__(self) -> None:
        self._changes: dict[str, deque[Change]] = {}  # by component
        self._count = 0
        self._bytes: dict[str, int] = {}  # by component
        self._bytes_on_disk = 0
        self._last = 0  # number
        self._new: list[Change] = []  # not on disk yet
        self._on_disk = 0  # lines

    def note(
        self,
        component: str,
        changes: Iterable[tuple[str, Value | None, Value]],
        who: str,
        how: str,
        takes_back: int = 0,
    ) -> None:
        """Note parameters of one component: name, value before, value."""
        self._last += 1
        now = time.time_ns()
        for name, before, value in changes:
            change = Change(self._last, now, component, name, before, value, who, how, takes_back)
            self._put(change)
            self._new.append(change)

    def of(self, component: str = "", parameter: str = "") -> list[Change]:
        """Return the changes of a component, or of all, and of a parameter, or of all."""
        chosen = [
            each
            for name in ([component] if component else self._changes)
            for each in self._changes.get(name, ())
            if not parameter or each.parameter == parameter
        ]
        return sorted(chosen, key=lambda each: each.number)

    def to_take_back(self, component: str) -> list[Change]:
        """Return what was changed last of a component and has not been taken back since: all
        that was changed at once; nothing if there is none."""
        changes = self._changes.get(component, ())
        undone = {each.takes_back for each in changes}
        numbers = [
            each.number
            for each in changes
            if not each.takes_back and each.number not in undone and each.how != UNANSWERED
        ]
        return [each for each in changes if numbers and each.number == numbers[-1]]

    def to_write(self) -> tuple[list[Change], bool]:
        """Return what is to be written, and whether that is all there is, in the place of what is
        on disk; else it is to be appended.  From then on it counts as written."""
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
        """What to_write() gave did not get to disk: all there is is written the next time."""
        self._on_disk = 2 * MOST + 1

    def read(self, text: str) -> None:
        """Take what was written; a line that is none, as of a power cut, is passed over."""
        for line in text.splitlines():
            self._on_disk += 1
            self._bytes_on_disk += len(line)
            try:
                change = _change(line)
            except NONSENSE:
                continue
            self._put(change)
            self._last = max(self._last, change.number)

    def _put(self, change: Change) -> None:
        name = change.component
        changes = self._changes.setdefault(name, deque())
        changes.append(change)
        self._count += 1
        self._bytes[name] = self._bytes.get(name, 0) + _size(change)
        while self._bytes[name] > MOST_BYTES_OF_A_COMPONENT and changes[0].number != change.number:
            self._drop_oldest(name)
        while sum(self._bytes.values()) > MOST_BYTES:
            oldest = self._with_oldest()
            if self._changes[oldest][0].number == change.number:
                break
            self._drop_oldest(oldest)
        if len(changes) > MOST_OF_A_COMPONENT:
            self._drop(name)
        elif self._count > MOST:
            self._drop(self._with_oldest())

    def _with_oldest(self) -> str:
        """Return the component that has the oldest change."""
        return min(self._changes, key=lambda name: self._changes[name][0].number)

    def _drop_oldest(self, component: str) -> None:
        """Drop all that was changed at once: a part of it is not to be taken back."""
        number = self._changes[component][0].number
        while component in self._changes and self._changes[component][0].number == number:
            self._drop(component)

    def _drop(self, component: str) -> None:
        changes = self._changes[component]
        self._bytes[component] -= _size(changes.popleft())
        self._count -= 1
        if not changes:
            del self._changes[component], self._bytes[component]


def text(changes: Iterable[Change]) -> str:
    """Return what read() takes; on any thread."""
    return "".join(_line(each) for each in changes)


def _size(change: Change) -> int:
    before = 0 if change.before is None else int(change.before.ByteSize())
    # Names, times and numbers besides.
    return 200 + len(change.component) + before + int(change.value.ByteSize())


def _line(change: Change) -> str:
    fields: dict[str, Any] = dict(vars(change))
    for name in ("before", "value"):
        if fields[name] is not None:
            fields[name] = json_format.MessageToDict(fields[name], preserving_proto_field_name=True)
    return json.dumps(fields) + "\n"


def _change(line: str) -> Change:
    fields = json.loads(line)
    for name in ("before", "value"):
        if fields[name] is not None:
            fields[name] = json_format.ParseDict(fields[name], Value())
    change = Change(**fields)
    if type(change.number) is not int or not isinstance(change.component, str):
        raise ValueError("no change")
    return change
