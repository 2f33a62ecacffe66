"""A connection that answers what is no HTTP in one line, and logs one line at most."""

import asyncio
import logging
import sys
from collections.abc import Callable
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from rtcf_scope.line import line

HEADERS = {
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
_UNREADABLE = (
    b"HTTP/1.1 400 Bad Request\r\nContent-Type: text/plain\r\nConnection: close\r\n\r\n"
    b"this is no request of HTTP\n"
)
_LONGEST = 200  # characters of what is wrong


class _OneLine(logging.Formatter):
    """Leaves tracebacks out: what went wrong stands in the line."""

    def format(self, record: logging.LogRecord) -> str:
        error = record.exc_info[1] if record.exc_info else None
        text = record.getMessage()
        return "rtcf-scope: " + line(f"{text}: {error!r}" if error is not None else text)


def logger() -> logging.Logger:
    """Return a logger of the server: a line on standard error for each error."""
    found = logging.getLogger("rtcf_scope.server")
    if not found.handlers:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(_OneLine())
        found.addHandler(handler)
        found.propagate = False
        # What it says of requests has their headers, in which the session is.
        logging.getLogger("aiohttp").addHandler(logging.NullHandler())
        logging.getLogger("aiohttp").propagate = False
    return found


class Connection(web.RequestHandler):
    """One client's connection to a server."""

    __slots__ = ("_counted",)

    def __init__(
        self,
        server: web.Server,
        loop: asyncio.AbstractEventLoop,
        counted: Callable[["Connection"], None],
    ) -> None:
        """`counted` is called once it is one of the server's connections."""
        # Requests have the token in their line: not for a log.
        no_log: Any = None
        super().__init__(server, loop=loop, logger=logger(), access_log=no_log)
        self._counted = counted

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin, and be counted."""
        super().connection_made(transport)
        self._counted(self)

    def data_received(self, data: bytes) -> None:
        """Take what has come; what a parser fails at ends the connection."""
        try:
            super().data_received(data)
        except Exception:
            if self.transport is not None:
                self.transport.write(_UNREADABLE)
            self.force_close()

    def handle_error(
        self,
        request: web.BaseRequest,
        status: int = 500,
        exc: BaseException | None = None,
        message: str | None = None,
    ) -> web.StreamResponse:
        """Return the answer to a request that failed."""
        if isinstance(exc, HttpProcessingError):
            text = f"this is no request of HTTP: {exc.message}"
        else:
            text = message or "the scope has failed: its log says why"
            if not isinstance(exc, ConnectionError):  # who asked has gone
                logger().error("%s %s failed", request.method, request.path, exc_info=exc)
        if request.writer.output_size > 0:
            raise ConnectionError("the answer has begun already")
        text = line(" ".join(text.split())[:_LONGEST])
        answer = web.Response(status=status, text=f"{text}\n", headers=HEADERS)
        answer.force_close()
        return answer
