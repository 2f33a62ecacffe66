"""Files that are read up to a limit, and written completely or not at all.

An interrupted write leaves the old file.
"""

import contextlib
import errno
import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

MOST_BYTES = 16 * 1024 * 1024  # the limit of a message to rtcfd
# Files in these folders are written to, never replaced.
_NO_FILES = ("/dev/", "/proc/")


def write_named(file: str | os.PathLike[str], data: bytes) -> None:
    """Write `data` to a file that a user names; raises OSError.  Blocks.

    A regular file, or the target of a link, is replaced.  It keeps its owner and mode, except in
    a folder to which everybody can write (sticky, as /tmp).  A device or a pipe is written to.
    """
    try:
        # Resolved by the kernel, which follows no link of another user in a sticky folder.
        place = os.open(file, os.O_PATH | os.O_CLOEXEC)
    except FileNotFoundError:
        if os.path.islink(file):
            raise OSError(errno.EINVAL, "a symbolic link that leads nowhere") from None
        replace(file, data)
        return
    try:
        found = os.fstat(place)
        path = f"/proc/self/fd/{place}"
        if not stat.S_ISREG(found.st_mode) or os.path.abspath(file).startswith(_NO_FILES):
            with open(path, "ab") as out:  # appends, if it leads to a regular file
                out.write(data)
            return
        real = os.readlink(path)
        everybodys = os.stat(os.path.dirname(real)).st_mode & stat.S_ISVTX
        replace(real, data, like=None if everybodys else found)
    finally:
        os.close(place)


def replace(
    file: str | os.PathLike[str],
    data: bytes,
    *,
    sync: bool = True,
    like: os.stat_result | None = None,
    mode: int = 0o666,
) -> None:
    """Replace the content of a file atomically; on an error, it is unchanged; raises OSError.
    Blocks.

    Until sync_folder(), the file may have its old content after a power cut; without `sync`, it
    may be empty.  The new file gets the mode of `like`, and its owner if that is permitted;
    without `like`, `mode` minus the umask.
    """
    folder, name = os.path.split(file)
    new = os.path.join(folder, f".{name}.new")
    try:
        # Do not open an existing file of this name: it may be a named pipe.
        with contextlib.suppress(FileNotFoundError):
            os.unlink(new)
        with open(new, "xb", opener=lambda path, flags: os.open(path, flags, mode)) as out:
            if like is not None:
                with contextlib.suppress(PermissionError):
                    os.fchown(out.fileno(), like.st_uid, like.st_gid)
                os.fchmod(out.fileno(), like.st_mode & 0o777)
            out.write(data)
            if sync:
                out.flush()
                os.fsync(out.fileno())
        os.replace(new, file)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(new)
        for path in (new, file):
            if isinstance(error, IsADirectoryError) and os.path.isdir(path):
                raise IsADirectoryError(error.errno, f"{path} is a folder") from None
        raise


def sync_folder(folder: str | os.PathLike[str]) -> None:
    """Write the renamed and removed names of a folder to disk; raises OSError.  Blocks."""
    # Without this, a power cut may undo a rename (fsync(2), NOTES).
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
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


def read(path: str | Path) -> bytes:
    """Return the content of a file that a user names; "-" is standard input.

    The file may be a device or an endless pipe.  Raises OSError, also for more than MOST_BYTES.
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
