"""The lock on the folder of the executors' sockets: one rtcfd at a time uses it.

A second rtcfd would adopt the executors of the first one, change their settings and end them.
Owned by the daemon.
"""

import asyncio
import contextlib
import logging
import os
import socket
from pathlib import Path

from rtcf.v1 import errors_pb2

from rtcfd.common import locks
from rtcfd.common.errors import FailedPrecondition
from rtcfd.executor.command import ExecutorCommand

log = logging.getLogger(__name__)

_END_S = 30.0  # for another rtcfd to end
_LOOK_S = 0.05
_ATTEMPTS = 100  # another rtcfd removes the folder once, at its end
_FLAGS = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC


class RuntimeLock:
    """Locks the folders of an ExecutorCommand, from take() to the end of the process.

    Locks a file that only our user can open: systemd sometimes lets the group of rtcfd into the
    folder, and its users must not be able to keep rtcfd from starting.
    """

    def __init__(self, command: ExecutorCommand, control: Path) -> None:
        """`control` is a socket in the folder that the running rtcfd serves until it ends."""
        self._command = command
        self._control = control
        self.held = False

    async def take(self, end: asyncio.Event) -> None:
        """Lock the folder, which is made if needed.

        Waits for another rtcfd that ends.  Raises FailedPrecondition if it does not end, or if
        `end` is set in the meantime.
        """
        loop = asyncio.get_running_loop()
        deadline = loop.time() + _END_S
        waiting = False
        while (user := self._try()) is not None:
            folder = self._command.folder.parent
            if self._is_served() or end.is_set() or loop.time() > deadline:
                raise FailedPrecondition(
                    f"runtime folder {folder} is in use by another rtcfd{user}: end that, or "
                    "choose another --runtime-dir",
                    errors_pb2.REASON_DAEMON_FAILED,
                )
            if not waiting:
                log.info("waiting for the end of the rtcfd%s that uses %s", user, folder)
                waiting = True
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(end.wait(), _LOOK_S)

    def _try(self) -> str | None:
        """Return None if the folder is locked now, else its user as in locks.holder()."""
        file = self._command.lock_file
        for attempt in range(_ATTEMPTS):
            descriptor = self._open(last=attempt + 1 == _ATTEMPTS)
            if descriptor is None:
                continue  # the other rtcfd has just removed the folder
            try:
                if not locks.try_lock(descriptor):
                    user = locks.holder(descriptor)
                    os.close(descriptor)
                    return user
            except OSError as error:
                log.warning(
                    "runtime folder %s cannot be locked (%s): start no other rtcfd with it",
                    self._command.folder.parent,
                    error.strerror,
                )
            if _is_at(descriptor, file):
                self.held = True  # and the descriptor stays open
                return None
            os.close(descriptor)  # the other rtcfd removed this file at its end
        raise FailedPrecondition(
            f"cannot lock {file}: the file vanishes; choose another --runtime-dir",
            errors_pb2.REASON_DAEMON_FAILED,
        )

    def _open(self, *, last: bool) -> int | None:
        """Return the opened file, which is made if needed; None if its folder has vanished."""
        folder, file = self._command.folder, self._command.lock_file
        try:
            self._command.make_folder()
        except OSError as error:
            if isinstance(error, FileNotFoundError) and not last:
                return None
            raise FailedPrecondition(
                f"cannot make folder {folder}: {error.strerror}; choose another --runtime-dir",
                errors_pb2.REASON_DAEMON_FAILED,
            ) from None
        try:
            return os.open(file, _FLAGS, 0o600)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise FailedPrecondition(
                f"cannot lock {file}: {error.strerror}; remove that file, or choose another "
                "--runtime-dir",
                errors_pb2.REASON_DAEMON_FAILED,
            ) from None

    def _is_served(self) -> bool:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            probe.setblocking(False)
            try:
                probe.connect(str(self._control))
            except BlockingIOError:
                pass  # its queue is full
            except OSError:
                return False
        return True


def _is_at(descriptor: int, file: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), file.lstat())
    except OSError:
        return False
