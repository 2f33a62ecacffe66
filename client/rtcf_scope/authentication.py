"""Authentication of requests by token or session, host name and origin.

The page itself is public; its requests are not.  The page exchanges the token for a session, keeps
the session in storage that only pages of the same host and port can read, and sends it in a
header.  The session is not a cookie, because browsers send cookies of one port to all servers of a
machine.  Sessions exist only in the memory of this process.  Another server that later uses the
same port therefore receives no valid session.

Requests of a page of another site are rejected by their Origin.  Requests by an unknown host name
that resolves to this machine (DNS rebinding) are rejected by their Host.
"""

import asyncio
import hashlib
import hmac
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web
from rtcf_shared.printable import printable

from rtcf_scope.connection import HEADERS, Connection
from rtcf_scope.options import LOOPBACK
from rtcf_scope.peer import user_of

_MOST_SESSIONS = 256  # the least recently used ones are removed
_SESSION_PROTOCOL = "session."  # subprotocol prefix; pages cannot set WebSocket headers
_LOGIN_S = 5.0  # deadline of the first authenticated request
# Connections of one user without such a request; the oldest is closed for another one.  Otherwise,
# any user of this machine could take all connections.
_MOST_UNAUTHENTICATED = 16
_LONGEST = 80  # characters of a request that an error quotes
_CROWDED = (
    b"HTTP/1.1 503 Service Unavailable\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
    b"too many connections: close some tabs\n"
)
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Authentication:
    """Authentication of one server; used only in the event loop."""

    def __init__(
        self, token: str, names: Iterable[str], most_connections: int, token_file: Path | None
    ) -> None:
        """Accept the host names `names` in addition to those of loopback.

        Errors name `token_file`, the file of the token, if there is one.
        """
        self._token = token.encode()
        self._where = (
            "the address that rtcfctl scope printed"
            if token_file is None
            else f"http://HOST:PORT/?token=TOKEN with the token in {token_file}"
        )
        self._names = {*LOOPBACK, *(name.lower() for name in names)}
        self._most = most_connections
        self._sessions: OrderedDict[bytes, None] = OrderedDict()  # by hash, last used last
        self._tickets: dict[bytes, Callable[[], None]] = {}  # by hash
        self._authenticated: set[Any] = set()  # authenticated connections
        self._recent: dict[Any, str] = {}  # users of the connections of the last _LOGIN_S, in order

    def ticket(self, used: Callable[[], None]) -> str:
        """Return a token for a single session; call `used` when it is exchanged."""
        ticket = secrets.token_urlsafe(24)
        self._tickets[_hash(ticket)] = used
        return ticket

    async def enter(self, request: web.Request) -> web.Response:
        """Exchange the token or a ticket for a new session; raises HTTPForbidden."""
        given = _bearer(request)
        used = self._tickets.pop(_hash(given), None)
        if used is not None:
            used()
        elif not self._is_token(given):
            raise self._forbidden()
        session = secrets.token_urlsafe(24)
        self._sessions[_hash(session)] = None
        if len(self._sessions) > _MOST_SESSIONS:
            self._sessions.popitem(last=False)
        self._authenticated.add(request.protocol)
        return web.json_response({"session": session})

    def middleware(self) -> Any:
        """Return the aiohttp middleware that checks each request and adds security headers."""

        @web.middleware
        async def check(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._middleware(request, handler)

        return check

    def open(self, server: web.Server) -> Callable[[], asyncio.Protocol]:
        """Return the factory of connections; above the limit, connections answer 503 and close."""
        loop = asyncio.get_running_loop()
        opened = partial(self._opened, server)
        return lambda: Connection(server, loop, opened)

    def _opened(self, server: web.Server, protocol: Connection) -> None:
        """Make room for a new connection, or reject it.

        A user's oldest unauthenticated connection is closed for another one of the user.
        """
        there = {*server.connections}
        self._authenticated &= there
        self._recent = {each: user for each, user in self._recent.items() if each in there}
        user = user_of(protocol.wire.get_extra_info("socket"))
        self._recent[protocol] = user
        asyncio.get_running_loop().call_later(_LOGIN_S, self._expire, protocol)
        unauthenticated = [
            each
            for each, its_user in self._recent.items()
            if its_user == user and each not in self._authenticated
        ]
        if len(unauthenticated) > _MOST_UNAUTHENTICATED:
            self._drop(unauthenticated[0])
        # Not all that are there: the server has those being closed, too.
        if len(self._authenticated | self._recent.keys()) > self._most:
            self._recent.pop(protocol)
            protocol.wire.write(_CROWDED)
            protocol.wire.close()

    def _expire(self, protocol: Connection) -> None:
        """Close a connection that is still unauthenticated."""
        self._recent.pop(protocol, None)
        if protocol not in self._authenticated:
            protocol.wire.close()
            # The client may still be reading the page, or it may read nothing.
            asyncio.get_running_loop().call_later(_LOGIN_S, protocol.wire.abort)

    def _drop(self, protocol: Connection) -> None:
        """Close a connection at once."""
        self._recent.pop(protocol)
        protocol.wire.abort()

    async def _middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            self._check(request)
            answer = await handler(request)
        except web.HTTPException as error:
            error.headers.update(HEADERS)
            raise
        if not answer.prepared:
            answer.headers.update(HEADERS)
        return answer

    def _check(self, request: web.Request) -> None:
        host = request.headers.get("Host", "")
        if not self._is_own_host(host):
            text = f"unknown host name {printable(host[:_LONGEST])}: allow it with --name\n"
            raise web.HTTPForbidden(text=text)
        origin = request.headers.get("Origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            raise web.HTTPForbidden(
                text=f"requests from pages of {printable(origin[:_LONGEST])} are rejected\n"
            )
        if is_public(request.path):
            return
        if not self._is_authenticated(_bearer(request)) and not self._is_authenticated(
            _session_of_protocols(request)
        ):
            raise self._forbidden()
        self._authenticated.add(request.protocol)

    def _is_authenticated(self, given: str) -> bool:
        if self._is_token(given):
            return True
        session = _hash(given)
        if session not in self._sessions:
            return False
        self._sessions.move_to_end(session)
        return True

    def _forbidden(self) -> web.HTTPForbidden:
        return web.HTTPForbidden(text=f"access requires the token: open {self._where}\n")

    def _is_own_host(self, host: str) -> bool:
        try:
            found = urlsplit(f"//{host}")
            return found.hostname in self._names and found.port != 0
        except ValueError:
            return False

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(_bytes(given), self._token)


def is_public(path: str) -> bool:
    """Return whether a path needs no authentication: the page's files and the login."""
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
    # Headers can contain any bytes.
    return given.encode(errors="surrogateescape")
