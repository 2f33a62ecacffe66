"""Reads files that a user names, up to a limit: they may be devices or endless pipes."""

import errno
import os
import sys
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 16 * 1024 * 1024  # the limit of a message to rtcfd


def read(path: str | Path) -> bytes:
    """Return the content of a file, device or pipe; "-" is standard input.

    Raises OSError, also for more than MOST_BYTES.
    """
    if str(path) == "-":
        return _all_of(sys.stdin.buffer)
    with open(path, "rb") as file:
        return _all_of(file)


def _all_of(file: BinaryIO) -> bytes:
    content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        why = f"{os.strerror(errno.EFBIG)}: more than {MOST_BYTES // 1024 // 1024} MiB"
        raise OSError(errno.EFBIG, why)
    return content
