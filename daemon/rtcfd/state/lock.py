"""Locks a state folder for one rtcfd: two would overwrite each other's states."""

import fcntl
import logging
import os
from pathlib import Path

from rtcf.v1 import errors_pb2

from rtcfd.common.refusals import FailedPrecondition

log = logging.getLogger(__name__)


def lock(folder: Path) -> None:
    """Lock a folder until this process ends; raises FailedPrecondition if another rtcfd has it.

    Locks the folder itself, which works on a full or read-only disk.  If the file system has no
    locks, only logs a warning.  Blocks.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:
        return  # the reader of the folder reports it
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = _holder(descriptor)
        os.close(descriptor)
        raise FailedPrecondition(
            f"state folder {folder} is in use by another rtcfd{holder and f' (pid {holder})'}: "
            "end that, or choose another --state-dir",
            errors_pb2.REASON_DAEMON_FAILED,
        ) from None
    except OSError as error:
        os.close(descriptor)
        log.warning(
            "state folder %s cannot be locked (%s): start no other rtcfd with it",
            folder,
            error.strerror,
        )


def _holder(descriptor: int) -> str:
    """Return the pid of the process that has locked an open file, if known (proc_locks(5))."""
    inode = f":{os.fstat(descriptor).st_ino}"
    try:
        lines = Path("/proc/locks").read_text().splitlines()
    except OSError:
        return ""
    for line in lines:
        fields = line.split()
        if "FLOCK" in fields and fields[-3].endswith(inode) and fields[-4].isdigit():
            return fields[-4]
    return ""
