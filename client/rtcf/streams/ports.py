"""The stream of values of outputs and declared state of every cycle."""

from collections.abc import Callable, Iterator
from typing import Any

import grpc
from rtcf_shared.errors import RtcfError
from rtcf_shared.ports import PortBatch, PortSchema, numpy_module, schema_of

from rtcf import failures
from rtcf.connection import Closing
from rtcf.v1 import ports_pb2

_OLDER = (
    "the executor is too old for {}: `rtcfctl runner restart` stops the loop and starts a new "
    "executor"
)


class PortStream(Closing):
    """An iterator over PortBatch; created by Client.watch_ports, used by one thread.

    schema     the schema of the next batch
    on_schema  called in the reading thread when the schema changes, even if the loop is stopped

    Raises RefusedError, and DaemonUnreachableError if the connection is lost.
    """

    def __init__(self, method: Any, socket: str, request: ports_pb2.WatchPortsRequest) -> None:
        numpy_module()
        self.schema = PortSchema()
        self.on_schema: Callable[[PortSchema], None] | None = None
        self._socket = socket
        self._every = max(request.every, 1)
        self._min_max = request.min_max
        self._times = request.component_times
        self._call = method(request)
        self._next()  # the schema; from now on no cycle is missed

    def __iter__(self) -> Iterator[PortBatch]:
        while (response := self._next()) is not None:
            if response.WhichOneof("kind") != "batch":
                continue
            batch = response.batch
            if self._min_max and len(batch.counts) != len(batch.stamps_ns):
                raise RtcfError(_OLDER.format("minima"))
            if self._times and batch.stamps_ns and not batch.turns:
                raise RtcfError(_OLDER.format("times of components"))
            yield PortBatch(
                self.schema, self._every, batch.first_cycle, batch.lost, batch.last_of_loop, batch
            )

    def close(self) -> None:
        """End the stream; callable from any thread."""
        self._call.cancel()

    def _next(self) -> ports_pb2.WatchPortsResponse | None:
        try:
            response: ports_pb2.WatchPortsResponse | None = next(self._call, None)
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.CANCELLED:
                return None  # cancelled by close()
            raise failures.from_grpc(error, self._socket) from None
        if response is not None and response.WhichOneof("kind") == "schema":
            self.schema = schema_of(response.schema)
            if self.on_schema is not None:
                self.on_schema(self.schema)
        return response
