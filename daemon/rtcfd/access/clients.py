"""Accepts clients on the control socket, identifies them, and relays them to the gRPC servers.

grpcio neither shows a peer's credentials nor adopts a listening socket.  So the
gRPC servers listen on private sockets.  Each client is relayed there from a socket
with a unique name, which grpcio does show.  Owned by the daemon.

Limits apply to each user: connections, bytes per second, the time until the first
call and between calls.  Some connections are reserved for clients that may stop loops.
"""

import asyncio
import contextlib
import logging
import math
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
from rtcfd.access.frame_pace import MOST_CALLS, UNITS_PER_S, FramePace
from rtcfd.access.peer import Credentials, Directory, Peer, credentials, user_of
from rtcfd.common.budget import Budget
from rtcfd.common.errors import RequestError, ResourceExhausted
from rtcfd.common.limits import Limits
from rtcfd.common.pace import Pace

log = logging.getLogger(__name__)

_CHUNK = 65536
# Connections accepted in one turn of the event loop: the whole listen backlog, because a gRPC
# client that finds the backlog full does not wait.
_AT_ONCE = 4096
# New connections per user and second; further ones are closed at once.
_ARRIVALS_PER_S = 20.0
_MOST_USERS = 4096
# Connections above the limit that receive an error message; beyond, the oldest of them is closed.
_MOST_REJECTED = 64
_MOST_REJECTED_OF_A_USER = 8
_FIRST_CALL_S = 20.0  # longest time from the connection to the first call
_IDLE_S = 900.0  # longest time between calls; gRPC clients reconnect by themselves
_LOOK_S = 5.0  # interval of the search for overdue clients, and of warnings
_LINGER_S = 5.0  # grace period for dropped clients
_OUT_OF_DESCRIPTORS_S = 0.1  # pause before the next attempt to accept
_SHOWN_PREFIX = "unix-abstract:"  # how grpcio marks an abstract socket name
# Users with this right or more are not limited, and some connections are reserved for them.
TRUSTED = Level.OPERATE
_CALLS_AT_A_TIME = 64
_WATCHES_AT_A_TIME = 8
_CALLS_PER_S = 100.0
_BYTES_PER_S = 1024 * 1024.0
# A client whose frames were delayed for so long, and that still sends more than the relay reads at
# a time, does not wait for answers.
_FLOOD_S = 5.0


@dataclass(frozen=True)
class GrpcSockets:
    """The private sockets of the gRPC servers."""

    trusted: Path
    others: Path  # accepts only small messages and few streams


class Usage:
    """The use that one user makes of rtcfd: connections, running calls, calls per second.

    Users that may stop loops are not limited: a flood of calls by another user must never delay a
    stop.
    """

    def __init__(self) -> None:
        self.connections = 0
        self._calls = 0
        self._watches = 0
        self._pace = Pace(_CALLS_PER_S)
        self.bytes = Pace(_BYTES_PER_S)
        self.frames = Pace(UNITS_PER_S)

    @property
    def idle(self) -> bool:
        """Whether the user has neither connections nor running calls."""
        return not (self.connections or self._calls)

    @contextmanager
    def calling(self, method: str, peer: Peer, level: Level) -> Iterator[None]:
        """Count a running call; raises ResourceExhausted above the limits of
        untrusted users."""
        watches = method.startswith("Watch")
        if level < TRUSTED:
            for number, most, kind in (
                (self._calls, _CALLS_AT_A_TIME, "running calls"),
                (self._watches if watches else 0, _WATCHES_AT_A_TIME, "open streams"),
            ):
                if number >= most:
                    raise ResourceExhausted(
                        f"user {peer.user} has {number} {kind}, the limit of a user that may only "
                        f"{level.word}: end some",
                        errors_pb2.REASON_TOO_MANY_CALLS,
                        user=peer.user,
                    )
        self._calls += 1
        self._watches += watches
        try:
            yield
        finally:
            self._calls -= 1
            self._watches -= watches

    async def turn(self, level: Level) -> None:
        """Wait until the rate limit allows the next call."""
        if level < TRUSTED and (wait_s := self._pace.take()):
            await asyncio.sleep(wait_s)


