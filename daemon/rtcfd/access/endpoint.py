"""The control socket: binds it or takes it over from systemd, and removes its file."""

import os
import socket
from pathlib import Path

from rtcf.v1 import errors_pb2

from rtcfd.common.errors import FailedPrecondition
from rtcfd.executor.command import MAX_SOCKET_PATH

# The complement of 0660: owner and group may connect.
_UMASK = 0o117
_PRIVATE_UMASK = 0o177  # 0600
_BACKLOG = 4096
_FIRST_PASSED = 3  # sd_listen_fds(3)


class Endpoint:
    """A listening unix socket, owned by this process from listen() to remove()."""

    def __init__(self, path: Path, private: bool = False) -> None:
        """`private`: only this process's user may connect."""
        self.path = path
        self._umask = _PRIVATE_UMASK if private else _UMASK
        self._identity: tuple[int, int] | None = None  # device, inode; None: nothing to remove

    def listen(self) -> socket.socket:
        """Return the socket passed by systemd, or a new one.

        Replaces a stale socket file.  Raises FailedPrecondition if a daemon answers at the
        path, or if the socket cannot be created there.
        """
        passed = _passed()
        if passed is not None:
            self.path = Path(passed.getsockname())
            return passed
        if len(os.fsencode(self.path)) > MAX_SOCKET_PATH:
            raise FailedPrecondition(
                f"{self.path} is longer than the {MAX_SOCKET_PATH} characters of a unix socket's "
                "path: choose a shorter one",
                errors_pb2.REASON_DAEMON_FAILED,
            )
        self._make_way()
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        # The socket's mode follows the umask at this call.
        umask = os.umask(self._umask)
        try:
            self.path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
            listener.bind(str(self.path))
        except OSError as error:
            listener.close()
            raise FailedPrecondition(
                f"cannot listen on {self.path}: {error.strerror}; check that rtcfd may write to "
                "its folder",
                errors_pb2.REASON_DAEMON_FAILED,
            ) from None
        finally:
            os.umask(umask)
        listener.listen(_BACKLOG)
        found = self.path.lstat()
        self._identity = (found.st_dev, found.st_ino)
        return listener

    def remove(self) -> None:
        """Remove the file, if it is still the one that listen() made."""
        try:
            found = self.path.lstat()
        except OSError:
            return
        if (found.st_dev, found.st_ino) == self._identity:
            self.path.unlink(missing_ok=True)

    def _make_way(self) -> None:
        if not os.path.lexists(self.path):
            return
        if self.path.is_symlink() or not self.path.is_socket():
            raise FailedPrecondition(
                f"{self.path} is in the way and is no socket: remove it",
                errors_pb2.REASON_DAEMON_FAILED,
            )
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            try:
                probe.connect(str(self.path))
            except ConnectionRefusedError:
                self.path.unlink()
                return
            except OSError as error:
                raise FailedPrecondition(
                    f"{self.path} is in the way: {error.strerror}", errors_pb2.REASON_DAEMON_FAILED
                ) from None
        raise FailedPrecondition(
            f"a daemon answers at {self.path} already: stop it, or choose another --socket",
            errors_pb2.REASON_DAEMON_FAILED,
        )


def _passed() -> socket.socket | None:
    """Return the listening socket of rtcfd.socket; None: systemd passed none."""
    if os.environ.get("LISTEN_PID") != str(os.getpid()):
        return None
    count = os.environ.get("LISTEN_FDS", "")
    if count != "1":
        raise FailedPrecondition(
            f"systemd passed {count or 'no'} sockets: rtcfd expects one",
            errors_pb2.REASON_DAEMON_FAILED,
        )
    listener = socket.socket(fileno=_FIRST_PASSED)
    listening = listener.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
    if listener.family != socket.AF_UNIX or listener.type != socket.SOCK_STREAM or not listening:
        raise FailedPrecondition(
            "the socket that systemd passed is not a listening unix stream socket: "
            "see ListenStream= in rtcfd.socket",
            errors_pb2.REASON_DAEMON_FAILED,
        )
    listener.set_inheritable(False)
    return listener
