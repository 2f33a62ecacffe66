"""Files that are there whole or not at all: what ends halfway leaves what was there before."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole_file(path: Path, *, force: bool = False) -> Iterator[Path]:
    """Give the path to write to, in the folder of `path`; the file has that name from the end on.

    A device or a pipe is written to as it is.  Raises FileExistsError for a file that is there,
    unless `force`, also if it came meanwhile; and OSError.
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
            # A file system without such links, as of a USB stick.
            if error.errno not in (errno.EPERM, errno.EOPNOTSUPP) or target.exists():
                raise
    part.replace(target)
