"""What a client holds for as long as it lives: a runner, or a component.

Made by Client.hold_runner and Client.lease_component.  rtcfd takes the end of
the connection for the death of its client; end() is the orderly way.
"""

from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import grpc

from rtcf import failures
from rtcf.v1 import control_pb2


class Tenancy:
    """A call that lasts.  One thread iterates over its messages; any may call end()."""

    def __init__(self, method: Any, request: Any, opening: Any, socket: str) -> None:
        self._request = request
        self._socket = socket
        self._requests: SimpleQueue[Any] = SimpleQueue()
        self._requests.put(request(open=opening))
        self._call = method(iter(self._requests.get, None))

    def __iter__(self) -> Iterator[Any]:
        """Yield rtcfd's messages; the last one is `ended`.

        Raises RefusedError if it was not given, and DaemonUnreachableError if the
        connection was lost: rtcfd keeps what was held for 10 s, see `attach`.
        """
        try:
            yield from self._call
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self._socket) from None
        finally:
            self._requests.put(None)

    def end(self) -> None:
        """Give back what is held; the messages end when that is done."""
        self._requests.put(self._request(end=control_pb2.EndLease()))

    def drop(self) -> None:
        """Leave without a word, as a client that dies does."""
        self._call.cancel()
