"""Chunks of consecutive cycles for the tabs of a runner, and a bounded history of them."""

import re
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rtcf_shared.ports import PortBatch, PortSchema

ELEMENTS = 64  # listed elements of an array, each a signal
_LONGEST = 1000  # characters of a name
_COLUMN = re.compile(r"(?:/[A-Za-z]\w*)+\.[A-Za-z_]\w*", re.ASCII)
_ELEMENT = re.compile(r"(.+)\[([0-9]{1,9})\]")


@dataclass
class Chunk:
    """A batch of cycles with its position in the hub's sequence of cycles."""

    batch: PortBatch
    at: int  # number of cycles that the hub has sent before this chunk
    lost: int  # dropped cycles before this chunk
    packed: dict[tuple[str, ...], bytes] = field(default_factory=dict)  # cache of wire.body

    def __len__(self) -> int:
        return len(self.batch)

    @property
    def end(self) -> int:
        """`at` of the next chunk."""
        return self.at + len(self)

    @property
    def cycles(self) -> NDArray[np.int64]:
        """The cycle numbers."""
        return self.batch.cycles

    @property
    def stamps_ns(self) -> NDArray[np.int64]:
        """The loop's time; ns."""
        return self.batch.stamps_ns

    @property
    def latencies_us(self) -> NDArray[np.float64]:
        """The wake-up latency of each cycle; µs."""
        return self.batch.latencies_ns / 1e3

    @property
    def durations_us(self) -> NDArray[np.float64]:
        """The calculation duration of each cycle; µs."""
        return self.batch.durations_ns / 1e3

    def values(self, name: str) -> NDArray[np.float64]:
        """Return the values of a trace, one per cycle; NaN if the graph lacks the signal."""
        if not has_trace(self.batch.schema, name):
            return np.full(len(self), np.nan)
        signal, index = split_element(name)
        values: NDArray[Any] = self.batch[signal].reshape(len(self), -1)
        return values[:, index].astype(np.float64)


class History:
    """The last chunks of a runner, at most `most_bytes` of them."""

    def __init__(self, most_bytes: int) -> None:
        self._most = most_bytes
        self._bytes = 0
        self._chunks: deque[Chunk] = deque()

    def __iter__(self) -> Any:
        return iter(self._chunks)

    def __len__(self) -> int:
        return len(self._chunks)

    def add(self, chunk: Chunk) -> None:
        """Add a chunk; remove the oldest chunks above the limit."""
        self._chunks.append(chunk)
        self._bytes += _size(chunk)
        while self._bytes > self._most and len(self._chunks) > 1:
            removed = self._chunks.popleft()
            self._bytes -= _size(removed)
            removed.packed.clear()

    def between(self, begin: int, end: int) -> list[Chunk]:
        """Return the chunks with any of the cycles [begin, end), counted as `Chunk.at`."""
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
    """Return signal and index of a trace: ("/arm.q", 2) for "/arm.q[2]"; index 0 for a scalar."""
    found = _ELEMENT.fullmatch(name)
    return (found[1], int(found[2])) if found else (name, 0)


def column_of(name: str) -> str:
    """Return the output or state of a trace: "/arm.cmd" for "/arm.cmd.twist.linear.x".

    Empty for text that is not a signal name.
    """
    found = _COLUMN.match(name) if len(name) <= _LONGEST else None
    return found[0] if found else ""


def has_trace(schema: PortSchema, name: str) -> bool:
    """Return whether a stream has values of a trace."""
    signal, index = split_element(name)
    found = schema.signals.get(signal)
    return found is not None and index < max(int(np.prod(found.shape)), 1)


def traces(schema: PortSchema) -> list[dict[str, str]]:
    """Return name, unit and kind ("bool" or "number") of all possible traces of a stream."""
    found = []
    for signal in schema.signals.values():
        count = int(np.prod(signal.shape)) if signal.shape else 0
        names = [f"{signal.name}[{i}]" for i in range(min(count, ELEMENTS))] or [signal.name]
        kind = kind_of(signal.format)
        found += [{"name": name, "unit": signal.unit, "kind": kind} for name in names]
    return found


def kind_of(form: str) -> str:
    """Return "bool", "integer" or "number" for a format of NumPy."""
    return {"b": "bool", "i": "integer", "u": "integer"}.get(np.dtype(form).kind, "number")
