"""Files that outlive a power cut."""

import os
from pathlib import Path


def replace(file: Path, data: bytes) -> None:
    """Make `data` what a file holds, or leave it as it is; raises OSError.  Blocks."""
    new = file.with_name(f".{file.name}.new")
    try:
        with new.open("wb") as out:
            out.write(data)
            out.flush()
            os.fsync(out.fileno())
        new.replace(file)
    except OSError:
        new.unlink(missing_ok=True)
        raise
    sync_folder(file.parent)


def sync_folder(folder: Path) -> None:
    """Bring what was renamed and removed in a folder to disk; raises OSError.  Blocks."""
    # Without this a rename may be undone by a power cut (fsync(2), NOTES).
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
