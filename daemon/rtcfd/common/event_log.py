"""What has happened, in order and with numbers: for those who watch, however slow they are.

Owned by the daemon, on rtcfd's one thread.  Watchers have a place in it each and nothing else,
so that one costs nothing; who is left behind is told how many events were not kept.
"""

import asyncio
import secrets
import time
from collections import deque

from rtcf.v1 import control_pb2, runner_pb2

KEPT = 4096
_LONGEST = 1000  # characters of a message

Kind = control_pb2.Event.Kind


class EventLog:
    """The last events."""

    def __init__(self, kept: int = KEPT) -> None:
        self.log_id = secrets.token_hex(8)
        self.last = 0  # number of the newest
        self._events: deque[control_pb2.Event] = deque(maxlen=kept)
        self._news = asyncio.Event()

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
        """Note what has just happened; see Event."""
        self.last += 1
        line = " ".join(message.split())
        self._events.append(
            control_pb2.Event(
                sequence=self.last,
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
        news, self._news = self._news, asyncio.Event()
        news.set()

    def after(self, number: int, most: int) -> tuple[list[control_pb2.Event], int]:
        """Return the events behind a number, the oldest first, and how many of them were lost."""
        first = self.last - len(self._events) + 1  # the oldest that is kept
        lost = max(first - 1 - number, 0)
        begin = number + lost + 1 - first
        end = min(begin + most, len(self._events))
        return [self._events[index] for index in range(begin, end)], lost

    async def beyond(self, number: int) -> None:
        """Wait for an event behind a number."""
        while self.last <= number:
            await self._news.wait()
