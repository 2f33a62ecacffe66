"""Cycles as bytes for a page: a head, then columns of float64, all of one length.

Columns are the time (seconds after the base that the text message `watching` tells), the number
of the cycle, wake-up latency and calculation (µs), then the traces in the order of `watching`.
All little endian; page/wire.js reads it.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rtcf_scope.chunk import Chunk

CYCLES, SHOT, RECORDED = range(1, 4)
# Kind, last of a loop, number of `watching`, cycles, columns, lost before these, cycle of the hit.
# Of a recording, the last is the length of a window, whose minimum and maximum are two rows; 1 = a
# row is a cycle.
_HEAD = struct.Struct("<BBHIIIdd8x")


def head(
    kind: int, watching: int, count: int, columns: int, *, lost: int = 0, hit: int = -1,
    last: bool = False,
) -> bytes:  # fmt: skip
    """Return the head of a message."""
    return _HEAD.pack(kind, last, watching & 0xFFFF, count, columns, 0, float(lost), float(hit))


def columns(chunk: Chunk, names: Sequence[str], base_ns: int) -> list[NDArray[np.float64]]:
    """Return all columns of a chunk."""
    return [
        (chunk.stamps_ns - base_ns) / 1e9,
        chunk.cycles.astype("<f8"),
        chunk.latencies_us,
        chunk.durations_us,
        *(chunk.values(name) for name in names),
    ]


def body(chunk: Chunk, names: Sequence[str], base_ns: int) -> bytes:
    """Return a chunk's columns as bytes; made once for all tabs that show the same."""
    key = tuple(names)
    if key not in chunk.packed:
        chunk.packed[key] = np.array(columns(chunk, names, base_ns), "<f8").tobytes()
    return chunk.packed[key]


def cut(
    chunks: Sequence[Chunk], names: Sequence[str], base_ns: int, begin: int, end: int
) -> NDArray[np.float64]:
    """Return the columns of the cycles from `begin` to before `end`, by their place at the hub."""
    found = np.hstack([np.array(columns(each, names, base_ns), "<f8") for each in chunks])
    first = chunks[0].at
    result: NDArray[np.float64] = found[:, max(begin - first, 0) : end - first]
    return result
