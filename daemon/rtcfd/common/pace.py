"""A rate limit that delays instead of rejecting."""

import time

_SAVED_S = 0.5  # seconds of unused rate that a burst may use


class Pace:
    """A number of units per second, on the monotonic clock."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._due = time.monotonic()

    def take(self, amount: float = 1.0) -> float:
        """Account for `amount`; return how many seconds to wait before using it."""
        now = time.monotonic()
        self._due = max(self._due, now - _SAVED_S) + amount / self._per_s
        return max(self._due - now, 0.0)
