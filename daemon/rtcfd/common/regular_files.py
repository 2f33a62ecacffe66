"""Reading, and adding to, files in whose place there may be something else.

Whoever opens a named pipe waits for its other end, for ever; a device may do
anything when it is opened.  What is no regular file is an OSError here, whose
`strerror` says what it is instead.

FileNotFoundError is for a name that is not there: a link that leads nowhere is
another error, as somebody meant a file by it.
"""

import errno
import os
import stat
from collections.abc import Callable
from pathlib import Path

_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def read_bytes(file: Path) -> bytes:
    """Return what a file holds; raises OSError."""
    with open(_opened(file, os.O_RDONLY), "rb") as content:
        return content.read()


def read_text(file: Path, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Return the text that a file holds; raises OSError, UnicodeDecodeError."""
    with open(_opened(file, os.O_RDONLY), encoding=encoding, errors=errors) as content:
        return content.read()


def append(file: Path, data: bytes) -> None:
    """Write to the end of a file, which is made if it is not there; raises OSError."""
    with open(_opened(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT), "ab") as out:
        out.write(data)


def require_present(path: Path) -> None:
    """Raise FileNotFoundError if there is no such name, another OSError if a link on the way to
    it leads nowhere."""
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
    """Raise OSError if what was found at a path is no regular file."""
    if not stat.S_ISREG(found.st_mode):
        kind = next((word for is_one, word in _KINDS if is_one(found.st_mode)), "something else")
        raise OSError(errno.EINVAL, f"it is {kind}, no regular file", str(file))


def _opened(file: Path, flags: int) -> int:
    try:
        require_present(file)
        require_regular(file, file.stat())
    except FileNotFoundError:
        if not flags & os.O_CREAT:
            raise
    # Without waiting: it may have become something else meanwhile.
    descriptor = os.open(file, flags | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    try:
        require_regular(file, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
