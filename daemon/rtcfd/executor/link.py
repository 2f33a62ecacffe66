"""The connection to one executor: sends requests, receives responses and notifications.

Owned by the Executor.  Requests may overlap; a response has the id of its request.
When the link ends, all pending requests fail.
"""

import asyncio
import contextvars
import os
import socket
import struct
from collections.abc import Callable
from pathlib import Path

from google.protobuf.message import DecodeError
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import errors_pb2, ports_pb2

from rtcfd.common import errors
from rtcfd.common.background import log_failure

# The protocol version of this rtcfd.  It increases with features that need support by the peer.
# rtcfd and an executor of neighbouring versions work together: the newer one does not use the new
# features.  Hello, Stop and Exit never change.
PROTOCOL = 4
LIMITS_PROTOCOL = 2  # since then, executors enforce [limits]
ACCESS_PROTOCOL = 3  # since then, executors accept and report direct stops
STATISTICS_PROTOCOL = 4  # since then, one reset begins the counts of status and statistics
PORTS_PROTOCOL = 4  # since then, executors send the values of ports
MAX_MESSAGE = 16 * 1024 * 1024  # bytes, without the length before it
_LENGTH_BYTES = 4  # little-endian, before each message
_CREDENTIALS = struct.Struct("3i")  # struct ucred, unix(7)

Progress = Callable[[str], None]
Unasked = Callable[[wire.Response], None]
OnAnswer = Callable[[wire.Response], None]
OnPorts = Callable[[ports_pb2.WatchPortsResponse], None]

# By code: the exception, and the reason for an executor that sends none.
_ERRORS: dict[int, tuple[type[errors.RequestError], errors_pb2.Reason]] = {
    wire.Error.CODE_INVALID_ARGUMENT: (errors.InvalidArgument, errors_pb2.REASON_VALUE_INVALID),
    wire.Error.CODE_NOT_FOUND: (errors.NotFound, errors_pb2.REASON_COMPONENT_NOT_FOUND),
    wire.Error.CODE_ALREADY_EXISTS: (errors.AlreadyExists, errors_pb2.REASON_COMPONENT_EXISTS),
    wire.Error.CODE_FAILED_PRECONDITION: (
        errors.FailedPrecondition,
        errors_pb2.REASON_COMPONENT_REFUSED,
    ),
    wire.Error.CODE_UNAVAILABLE: (errors.Unavailable, errors_pb2.REASON_LOOP_STUCK),
    wire.Error.CODE_NO_MASTER: (errors.NoMaster, errors_pb2.REASON_NO_MASTER),
    wire.Error.CODE_RESOURCE_EXHAUSTED: (
        errors.ResourceExhausted,
        errors_pb2.REASON_LIMIT_REACHED,
    ),
}


class MessageError(Exception):
    """A message violates the protocol."""


class _Pending:
    """A request that waits for its response."""

    def __init__(
        self,
        on_progress: Progress | None = None,
        on_answer: OnAnswer | None = None,
        on_ports: OnPorts | None = None,
    ) -> None:
        self.on_progress = on_progress
        self.on_answer = on_answer
        self.on_ports = on_ports
        self.result: asyncio.Future[wire.Response] = asyncio.get_running_loop().create_future()


