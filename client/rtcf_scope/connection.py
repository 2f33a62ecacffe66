"""A connection that answers malformed HTTP with one line, and logs at most one line per error."""

import asyncio
import logging
import sys
from collections.abc import Callable
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError
from rtcf_shared.printable import printable

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
    b"not an HTTP request\n"
)
_LONGEST = 200  # characters of an error message


class _OneLine(logging.Formatter):
    """Formats a record as one line: the exception instead of its traceback."""

    def format(self, record: logging.LogRecord) -> str:
        error = record.exc_info[1] if record.exc_info else None
        text = record.getMessage()
        return "rtcf-scope: " + printable(f"{text}: {error!r}" if error is not None else text)


def logger() -> logging.Logger:
    """Return the server's logger, which writes one line per error to standard error."""
    found = logging.getLogger("rtcf_scope.server")
    if not found.handlers:
        handler = logging.StreamHandler(sys.stderr)
        handler.setFormatter(_OneLine())
        found.addHandler(handler)
        found.propagate = False
        # aiohttp logs request headers, which contain the session.
        logging.getLogger("aiohttp").addHandler(logging.NullHandler())
        logging.getLogger("aiohttp").propagate = False
    return found


class Connection(web.RequestHandler):
    """One client's connection to a server."""

    # aiohttp forgets its transport before that has sent everything.
    __slots__ = ("_opened", "wire")
    wire: asyncio.Transport

    def __init__(
        self,
        server: web.Server,
        loop: asyncio.AbstractEventLoop,
        opened: Callable[["Connection"], None],
    ) -> None:
        """Call `opened` when the connection is one of the server's."""
        # No access log: a request line can contain the token.
        no_log: Any = None
        super().__init__(server, loop=loop, logger=logger(), access_log=no_log)
        self._opened = opened

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register with the server, then report it."""
        super().connection_made(transport)
        assert isinstance(transport, asyncio.Transport)
        self.wire = transport
        self._opened(self)

    def data_received(self, data: bytes) -> None:
        """Process received bytes; close the connection if the parser fails."""
        try:
            super().data_received(data)
        except Exception:
            if self.transport is not None:
                self.transport.write(_UNREADABLE)
            self.force_close()

    def log_exception(self, *args: Any, **given: Any) -> None:
        """Log an error of the server.

        Exceptions: a body that nobody reads after the response, and a connection that ends during
        a request, of which aiohttp asserts that it is open.
        """
        error = given.get("exc_info")
        ended = isinstance(error, AssertionError) and self.wire.is_closing()
        if not ended and not isinstance(error, web.RequestPayloadError):
            super().log_exception(*args, **given)

    def handle_error(
        self,
        request: web.BaseRequest,
        status: int = 500,
        exc: BaseException | None = None,
        message: str | None = None,
    ) -> web.StreamResponse:
        """Return the response to a request that failed.

        Raises ConnectionError if the response has already started.
        """
        if isinstance(exc, HttpProcessingError):
            text = f"not an HTTP request: {exc.message}"
        elif (
            isinstance(exc, UnicodeEncodeError) and not request.headers.get("Expect", "").isascii()
        ):
            # aiohttp puts the header into its response as it came.
            status, text = 417, "unknown Expect header"
        else:
            text = message or "internal error of the scope: see its log"
            if not isinstance(exc, ConnectionError):  # the client has disconnected
                logger().error("%s %s failed", request.method, request.path, exc_info=exc)
        if request.writer.output_size > 0:
            raise ConnectionError("the response has already started")
        text = printable(" ".join(text.split())[:_LONGEST])
        answer = web.Response(status=status, text=f"{text}\n", headers=HEADERS)
        answer.force_close()
        return answer
