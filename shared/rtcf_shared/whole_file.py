"""Writes files completely or not at all: an interrupted write leaves the old file."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Yield the path to write to, in the folder of `path`; at the end, the file gets that name.

    A device or a pipe is written to directly.  Raises FileExistsError if the file exists, unless
    `force`, even if it was created meanwhile; raises OSError.
    """
    target = path.resolve()
    if target.exists() and not target.is_file():
        yield target
        return
    if target.exists() and not force:
        raise FileExistsError(f"{path} is there already")
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield part
        _name(part, target, force)
    finally:
        part.unlink(missing_ok=True)


def _name(part: Path, target: Path, force: bool) -> None:
    if not force:
        try:
            os.link(part, target)
            return
        except FileExistsError:
            raise
        except OSError as error:
            # A file system without hard links, as on a USB stick.
            if error.errno not in (errno.EPERM, errno.EOPNOTSUPP) or target.exists():
                raise
    part.replace(target)
