"""The values of a component in the interpreter."""

from typing import Any

import numpy as np


class Memory:
    """A record, and the arrays that hooks have used: names refer to them as in NumPy."""

    def __init__(self, record: Any) -> None:
        """Use a record of all members."""
        self.record = record
        self._arrays: dict[str, Any] = {}

    def array(self, name: str) -> Any:
        """Return the array that a member refers to."""
        if name not in self._arrays:
            self._arrays[name] = self.record[name].copy()
        return self._arrays[name]

    def bind(self, name: str, value: Any) -> None:
        """Let a member refer to an array of its type and shape; convert any other value."""
        field = self.record.dtype[name]
        if not isinstance(value, np.ndarray) or (value.dtype, value.shape) != (
            field.base, field.shape
        ):  # fmt: skip
            new = np.empty(field.shape, field.base)
            new[...] = value
            value = new
        self._arrays[name] = value

    def set(self, name: str, value: Any) -> None:
        """Set a number, or a member to a new array of these values."""
        if self.record.dtype[name].shape:
            self.bind(name, np.array(value))
        else:
            self.record[name] = value

    def written(self) -> Any:
        """Return the record with the values of the arrays."""
        for name, array in self._arrays.items():
            self.record[name] = array
        return self.record

    def whole(self) -> Any:
        """Return the record to be changed from outside: members refer to it from now on."""
        record = self.written()
        self._arrays.clear()
        return record
