"""Copies the memory of an executor's frames while its loop goes on writing them.

Without NumPy, and in little memory: it runs in a thread of rtcfd.
"""

import os

from rtcfd.incidents import frame_layout as layout

_PIECE = 1024 * 1024


def copied(descriptor: int) -> int:
    """Return a copy, in a memory of its own; its holes stay holes.

    Whatever was written anew meanwhile is marked as absent, as a part of it may be of another
    frame.
    """
    size = os.fstat(descriptor).st_size
    copy = os.memfd_create("rtcf-incident")
    try:
        os.ftruncate(copy, size)
        # An offset of its own: the descriptor shares its with others.
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
    """A frame's mark, and a ring's entry, change before anything else of it does."""
    for index in range(layout.ENTRIES):
        at = layout.entry_at(index)
        then = os.pread(copy, layout.ENTRY.size, at)
        if len(then) != layout.ENTRY.size:
            return  # these are no frames
        if then != os.pread(own, layout.ENTRY.size, at):
            os.pwrite(copy, bytes(layout.ENTRY.size), at)
            continue
        sequence, offset, frames, words, _, _ = layout.ENTRY.unpack(then)
        if not sequence:
            continue
        stride = words * layout.WORD.size
        for mark_at in range(offset, offset + frames * stride, stride):
            mark = os.pread(copy, layout.WORD.size, mark_at)
            if mark != os.pread(own, layout.WORD.size, mark_at):
                os.pwrite(copy, bytes(layout.WORD.size), mark_at)
