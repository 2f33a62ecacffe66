"""Identifies the caller of each gRPC call, checks its right, and logs each change.

An interceptor of the gRPC server, so that no method of the service can bypass it.
Owned by the daemon.
"""

import contextlib
import logging
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any, NoReturn

import grpc
from google.protobuf.message import DecodeError
from rtcf.v1 import errors_pb2

from rtcfd import VERSION
from rtcfd.access import calls
from rtcfd.access.caller import ASKED_KEY, Caller, enter
from rtcfd.access.calls import Call, Level
from rtcfd.access.clients import Client, Clients
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access
from rtcfd.common import enumerators
from rtcfd.common.budget import Budget
from rtcfd.common.errors import InvalidArgument, RequestError, ResourceExhausted
from rtcfd.common.status_codes import abort, bounded

log = logging.getLogger("rtcfd.access")

# Log lines about rejected calls, per second: a client that retries all day must not fill the disk.
_REJECTIONS_PER_S = 20


class _Malformed:
    """Stands for a request that is too large to be parsed, or could not be parsed."""

    def __init__(self, problem: RequestError) -> None:
        self.problem = problem


class Admission(grpc.aio.ServerInterceptor):  # type: ignore[misc]
    """Admits calls.  `access` may be changed at any time."""

    def __init__(self, access: Access) -> None:
        self.access = access
        self.clients: Clients | None = None  # set by the daemon, which owns both
        self._budget = Budget(_REJECTIONS_PER_S)

    def level(self, peer: Peer) -> Level:
        """Return the right of a peer."""
        return self.access.level(peer)

    async def intercept_service(self, continuation: Any, details: Any) -> Any:
        """Return the handler of a call, wrapped in the checks."""
        handler = await continuation(details)
        if handler is None:
            return None
        method = details.method.rpartition("/")[2]
        requirements = calls.of(method)
        kind = f"{'stream' if handler.request_streaming else 'unary'}_" + (
            "stream" if handler.response_streaming else "unary"
        )
        inner = getattr(handler, kind)
        wrap = self._stream if handler.response_streaming else self._unary
        make = getattr(grpc, f"{kind}_rpc_method_handler")
        return make(
            wrap(method, requirements, inner),
            request_deserializer=_forgiving(method, requirements, handler.request_deserializer),
            response_serializer=handler.response_serializer,
        )

    def _unary(self, method: str, requirements: Call, inner: Callable[..., Any]) -> Any:
        async def call(request: Any, context: Any) -> Any:
            async with self._admitted(method, request, context) as peer:
                with self._noted(method, requirements, request, context, peer):
                    return await inner(request, context)

        return call

    def _stream(self, method: str, requirements: Call, inner: Callable[..., Any]) -> Any:
        async def call(request: Any, context: Any) -> AsyncIterator[Any]:
            async with self._admitted(method, request, context) as peer:
                if isinstance(request, AsyncIterator):
                    request = self._formed(method, request, peer)
                watches = requirements.right <= Level.OBSERVE
                with self._noted(method, requirements, request, context, peer) as but:
                    async with contextlib.aclosing(inner(request, context)) as responses:
                        async for response in responses:
                            if watches:
                                await self._check_again(method, request, context, peer)
                            else:
                                but[:] = _rejected_parts(response)
                            yield response

        return call

    @contextlib.asynccontextmanager
    async def _admitted(self, method: str, request: Any, context: Any) -> AsyncIterator[Peer]:
        """Yield the caller for the duration of its call; abort the call if it is not allowed."""
        assert self.clients is not None
        with contextlib.ExitStack() as stack:
            client: Client | None = None
            try:
                client = stack.enter_context(self.clients.calling(context.peer(), method))
                await client.usage.turn(client.level)
                assert client.peer is not None
                self.access.check(client.peer, method)
                tuning = self.access.tuning(client.peer)
                _require_formed(request)
                enter(Caller(client.peer, client.level, tuning, _asked_ns(context)))
            except RequestError as error:
                known = None if client is None else client.peer
                await self._reject(error, method, request, context, known)
            yield client.peer

    async def _check_again(self, method: str, request: Any, context: Any, peer: Peer) -> None:
        """Abort a stream whose caller has lost its right since it began."""
        try:
            self.access.check(peer, method)
        except RequestError as error:
            await self._reject(error, method, request, context, peer)

    async def _formed(
        self, method: str, requests: AsyncIterator[Any], peer: Peer
    ) -> AsyncIterator[Any]:
        """Check each message of a request stream: the caller may lose its right meanwhile."""
        async for request in requests:
            self.access.check(peer, method)
            _require_formed(request)
            yield request

    async def _reject(
        self, error: RequestError, method: str, request: Any, context: Any, peer: Peer | None
    ) -> NoReturn:
        if peer is not None:
            text = f"{method} by {peer}: refused: {bounded(error)}"
            self._log(logging.WARNING, text, peer, request)
        await abort(context, error, request)

    @contextlib.contextmanager
    def _noted(
        self, method: str, requirements: Call, request: Any, context: Any, peer: Peer
    ) -> Iterator[list[str]]:
        """Log the result of a change.  The caller adds the rejected parts to the yielded list."""
        but: list[str] = []
        if requirements.right <= Level.OBSERVE:
            yield but
            return
        runner = _runner(request)
        call = f"{method} by {peer}"
        try:
            yield but
        except BaseException:
            reason = context.details() or "its caller disconnected"
            self._log(logging.WARNING, f"{call}: failed: {reason}", peer, request)
            raise
        if but:
            text = f"{call}: partly failed: {bounded('; '.join(but))}"
            self._log(logging.WARNING, text, peer, request)
            return
        log.info("%s: done", call, extra={"runner": runner, "peer": peer})

    def _log(self, level: int, text: str, peer: Peer, request: Any) -> None:
        if not self._budget.take():
            return
        if lost := self._budget.take_lost():
            text += f" ({lost} more were refused since the last such line)"
        log.log(level, "%s", text, extra={"runner": _runner(request), "peer": peer})


