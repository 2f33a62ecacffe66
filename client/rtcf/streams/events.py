"""Events as they happen: states of runners, faults, changes; none lost without a count."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import grpc

from rtcf import failures
from rtcf.closing import Closing
from rtcf.v1 import control_pb2


@dataclass(frozen=True)
class Place:
    """Where somebody stands among the events; made by an EventStream.

    The numbers of events begin anew with each start of rtcfd, as `log_id` tells.
    """

    log_id: str = ""
    sequence: int = 0


@dataclass(frozen=True)
class Lost:
    """So many events, of all runners, are not known any more: they would stand here."""

    count: int


class EventStream(Closing):
    """An iterator over Event and Lost; made by Client.watch_events, used by one thread.

    Raises RefusedError, and DaemonUnreachableError if the connection is lost: go on from
    `place` then.
    """

    def __init__(
        self,
        method: Any,
        socket: str,
        runners: Iterable[str],
        after: Place | None,
        until_now: bool,
    ) -> None:
        request = control_pb2.WatchEventsRequest(runners=runners, until_now=until_now)
        if after is not None:
            request.after, request.log_id = after.sequence, after.log_id
        self.place = after or Place()
        self._socket = socket
        self._call = method(request)
        self._waiting: list[control_pb2.Event | Lost] = []
        self._fetch()  # from here on nothing is missed

    def __iter__(self) -> Iterator[control_pb2.Event | Lost]:
        while True:
            while self._waiting:
                yield self._waiting.pop(0)
            if not self._fetch():
                return

    def close(self) -> None:
        """End the stream.  Any thread."""
        self._call.cancel()

    def _fetch(self) -> bool:
        """Take the next message; tell whether there was one."""
        try:
            response = next(self._call, None)
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.CANCELLED:
                return False  # by close()
            raise failures.from_grpc(error, self._socket) from None
        if response is None:
            return False
        self.place = Place(response.log_id, response.sequence)
        if response.lost:
            self._waiting.append(Lost(response.lost))
        self._waiting.extend(response.events)
        return True
