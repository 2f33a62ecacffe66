"""The bidirectional call of a replay: one response for each request."""

from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import grpc

from rtcf import failures
from rtcf.closing import Closing
from rtcf.v1 import control_pb2


class ReplayCall(Closing):
    """A call of Client.replay, used by one thread; closing it early ends the replay."""

    def __init__(self, method: Any, socket: str) -> None:
        self._socket = socket
        self._requests: SimpleQueue[control_pb2.ReplayRequest | None] = SimpleQueue()
        self._call = method(iter(self._requests.get, None))

    def run(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Replay one part of the recording; return after its cycles, without a timeout.

        Raises RefusedError, which ends the replay, or DaemonUnreachableError.
        """
        self._requests.put(request)
        try:
            return next(self._call)  # type: ignore[no-any-return]
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self._socket) from None

    def cycles(
        self, messages: list[control_pb2.RecordedMessage], until_ns: int, end: bool = False
    ) -> Iterator[control_pb2.ReplayResponse]:
        """Run all cycles up to `until_ns`; yield one or more responses.

        No message may be later than `until_ns`.  Consumed ones are removed from `messages`.  `end`
        ends the replay.
        """
        more = True
        while more:
            response = self.run(
                control_pb2.ReplayRequest(messages=messages, until_ns=until_ns, end=end)
            )
            del messages[: response.consumed]
            yield response
            more = response.more

    def close(self) -> None:
        """End the call; rtcfd then ends the replay if `end` has not."""
        self._requests.put(None)
        self._call.cancel()
