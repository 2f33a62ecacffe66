"""What clients connect to: takes them, learns who they are, and relays to the gRPC server.

grpcio neither shows a peer's credentials nor adopts a listening socket. So it
serves private sockets, and each client is relayed there from a socket with a
name of its own, which grpcio does show.  Owned by the daemon.

Everything here is bounded by user: connections, bytes a second, the time until
a first call and between calls; and some connections are kept for those who may
stop loops.
"""

import asyncio
import contextlib
import logging
import secrets
import socket
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rtcf.v1 import errors_pb2

from rtcfd.access.calls import Level
from rtcfd.access.peer import Credentials, Directory, Peer, credentials, user_of
from rtcfd.access.usage import TRUSTED, Usage
from rtcfd.common.budget import Budget
from rtcfd.common.limits import Limits
from rtcfd.common.refusals import Refusal, ResourceExhausted

log = logging.getLogger(__name__)

_CHUNK = 65536
# Accepted before the event loop looks after something else: as many as may wait, as one for whom
# there is no place in that queue is not waited for by gRPC.
_AT_ONCE = 4096
# New connections of a user; above that they are hung up on before anything else is asked.
_ARRIVALS_PER_S = 20.0
_MOST_USERS = 4096
# Connections above the limit that get a word of refusal; more are hung up on.
_MOST_REFUSED = 64
_MOST_REFUSED_OF_A_USER = 8
_FIRST_CALL_S = 20.0  # from the connection on
_IDLE_S = 900.0  # without a call; gRPC's clients connect again by themselves
_LOOK_S = 5.0
_LINGER_S = 5.0  # for who was hung up on to hang up too
_OUT_OF_DESCRIPTORS_S = 0.1
_SHOWN_PREFIX = "unix-abstract:"  # of an abstract name, as grpcio shows it


@dataclass(frozen=True)
class Doors:
    """The private sockets of the gRPC servers."""

    trusted: Path
    others: Path  # takes small messages and few streams only


@dataclass(eq=False)
class Client:
    """One connection."""

    found: Credentials
    connection: socket.socket
    since: float
    usage: Usage
    peer: Peer | None = None  # None: its names are not known yet
    level: Level = Level.NONE
    refused: bool = False  # one too many: it is told so until there is room
    calls: int = 0  # under way
    last_call: float = 0.0  # 0 = none yet
    name: str = field(default_factory=lambda: f"rtcfd-client-{secrets.token_hex(16)}")

    @property
    def trusted(self) -> bool:
        """Tell whether the reserve is for this one."""
        return self.level >= TRUSTED

    def overdue(self, now: float) -> str:
        """Return why it is to be ended; empty = it is not."""
        if self.calls:
            return ""
        if not self.last_call:
            return "it made no call" if now - self.since > _FIRST_CALL_S else ""
        return "it was idle" if now - self.last_call > _IDLE_S else ""


