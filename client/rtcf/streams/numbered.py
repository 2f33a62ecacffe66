"""What comes one after the other, with numbers; none lost without a count."""

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import grpc

from rtcf import failures
from rtcf.closing import Closing

Entry = TypeVar("Entry")


@dataclass(frozen=True)
class Place:
    """Where somebody stands; made by a stream.

    Numbers begin anew with each start of rtcfd, as `log_id` tells.
    """

    log_id: str = ""
    sequence: int = 0


@dataclass(frozen=True)
class Lost:
    """So many, of all that could have been asked for, are not known any more: they would stand
    here."""

    count: int


class NumberedStream(Closing, Generic[Entry]):
    """An iterator over entries and Lost, used by one thread.

    Raises RefusedError, and DaemonUnreachableError if the connection is lost: go on from
    `place` then.
    """

    def __init__(
        self, method: Any, socket: str, request: Any, after: Place | None, until_now: bool
    ) -> None:
        request.until_now = until_now
        if after is not None:
            request.after, request.log_id = after.sequence, after.log_id
        self.place = after or Place()
        self._socket = socket
        self._call = method(request)
        self._waiting: list[Entry | Lost] = []
        self._fetch()  # from here on nothing is missed

    def __iter__(self) -> Iterator[Entry | Lost]:
        while True:
            while self._waiting:
                yield self._waiting.pop(0)
            if not self._fetch():
                return

    def close(self) -> None:
        """End the stream.  Any thread."""
        self._call.cancel()

    @abstractmethod
    def _entries(self, response: Any) -> Iterator[Entry]:
        """Return what a message tells."""

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
        self._waiting.extend(self._entries(response))
        return True