@dataclass(eq=False)
class Client:
    """One connection."""

    found: Credentials
    connection: socket.socket
    since: float
    usage: Usage
    peer: Peer | None = None  # None: its names are not known yet
    level: Level = Level.NONE
    rejected: bool = False  # above the limit: its calls fail until there is room
    relay: "asyncio.Task[None] | None" = None
    calls: int = 0  # running
    last_call: float = 0.0  # 0 = none yet
    name: str = field(default_factory=lambda: f"rtcfd-client-{secrets.token_hex(16)}")

    @property
    def trusted(self) -> bool:
        """Whether this client may use the reserved connections."""
        return self.level >= TRUSTED

    def overdue(self, now: float) -> str:
        """Return the reason to disconnect this client; empty = there is none."""
        if self.calls:
            return ""
        if not self.last_call:
            return "it made no call" if now - self.since > _FIRST_CALL_S else ""
        return "it was idle" if now - self.last_call > _IDLE_S else ""


class Clients:
    """The connected clients.  `limits` may be changed at any time.

    `level_of` returns the right of a peer under the current rules.
    """

    def __init__(
        self, servers: GrpcSockets, limits: Limits, level_of: Callable[[Peer], Level]
    ) -> None:
        self.limits = limits
        self._servers = servers
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
        """Begin to accept clients from a listening socket."""
        listener.setblocking(False)
        self._listener = listener
        asyncio.get_running_loop().add_reader(listener, self._accept)

    def stop_accepting(self) -> None:
        """Stop accepting clients.  At systemd's socket, new clients wait for the next rtcfd."""
        if self._listener is not None:
            asyncio.get_running_loop().remove_reader(self._listener)
            self._listener.close()
            self._listener = None

    async def read(self, timeout_s: float) -> None:
        """Wait until all clients have read the last responses of the ended gRPC servers."""
        if self._relays:
            await asyncio.wait(self._relays, timeout=timeout_s)

    def close(self) -> None:
        """Stop accepting clients, and disconnect the present ones."""
        self.stop_accepting()
        for relay in self._relays:
            relay.cancel()

    @contextmanager
    def calling(self, shown: str, method: str) -> Iterator[Client]:
        """Count a call while it lasts; yield its client, found by the name that grpcio shows.

        Raises ResourceExhausted if the client or the call is above a limit.
        """
        client = self._clients.get(shown.removeprefix(_SHOWN_PREFIX))
        if client is None or client.peer is None:
            raise RequestError(
                "this call did not arrive by the control socket", errors_pb2.REASON_INTERNAL
            )
        client.level = self._level_of(client.peer)
        client.last_call = time.monotonic()
        if client.rejected and not self._full(client):
            client.rejected = False
        if client.rejected:
            raise ResourceExhausted(
                f"rtcfd serves {self.limits.clients} clients already: end some, or raise clients "
                "under [limits] in its settings"
                if client.trusted
                else f"rtcfd has no free place for a client of user {client.peer.user}: end some, "
                "or raise clients or clients_per_user under [limits] in its settings",
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
        """Accept all waiting connections.  Those above the limits cost next to nothing."""
        for _ in range(_AT_ONCE):
            if self._listener is None:
                return
            try:
                connection, _ = self._listener.accept()
            except (BlockingIOError, ConnectionError):
                return
            except OSError as error:
                # Out of file descriptors: retrying at once would occupy the event loop.
                self._warn("cannot accept clients for now: %s", error.strerror)
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
        # Not at the end of a connection: a user that reconnects would have unused rates again.
        if len(self._usage) >= _MOST_USERS:
            self._usage = defaultdict(
                Usage, {uid: usage for uid, usage in self._usage.items() if not usage.idle}
            )
        client = Client(found, connection, time.monotonic(), self._usage[found.uid])
        known = self._directory.known(found)
        if known is not None:
            client.peer, client.level = known, self._level_of(known)
        if self._full(client):
            client.rejected = True
            self._make_room_for_rejected(found.uid)
            self._warn("too many clients: rejecting some of uid %d", found.uid)
        self._clients[client.name] = client
        client.usage.connections += 1
        relay = client.relay = asyncio.get_running_loop().create_task(self._serve(client))
        self._relays.add(relay)
        # Not at the end of _serve(), which a cancelled task may not even begin.
        relay.add_done_callback(lambda _: self._gone(client, relay))

    def _gone(self, client: Client, relay: "asyncio.Task[None]") -> None:
        self._relays.discard(relay)
        client.connection.close()
        self._clients.pop(client.name, None)
        client.usage.connections -= 1

    def _make_room_for_rejected(self, uid: int) -> None:
        """Disconnect the oldest of too many rejected clients, so that the newest gets its error."""
        rejected = [each for each in self._clients.values() if each.rejected]
        of_user = [each for each in rejected if each.found.uid == uid]
        if len(of_user) >= _MOST_REJECTED_OF_A_USER:
            oldest = of_user[0]
        elif len(rejected) >= _MOST_REJECTED:
            oldest = rejected[0]
        else:
            return
        del self._clients[oldest.name]
        if oldest.relay is not None:
            oldest.relay.cancel()

    def _arrivals_of(self, uid: int) -> Budget:
        found = self._arrivals.get(uid)
        if found is None:
            if len(self._arrivals) >= _MOST_USERS:
                self._arrivals.clear()
            found = self._arrivals[uid] = Budget(_ARRIVALS_PER_S)
        return found

    def _full(self, client: Client) -> bool:
        """Return whether the limits leave no room for this client."""
        served = [
            each for each in self._clients.values() if not each.rejected and each is not client
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
                if client.rejected and client.trusted:
                    client.rejected = self._full(client)
            await self._relay(client)
        except OSError as error:
            self._warn("a client's connection failed: %s", error.strerror or error)

    async def _relay(self, client: Client) -> None:
        server = self._servers.trusted if client.trusted else self._servers.others
        # Sockets, not asyncio streams: closing one takes effect at once, even if the other side
        # has unread data.
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as inner:
            inner.setblocking(False)
            inner.bind("\0" + client.name)
            await asyncio.get_running_loop().sock_connect(inner, str(server))
            # When one side closes, close the other too: gRPC never closes a single direction.
            most_calls = math.inf if client.trusted else MOST_CALLS
            frames = FramePace(client.usage.frames, most_calls)
            there = asyncio.create_task(self._pump_paced(client, inner, frames))
            back = asyncio.create_task(_pump(inner, client.connection, frames.answer))
            ways = {there, back}
            try:
                while not (
                    await asyncio.wait(ways, timeout=_LOOK_S, return_when=asyncio.FIRST_COMPLETED)
                )[0]:
                    if reason := client.overdue(time.monotonic()):
                        log.debug("disconnecting a client of %s: %s", client.peer, reason)
                        break
                if there.done() and not there.result():
                    # gRPC has closed the connection of a client that still sends: relay gRPC's
                    # last responses first.
                    await asyncio.wait({back}, timeout=_LINGER_S)
            finally:
                hung_up = back.done()
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
            if hung_up:
                await _linger(client.connection)

    async def _pump_paced(self, client: Client, sink: socket.socket, frames: FramePace) -> bool:
        """Copy from a client to `sink`, like _pump(), at the rates of its user.

        Also ends when the client floods: it sends more than we read at a time, while its frames
        have to wait.
        """
        loop = asyncio.get_running_loop()
        prompt = time.monotonic()  # the last time at which no frame had to wait
        with contextlib.suppress(OSError):
            while data := await loop.sock_recv(client.connection, _CHUNK):
                if not client.trusted and (wait_s := client.usage.bytes.take(len(data))):
                    await asyncio.sleep(wait_s)
                delayed = False
                for part, wait_s in frames.cut(data, paced=not client.trusted):
                    try:
                        await loop.sock_sendall(sink, part)
                    except OSError:
                        return False
                    if not wait_s:
                        continue
                    delayed = True
                    if len(data) == _CHUNK and time.monotonic() - prompt > _FLOOD_S:
                        self._warn("disconnecting a client of %s: it floods", client.peer)
                        return True
                    await asyncio.sleep(wait_s)
                if frames.evades:
                    self._warn(
                        "disconnecting a client of %s: it ignores the limit of calls", client.peer
                    )
                    return True
                if not delayed:
                    prompt = time.monotonic()
        return True

    def _warn(self, text: str, *arguments: object) -> None:
        """Log a warning, at most one per _LOOK_S: its cause may occur 1000 times a second."""
        now = time.monotonic()
        if now - self._warned > _LOOK_S:
            self._warned = now
            log.warning(text, *arguments)


async def _linger(connection: socket.socket) -> None:
    """Wait for the client to close, so that it can read the last response.

    Closing at once could make the client's next write fail, and a gRPC client discards
    all unread data then.
    """
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError, TimeoutError):
        connection.shutdown(socket.SHUT_WR)
        async with asyncio.timeout(_LINGER_S):
            while await loop.sock_recv(connection, _CHUNK):
                # A client that sends without pause must not starve the others.
                await asyncio.sleep(0)


async def _pump(source: socket.socket, sink: socket.socket, note: Callable[[bytes], None]) -> bool:
    """Copy from `source` to `sink` until the source closes; return False if the sink failed.

    Call `note` with the bytes before they are sent.
    """
    loop = asyncio.get_running_loop()
    with contextlib.suppress(OSError):
        while data := await loop.sock_recv(source, _CHUNK):
            note(data)
            try:
                await loop.sock_sendall(sink, data)
            except OSError:
                return False
    return True