def _rejected_parts(response: Any) -> list[str]:
    """Return the rejected parts of a change from its response, a line each."""
    result = getattr(response, "result", None)
    return [str(line) for line in getattr(result, "refused", ())]


def _asked_ns(context: Any) -> int:
    """Return the caller's time of the request, CLOCK_MONOTONIC in ns: rtcfd itself may have been
    suspended since then."""
    now = time.monotonic_ns()
    for key, value in context.invocation_metadata() or ():
        if key == ASKED_KEY and _is_number(value):
            return min(int(value), now)
    return now


def _is_number(value: object) -> bool:
    """Return whether metadata is a number of ns: of ASCII digits, unlike what int() rejects."""
    return isinstance(value, str) and value.isascii() and value.isdigit() and len(value) < 20


def _runner(request: Any) -> str:
    return str(getattr(request, "runner", ""))[: calls.LONGEST_NAME]


def _require_formed(request: Any) -> None:
    if isinstance(request, _Malformed):
        raise request.problem
    if hasattr(request, "DESCRIPTOR"):
        calls.check_texts(request)
        enumerators.check(request)


def _has_unknown_fields(request: Any) -> bool:
    """Return whether a message has fields without a definition here, and drop them."""
    size = request.ByteSize()
    request.DiscardUnknownFields()
    return bool(request.ByteSize() != size)


def _forgiving(
    method: str, requirements: Call, deserialize: Callable[[bytes], Any]
) -> Callable[[bytes], Any]:
    """Make a deserializer that returns _Malformed for a request that is too large or malformed.

    An exception would leave a traceback in the log.
    """
    largest = requirements.largest

    def forgiving(data: bytes) -> Any:
        if len(data) > largest:
            return _Malformed(
                ResourceExhausted(
                    f"a request of {len(data)} bytes is too large for {method}: at most {largest}",
                    errors_pb2.REASON_REQUEST_TOO_LARGE,
                )
            )
        try:
            request = deserialize(data)
            if requirements.right > Level.OBSERVE and _has_unknown_fields(request):
                return _Malformed(
                    InvalidArgument(
                        f"the request of {method} has fields that rtcfd {VERSION} does not know, "
                        "perhaps of a newer client: rtcfd would not do all that it asks for; "
                        "install both in one version",
                        errors_pb2.REASON_REQUEST_MALFORMED,
                    )
                )
            return request
        except DecodeError as error:
            return _Malformed(
                InvalidArgument(
                    f"the request of {method} is malformed: {error}",
                    errors_pb2.REASON_REQUEST_MALFORMED,
                )
            )

    return forgiving
