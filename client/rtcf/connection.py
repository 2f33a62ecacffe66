"""A connection to rtcfd: calls, their timeouts, retries and paging."""

import os
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

import grpc

from rtcf import failures
from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.v1 import control_pb2, control_pb2_grpc

DEFAULT_SOCKET = "/run/rtcfd/control.sock"
QUERY_TIMEOUT_S = 20.0
# Above rtcfd's own timeouts, so that its more precise error arrives first.
CHANGE_TIMEOUT_S = 120.0
_CROWDED_S = 15.0  # for a place in the listen queue of rtcfd's socket
_RETRY_S = 0.05
_CLOSE_S = 2.0
_MOST_CHANNELS = 8  # the present one, and interrupted ones
_LONGEST_PATH = 107  # unix(7)
# The timeout of one attempt to connect: systemd accepts connections before rtcfd has started, and a
# busy machine may schedule rtcfd late.
_CONNECT_MS = 60_000
_CONNECT_TO_STRANGER_MS = 10_000  # to the socket of another user, which may not be rtcfd's

_OPTIONS = (
    ("grpc.max_receive_message_length", 64 * 1024 * 1024),
    # rtcfd sends error details as metadata, which gRPC limits to 8 KiB by default.
    ("grpc.max_metadata_size", 1024 * 1024),
    # A separate connection: a shared one may belong to an rtcfd that has ended.
    ("grpc.use_local_subchannel_pool", 1),
    # Reconnect soon after a restart of rtcfd, not after gRPC's 1 to 120 s.
    ("grpc.initial_reconnect_backoff_ms", 100),
    ("grpc.max_reconnect_backoff_ms", 1000),
)

OnProgress = Callable[[str], None]


def default_socket() -> str:
    """Return the path $RTCF_SOCKET, or the system daemon's socket."""
    return os.environ.get("RTCF_SOCKET") or DEFAULT_SOCKET


class Closing(ABC):
    """Calls close() at the end of a `with` statement, also after an exception."""

    @abstractmethod
    def close(self) -> None:
        """Release all resources; a second call does nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Connection(Closing):
    """A channel to rtcfd, opened by the first call; thread-safe; owned by a Client.

    stub  has a method for each call of rtcf.v1.Control, which are the `method` below

    Calls raise RefusedError, DaemonUnreachableError or RtcfError.
    """

    def __init__(self, socket: str | os.PathLike[str] | None = None) -> None:
        self.socket = os.path.abspath(socket if socket is not None else default_socket())
        if len(os.fsencode(self.socket)) > _LONGEST_PATH:
            raise DaemonUnreachableError(
                f"{self.socket} is longer than the {_LONGEST_PATH} characters of a unix socket's "
                "path"
            )
        self._channels: list[grpc.Channel] = []
        self._open()

    def _open(self) -> None:
        patience = _CONNECT_TO_STRANGER_MS if failures.stranger(self.socket) else _CONNECT_MS
        options = (*_OPTIONS, ("grpc.min_reconnect_backoff_ms", patience))
        channel = grpc.insecure_channel(f"unix:{self.socket}", options=options)
        self._channels.append(channel)
        self.stub: Any = control_pb2_grpc.ControlStub(channel)  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Close the connection."""
        closing = [_closing(each) for each in self._channels]
        until = time.monotonic() + _CLOSE_S
        for each in closing:
            each.join(max(until - time.monotonic(), 0.0))

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Use another channel after KeyboardInterrupt in a call.

        It can leave a lock of gRPC locked, or a call half begun, and all later calls of that
        channel would wait for ever.  Leases and streams of the last _MOST_CHANNELS go on.
        """
        try:
            yield
        except (KeyboardInterrupt, RuntimeError) as error:
            self._open()
            if len(self._channels) > _MOST_CHANNELS:
                _closing(self._channels.pop(0))
            # threading.Condition raises RuntimeError if it is interrupted while it is locked again.
            if isinstance(error.__context__, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise

    def ask(self, method: Any, request: Any, timeout_s: float | None = QUERY_TIMEOUT_S) -> Any:
        """Make a call with one response; return it."""
        return self._with_retries(lambda: method(request, timeout=timeout_s), _CROWDED_S)

    def pages(self, method: Any, request: Any, field: str) -> list[Any]:
        """Return a whole list; start again if it changes between two pages."""
        found: list[Any] = []
        while True:
            try:
                response = self.ask(method, request)
            except RefusedError as refused:
                if refused.reason != "LIST_CHANGED":
                    raise
                found.clear()
                request.page_token = ""
                continue
            found.extend(getattr(response, field))
            request.page_token = response.next_page_token
            if not request.page_token:
                return found

    def stream(self, method: Any, request: Any, timeout_s: float | None = None) -> Iterator[Any]:
        """Yield the responses of a call."""
        try:
            with self._interruptible():
                yield from method(request, timeout=timeout_s)
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self.socket) from None

    def change(
        self,
        method: Any,
        request: Any,
        on_progress: OnProgress | None,
        timeout_s: float | None = CHANGE_TIMEOUT_S,
        *,
        patient: bool = True,
    ) -> Any:
        """Make a call with progress messages; return its last message.

        With `patient`, the call waits for a place in the listen queue.
        """

        def change() -> Any:
            last: Any = None
            # With the time of the request, an rtcfd that was frozen can reject a request older than
            # a stop at the executor.
            asked = (("rtcf-asked-ns", str(time.monotonic_ns())),)
            for last in method(request, timeout=timeout_s, metadata=asked):
                if on_progress is not None and last.WhichOneof("kind") == "progress":
                    on_progress(last.progress)
            return last

        return self._with_retries(change, _CROWDED_S if patient else 0.0)

    def changed(
        self,
        method: Any,
        request: Any,
        on_progress: OnProgress | None,
        timeout_s: float | None = CHANGE_TIMEOUT_S,
        *,
        patient: bool = True,
    ) -> control_pb2.ChangeResult:
        """Do the same as change(); return only the result in the last message."""
        last = self.change(method, request, on_progress, timeout_s, patient=patient)
        return last.result  # type: ignore[no-any-return]

    def _with_retries(self, call: Callable[[], Any], patience_s: float) -> Any:
        """Repeat a call while the listen queue of rtcfd's socket is full: gRPC does not wait."""
        until = time.monotonic() + patience_s
        while True:
            try:
                with self._interruptible():
                    return call()
            except grpc.RpcError as error:
                if time.monotonic() > until or not failures.is_crowded(error, self.socket):
                    raise failures.from_grpc(error, self.socket) from None
            time.sleep(_RETRY_S)


def _closing(channel: grpc.Channel) -> threading.Thread:
    """Close a channel in another thread, because an interrupted one may wait for ever."""
    thread = threading.Thread(target=channel.close, daemon=True)
    thread.start()
    return thread
