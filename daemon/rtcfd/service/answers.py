"""How the methods of the service answer: at once, with progress first, or for as long as they last.

Decorators, and the one place that knows when a call's caller has left.
"""

import asyncio
import functools
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from typing import Any, Protocol

from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.refusals import InvalidArgument
from rtcfd.common.status_codes import abort
from rtcfd.executor.link import Progress
from rtcfd.runners.outbox import Outbox

_SILENCE_S = 2.0  # of a call, until it says that it waits
_LONGEST_SILENCE_S = 16.0

Work = Callable[[Progress], Coroutine[Any, Any, Any]]


def answering(method: Callable[..., Awaitable[Any]]) -> Any:
    """Turn a refusal of a unary method into a status."""

    @functools.wraps(method)
    async def wrapper(self: Any, request: Any, context: Any) -> Any:
        try:
            return await method(self, request)
        except Exception as error:
            await abort(context, error, request)

    return wrapper


def lasting(response: Any, last: str) -> Callable[[Callable[..., Work]], Any]:
    """Stream what a call does, as `response`, then its result in the field `last`; or turn its
    refusal into a status.  The method returns the work, which tells of its progress; what is
    silent for long is said to be waited for."""

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
                    task.cancel()  # one that has begun goes on: see operations/operations.py

        return wrapper

    return decorate


async def _with_word_of_waiting(lines: "asyncio.Queue[str | None]") -> AsyncIterator[str]:
    """Yield lines until None comes, and one of ours for each silence that lasts."""
    since, silence_s = time.monotonic(), _SILENCE_S
    while True:
        try:
            line = await asyncio.wait_for(lines.get(), silence_s)
        except TimeoutError:
            waited_s = time.monotonic() - since
            yield f"not done after {waited_s:.0f} s: `rtcfctl status` tells what is waited for"
            silence_s = min(2 * silence_s, _LONGEST_SILENCE_S)
            continue
        if line is None:
            return
        yield line


changing = lasting(control_pb2.ChangeResponse, "result")


class Tenancy(Protocol):
    """What a call holds for as long as it lasts: a runner, or a component."""

    async def open(self) -> None:
        """Take it."""

    async def end(self) -> None:
        """Give it back, at the caller's word."""

    def lost(self) -> None:
        """The caller has left without a word."""


def holding(method: Callable[..., tuple[Outbox, Tenancy]]) -> Any:
    """Serve a call that holds something: its first message opens, `end` or its death ends it."""

    @functools.wraps(method)
    async def wrapper(self: Any, requests: Any, context: Any) -> AsyncIterator[Any]:
        tasks: list[asyncio.Future[None]] = []
        tenancy: Tenancy | None = None
        opening_request: Any = None
        messages = aiter(requests)
        try:
            first = await anext(messages, None)
            if first is None or first.WhichOneof("kind") != "open":
                raise InvalidArgument(
                    "the first message of such a call is `open`",
                    errors_pb2.REASON_REQUEST_MALFORMED,
                )
            opening_request = first.open
            outbox, tenancy = method(self, opening_request)
            opening = asyncio.ensure_future(_open(tenancy, outbox))
            tasks = [opening, asyncio.ensure_future(_listen(messages, opening, tenancy, outbox))]
            async for response in outbox:
                yield response
        except Exception as error:
            await abort(context, error, opening_request)
        finally:
            if tenancy is not None and not outbox.ended:
                tenancy.lost()
            for task in tasks:
                task.cancel()

    return wrapper


async def _open(tenancy: Tenancy, outbox: Outbox) -> None:
    try:
        await tenancy.open()
    except Exception as error:
        outbox.refuse(error)


async def _listen(
    messages: AsyncIterator[Any], opening: "asyncio.Future[None]", tenancy: Tenancy, outbox: Outbox
) -> None:
    """Wait for the caller's `end`.  A stream that just ends says nothing: the connection counts."""
    try:
        async for message in messages:
            if message.WhichOneof("kind") == "end":
                break
        else:
            return
    except Exception as error:  # a message that is refused
        outbox.refuse(error)
        return
    await asyncio.wait({opening})
    try:
        await tenancy.end()
    except Exception as error:
        outbox.refuse(error)
    outbox.end(control_pb2.LeaseEnded.WHY_ASKED)
