"""The layout of the memory of an executor's frames, as defined in executor.proto."""

import struct

MAGIC = 0x42435452
VERSION = 1
HEAD = struct.Struct("<II")
ENTRY = struct.Struct("<6Q")  # sequence, offset, frames, words of a frame, layout's offset, bytes
ENTRIES = 8
WORD = struct.Struct("<Q")
HEAD_WORDS = 6  # of a frame: mark, iteration, stamp, latency, duration, last of its loop


def entry_at(index: int) -> int:
    """Return the offset of an entry of the directory."""
    return HEAD.size + index * ENTRY.size
