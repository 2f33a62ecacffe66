"""Relays the values of ports from an executor to one caller; a slow caller loses values."""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator

from rtcf.v1 import errors_pb2, ports_pb2

from rtcfd.common.errors import InvalidArgument
from rtcfd.runners.runner import Runner

_MOST = 8 * 1024 * 1024  # bytes in the queue to the caller
_MOST_PATTERNS = 256  # each is compared with each output and state, whenever the graph changes
_MOST_NAMES = 16384  # names of single outputs and states, which are looked up
_WILD = frozenset("*?[")


class _CallerQueue:
    """The queue to the caller.

    Batches are meaningless without their schema.  So a schema is dropped only if no batch of it
    is in the queue.
    """

    def __init__(self, every: int) -> None:
        self._every = max(every, 1)
        self._responses: deque[tuple[ports_pb2.WatchPortsResponse, int]] = deque()
        self._bytes = 0
        self._lost: ports_pb2.PortBatch | None = None  # an empty batch with the count of drops
        self.some = asyncio.Event()

    def put(self, response: ports_pb2.WatchPortsResponse) -> None:
        size = response.ByteSize()
        if response.WhichOneof("kind") == "batch":
            batch = response.batch
            if self._bytes + size > _MOST:
                self._lose(batch)
                return
            if self._lost is not None:
                batch.lost += self._lost.lost
                self._lost = None
        elif self._responses and self._responses[-1][0].WhichOneof("kind") == "schema":
            # No batch of the previous schema is in the queue.
            self._bytes -= self._responses.pop()[1]
            if self._lost is not None:
                self._lost.values[:] = [b""] * len(response.schema.columns)
                if self._lost.places:
                    self._lost.places[:] = self._lost.values
        elif self._lost is not None:
            # The dropped batches belong to the previous schema.
            self._responses.append((ports_pb2.WatchPortsResponse(batch=self._lost), 0))
            self._lost = None
        self._responses.append((response, size))
        self._bytes += size
        self.some.set()

    def take(self) -> ports_pb2.WatchPortsResponse | None:
        if not self._responses:
            if self._lost is not None:
                lost, self._lost = self._lost, None
                return ports_pb2.WatchPortsResponse(batch=lost)
            self.some.clear()
            return None
        response, size = self._responses.popleft()
        self._bytes -= size
        return response

    def _lose(self, batch: ports_pb2.PortBatch) -> None:
        count = len(batch.stamps_ns)
        before = 0 if self._lost is None else self._lost.lost
        self._lost = ports_pb2.PortBatch(
            first_cycle=batch.first_cycle + count * self._every,
            lost=before + batch.lost + (sum(batch.counts) if batch.counts else count),
            values=[b""] * len(batch.values),
            places=[b""] * len(batch.places),
        )


async def watch_ports(
    runner: Runner, request: ports_pb2.WatchPortsRequest
) -> AsyncGenerator[ports_pb2.WatchPortsResponse, None]:
    """Yield schemas and batches, without end; raises the executor's error, or that of its end."""
    patterns = sum(1 for each in request.selection if _is_pattern(each))
    for count, most, what in (
        (patterns, _MOST_PATTERNS, "components and patterns of ports"),
        (len(request.selection) - patterns, _MOST_NAMES, "names of ports"),
    ):
        if count > most:
            raise InvalidArgument(
                f"{count} {what} are too many, {most} at most: use wildcards",
                errors_pb2.REASON_REQUEST_TOO_LARGE,
            )
    waiting = _CallerQueue(request.every)
    telling = asyncio.ensure_future(runner.watch_ports(request, waiting.put))
    telling.add_done_callback(lambda _: waiting.some.set())
    try:
        while True:
            while (response := waiting.take()) is not None:
                yield response
            if telling.done():
                telling.result()
                return
            await waiting.some.wait()
    finally:
        telling.cancel()
        await asyncio.gather(telling, return_exceptions=True)


def _is_pattern(selection: str) -> bool:
    """Return whether a selection may match several outputs or states."""
    return "." not in selection.rpartition("/")[2] or not _WILD.isdisjoint(selection)
