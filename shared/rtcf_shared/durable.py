"""Files that are replaced at once, and outlive a power cut."""

import contextlib
import errno
import os
import stat

# What is opened here is no file of a disk, whatever it leads to.
_NO_FILES = ("/dev/", "/proc/")


def write_named(file: str | os.PathLike[str], data: bytes) -> None:
    """Make `data` what somebody finds in the file that he named; raises OSError.  Blocks.

    A file is replaced, of a link the one that it leads to, and stays whose it is and as open as
    it is (not in a folder that is everybody's).  A device or a pipe is never replaced: it is
    written to.
    """
    try:
        # By the kernel: it follows no stranger's link in a folder that is everybody's.
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
            with open(path, "ab") as out:  # where it stands, if it leads to a file
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
    """Make `data` what a file holds, or leave it as it is; raises OSError.  Blocks.

    After a power cut it may still hold what it held, until sync_folder(); without
    `sync` it may hold nothing.  `like`: whose mode it gets, and its owner where that is allowed;
    else it gets `mode`, but for what the umask takes away.
    """
    folder, name = os.path.split(file)
    new = os.path.join(folder, f".{name}.new")
    try:
        # What is there, of a power cut or of somebody, is not opened: it may be a named pipe.
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
    """Bring what was renamed and removed in a folder to disk; raises OSError.  Blocks."""
    # Without this a rename may be undone by a power cut (fsync(2), NOTES).
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
