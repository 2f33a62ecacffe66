"""Where the numbers of a serialised ROS message lie, by its definition and a sample of it.

Of messages of one length: strings and arrays are as long in each as in the sample.  How ROS 1
serialises is told in http://wiki.ros.org/msg.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

from rtcf_shared.ros_definition import Definition

_NUMBERS = {
    "bool": "?", "int8": "i1", "byte": "i1", "uint8": "u1", "char": "u1", "int16": "<i2",
    "uint16": "<u2", "int32": "<i4", "uint32": "<u4", "int64": "<i8", "uint64": "<u8",
    "float32": "<f4", "float64": "<f8",
}  # fmt: skip
_TIMES = {"time": "<u4", "duration": "<i4"}
_LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class Leaf:
    """A number of a message, or an array of numbers."""

    path: str  # e.g. "twist.linear.x"; empty: the message is nothing else
    format: str  # as NumPy writes it
    count: int | None  # None: one number
    offset: int  # bytes
    number: int = 0  # of the first one, among all numbers of the message


def size_of(form: str) -> int:
    """Return the bytes of one number."""
    return 1 if form == "?" else int(form[-1])


def leaves(definition: str, sample: bytes) -> list[Leaf]:
    """Return the numbers of such a message, in order."""
    found = list(_Walk(Definition(definition), sample).message("", ""))
    # std_msgs wrap one thing, whose name says nothing.
    data = [leaf for leaf in found if leaf.path == "data"]
    rest = {leaf.path.partition(".")[0] for leaf in found} - {"data", "layout"}
    if len(data) == 1 and not rest:
        return [replace(data[0], path="")]
    return found


class _Walk:
    """One way through a sample."""

    def __init__(self, types: Definition, sample: bytes) -> None:
        self._types = types
        self._sample = sample
        self._at = 0
        self._number = 0

    def message(self, name: str, path: str) -> Iterator[Leaf]:
        for field in self._types.fields(name):
            full = f"{path}.{field.name}" if path else field.name
            count = field.length
            if field.is_array and count is None:
                count = self._length()
            yield from self._field(field.kind, full, count)

    def _field(self, kind: str, path: str, count: int | None) -> Iterator[Leaf]:
        if kind in _NUMBERS or kind in _TIMES:
            form, each = _NUMBERS.get(kind, ""), 1
            if kind in _TIMES:
                form, each = _TIMES[kind], 2  # seconds and nanoseconds
                count = each * (1 if count is None else count)
            yield Leaf(path, form, count, self._at, self._number)
            numbers = 1 if count is None else count
            self._at += size_of(form) * numbers
            self._number += numbers
            return
        for index in range(1 if count is None else count):
            each_path = path if count is None else f"{path}[{index}]"
            if kind == "string":
                length = self._length()
                self._at += length
            else:
                yield from self.message(kind, each_path)

    def _length(self) -> int:
        (length,) = _LENGTH.unpack_from(self._sample, self._at)
        self._at += _LENGTH.size
        return int(length)
