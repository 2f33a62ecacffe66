"""The queue of messages and log records to the holder of a lease.

Owned by the call that serves the holder, on rtcfd's one thread.  Log records may be
dropped: a slow holder costs a bounded amount of memory and delays nobody.
"""

import asyncio
from collections import deque
from collections.abc import AsyncIterator
from typing import Any

from rtcf.v1 import control_pb2

# The records of some seconds; a terminal shows thousands of lines a second.
MOST_RECORDS = 2000
_BATCH = 200


class Outbox:
    """Messages to one holder, of the response type of its call."""

    def __init__(self, response: Any) -> None:
        self.gone = False  # the holder has disconnected
        self.unseen = False  # the holder shows only warnings
        self._response = response
        self._messages: deque[Any] = deque()
        self._report: control_pb2.HoldReport | None = None
        self._records: deque[control_pb2.LogRecord] = deque()
        self._dropped = 0
        self._error: BaseException | None = None
        self._ended: control_pb2.LeaseEnded | None = None
        self._wake = asyncio.Event()

    def say(self, **kind: Any) -> None:
        """Send a message; these are few per holder, and never dropped."""
        self._messages.append(self._response(**kind))
        self._wake.set()

    def progress(self, line: str) -> None:
        """Send a line on the progress."""
        self.say(progress=line)

    def waiting(self, line: str) -> None:
        """Send the reason for a wait."""
        self.say(waiting=line)

    def report(self, report: control_pb2.HoldReport) -> None:
        """Send a report; it replaces one that is still in the queue."""
        self._report = report
        self._wake.set()

    def log(self, record: control_pb2.LogRecord) -> None:
        """Send a record; if the queue is full, the oldest one is dropped and counted."""
        if len(self._records) >= MOST_RECORDS:
            self._records.popleft()
            self._dropped += 1
        self._records.append(record)
        self._wake.set()

    def end(self, why: "control_pb2.LeaseEnded.Why", message: str = "") -> None:
        """Send the last message; later calls have no effect."""
        if self._ended is None:
            self._ended = control_pb2.LeaseEnded(why=why, message=message)
            self._wake.set()

    def fail(self, error: BaseException) -> None:
        """Make the reader raise an error."""
        self._error = error
        self._wake.set()

    @property
    def ended(self) -> bool:
        """Whether end() has been called."""
        return self._ended is not None

    async def __aiter__(self) -> AsyncIterator[Any]:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._messages:
                yield self._messages.popleft()
            if self._error is not None:
                raise self._error
            while self._records:
                yield self._batch()
            if self._report is not None:
                report, self._report = self._report, None
                yield self._response(report=report)
            if self._ended is not None and not self._messages:
                yield self._response(ended=self._ended)
                return

    def _batch(self) -> Any:
        count = min(len(self._records), _BATCH)
        records = [self._records.popleft() for _ in range(count)]
        dropped, self._dropped = self._dropped, 0
        return self._response(logs=control_pb2.LogRecords(records=records, dropped=dropped))
