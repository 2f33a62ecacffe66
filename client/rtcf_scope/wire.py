"""Binary messages to a page: a head, then columns of float64 of equal length.

The columns are the time (seconds after the base in the text message `watching`), the cycle number,
the wake-up latency (µs), the calculation duration (µs), then the traces in the order of `watching`.
All values are little endian; page/wire.js parses them.
"""

import struct
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rtcf_scope.chunk import Chunk

CYCLES, SHOT, RECORDED = range(1, 4)
# Kind, last of a loop, number of `watching`, rows, columns, dropped cycles before, row of the hit.
# For a recording, the last field is the length of a window in cycles: each window has two rows, its
# minimum and its maximum; 1 means one row per cycle.
_HEAD = struct.Struct("<BBHIIIdd8x")


def head(
    kind: int, watching: int, count: int, columns: int, *, lost: int = 0, hit: int = -1,
    last: bool = False,
) -> bytes:  # fmt: skip
    """Return the head of a message."""
    return _HEAD.pack(kind, last, watching & 0xFFFF, count, columns, 0, float(lost), float(hit))


def columns(chunk: Chunk, names: Sequence[str], base_ns: int) -> list[NDArray[np.float64]]:
    """Return the columns of a chunk with the traces `names`."""
    return [
        (chunk.stamps_ns - base_ns) / 1e9,
        chunk.cycles.astype("<f8"),
        chunk.latencies_us,
        chunk.durations_us,
        *(chunk.values(name) for name in names),
    ]


def body(chunk: Chunk, names: Sequence[str], base_ns: int) -> bytes:
    """Return a chunk's columns as bytes, cached for all tabs with the same traces."""
    key = tuple(names)
    if key not in chunk.packed:
        chunk.packed[key] = np.array(columns(chunk, names, base_ns), "<f8").tobytes()
    return chunk.packed[key]


def cut(
    chunks: Sequence[Chunk], names: Sequence[str], base_ns: int, begin: int, end: int
) -> NDArray[np.float64]:
    """Return the columns of the cycles [begin, end), counted as `Chunk.at`."""
    found = np.hstack([np.array(columns(each, names, base_ns), "<f8") for each in chunks])
    first = chunks[0].at
    result: NDArray[np.float64] = found[:, max(begin - first, 0) : end - first]
    return result
