"""What one user takes of rtcfd: connections, calls under way, calls a second.

Owned by Clients.  Those who may stop loops are not held back: a flood by one
who may only look must never be the reason why a loop goes on.
"""

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rtcf.v1 import errors_pb2

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.common.refusals import ResourceExhausted

# From this right on nothing is held back, and connections are kept in reserve.
TRUSTED = Level.OPERATE
_CALLS_AT_A_TIME = 64
_WATCHES_AT_A_TIME = 8
_CALLS_PER_S = 100.0
_BYTES_PER_S = 1024 * 1024.0
_SAVED_S = 0.5  # of the above, for bursts


class Pace:
    """So many a second: says how long to wait before the next."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._due = time.monotonic()

    def take(self, amount: float = 1.0) -> float:
        """Take some; return for how many seconds to wait before."""
        now = time.monotonic()
        self._due = max(self._due, now - _SAVED_S) + amount / self._per_s
        return max(self._due - now, 0.0)


class Usage:
    """Of one user."""

    def __init__(self) -> None:
        self.connections = 0
        self._calls = 0
        self._watches = 0
        self._pace = Pace(_CALLS_PER_S)
        self.bytes = Pace(_BYTES_PER_S)

    @property
    def idle(self) -> bool:
        """Tell whether there is nothing of this user."""
        return not (self.connections or self._calls)

    @contextmanager
    def calling(self, method: str, peer: Peer, level: Level) -> Iterator[None]:
        """Count a call that is under way; refuse one too many of those who may only look."""
        watches = method.startswith("Watch")
        if level < TRUSTED:
            for number, most, what in (
                (self._calls, _CALLS_AT_A_TIME, "calls"),
                (self._watches if watches else 0, _WATCHES_AT_A_TIME, "streams of figures"),
            ):
                if number >= most:
                    raise ResourceExhausted(
                        f"user {peer.user} has {number} {what} under way, the most at a time of "
                        f"who may only {level.word}: end some",
                        errors_pb2.REASON_TOO_MANY_CALLS,
                        user=peer.user,
                    )
        self._calls += 1
        self._watches += watches
        try:
            yield
        finally:
            self._calls -= 1
            self._watches -= watches

    async def turn(self, level: Level) -> None:
        """Wait until the next call may be done."""
        if level < TRUSTED and (wait_s := self._pace.take()):
            await asyncio.sleep(wait_s)
