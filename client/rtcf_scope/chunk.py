"""Cycles one after the other, as the tabs of a runner get them, and the last ones of them."""

import re
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rtcf.streams.ports import PortBatch, PortSchema

ELEMENTS = 64  # of an array that are told, each as a signal of its own
_LONGEST = 1000  # characters of a name
_COLUMN = re.compile(r"(?:/[A-Za-z]\w*)+\.[A-Za-z_]\w*", re.ASCII)
_ELEMENT = re.compile(r"(.+)\[([0-9]{1,9})\]")


@dataclass
class Chunk:
    """A batch; `at` counts all cycles that its hub has told before."""

    batch: PortBatch
    at: int
    lost: int  # cycles before these
    packed: dict[tuple[str, ...], bytes] = field(default_factory=dict)  # made by wire, for all tabs

    def __len__(self) -> int:
        return len(self.batch)

    @property
    def end(self) -> int:
        """`at` of the next one."""
        return self.at + len(self)

    @property
    def cycles(self) -> NDArray[np.int64]:
        """The numbers of the cycles."""
        return self.batch.cycles

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """The loop's time; ns."""
        return self.batch.stamps_ns

    @property
    def latencies_us(self) -> NDArray[np.float64]:
        """Wake-up after each deadline; µs."""
        return self.batch.latencies_ns / 1e3

    @property
    def durations_us(self) -> NDArray[np.float64]:
        """Calculation in each cycle; µs."""
        return self.batch.durations_ns / 1e3

    def values(self, name: str) -> NDArray[np.float64]:
        """Return the values of a trace; NaN where the graph has no such signal."""
        if not is_there(self.batch.schema, name):
            return np.full(len(self), np.nan)
        signal, index = split_element(name)
        values: NDArray[Any] = self.batch[signal].reshape(len(self), -1)
        return values[:, index].astype(np.float64)


class Memory:
    """The last chunks of a runner, bounded in bytes."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._bytes = 0
        self._chunks: deque[Chunk] = deque()

    def __iter__(self) -> Any:
        return iter(self._chunks)

    def __len__(self) -> int:
        return len(self._chunks)

    def add(self, chunk: Chunk) -> None:
        """Keep it; the oldest ones go."""
        self._chunks.append(chunk)
        self._bytes += _size(chunk)
        while self._bytes > self._most and len(self._chunks) > 1:
            gone = self._chunks.popleft()
            self._bytes -= _size(gone)
            gone.packed.clear()

    def between(self, begin: int, end: int) -> list[Chunk]:
        """Return those that hold any of the cycles from `begin` to before `end`, by `at`."""
        found = []
        for chunk in reversed(self._chunks):
            if chunk.end <= begin:
                break
            if chunk.at < end:
                found.append(chunk)
        return found[::-1]


def _size(chunk: Chunk) -> int:
    message = chunk.batch.message
    return sum(len(each) for each in message.values) + 48 * len(message.stamps_ns) + 1000


def split_element(name: str) -> tuple[str, int]:
    """Return signal and place of "/arm.q[2]"; of one that is a number, place 0."""
    found = _ELEMENT.fullmatch(name)
    return (found[1], int(found[2])) if found else (name, 0)


def column_of(name: str) -> str:
    """Return the output or state that a trace is of: "/arm.cmd" of "/arm.cmd.twist.linear.x".

    Empty of what is no name of a signal.
    """
    found = _COLUMN.match(name) if len(name) <= _LONGEST else None
    return found[0] if found else ""


def is_there(schema: PortSchema, name: str) -> bool:
    """Tell whether a trace has values in a stream."""
    signal, index = split_element(name)
    found = schema.signals.get(signal)
    return found is not None and index < max(int(np.prod(found.shape)), 1)


def traces(schema: PortSchema) -> list[dict[str, str]]:
    """Return name and unit of all that can be drawn."""
    found = []
    for signal in schema.signals.values():
        count = int(np.prod(signal.shape)) if signal.shape else 0
        names = [f"{signal.name}[{i}]" for i in range(min(count, ELEMENTS))] or [signal.name]
        kind = "bool" if signal.format == "?" else "number"
        found += [{"name": name, "unit": signal.unit, "kind": kind} for name in names]
    return found
