"""Locks between processes, on open files: flock(2).

The kernel releases them at the end of the process, however it ends.
"""

import fcntl
import os
from pathlib import Path


def try_lock(descriptor: int) -> bool:
    """Lock an open file; return False if another process has locked it.

    Raises another OSError if the file system has no locks.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def holder(descriptor: int) -> str:
    """Return " (pid N)" of the process that has locked an open file; empty if it is not known."""
    inode = f":{os.fstat(descriptor).st_ino}"
    try:
        lines = Path("/proc/locks").read_text().splitlines()
    except OSError:
        return ""
    for line in lines:
        fields = line.split()
        if "FLOCK" in fields and fields[-3].endswith(inode) and fields[-4].isdigit():
            return f" (pid {fields[-4]})"
    return ""
