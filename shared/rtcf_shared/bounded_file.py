"""Files that a caller names: whatever stands there, no more of it is read than can be used."""

import errno
import os
import sys
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 16 * 1024 * 1024  # of a message to rtcfd


def read(path: str | Path) -> bytes:
    """Return what a file, device or pipe gives, "-" being standard input.

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
