"""The peer of a connection: its credentials from the kernel, its names from the user database."""

import grp
import os
import pwd
import socket
import struct
import time
from dataclasses import dataclass

from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import RequestError

_CREDENTIALS = struct.Struct("3i")  # struct ucred, unix(7)
_SO_PEERGROUPS = 59  # asm-generic/socket.h; unknown to Python's socket
_LARGEST_OPTION = 1024  # bytes, the limit of Python's getsockopt: 256 groups
_KEPT_S = 60.0  # how long names stay in the cache
_MOST_KEPT = 4096
_TIMEOUT_S = 5.0  # of a look-up in the user database


@dataclass(frozen=True)
class Credentials:
    """A connected process, as the kernel recorded it when it connected."""

    pid: int
    uid: int
    gids: frozenset[int]


@dataclass(frozen=True)
class Peer:
    """A connected process, with the names of its user and groups."""

    pid: int
    uid: int
    user: str  # #uid if it has no name
    groups: frozenset[str]  # names; #gid for a group without one
    known: bool = True  # False: the user database did not answer

    def __str__(self) -> str:
        return f"{self.user} (uid {self.uid}, pid {self.pid})"


def user_of(connection: socket.socket) -> int:
    """Return the uid of the peer of a connected unix socket; raises OSError.  Never blocks."""
    found = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return int(_CREDENTIALS.unpack(found)[1])


def credentials(connection: socket.socket) -> Credentials:
    """Return the peer's credentials of a connected unix socket; raises OSError.  Never blocks."""
    found = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    pid, uid, gid = _CREDENTIALS.unpack(found)
    try:
        listed = connection.getsockopt(socket.SOL_SOCKET, _SO_PEERGROUPS, _LARGEST_OPTION)
    except OSError:
        # With more than 256 groups, only the primary group counts.
        listed = b""
    return Credentials(pid, uid, frozenset({gid, *struct.unpack(f"{len(listed) // 4}I", listed)}))


class Directory:
    """The names of users and groups, looked up in worker threads and cached.

    Owned by Clients.
    """

    def __init__(self) -> None:
        self._threads = WorkerThreads("user database")
        self._kept: dict[tuple[int, frozenset[int]], tuple[float, str, frozenset[str]]] = {}
        # A hanging user database must not lock out root and our own user.
        self._sure = {0: "root", os.geteuid(): user_name(os.geteuid())}

    def sure(self, uid: int) -> bool:
        """Return whether this is root or our own user."""
        return uid in self._sure

    def known(self, found: Credentials) -> Peer | None:
        """Return a peer if its names are cached, else None."""
        if found.uid in self._sure:
            return Peer(found.pid, found.uid, self._sure[found.uid], frozenset())
        until, user, groups = self._kept.get((found.uid, found.gids), (0.0, "", frozenset()))
        return Peer(found.pid, found.uid, user, groups) if until > time.monotonic() else None

    async def peer(self, found: Credentials) -> Peer:
        """Return a peer with its names; not `known` if the user database does not answer."""
        try:
            user, groups = await self._threads.run(lambda: _names(found), _TIMEOUT_S)
        except (RequestError, OSError):
            return Peer(found.pid, found.uid, f"#{found.uid}", frozenset(), known=False)
        if len(self._kept) >= _MOST_KEPT:
            self._kept.clear()
        self._kept[found.uid, found.gids] = (time.monotonic() + _KEPT_S, user, groups)
        return Peer(found.pid, found.uid, user, groups)

    async def name_of(self, uid: int) -> str:
        """Return a user's name, or #uid if the user database does not answer."""
        try:
            if uid in self._sure:
                return self._sure[uid]
            return await self._threads.run(lambda: user_name(uid), _TIMEOUT_S)
        except (RequestError, OSError):
            return f"#{uid}"


def user_name(uid: int) -> str:
    """Return a user's name, or #uid if it has none.  May block."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return f"#{uid}"


def _group_name(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return f"#{gid}"


def _names(found: Credentials) -> tuple[str, frozenset[str]]:
    return user_name(found.uid), frozenset(_group_name(gid) for gid in found.gids)