class Link:
    """One connection.  `peer` names the executor in messages."""

    def __init__(
        self,
        peer: str,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        on_unasked: Unasked,
    ) -> None:
        self.peer = peer
        self._writer = writer
        self._on_unasked = on_unasked
        self._next_id = 1
        self._pending: dict[int, _Pending] = {}
        # The number of direct stops that we know of.  It goes into each request, and the executor
        # rejects a request to start that was sent before a later one.
        self.direct_stops = 0
        self.problem = ""  # why we closed the connection; empty = the peer closed it
        self.ended = asyncio.Event()
        credentials = writer.get_extra_info("socket").getsockopt(
            socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size
        )
        # From the kernel; those of the process that listens.
        self.peer_pid, self.peer_uid, _ = _CREDENTIALS.unpack(credentials)
        # Own context: do not attribute executor messages to the connecting client.
        reading = asyncio.create_task(self._read(reader), context=contextvars.Context())
        self._reading = log_failure(reading, f"the link to {peer}")

    @classmethod
    async def connect(cls, peer: str, path: Path, on_unasked: Unasked) -> "Link":
        """Connect to the executor's socket; raises OSError, or Unavailable if it belongs to
        another user."""
        reader, writer = await asyncio.open_unix_connection(path)
        link = cls(peer, reader, writer, on_unasked)
        if link.peer_uid not in (os.geteuid(), 0):
            await link.close()
            raise errors.Unavailable(
                f"{path} is served by user {link.peer_uid}, not by us: remove it",
                errors_pb2.REASON_EXECUTOR_SILENT,
            )
        return link

    async def hello(self, timeout_s: float) -> wire.HelloResult:
        """Exchange hello messages, which have the protocol and the version of both sides."""
        request = wire.Request(hello=wire.Hello(protocol=PROTOCOL))
        return (await self.request(request, timeout_s)).hello

    async def request(
        self,
        request: wire.Request,
        timeout_s: float | None,
        on_progress: Progress | None = None,
        on_answer: OnAnswer | None = None,
    ) -> wire.Response:
        """Send a request, set its id, and return the response that completes it.

        `on_answer` is called with the response when it arrives, unless it is an error, and
        before any later message is handled.

        Raises the executor's error, or Unavailable when the link ends or `timeout_s` of
        wall-clock time passes (None: the caller has a limit of its own).
        """
        return await self._request(request, timeout_s, _Pending(on_progress, on_answer))

    async def watch_ports(self, request: ports_pb2.WatchPortsRequest, on_ports: OnPorts) -> None:
        """Receive the values of ports until cancelled; raises the errors of request()."""
        opening = wire.Request(watch_ports=request)
        try:
            await self._request(opening, None, _Pending(on_ports=on_ports))
        finally:
            if opening.id and not self.ended.is_set():
                # Nobody waits for its response.
                closing = wire.Request(end_watch=wire.EndWatch(watch=opening.id))
                self._writer.write(pack_message(self._numbered(closing).SerializeToString()))

    def _numbered(self, request: wire.Request) -> wire.Request:
        request.id = self._next_id
        request.direct_stops = self.direct_stops
        self._next_id += 1
        return request

    async def _request(
        self, request: wire.Request, timeout_s: float | None, pending: _Pending
    ) -> wire.Response:
        if self.ended.is_set():
            raise errors.Unavailable(self._lost(), errors_pb2.REASON_EXECUTOR_SILENT)
        self._numbered(request)
        self._pending[request.id] = pending
        try:
            self._writer.write(pack_message(request.SerializeToString()))
            async with asyncio.timeout(timeout_s):
                await self._writer.drain()
                response = await pending.result
        except TimeoutError:
            raise errors.Unavailable(
                f"{self.peer} did not answer {request.WhichOneof('kind')} within {timeout_s:g} s",
                errors_pb2.REASON_EXECUTOR_SILENT,
            ) from None
        except MessageError as error:
            raise errors.InvalidArgument(
                f"request too large: {error}", errors_pb2.REASON_REQUEST_TOO_LARGE
            ) from None
        except ConnectionError:
            raise errors.Unavailable(self._lost(), errors_pb2.REASON_EXECUTOR_SILENT) from None
        finally:
            del self._pending[request.id]
            pending.result.cancel()
        if response.WhichOneof("kind") == "error":
            raise _error_of(response.error)
        return response

    async def close(self) -> None:
        """Close the connection; pending requests fail."""
        self._writer.close()
        self._reading.cancel()
        await asyncio.gather(self._reading, return_exceptions=True)
        self._fail_pending()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        try:
            while (message := await read_message(reader)) is not None:
                self._dispatch(wire.Response.FromString(message))
        except (MessageError, DecodeError) as error:
            self.problem = f"{self.peer} violates the protocol: {error}"
        finally:
            self._writer.close()
            self._fail_pending()

    def _dispatch(self, response: wire.Response) -> None:
        if response.id == 0:
            if response.WhichOneof("kind") == "direct_stop":
                self.direct_stops = response.direct_stop.count
            self._on_unasked(response)
            return
        pending = self._pending.get(response.id)
        if pending is None:
            return  # its caller has stopped waiting
        if response.WhichOneof("kind") == "progress":
            if pending.on_progress is not None:
                pending.on_progress(response.progress)
        elif response.WhichOneof("kind") == "ports":
            if pending.on_ports is not None:
                pending.on_ports(response.ports)
        elif not pending.result.done():
            if pending.on_answer is not None and response.WhichOneof("kind") != "error":
                pending.on_answer(response)
            pending.result.set_result(response)

    def _fail_pending(self) -> None:
        self.ended.set()
        for pending in self._pending.values():
            if not pending.result.done():
                pending.result.set_exception(
                    errors.Unavailable(self._lost(), errors_pb2.REASON_EXECUTOR_SILENT)
                )

    def _lost(self) -> str:
        return self.problem or f"{self.peer} closed its connection"


def _error_of(error: wire.Error) -> errors.RequestError:
    kind, reason = _ERRORS.get(
        error.code, (errors.FailedPrecondition, errors_pb2.REASON_COMPONENT_REFUSED)
    )
    # A newer executor may have reasons that this rtcfd does not know.
    known = error.reason in errors_pb2.Reason.values()
    return kind(error.message, (known and error.reason) or reason)


def pack_message(message: bytes) -> bytes:
    """Return a serialized message with its length before it."""
    if len(message) > MAX_MESSAGE:
        raise MessageError(f"a message of {len(message)} bytes is above the limit of {MAX_MESSAGE}")
    return len(message).to_bytes(_LENGTH_BYTES, "little") + message


async def read_message(reader: asyncio.StreamReader) -> bytes | None:
    """Return the next message, or None at the end of the stream."""
    try:
        size = int.from_bytes(await reader.readexactly(_LENGTH_BYTES), "little")
        if size > MAX_MESSAGE:
            raise MessageError(f"a message of {size} bytes is above the limit of {MAX_MESSAGE}")
        return await reader.readexactly(size)
    except (asyncio.IncompleteReadError, ConnectionError):
        return None
