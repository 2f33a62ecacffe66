"""Copies the memory of an executor's frames while its loop continues to write them.

Runs in a thread of rtcfd, so it uses little memory, and no NumPy.
"""

import os

from rtcfd.incidents import frame_layout as layout

_PIECE = 1024 * 1024


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
    for index in range(layout.ENTRIES):
        at = layout.entry_at(index)
        then = os.pread(copy, layout.ENTRY.size, at)
        if len(then) != layout.ENTRY.size:
            return  # this is not a memory of frames
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
