"""A lease: a client's hold on a runner or a component that ends with its connection.

Created by Client.hold_runner and Client.lease_component.  rtcfd treats a lost connection as the
death of the client; end() ends the lease in order.
"""

from collections.abc import Iterator
from queue import SimpleQueue
from typing import Any

import grpc

from rtcf import failures
from rtcf.v1 import control_pb2


class Lease:
    """A lease.  One thread iterates over its messages; any thread may call end() and drop()."""

    def __init__(self, method: Any, request: Any, opening: Any, socket: str) -> None:
        self._request = request
        self._socket = socket
        self._requests: SimpleQueue[Any] = SimpleQueue()
        self._requests.put(request(open=opening))
        self._call = method(iter(self._requests.get, None))

    def __iter__(self) -> Iterator[Any]:
        """Yield rtcfd's messages; the last one is `ended`.

        Raises RefusedError if the lease is not granted.  Raises DaemonUnreachableError if the
        connection is lost; the lease then stays valid for 10 s, see `attach`.
        """
        try:
            yield from self._call
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self._socket) from None
        finally:
            self._requests.put(None)

    def end(self) -> None:
        """Request the end of the lease; the messages end after it."""
        self._requests.put(self._request(end=control_pb2.EndLease()))

    def drop(self) -> None:
        """Close the connection without ending the lease, like a client that dies."""
        self._call.cancel()
