"""The stream of log records of a runner's components and executor."""

from collections.abc import Iterable, Iterator
from typing import Any

from rtcf_shared.enums import choices

from rtcf.streams.numbered import NumberedStream, Place
from rtcf.v1 import control_pb2

# The levels by name: "debug" to "fatal".
LEVELS = choices(control_pb2.LogRecord.Level.DESCRIPTOR)


class LogStream(NumberedStream[control_pb2.LogRecord]):
    """An iterator over LogRecord and Lost; created by Client.watch_logs."""

    def __init__(
        self,
        method: Any,
        socket: str,
        runner: str,
        components: Iterable[str],
        level: str,
        after: Place | None,
        until_now: bool,
    ) -> None:
        if level not in LEVELS:
            raise ValueError(f'level "{level}": must be one of {", ".join(LEVELS)}')
        request = control_pb2.WatchLogsRequest(runner=runner, components=components)
        request.level = LEVELS[level]  # type: ignore[assignment]
        super().__init__(method, socket, request, after, until_now)

    def _entries(self, response: control_pb2.WatchLogsResponse) -> Iterator[control_pb2.LogRecord]:
        yield from response.records
