"""A replay that is under way: one request, one answer, for as long as the call lasts."""

from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import grpc

from rtcf import failures
from rtcf.closing import Closing
from rtcf.v1 import control_pb2


class ReplayCall(Closing):
    """Made by Client.replay; used by one thread.  Closing it before its end ends the replay."""

    def __init__(self, method: Any, socket: str) -> None:
        self._socket = socket
        self._requests: SimpleQueue[control_pb2.ReplayRequest | None] = SimpleQueue()
        self._call = method(iter(self._requests.get, None))

    def run(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Run one piece of the recording; takes as long as its cycles take.

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
        """Run all cycles up to a time; yield the answers, of which there may be several.

        `messages`, none after that time, are taken out as they are consumed.
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
        """End the call; one that was not ended by `end` is ended by rtcfd."""
        self._requests.put(None)
        self._call.cancel()
