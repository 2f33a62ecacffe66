"""Numbered logs for any number of watchers of any speed: of events, and of log records.

Used on rtcfd's one thread.  A watcher holds only the number of its last entry, so it costs no
memory here.  If entries are deleted before a slow watcher reads them, it learns their number.
"""

import asyncio
import secrets
import time
from collections import deque
from itertools import islice
from typing import Generic, TypeVar

from rtcf.v1 import control_pb2, runner_pb2

KEPT = 4096
_LONGEST = 1000  # characters of a message

Entry = TypeVar("Entry")


class NumberedLog(Generic[Entry]):
    """The last `kept` entries; the first entry ever has number 1."""

    def __init__(self, kept: int = KEPT) -> None:
        self.log_id = secrets.token_hex(8)
        self.last = 0  # number of the newest entry
        self.ended = False  # no more entries follow
        self._entries: deque[Entry] = deque(maxlen=kept)
        self._news: asyncio.Event | None = None  # set at the next entry; None: nobody waits

    def append(self, entry: Entry) -> None:
        """Append an entry, and wake the watchers."""
        self.last += 1
        self._entries.append(entry)
        self._tell()

    def end(self) -> None:
        """End the log, and wake the watchers."""
        self.ended = True
        self._tell()

    def after(self, number: int, most: int) -> tuple[list[Entry], int]:
        """Return up to `most` entries after a number, the oldest first, and how many are lost.

        The first returned entry has the number `number + lost + 1`.
        """
        first = self.last - len(self._entries) + 1  # number of the oldest kept entry
        lost = max(first - 1 - number, 0)
        begin = number + lost + 1 - first
        return list(islice(self._entries, begin, begin + most)), lost

    async def beyond(self, number: int) -> None:
        """Wait for an entry after a number, or for the end."""
        while self.last <= number and not self.ended:
            if self._news is None:
                self._news = asyncio.Event()
            await self._news.wait()

    def _tell(self) -> None:
        news, self._news = self._news, None
        if news is not None:
            news.set()


class EventLog(NumberedLog[control_pb2.Event]):
    """The last events; owned by the daemon."""

    def add(
        self,
        kind: "control_pb2.Event.Kind",
        message: str,
        runner: str = "",
        state: "runner_pb2.RunnerState" = runner_pb2.RUNNER_STATE_UNSPECIFIED,
        component: str = "",
        iteration: int = 0,
        user: str = "",
        holder: str = "",
    ) -> None:
        """Append an event that has just happened; see Event in control.proto."""
        line = " ".join(message.split())
        self.append(
            control_pb2.Event(
                sequence=self.last + 1,
                time_ns=time.time_ns(),
                kind=kind,
                runner=runner,
                state=state,
                message=line if len(line) <= _LONGEST else f"{line[:_LONGEST]}…",
                component=component,
                iteration=iteration,
                user=user,
                holder=holder,
            )
        )
