"""A budget of log lines: so many a second, saved up for some seconds; the rest is counted."""

import time

_SAVED_S = 5.0


class Budget:
    """A token bucket on the monotonic clock."""

    def __init__(self, per_s: float) -> None:
        self.per_s = per_s
        self._lost = 0
        self._tokens = per_s * _SAVED_S
        self._at = time.monotonic()

    def take(self) -> bool:
        """Tell whether there is room for one more; if not it counts as lost."""
        now = time.monotonic()
        self._tokens = min(self._tokens + (now - self._at) * self.per_s, self.per_s * _SAVED_S)
        self._at = now
        if self._tokens < 1.0:
            self._lost += 1
            return False
        self._tokens -= 1.0
        return True

    def take_lost(self) -> int:
        """Return how many were lost since the last call."""
        lost, self._lost = self._lost, 0
        return lost
