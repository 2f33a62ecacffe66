"""Who comes in: whoever shows the token or a session, by a name of this machine, from the page.

The page itself is no secret, what it asks is.  The token is exchanged for a session, which the page
keeps where pages of this host and port alone can read it, and shows in a header.  No cookie has it:
a browser sends cookies of one port to all servers of a machine.  Sessions are known to this process
alone and end with it, so that another server, which has its port later, gets nothing of use.

A page of another site may not ask anything (its Origin is another), nor by a name of its own that
it lets lead here (the Host is another: DNS rebinding).
"""

import asyncio
import hashlib
import hmac
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

from rtcf_scope.connection import HEADERS, Connection
from rtcf_scope.line import line

LOOPBACK = ("127.0.0.1", "localhost", "::1")
_MOST_SESSIONS = 256  # those that were shown least lately go
_SESSION_PROTOCOL = "session."  # of a WebSocket, before its session: it has no other header
_STRANGER_S = 5.0  # for a first request with the token
_LONGEST = 80  # characters that are said again in a refusal
_CROWDED = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
    b"too many connections: close some tabs\n"
)
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Door:
    """The rules of one server; one thread."""

    def __init__(
        self, token: str, names: Iterable[str], most_connections: int, token_file: Path | None
    ) -> None:
        """`names` are those of this machine, by which it may be called beside loopback's."""
        self._token = token.encode()
        self._where = (
            "the one that rtcfctl scope printed"
            if token_file is None
            else f"http://HOST:PORT/?token=TOKEN, with the token that is in {token_file}"
        )
        self._names = {*LOOPBACK, *(name.lower() for name in names)}
        self._most = most_connections
        self._sessions: OrderedDict[bytes, None] = OrderedDict()  # by their hash, newest last
        self._tickets: dict[bytes, Callable[[], None]] = {}
        self._new: set[Any] = set()
        self._known: set[Any] = set()  # connections that have shown the token

    def ticket(self, used: Callable[[], None]) -> str:
        """Return a token that gives one session, once; `used` is called then."""
        ticket = secrets.token_urlsafe(24)
        self._tickets[_hash(ticket)] = used
        return ticket

    async def enter(self, request: web.Request) -> web.Response:
        """Answer with a new session for the token, or a ticket."""
        given = _bearer(request)
        used = self._tickets.pop(_hash(given), None)
        if used is not None:
            used()
        elif not self._is_token(given):
            raise self._stranger()
        session = secrets.token_urlsafe(24)
        self._sessions[_hash(session)] = None
        if len(self._sessions) > _MOST_SESSIONS:
            self._sessions.popitem(last=False)
        self._known.add(request.protocol)
        return web.json_response({"session": session})

    def middleware(self) -> Any:
        """Return what looks at each request before it is answered."""

        @web.middleware
        async def look(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._middleware(request, handler)

        return look

    def open(self, server: web.Server) -> Callable[[], asyncio.Protocol]:
        """Return what makes a connection's protocol: of too many, one that refuses."""
        loop = asyncio.get_running_loop()

        def connection() -> asyncio.Protocol:
            there = {*server.connections}
            self._known &= there
            # The server counts a connection a little later than it makes one.
            if len(there | self._new) >= self._most:
                return _Refusal()
            protocol = Connection(server, loop, self._new.discard)
            self._new.add(protocol)
            loop.call_later(_STRANGER_S, self._drop_stranger, protocol)
            return protocol

        return connection

    def _drop_stranger(self, protocol: web.RequestHandler) -> None:
        if protocol not in self._known:
            protocol.force_close()

    async def _middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            self._check(request)
            answer = await handler(request)
        except web.HTTPException as refusal:
            refusal.headers.update(HEADERS)
            raise
        if not answer.prepared:
            answer.headers.update(HEADERS)
        return answer

    def _check(self, request: web.Request) -> None:
        host = request.headers.get("Host", "")
        if not self._is_ours(host):
            text = f"{line(host[:_LONGEST])} is not a name of this scope: see --name\n"
            raise web.HTTPForbidden(text=text)
        origin = request.headers.get("Origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            raise web.HTTPForbidden(text=f"pages of {line(origin[:_LONGEST])} may not ask here\n")
        if is_public(request.path):
            return
        if not self._knows(_bearer(request)) and not self._knows(_session_of_protocols(request)):
            raise self._stranger()
        self._known.add(request.protocol)

    def _knows(self, given: str) -> bool:
        if self._is_token(given):
            return True
        session = _hash(given)
        if session not in self._sessions:
            return False
        self._sessions.move_to_end(session)
        return True

    def _stranger(self) -> web.HTTPForbidden:
        return web.HTTPForbidden(text=f"the address with its token is {self._where}\n")

    def _is_ours(self, host: str) -> bool:
        try:
            found = urlsplit(f"//{host}")
            return found.hostname in self._names and found.port != 0
        except ValueError:
            return False

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(_bytes(given), self._token)


class _Refusal(asyncio.Protocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.write(_CROWDED)
        transport.close()


def is_public(path: str) -> bool:
    """Tell whether a path is the page's, which holds nothing of the loop, or the way in."""
    return path in ("/", "/api/session") or path.startswith("/page/")


def _bearer(request: web.Request) -> str:
    kind, _, given = request.headers.get("Authorization", "").partition(" ")
    return given.strip() if kind.lower() == "bearer" else ""


def _session_of_protocols(request: web.Request) -> str:
    for each in request.headers.get("Sec-WebSocket-Protocol", "").split(","):
        if each.strip().startswith(_SESSION_PROTOCOL):
            return each.strip().removeprefix(_SESSION_PROTOCOL)
    return ""


def _hash(given: str) -> bytes:
    return hashlib.sha256(_bytes(given)).digest()


def _bytes(given: str) -> bytes:
    # A header has any bytes.
    return given.encode(errors="surrogateescape")
