"""The parameter history of a runner: the last changes, with their authors and times.

Part of its Desired; store.py keeps it on disk.  Number and bytes are limited in total,
and for each component, so that a component that is tuned all day does not displace the
others.
"""

import json
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from google.protobuf import json_format
from rtcf.v1 import graph_pb2

from rtcfd.common.regular_files import PARSE_ERRORS

MOST_OF_A_COMPONENT = 200
MOST = 4000
# String values may be long.  The newest changes of one cycle boundary stay, however large.
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


class History:
    """The changes, oldest first."""

    def __init__(self) -> None:
        self._changes: dict[str, deque[ParameterChange]] = {}  # by component
        self._count = 0
        self._bytes: dict[str, int] = {}  # by component
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
    ) -> None:
        """Add changes of one component's parameters: name, value before, new value."""
        self._last += 1
        now = time.time_ns()
        for name, before, value in changes:
            change = ParameterChange(
                self._last, now, component, name, before, value, who, how, takes_back
            )
            self._put(change)
            self._new.append(change)

    def of(self, component: str = "", parameter: str = "") -> list[ParameterChange]:
        """Return the changes of a component, or of all, and of a parameter, or of all."""
        chosen = [
            each
            for name in ([component] if component else self._changes)
            for each in self._changes.get(name, ())
            if not parameter or each.parameter == parameter
        ]
        return sorted(chosen, key=lambda each: each.number)

    def to_take_back(self, component: str) -> list[ParameterChange]:
        """Return the last change of a component that is not undone, with all its parameters.

        Empty if there is none.
        """
        changes = self._changes.get(component, ())
        undone = {each.takes_back for each in changes}
        numbers = [
            each.number
            for each in changes
            if not each.takes_back and each.number not in undone and each.how != UNANSWERED
        ]
        return [each for each in changes if numbers and each.number == numbers[-1]]

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
            self._last = max(self._last, change.number)

    def _put(self, change: ParameterChange) -> None:
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
        """Return the component with the oldest change."""
        return min(self._changes, key=lambda name: self._changes[name][0].number)

    def _drop_oldest(self, component: str) -> None:
        """Drop all changes of the oldest number, because undo must restore all or none of them."""
        number = self._changes[component][0].number
        while component in self._changes and self._changes[component][0].number == number:
            self._drop(component)

    def _drop(self, component: str) -> None:
        changes = self._changes[component]
        self._bytes[component] -= _size(changes.popleft())
        self._count -= 1
        if not changes:
            del self._changes[component], self._bytes[component]


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
