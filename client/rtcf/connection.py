"""A connection to rtcfd: calls, their timeouts, retries and paging."""

import os
import time
from collections.abc import Callable
from typing import Any

import grpc

from rtcf import failures
from rtcf.closing import Closing
from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.v1 import control_pb2, control_pb2_grpc

DEFAULT_SOCKET = "/run/rtcfd/control.sock"
QUERY_TIMEOUT_S = 20.0
# Above rtcfd's own timeouts, so that its more precise error arrives first.
CHANGE_TIMEOUT_S = 120.0
_CROWDED_S = 15.0  # for a place in the listen queue of rtcfd's socket
_RETRY_S = 0.05
_LONGEST_PATH = 107  # unix(7)

_OPTIONS = (
    ("grpc.max_receive_message_length", 64 * 1024 * 1024),
    # rtcfd sends error details as metadata, which gRPC limits to 8 KiB by default.
    ("grpc.max_metadata_size", 1024 * 1024),
    # A separate connection: a shared one may belong to an rtcfd that has ended.
    ("grpc.use_local_subchannel_pool", 1),
    # Reconnect soon after a restart of rtcfd, not after gRPC's 1 to 120 s.
    ("grpc.initial_reconnect_backoff_ms", 100),
    # The timeout of one attempt to connect: systemd accepts connections before rtcfd has started,
    # and a busy machine may schedule rtcfd late.
    ("grpc.min_reconnect_backoff_ms", 60_000),
    ("grpc.max_reconnect_backoff_ms", 1000),
)

OnProgress = Callable[[str], None]


def default_socket() -> str:
    """Return the path $RTCF_SOCKET, or the system daemon's socket."""
    return os.environ.get("RTCF_SOCKET") or DEFAULT_SOCKET


class Connection(Closing):
    """A connection to rtcfd, opened by the first call; thread-safe."""

    def __init__(self, socket: str | os.PathLike[str] | None = None) -> None:
        self.socket = os.path.abspath(socket if socket is not None else default_socket())
        if len(os.fsencode(self.socket)) > _LONGEST_PATH:
            raise DaemonUnreachableError(
                f"{self.socket} is longer than the {_LONGEST_PATH} characters of a unix socket's "
                "path"
            )
        self._channel = grpc.insecure_channel(f"unix:{self.socket}", options=_OPTIONS)
        self._stub: Any = control_pb2_grpc.ControlStub(self._channel)  # type: ignore[no-untyped-call]

    def close(self) -> None:
        """Close the connection."""
        self._channel.close()

    def _pages(self, method: Any, request: Any, field: str) -> list[Any]:
        """Return a whole list; start again if it changes between two pages."""
        found: list[Any] = []
        while True:
            try:
                response = self._ask(method, request)
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

    def _ask(self, method: Any, request: Any, timeout_s: float | None = QUERY_TIMEOUT_S) -> Any:
        until = time.monotonic() + _CROWDED_S
        while True:
            try:
                return method(request, timeout=timeout_s)
            except grpc.RpcError as error:
                if not self._crowded(error, until):
                    raise failures.from_grpc(error, self.socket) from None

    def _crowded(self, error: Any, until: float) -> bool:
        """Return whether to retry because the listen queue was full, after a short pause.

        gRPC does not wait for a place in the queue.
        """
        if time.monotonic() > until or not failures.is_crowded(error, self.socket):
            return False
        time.sleep(_RETRY_S)
        return True

    def _changed(
        self,
        method: Any,
        request: Any,
        on_progress: OnProgress | None,
        timeout_s: float | None = CHANGE_TIMEOUT_S,
        *,
        patient: bool = True,
    ) -> control_pb2.ChangeResult:
        last = self._change(method, request, on_progress, timeout_s, patient=patient)
        return last.result  # type: ignore[no-any-return]

    def _change(
        self,
        method: Any,
        request: Any,
        on_progress: OnProgress | None,
        timeout_s: float | None = CHANGE_TIMEOUT_S,
        *,
        patient: bool = True,
    ) -> Any:
        """Make a call with progress messages; return its last message."""
        until = time.monotonic() + (_CROWDED_S if patient else 0.0)
        while True:
            try:
                return self._change_once(method, request, on_progress, timeout_s)
            except grpc.RpcError as error:
                if not self._crowded(error, until):
                    raise failures.from_grpc(error, self.socket) from None

    @staticmethod
    def _change_once(
        method: Any, request: Any, on_progress: OnProgress | None, timeout_s: float | None
    ) -> Any:
        last: Any = None
        # With the time of the request, an rtcfd that was frozen can reject a request older than a
        # stop at the executor.
        asked = (("rtcf-asked-ns", str(time.monotonic_ns())),)
        for last in method(request, timeout=timeout_s, metadata=asked):
            if on_progress is not None and last.WhichOneof("kind") == "progress":
                on_progress(last.progress)
        return last
