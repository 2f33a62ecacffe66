"""The use that one user makes of rtcfd: connections, running calls, calls per second.

Owned by Clients.  Users that may stop loops are not limited: a flood of calls by
another user must never delay a stop.
"""

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rtcf.v1 import errors_pb2

from rtcfd.access.calls import Level
from rtcfd.access.peer import Peer
from rtcfd.common.refusals import ResourceExhausted

# Users with this right or more are not limited, and some connections are reserved for them.
TRUSTED = Level.OPERATE
_CALLS_AT_A_TIME = 64
_WATCHES_AT_A_TIME = 8
_CALLS_PER_S = 100.0
_BYTES_PER_S = 1024 * 1024.0
_SAVED_S = 0.5  # seconds of unused rate that a burst may use


class Pace:
    """A rate limit that delays instead of rejecting."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._due = time.monotonic()

    def take(self, amount: float = 1.0) -> float:
        """Account for `amount`; return how many seconds to wait before using it."""
        now = time.monotonic()
        self._due = max(self._due, now - _SAVED_S) + amount / self._per_s
        return max(self._due - now, 0.0)


class Usage:
    """The use of one user."""

    def __init__(self) -> None:
        self.connections = 0
        self._calls = 0
        self._watches = 0
        self._pace = Pace(_CALLS_PER_S)
        self.bytes = Pace(_BYTES_PER_S)

    @property
    def idle(self) -> bool:
        """Whether the user has neither connections nor running calls."""
        return not (self.connections or self._calls)

    @contextmanager
    def calling(self, method: str, peer: Peer, level: Level) -> Iterator[None]:
        """Count a running call; raises ResourceExhausted above the limits of
        untrusted users."""
        watches = method.startswith("Watch")
        if level < TRUSTED:
            for number, most, kind in (
                (self._calls, _CALLS_AT_A_TIME, "running calls"),
                (self._watches if watches else 0, _WATCHES_AT_A_TIME, "open streams"),
            ):
                if number >= most:
                    raise ResourceExhausted(
                        f"user {peer.user} has {number} {kind}, the limit of a user that may only "
                        f"{level.word}: end some",
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
        """Wait until the rate limit allows the next call."""
        if level < TRUSTED and (wait_s := self._pace.take()):
            await asyncio.sleep(wait_s)
