"""A stream of numbered entries; lost entries are counted."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import grpc

from rtcf import failures
from rtcf.connection import Closing

Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Place:
    """A position in a stream, from NumberedStream.place.

    Sequence numbers restart with each start of rtcfd, which `log_id` identifies.
    """

    log_id: str = ""
    sequence: int = 0


@dataclass(frozen=True)
class Lost:
    """The number of entries missing at this position, because rtcfd no longer keeps them."""

    count: int


class NumberedStream(Closing, Generic[Entry]):
    """An iterator over entries and Lost, used by one thread.

    Raises RefusedError, and DaemonUnreachableError if the connection is lost.  A new stream can
    then continue after `place`.
    """

    def __init__(
        self,
        method: Any,
        socket: str,
        request: Any,
        after: Place | None,
        until_now: bool,
        entries: str,
    ) -> None:
        """Open the stream; called by Client.watch_events and watch_logs.

        entries  the field of a response that holds its entries
        """
        request.until_now = until_now
        if after is not None:
            request.after, request.log_id = after.sequence, after.log_id
        self.place = after or Place()
        self._socket = socket
        self._field = entries
        self._call = method(request)
        self._waiting: list[Entry | Lost] = []
        self._fetch()  # from now on no entry is missed

    def __iter__(self) -> Iterator[Entry | Lost]:
        while True:
            while self._waiting:
                yield self._waiting.pop(0)
            if not self._fetch():
                return

    def close(self) -> None:
        """End the stream; callable from any thread."""
        self._call.cancel()

    def _fetch(self) -> bool:
        """Receive the next message; return whether there was one."""
        try:
            response = next(self._call, None)
        except grpc.RpcError as error:
            if error.code() == grpc.StatusCode.CANCELLED:
                return False  # cancelled by close()
            raise failures.from_grpc(error, self._socket) from None
        if response is None:
            return False
        self.place = Place(response.log_id, response.sequence)
        if response.lost:
            self._waiting.append(Lost(response.lost))
        self._waiting.extend(getattr(response, self._field))
        return True
