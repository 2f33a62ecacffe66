"""Who comes in: whoever has the token, by a name of this machine, from the page itself.

A page of another site may not ask anything (its Origin is another), nor by a name of its own that
it lets lead here (the Host is another: DNS rebinding).
"""

import asyncio
import hmac
from collections.abc import Awaitable, Callable, Iterable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from aiohttp import web

LOOPBACK = ("127.0.0.1", "localhost", "::1")
_NEW_S = 1.0
_STRANGER_S = 5.0  # for a first request with the token
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
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
        self._new: set[Any] = set()
        self._known: set[Any] = set()  # connections that have shown the token

    def middleware(self) -> Any:
        """Return what looks at each request before it is answered."""

        @web.middleware
        async def look(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._middleware(request, handler)

        return look

    def open(self, server: web.Server) -> Callable[[], asyncio.Protocol]:
        """Return what makes a connection's protocol: of too many, one that refuses."""

        def connection() -> asyncio.Protocol:
            there = {*server.connections}
            self._known &= there
            # The server counts a connection a little later than it makes one.
            if len(there | self._new) >= self._most:
                return _Refusal()
            protocol = server()
            self._new.add(protocol)
            loop = asyncio.get_running_loop()
            loop.call_later(_NEW_S, self._new.discard, protocol)
            loop.call_later(_STRANGER_S, self._drop_stranger, protocol)
            return protocol

        return connection

    def _drop_stranger(self, protocol: web.RequestHandler) -> None:
        if protocol not in self._known:
            protocol.force_close()

    async def _middleware(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        try:
            answer = await self._checked(request, handler)
        except web.HTTPException as refusal:
            refusal.headers.update(_HEADERS)
            raise
        if not answer.prepared:
            answer.headers.update(_HEADERS)
        return answer

    async def _checked(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        host = request.headers.get("Host", "")
        if not self._is_ours(host):
            raise web.HTTPForbidden(text=f"{host} is not a name of this scope: see --name\n")
        origin = request.headers.get("Origin")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            raise web.HTTPForbidden(text=f"pages of {origin} may not ask here\n")
        changes = request.method != "GET" or "Upgrade" in request.headers
        if changes and origin is None and "Authorization" not in request.headers:
            raise web.HTTPForbidden(text="a browser says from which page it asks: no Origin\n")
        cookie = cookie_name(request)
        if request.path == "/" and self._is_token(request.query.get("token")):
            # Out of the address bar and the history.
            self._known.add(request.protocol)
            to_page = web.HTTPFound("/")
            to_page.set_cookie(
                cookie, request.query["token"], httponly=True, samesite="Lax", path="/"
            )
            raise to_page
        given = request.headers.get("Authorization", "").removeprefix("Bearer ")
        if not self._is_token(request.cookies.get(cookie)) and not self._is_token(given):
            raise web.HTTPForbidden(text=f"the address with its token is {self._where}\n")
        self._known.add(request.protocol)
        return await handler(request)

    def _is_ours(self, host: str) -> bool:
        try:
            return urlsplit(f"//{host}").hostname in self._names
        except ValueError:
            return False

    def _is_token(self, given: str | None) -> bool:
        return given is not None and hmac.compare_digest(given.encode(), self._token)


class _Refusal(asyncio.Protocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.write(_CROWDED)
        transport.close()


def cookie_name(request: web.Request) -> str:
    """Return the name of the cookie: browsers send those of one port to all of a machine."""
    return f"rtcf_scope_{urlsplit(f'//{request.host}').port or 80}"
