"""The control socket's file: taking it, and giving it back."""

import os
import socket
from pathlib import Path

import grpc

from rtcfd.command import MAX_SOCKET_PATH
from rtcfd.errors import FailedPrecondition

# The complement of 0660: owner and group may connect.
_UMASK = 0o117


class Endpoint:
    """A unix socket at a path, ours from listen() to remove()."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._inode = 0

    def listen(self, server: grpc.aio.Server) -> None:
        """Let a server listen here; a stale socket is removed, a live one is refused."""
        if len(os.fsencode(self._path)) > MAX_SOCKET_PATH:
            raise FailedPrecondition(
                f"{self._path} is longer than the {MAX_SOCKET_PATH} characters of a unix socket's "
                "path: choose a shorter one"
            )
        self._make_way()
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # The socket's mode follows the umask at this call.
        umask = os.umask(_UMASK)
        try:
            if not server.add_insecure_port(f"unix:{self._path}"):
                raise RuntimeError("no port")
        except RuntimeError:
            raise FailedPrecondition(
                f"cannot listen on {self._path}: is its folder ours to write?"
            ) from None
        finally:
            os.umask(umask)
        self._inode = self._path.stat().st_ino

    def remove(self) -> None:
        """Remove the socket, if it is still ours."""
        try:
            if self._path.stat().st_ino == self._inode:
                self._path.unlink()
        except FileNotFoundError:
            pass

    def _make_way(self) -> None:
        if not self._path.exists():
            return
        if not self._path.is_socket():
            raise FailedPrecondition(f"{self._path} is in the way and is no socket: remove it")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            try:
                probe.connect(str(self._path))
            except ConnectionRefusedError:
                self._path.unlink()
                return
            except OSError as error:
                raise FailedPrecondition(f"{self._path} is in the way: {error.strerror}") from None
        raise FailedPrecondition(
            f"a daemon answers at {self._path} already: stop it, or choose another --socket"
        )