class Clients:
    """Those who are connected.  `limits` may be changed while it serves.

    `level_of` says what a peer may do by the rules of now.
    """

    def __init__(self, doors: Doors, limits: Limits, level_of: Callable[[Peer], Level]) -> None:
        self.limits = limits
        self._doors = doors
        self._level_of = level_of
        self._directory = Directory()
        self._clients: dict[str, Client] = {}
        self._usage: defaultdict[int, Usage] = defaultdict(Usage)
        self._arrivals: dict[int, Budget] = {}
        self._listener: socket.socket | None = None
        self._relays: set[asyncio.Task[None]] = set()
        self._warned = 0.0

    async def name_of(self, uid: int) -> str:
        """Return a user's name for people."""
        return await self._directory.name_of(uid)

    async def serve(self, listener: socket.socket) -> None:
        """Begin to take clients from a listening socket."""
        listener.setblocking(False)
        self._listener = listener
        asyncio.get_running_loop().add_reader(listener, self._accept)

    def close_door(self) -> None:
        """Take no more clients: with systemd's socket they wait for the next rtcfd."""
        if self._listener is not None:
            asyncio.get_running_loop().remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    async def read(self, timeout_s: float) -> None:
        """Wait until all clients have read what they were answered, of servers that have ended."""
        if self._relays:
            await asyncio.wait(self._relays, timeout=timeout_s)

    def close(self) -> None:
        """Take no more clients, and let go those that are there."""
        self.close_door()
        for relay in self._relays:
            relay.cancel()

    @contextmanager
    def calling(self, shown: str, method: str) -> Iterator[Client]:
        """Count a call as long as it lasts; return who makes it, from what grpcio shows.

        Refuses one client, or one call, too many.
        """
        client = self._clients.get(shown.removeprefix(_SHOWN_PREFIX))
        if client is None or client.peer is None:
            raise Refusal(
                "this call did not come by the control socket", errors_pb2.REASON_INTERNAL
            )
        client.level = self._level_of(client.peer)
        client.last_call = time.monotonic()
        if client.refused and not self._full(client):
            client.refused = False
        if client.refused:
            raise ResourceExhausted(
                f"rtcfd serves {self.limits.clients} clients already: end some, or raise clients "
                "under [limits] in its settings"
                if client.trusted
                else f"rtcfd serves as many clients as user {client.peer.user} may have, or as "
                "there is room for: end some, or raise clients or clients_per_user under [limits] "
                "in its settings",
                errors_pb2.REASON_TOO_MANY_CLIENTS,
                user=client.peer.user,
            )
        with client.usage.calling(method, client.peer, client.level):
            client.calls += 1
            try:
                yield client
            finally:
                client.calls -= 1
                client.last_call = time.monotonic()

    def _accept(self) -> None:
        """Take those that wait; who is one too many costs next to nothing."""
        for _ in range(_AT_ONCE):
            if self._listener is None:
                return
            try:
                connection, _ = self._listener.accept()
            except (BlockingIOError, ConnectionError):
                return
            except OSError as error:
                # Out of descriptors: looking again at once would do nothing else.
                self._warn("no more clients for now: %s", error.strerror)
                self._pause(self._listener)
                return
            connection.setblocking(False)
            try:
                self._take(connection)
            except OSError:
                connection.close()

    def _pause(self, listener: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        loop.remove_reader(listener)

        def go_on() -> None:
            if self._listener is listener:
                loop.add_reader(listener, self._accept)

        loop.call_later(_OUT_OF_DESCRIPTORS_S, go_on)

    def _take(self, connection: socket.socket) -> None:
        uid = user_of(connection)
        if not self._directory.sure(uid) and not self._arrivals_of(uid).take():
            connection.close()
            return
        found = credentials(connection)
        client = Client(found, connection, time.monotonic(), self._usage[found.uid])
        known = self._directory.known(found)
        if known is not None:
            client.peer, client.level = known, self._level_of(known)
        if self._full(client):
            client.refused = True
            refused = [each for each in self._clients.values() if each.refused]
            of_user = sum(each.found.uid == found.uid for each in refused)
            if len(refused) >= _MOST_REFUSED or of_user >= _MOST_REFUSED_OF_A_USER:
                connection.close()
                return
            self._warn("too many clients: some of uid %d are refused", found.uid)
        self._clients[client.name] = client
        client.usage.connections += 1
        task = asyncio.get_running_loop().create_task(self._serve(client))
        self._relays.add(task)
        task.add_done_callback(self._relays.discard)

    def _arrivals_of(self, uid: int) -> Budget:
        found = self._arrivals.get(uid)
        if found is None:
            if len(self._arrivals) >= _MOST_USERS:
                self._arrivals.clear()
            found = self._arrivals[uid] = Budget(_ARRIVALS_PER_S)
        return found

    def _full(self, client: Client) -> bool:
        """Tell whether there is no room for one more such client."""
        served = [
            each for each in self._clients.values() if not each.refused and each is not client
        ]
        if client.trusted:
            return len(served) >= self.limits.clients
        others = sum(not each.trusted for each in served)
        of_user = sum(each.found.uid == client.found.uid for each in served)
        return (
            of_user >= self.limits.clients_per_user
            or others >= self.limits.clients - self.limits.reserve
            or len(served) >= self.limits.clients
        )

    async def _serve(self, client: Client) -> None:
        try:
            if client.peer is None:
                client.peer = await self._directory.peer(client.found)
                client.level = self._level_of(client.peer)
                if client.refused and client.trusted:
                    client.refused = self._full(client)
            await self._relay(client)
        except OSError as error:
            self._warn("a client is lost: %s", error.strerror or error)
        finally:
            client.connection.close()
            del self._clients[client.name]
            client.usage.connections -= 1
            if client.usage.idle:
                self._usage.pop(client.found.uid, None)

    async def _relay(self, client: Client) -> None:
        door = self._doors.trusted if client.trusted else self._doors.others
        # Bare sockets: closing them is the end, whatever has not been read on the other side.
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as inner:
            inner.setblocking(False)
            inner.bind("\0" + client.name)
            await asyncio.get_running_loop().sock_connect(inner, str(door))
            # When one side ends so does the other: gRPC never closes only half.
            there = asyncio.create_task(_pump(client.connection, inner, client))
            back = asyncio.create_task(_pump(inner, client.connection))
            ways = {there, back}
            try:
                while not (
                    await asyncio.wait(ways, timeout=_LOOK_S, return_when=asyncio.FIRST_COMPLETED)
                )[0]:
                    if reason := client.overdue(time.monotonic()):
                        log.debug("a client of %s is hung up on: %s", client.peer, reason)
                        break
                if there.done() and not there.result():
                    # gRPC has hung up on who still talks: what it had answered comes first.
                    await asyncio.wait({back}, timeout=_LINGER_S)
            finally:
                hung_up = back.done()
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
            if hung_up:
                await _linger(client.connection)

    def _warn(self, text: str, *arguments: object) -> None:
        """Say what may happen a thousand times a second, once in a while."""
        now = time.monotonic()
        if now - self._warned > _LOOK_S:
            self._warned = now
            log.warning(text, *arguments)


async def _linger(connection: socket.socket) -> None:
    """Let a client read to the end: with its first word that fails, gRPC throws away what it has
    not read yet."""
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError, TimeoutError):
        connection.shutdown(socket.SHUT_WR)
        async with asyncio.timeout(_LINGER_S):
            while await loop.sock_recv(connection, _CHUNK):
                # Who talks on and on gets no turn of all others.
                await asyncio.sleep(0)


async def _pump(source: socket.socket, sink: socket.socket, client: Client | None = None) -> bool:
    """Hand on what comes; of a `client` that may only look, so much a second.  Tell whether it
    was all taken."""
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError):
        while data := await loop.sock_recv(source, _CHUNK):
            if client is not None and not client.trusted:
                wait_s = client.usage.bytes.take(len(data))
                if wait_s:
                    await asyncio.sleep(wait_s)
            try:
                await loop.sock_sendall(sink, data)
            except OSError:
                return False
    return True
