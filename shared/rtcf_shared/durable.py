"""Files that are replaced at once, and outlive a power cut."""

import contextlib
import os


def replace(file: str | os.PathLike[str], data: bytes, *, sync: bool = True) -> None:
    """Make `data` what a file holds, or leave it as it is; raises OSError.  Blocks.

    After a power cut it may still hold what it held, until sync_folder(); without
    `sync` it may hold nothing.
    """
    folder, name = os.path.split(file)
    new = os.path.join(folder, f".{name}.new")
    try:
        # What is there, of a power cut or of somebody, is not opened: it may be a named pipe.
        with contextlib.suppress(FileNotFoundError):
            os.unlink(new)
        with open(new, "xb") as out:
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
