"""The outputs of a graph under test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from rtcf_shared.naming import listing, suggestion


class Response(Mapping[str, npt.NDArray[np.generic]]):
    """The values of outputs by name, with a row per cycle: the value at the end of the cycle.

    time     the times of the cycles, in seconds from 0
    written  for each output, whether it was written in each cycle

    Before an output is written for the first time, it is NaN, or 0 for integers and bool. An output
    whose messages differ in length, e.g. a text, has no values here.
    """

    def __init__(
        self,
        time: npt.NDArray[np.floating[Any]],
        written: dict[str, npt.NDArray[np.bool_]],
        columns: dict[str, npt.NDArray[np.generic]],
        without_columns: Mapping[str, str],
    ) -> None:
        """`without_columns`: outputs that were written but have no columns, with the reasons."""
        self.time = time
        self.written = written
        self._columns = columns
        self._without_columns = without_columns

    def __getitem__(self, name: str) -> npt.NDArray[np.generic]:
        if name not in self._columns:
            for port, reason in self._without_columns.items():
                if name == port or name.startswith(f"{port}."):
                    raise KeyError(f"output {port} has no columns: {reason}")
            names = list(self._columns)
            raise KeyError(
                f"no output {name} was written{suggestion(name, names)} "
                f"(written: {listing(names) or 'none'})"
            )
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)


def held(
    values: npt.NDArray[np.generic], cycles: npt.NDArray[np.int64], steps: int
) -> npt.NDArray[np.generic]:
    """Return values written in `cycles` for all `steps` cycles, each held until the next one."""
    result = np.zeros((steps, *values.shape[1:]), values.dtype)
    if values.dtype.kind == "f":
        result[:] = np.nan
    newest = np.searchsorted(cycles, np.arange(steps), side="right") - 1
    there = newest >= 0
    result[there] = values[newest[there]]
    return result
