"""Files that are replaced at once, and outlive a power cut."""

import os


def replace(file: str | os.PathLike[str], data: bytes) -> None:
    """Make `data` what a file holds, or leave it as it is; raises OSError.  Blocks.

    After a power cut it may still hold what it held, until sync_folder().
    """
    folder, name = os.path.split(file)
    new = os.path.join(folder, f".{name}.new")
    try:
        with open(new, "wb") as out:
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
        os.replace(new, file)
    except OSError:
        if os.path.lexists(new):
            os.unlink(new)
        raise


def sync_folder(folder: str | os.PathLike[str]) -> None:
    """Bring what was renamed and removed in a folder to disk; raises OSError.  Blocks."""
    # Without this a rename may be undone by a power cut (fsync(2), NOTES).
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
