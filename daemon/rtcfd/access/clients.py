"""What clients connect to: takes them, learns who they are, and relays to the gRPC server.

grpcio neither shows a peer's credentials nor adopts a listening socket. So it
serves a private socket, and each client is relayed there from a socket with a
name of its own, which grpcio does show.  Owned by the daemon.
"""

import asyncio
import contextlib
import logging
import secrets
import socket
import sys
from collections import deque
from pathlib import Path
from typing import Any

from rtcfd.access import peer
from rtcfd.access.peer import Peer
from rtcfd.common.refusals import Refusal, ResourceExhausted

log = logging.getLogger(__name__)

_CHUNK = 65536
_BACKLOG = 256
# Connections above the limit that get a word of refusal; more wait until others leave.
_MOST_WAITING = 64
# Above that they are hung up on, before the descriptors are gone that loops take.
_MOST_QUEUED = 4096
# asyncio of Python 3.13 on removes a socket's file with its server; it is systemd's or Endpoint's.
_KEEP_FILE: dict[str, Any] = {"cleanup_socket": False} if sys.version_info >= (3, 13) else {}
_SHOWN_PREFIX = "unix-abstract:"  # of an abstract name, as grpcio shows it


class Clients:
    """Those who are connected.  `limit` may be changed while it serves."""

    def __init__(self, private: Path, limit: int) -> None:
        self.limit = limit
        self._private = private
        self._peers: dict[str, Peer] = {}  # by the name of the relaying socket
        self._waiting: dict[str, Peer] = {}  # one too many; served when there is room
        self._queue: deque[asyncio.Future[None]] = deque()  # those that wait to be looked at
        self._server: asyncio.Server | None = None
        self._relays: set[asyncio.Task[None]] = set()

    async def serve(self, listener: socket.socket) -> None:
        """Begin to take clients from a listening socket."""
        self._server = await asyncio.start_unix_server(
            self._take, sock=listener, backlog=_BACKLOG, **_KEEP_FILE
        )

    def close_door(self) -> None:
        """Take no more clients: with systemd's socket they wait for the next rtcfd."""
        if self._server is not None:
            self._server.close()

    def close(self) -> None:
        """Take no more clients, and let go those that are there."""
        self.close_door()
        for relay in self._relays:
            relay.cancel()

    def peer(self, shown: str) -> Peer:
        """Return who makes a call, from what grpcio shows; refuse one client too many."""
        name = shown.removeprefix(_SHOWN_PREFIX)
        if name in self._waiting and len(self._peers) < self.limit:
            self._peers[name] = self._waiting.pop(name)
        if name in self._waiting:
            raise ResourceExhausted(
                f"rtcfd serves {self.limit} clients already: end some, or raise clients under "
                "[limits] in its settings"
            )
        try:
            return self._peers[name]
        except KeyError:
            raise Refusal("this call did not come by the control socket") from None

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._relays.add(task)
        name = f"rtcfd-client-{secrets.token_hex(16)}"
        try:
            await self._turn()
            self._admit(name, writer.get_extra_info("socket"))
            await self._relay(name, reader, writer)
        except ConnectionRefusedError:
            pass  # too many: that was said when the first of them came; or we are ending
        except OSError as error:
            log.warning("a client is lost: %s", error.strerror or error)
        finally:
            self._peers.pop(name, None)
            self._waiting.pop(name, None)
            self._relays.discard(task)
            writer.close()
            self._next()

    async def _turn(self) -> None:
        """Wait as long as there are too many even to be refused."""
        while len(self._peers) >= self.limit and len(self._waiting) >= _MOST_WAITING:
            if len(self._queue) >= _MOST_QUEUED:
                raise ConnectionRefusedError
            turn: asyncio.Future[None] = asyncio.get_running_loop().create_future()
            self._queue.append(turn)
            await turn

    def _next(self) -> None:
        """Let the first of those that wait look again: somebody has left."""
        while self._queue:
            turn = self._queue.popleft()
            if not turn.done():
                turn.set_result(None)
                return

    def _admit(self, name: str, connection: socket.socket) -> None:
        who = peer.of(connection)
        if len(self._peers) < self.limit:
            self._peers[name] = who
            return
        if not self._waiting:
            log.warning("%d clients, the limit: %s and others are refused", self.limit, who)
        self._waiting[name] = who

    async def _relay(
        self, name: str, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as inner:
            inner.setblocking(False)
            inner.bind("\0" + name)
            await asyncio.get_running_loop().sock_connect(inner, str(self._private))
            inner_reader, inner_writer = await asyncio.open_unix_connection(sock=inner)
            try:
                # When one side ends so does the other: gRPC never closes only half.
                ways = {
                    asyncio.create_task(_pump(reader, inner_writer)),
                    asyncio.create_task(_pump(inner_reader, writer)),
                }
                try:
                    await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
                finally:
                    for way in ways:
                        way.cancel()
            finally:
                inner_writer.close()


async def _pump(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with contextlib.suppress(ConnectionError):
        while data := await source.read(_CHUNK):
            sink.write(data)
            await sink.drain()
