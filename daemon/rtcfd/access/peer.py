"""Who is at the other end of a connection, by the kernel's word."""

import errno
import grp
import os
import pwd
import socket
import struct
from collections.abc import Iterable
from dataclasses import dataclass

_CREDENTIALS = struct.Struct("3i")  # struct ucred, unix(7)
_SO_PEERGROUPS = 59  # asm-generic/socket.h; unknown to Python's socket
_LARGEST_OPTION = 1024  # bytes, of Python's getsockopt


@dataclass(frozen=True)
class Peer:
    """A process that connected, with the rights it had then."""

    pid: int
    uid: int
    groups: frozenset[int]

    @property
    def user(self) -> str:
        """Return the user's name, or #uid where there is none."""
        try:
            return pwd.getpwuid(self.uid).pw_name
        except KeyError:
            return f"#{self.uid}"

    def group_names(self) -> set[str]:
        """Return the names of its groups."""
        names = set()
        for gid in self.groups:
            try:
                names.add(grp.getgrgid(gid).gr_name)
            except KeyError:
                names.add(f"#{gid}")
        return names

    def __str__(self) -> str:
        return f"{self.user} (uid {self.uid}, pid {self.pid})"


def of(connection: socket.socket) -> Peer:
    """Return the peer of a connected unix socket; raises OSError."""
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    pid, uid, gid = _CREDENTIALS.unpack(credentials)
    return Peer(pid, uid, frozenset({gid, *_groups(connection, uid, gid)}))


def _groups(connection: socket.socket, uid: int, gid: int) -> Iterable[int]:
    try:
        listed = connection.getsockopt(socket.SOL_SOCKET, _SO_PEERGROUPS, _LARGEST_OPTION)
        return struct.unpack(f"{len(listed) // 4}I", listed)
    except OSError as error:
        if error.errno != errno.ERANGE:
            raise
    # Of more than 256 groups, those in the user database.
    try:
        return os.getgrouplist(pwd.getpwuid(uid).pw_name, gid)
    except KeyError:
        return ()
