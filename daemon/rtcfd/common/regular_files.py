"""Reads and appends to regular files, and rejects everything else.

Opening a named pipe blocks until its other end is open; opening a device may have any
effect.  So for anything but a regular file, these functions raise an OSError whose
`strerror` names the kind of file.

FileNotFoundError means that the name does not exist.  A dangling symbolic link is
another OSError, because somebody meant a file by it.
"""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

from google.protobuf import json_format

# Raised by parsing unexpected content of a file.
PARSE_ERRORS = (
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    OverflowError,
    RecursionError,
    json_format.ParseError,
)

_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_bytes(file: Path) -> bytes:
    """Return the content of a file; raises OSError."""
    with open(_opened(file, os.O_RDONLY), "rb") as content:
        return content.read()


def read_piece(file: Path, most: int, at: int = 0) -> bytes:
    """Return at most `most` bytes of a file, from byte `at` on; raises OSError."""
    with open(_opened(file, os.O_RDONLY), "rb") as content:
        content.seek(at)
        return content.read(most)


def read_text(file: Path, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Return the text of a file; raises OSError, UnicodeDecodeError."""
    with open(_opened(file, os.O_RDONLY), encoding=encoding, errors=errors) as content:
        return content.read()


def append(file: Path, data: bytes) -> None:
    """Append to a file, which is created if needed; raises OSError."""
    with open(_opened(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT), "ab") as out:
        out.write(data)


def require_present(path: Path) -> None:
    """Raise FileNotFoundError if a name does not exist, another OSError if the name, or a folder
    on its path, is a dangling symbolic link."""
    try:
        path.stat()
    except FileNotFoundError:
        for each in (path, *path.parents):
            if os.path.islink(each) and not os.path.exists(each):
                where = "it" if each == path else str(each)
                raise OSError(
                    errno.EINVAL, f"{where} is a symbolic link that leads nowhere", str(path)
                ) from None
        raise


def require_regular(file: Path, found: os.stat_result) -> None:
    """Raise OSError if `found`, the status of `file`, is not that of a regular file."""
    if not stat.S_ISREG(found.st_mode):
        kind = next((word for is_one, word in _KINDS if is_one(found.st_mode)), "something else")
        raise OSError(errno.EINVAL, f"it is {kind}, not a regular file", str(file))


def _opened(file: Path, flags: int) -> int:
    try:
        require_present(file)
        require_regular(file, file.stat())
    except FileNotFoundError:
        if not flags & os.O_CREAT:
            raise
    # O_NONBLOCK: a pipe may have replaced the file meanwhile.
    descriptor = os.open(file, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    try:
        require_regular(file, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
