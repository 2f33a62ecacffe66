"""The layout of the numbers in a serialised ROS 1 message, by its definition and a sample.

The layout applies to messages of the sample's length, with strings and arrays of the same lengths.
http://wiki.ros.org/msg describes the serialisation of ROS 1.
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
# Messages whose numbers have no unit.
_PLAIN = {"Header", "std_msgs/Header", "Quaternion", "geometry_msgs/Quaternion"}


@dataclass(frozen=True)
class Leaf:
    """A number or an array of numbers in a message."""

    path: str  # e.g. "twist.linear.x"; empty for the only value of a std_msgs message
    format: str  # NumPy format of one number
    count: int | None  # length of the array; None: a single number
    offset: int  # bytes
    number: int = 0  # index of the first number among all numbers of the message
    has_unit: bool = True  # whether the unit of a port applies: not to times and quaternions


def size_of(form: str) -> int:
    """Return the size of one number of a NumPy format, in bytes."""
    return 1 if form == "?" else int(form[-1])


def leaves(definition: str, sample: bytes) -> list[Leaf]:
    """Return the numbers of messages with a definition and the length of a sample, in order."""
    found = list(_Walk(Definition(definition), sample).message("", ""))
    # std_msgs wrap one value in a field `data`: omit this name.
    data = [leaf for leaf in found if leaf.path == "data"]
    rest = {leaf.path.partition(".")[0] for leaf in found} - {"data", "layout"}
    if len(data) == 1 and not rest:
        return [replace(data[0], path="")]
    return found


class _Walk:
    """One traversal of a sample."""

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
            yield Leaf(path, form, count, self._at, self._number, kind not in _TIMES)
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
                for leaf in self.message(kind, each_path):
                    yield replace(leaf, has_unit=leaf.has_unit and kind not in _PLAIN)

    def _length(self) -> int:
        (length,) = _LENGTH.unpack_from(self._sample, self._at)
        self._at += _LENGTH.size
        return int(length)
