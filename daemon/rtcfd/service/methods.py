"""Decorators of the service's methods: unary calls, streams, calls with progress or a lease.

Only this module notices that a caller has disconnected.
"""

import asyncio
import functools
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from typing import Any, Protocol

from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.errors import InvalidArgument
from rtcfd.common.status_codes import abort
from rtcfd.executor.link import Progress
from rtcfd.runners.outbox import Outbox

_SILENCE_S = 2.0  # without progress, until the first message that the call still waits
_LONGEST_SILENCE_S = 16.0

Work = Callable[[Progress], Coroutine[Any, Any, Any]]


def unary(method: Callable[..., Awaitable[Any]]) -> Any:
    """Convert errors of a unary method into statuses."""

    @functools.wraps(method)
    async def wrapper(self: Any, request: Any, context: Any) -> Any:
        try:
            return await method(self, request)
        except Exception as error:
            await abort(context, error, request)

    return wrapper


def stream(method: Callable[..., AsyncIterator[Any]]) -> Any:
    """Convert errors of a method that streams its responses into statuses."""

    @functools.wraps(method)
    async def wrapper(self: Any, request: Any, context: Any) -> AsyncIterator[Any]:
        try:
            async for response in method(self, request):
                yield response
        except Exception as error:
            await abort(context, error, request)

    return wrapper


def with_progress(response: Any, last: str) -> Callable[[Callable[..., Work]], Any]:
    """Stream the progress of a call as `response`, then its result in the field `last`.

    Converts an error into a status.  The method returns the work, which reports its progress.
    After long silence, the stream has a message that the call still waits.
    """

    def decorate(method: Callable[..., Work]) -> Any:
        @functools.wraps(method)
        async def wrapper(self: Any, request: Any, context: Any) -> AsyncIterator[Any]:
            lines: asyncio.Queue[str | None] = asyncio.Queue()
            task: asyncio.Future[Any] | None = None
            try:
                task = asyncio.ensure_future(method(self, request)(lines.put_nowait))
                task.add_done_callback(lambda _: lines.put_nowait(None))
                async for line in _with_word_of_waiting(lines):
                    yield response(progress=line)
                yield response(**{last: task.result()})
            except Exception as error:
                await abort(context, error, request)
            finally:
                if task is not None:
                    task.cancel()  # a running operation goes on: see operations/operations.py

        return wrapper

    return decorate


async def _with_word_of_waiting(lines: "asyncio.Queue[str | None]") -> AsyncIterator[str]:
    """Yield lines until None comes, and a waiting message for each long silence."""
    since, silence_s = time.monotonic(), _SILENCE_S
    while True:
        try:
            line = await asyncio.wait_for(lines.get(), silence_s)
        except TimeoutError:
            waited_s = time.monotonic() - since
            yield f"still waiting after {waited_s:.0f} s: see `rtcfctl status`"
            silence_s = min(2 * silence_s, _LONGEST_SILENCE_S)
            continue
        if line is None:
            return
        yield line


class CallLease(Protocol):
    """The lease of a call, on a runner or a component."""

    async def open(self) -> None:
        """Begin the lease."""

    async def end(self) -> None:
        """End the lease, on request of the caller."""

    def lost(self) -> None:
        """Handle the loss of the caller's connection."""


def with_lease(method: Callable[..., tuple[Outbox, CallLease]]) -> Any:
    """Serve a call that holds a lease.

    Its first message begins the lease; the message `end`, or the loss of the connection, ends it.
    """

    @functools.wraps(method)
    async def wrapper(self: Any, requests: Any, context: Any) -> AsyncIterator[Any]:
        tasks: list[asyncio.Future[None]] = []
        lease: CallLease | None = None
        opening_request: Any = None
        messages = aiter(requests)
        try:
            first = await anext(messages, None)
            if first is None or first.WhichOneof("kind") != "open":
                raise InvalidArgument(
                    "the first message of this call must be `open`",
                    errors_pb2.REASON_REQUEST_MALFORMED,
                )
            opening_request = first.open
            outbox, lease = method(self, opening_request)
            opening = asyncio.ensure_future(_open(lease, outbox))
            tasks = [opening, asyncio.ensure_future(_listen(messages, opening, lease, outbox))]
            async for response in outbox:
                yield response
        except Exception as error:
            await abort(context, error, opening_request)
        finally:
            if lease is not None and not outbox.ended:
                lease.lost()
            for task in tasks:
                task.cancel()

    return wrapper


async def _open(lease: CallLease, outbox: Outbox) -> None:
    try:
        await lease.open()
    except Exception as error:
        outbox.fail(error)


async def _listen(
    messages: AsyncIterator[Any], opening: "asyncio.Future[None]", lease: CallLease, outbox: Outbox
) -> None:
    """Wait for the caller's `end`.

    The end of the request stream alone does not end the lease; the loss of the connection does.
    """
    try:
        async for message in messages:
            if message.WhichOneof("kind") == "end":
                break
        else:
            return
    except Exception as error:  # a message was rejected
        outbox.fail(error)
        return
    await asyncio.wait({opening})
    try:
        await lease.end()
    except Exception as error:
        outbox.fail(error)
    outbox.end(control_pb2.LeaseEnded.WHY_ASKED)
