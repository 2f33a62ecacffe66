"""The memory of an executor's frames: its layout, as defined in executor.proto, and a copy of it.

The copy is made while the loop continues to write, in a thread of rtcfd: so with little memory,
and without NumPy.
"""

import os
import struct

MAGIC = 0x42435452
VERSION = 2
HEAD = struct.Struct("<II")
ENTRY = struct.Struct("<6Q")  # sequence, offset, frames, words of a frame, layout's offset, bytes
ENTRIES = 8
WORD = struct.Struct("<Q")
HEAD_WORDS = 8  # of a frame: mark, iteration, stamp, latency, kind, begin, ready, end

_PIECE = 1024 * 1024


def entry_at(index: int) -> int:
    """Return the offset of an entry of the directory."""
    return HEAD.size + index * ENTRY.size


def copied(descriptor: int) -> int:
    """Return the descriptor of a copy in memory; holes stay holes.

    Frames that were overwritten during the copy are marked as absent, because they may have
    parts of two cycles.
    """
    size = os.fstat(descriptor).st_size
    copy = os.memfd_create("rtcf-incident")
    try:
        os.ftruncate(copy, size)
        # Opened again, for a file offset of its own: duplicates of the descriptor share one.
        own = os.open(f"/proc/self/fd/{descriptor}", os.O_RDONLY | os.O_CLOEXEC)
        try:
            _copy(own, copy, size)
            _leave_out_torn(own, copy)
        finally:
            os.close(own)
    except BaseException:
        os.close(copy)
        raise
    return copy


def _copy(own: int, copy: int, size: int) -> None:
    at = 0
    while at < size:
        try:
            at = os.lseek(own, at, os.SEEK_DATA)
        except OSError:
            return  # no more data
        end = os.lseek(own, at, os.SEEK_HOLE)
        while at < end:
            at += os.pwrite(copy, os.pread(own, min(end - at, _PIECE), at), at)


def _leave_out_torn(own: int, copy: int) -> None:
    """Mark overwritten frames and rings in the copy as absent.

    The executor changes the mark of a frame, and the entry of a ring, before the rest of it.
    """
    for index in range(ENTRIES):
        at = entry_at(index)
        then = os.pread(copy, ENTRY.size, at)
        if len(then) != ENTRY.size:
            return  # this is not a memory of frames
        if then != os.pread(own, ENTRY.size, at):
            os.pwrite(copy, bytes(ENTRY.size), at)
            continue
        sequence, offset, frames, words, _, _ = ENTRY.unpack(then)
        if not sequence:
            continue
        stride = words * WORD.size
        for mark_at in range(offset, offset + frames * stride, stride):
            mark = os.pread(copy, WORD.size, mark_at)
            if mark != os.pread(own, WORD.size, mark_at):
                os.pwrite(copy, bytes(WORD.size), mark_at)
