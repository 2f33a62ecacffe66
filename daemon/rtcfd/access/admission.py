"""Between the gRPC server and the service: who calls, whether they may, and a line on each change.

An interceptor, so that no method of the service can be reached around it.
Owned by the daemon.
"""

import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any

import grpc
from google.protobuf.message import DecodeError

from rtcfd.access.clients import Clients
from rtcfd.access.peer import Peer
from rtcfd.access.rights import Access, Level, needed
from rtcfd.common.budget import Budget
from rtcfd.common.refusals import InvalidArgument, Refusal
from rtcfd.common.status_codes import abort

log = logging.getLogger("rtcfd.access")

# Refused calls that are logged, each second; a client that tries all day fills no disk.
_REFUSALS_PER_S = 20


class _Malformed:
    """What arrived was no message of the expected type."""

    def __init__(self, problem: str) -> None:
        self.problem = problem


class Admission(grpc.aio.ServerInterceptor):  # type: ignore[misc]
    """Admits calls.  `access` may be changed at any time."""

    def __init__(self, clients: Clients, access: Access) -> None:
        self.access = access
        self._clients = clients
        self._budget = Budget(_REFUSALS_PER_S)

    async def intercept_service(self, continuation: Any, details: Any) -> Any:
        """Return the handler of a call, behind the check."""
        handler = await continuation(details)
        if handler is None:
            return None
        method = details.method.rpartition("/")[2]
        kind = f"{'stream' if handler.request_streaming else 'unary'}_" + (
            "stream" if handler.response_streaming else "unary"
        )
        inner = getattr(handler, kind)
        wrap = self._stream if handler.response_streaming else self._unary
        make = getattr(grpc, f"{kind}_rpc_method_handler")
        return make(
            wrap(method, inner),
            request_deserializer=_forgiving(handler.request_deserializer),
            response_serializer=handler.response_serializer,
        )

    def _unary(self, method: str, inner: Callable[..., Any]) -> Any:
        async def call(request: Any, context: Any) -> Any:
            peer = await self._admit(method, request, context)
            with self._noted(method, request, context, peer):
                return await inner(request, context)

        return call

    def _stream(self, method: str, inner: Callable[..., Any]) -> Any:
        async def call(request: Any, context: Any) -> AsyncIterator[Any]:
            peer = await self._admit(method, request, context)
            if isinstance(request, AsyncIterator):
                request = _formed(method, request)
            with self._noted(method, request, context, peer):
                async for response in inner(request, context):
                    yield response

        return call

    async def _admit(self, method: str, request: Any, context: Any) -> Peer:
        """Return who calls; refuse who may not."""
        peer = None
        try:
            peer = self._clients.peer(context.peer())
            _require_formed(method, request)
            self.access.check(peer, method)
            return peer
        except Refusal as refusal:
            if peer is not None:
                self._log(logging.WARNING, f"{method} by {peer}: refused: {refusal}", peer, request)
            await abort(context, refusal)
            raise

    @contextlib.contextmanager
    def _noted(self, method: str, request: Any, context: Any, peer: Peer) -> Iterator[None]:
        """Log what came of a change."""
        if needed(method) <= Level.OBSERVE:
            yield
            return
        runner = getattr(request, "runner", "")
        what = f"{method} by {peer}"
        try:
            yield
        except BaseException:
            reason = context.details() or "its caller left"
            self._log(logging.WARNING, f"{what}: not done: {reason}", peer, request)
            raise
        log.info("%s: done", what, extra={"runner": runner, "peer": peer})

    def _log(self, level: int, text: str, peer: Peer, request: Any) -> None:
        if not self._budget.take():
            return
        if lost := self._budget.take_lost():
            text += f" ({lost} more were refused since the last such line)"
        log.log(level, "%s", text, extra={"runner": getattr(request, "runner", ""), "peer": peer})


def _require_formed(method: str, request: Any) -> None:
    if isinstance(request, _Malformed):
        raise InvalidArgument(f"the request of {method} is malformed: {request.problem}")


async def _formed(method: str, requests: AsyncIterator[Any]) -> AsyncIterator[Any]:
    async for request in requests:
        _require_formed(method, request)
        yield request


def _forgiving(deserialize: Callable[[bytes], Any]) -> Callable[[bytes], Any]:
    """Make a deserializer that hands on what is malformed, instead of a traceback in the log."""

    def forgiving(data: bytes) -> Any:
        try:
            return deserialize(data)
        except DecodeError as error:
            return _Malformed(str(error))

    return forgiving
