"""Conversion between serialised ROS messages of equal length and NumPy columns."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from rtcf_shared import ros_layout
from rtcf_shared.naming import listing, suggestion
from rtcf_shared.ros_definition import Definition, Field

_LENGTH = struct.Struct("<I")
_SIZES = {"string": 0, "bool": 1, "byte": 1, "char": 1, "time": 8, "duration": 8} | {
    f"{kind}{bits}": bits // 8
    for kind, all_bits in (("int", (8, 16, 32, 64)), ("uint", (8, 16, 32, 64)), ("float", (32, 64)))
    for bits in all_bits
}


def pack(definition: str, columns: Mapping[str, npt.NDArray[np.generic]]) -> list[bytes]:
    """Return one serialised message per row of the columns; fields without a column are zero.

    Columns are by the path of a field, or "" for the only value of a std_msgs message, or for all
    numbers of a message that has only numbers, such as a vector.  For an array, the axes after the
    first one have its values.  Raises ValueError.
    """
    steps = max(len(each) for each in columns.values())
    sample = _Zero(Definition(definition), columns).message("", "")
    leaves = {each.path: each for each in ros_layout.leaves(definition, sample)}
    rows = np.tile(np.frombuffer(sample, "u1"), (steps, 1))
    for path, column in _by_number(columns, list(leaves.values()), steps).items():
        leaf = leaves.get(path)
        if leaf is None:
            names = [each or "(the value itself)" for each in leaves]
            raise ValueError(
                f"no field {path or '(the value itself)'}{suggestion(path, names)} "
                f"(fields: {listing(names)})"
            )
        values = column.reshape(steps, -1)
        count = 1 if leaf.count is None else leaf.count
        if values.shape[1] != count:
            raise ValueError(
                f"{path + ': ' if path else ''}"
                f"{values.shape[1]} values per cycle instead of {count}"
            )
        size = count * ros_layout.size_of(leaf.format)
        with np.errstate(invalid="ignore"):  # inexact conversions are rejected below
            exact = np.ascontiguousarray(values.astype(leaf.format, casting="unsafe"))
        if exact.dtype.kind in "iub" and not np.array_equal(exact.astype(float), values):
            raise ValueError(f"{path + ': ' if path else ''}some values do not fit {exact.dtype}")
        rows[:, leaf.offset : leaf.offset + size] = exact.view("u1").reshape(steps, size)
    return [row.tobytes() for row in rows]


def unpack(definition: str, messages: Sequence[bytes]) -> dict[str, npt.NDArray[np.generic]]:
    """Return the columns of messages, by path as in pack().

    Raises ValueError if the messages differ in length.
    """
    if len({len(each) for each in messages}) > 1:
        raise ValueError("the messages differ in length")
    rows = np.frombuffer(b"".join(messages), "u1").reshape(len(messages), -1)
    columns = {}
    for leaf in ros_layout.leaves(definition, messages[0]):
        count = 1 if leaf.count is None else leaf.count
        end = leaf.offset + count * ros_layout.size_of(leaf.format)
        values = np.ascontiguousarray(rows[:, leaf.offset : end]).view(leaf.format)
        columns[leaf.path] = values[:, 0] if leaf.count is None else values
    return columns


def _by_number(
    columns: Mapping[str, npt.NDArray[np.generic]], leaves: Sequence[ros_layout.Leaf], steps: int
) -> Mapping[str, npt.NDArray[np.generic]]:
    """Return the columns with that of a whole vector split into its numbers."""
    if "" not in columns or any(each.count is not None or not each.path for each in leaves):
        return columns
    whole = columns[""].reshape(steps, -1)
    paths = [each.path for each in leaves]
    if whole.shape[1] != len(paths):
        raise ValueError(
            f"{whole.shape[1]} values per cycle instead of {len(paths)}: "
            f"give a sequence of {len(paths)} numbers (fields: {listing(paths)})"
        )
    others = {path: column for path, column in columns.items() if path}
    return {**dict(zip(paths, whole.T, strict=True)), **others}


class _Zero:
    """A message of zeros, with array lengths according to the widths of the columns."""

    def __init__(self, types: Definition, columns: Mapping[str, npt.NDArray[np.generic]]) -> None:
        self._types = types
        self._columns = columns

    def message(self, name: str, path: str) -> bytes:
        return b"".join(
            self._field(each, f"{path}.{each.name}" if path else each.name)
            for each in self._types.fields(name)
        )

    def _field(self, field: Field, path: str) -> bytes:
        if not field.is_array:
            return self._single(field.kind, path)
        count, head = field.length, b""
        if count is None:
            column = self._columns.get(path, self._columns.get("") if path == "data" else None)
            count = 0 if column is None else int(np.prod(column.shape[1:], dtype=int))
            head = _LENGTH.pack(count)
        return head + b"".join(self._single(field.kind, f"{path}[{i}]") for i in range(count))

    def _single(self, kind: str, path: str) -> bytes:
        if kind == "string":
            return _LENGTH.pack(0)
        return bytes(_SIZES[kind]) if kind in _SIZES else self.message(kind, path)
