"""The stream of events: states of runners, faults, changes."""

from collections.abc import Iterable, Iterator
from typing import Any

from rtcf.streams.numbered import NumberedStream, Place
from rtcf.v1 import control_pb2


class EventStream(NumberedStream[control_pb2.Event]):
    """An iterator over Event and Lost; created by Client.watch_events."""

    def __init__(
        self,
        method: Any,
        socket: str,
        runners: Iterable[str],
        after: Place | None,
        until_now: bool,
    ) -> None:
        request = control_pb2.WatchEventsRequest(runners=runners)
        super().__init__(method, socket, request, after, until_now)

    def _entries(self, response: control_pb2.WatchEventsResponse) -> Iterator[control_pb2.Event]:
        yield from response.events
