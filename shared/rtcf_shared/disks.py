"""Free space on disks."""

import os
from pathlib import Path

_MIB = 1024 * 1024


def free_mib(folder: Path) -> int:
    """Return the free space for users on the disk of a folder.  Raises OSError."""
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize // _MIB
