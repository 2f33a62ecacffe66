"""A budget of log lines per second.  Lines above it are counted as lost."""

import time

_SAVED_S = 5.0  # seconds of unused budget that a burst may use


class Budget:
    """A token bucket on the monotonic clock."""

    def __init__(self, per_s: float) -> None:
        self.per_s = per_s
        self._lost = 0
        self._tokens = per_s * _SAVED_S
        self._at = time.monotonic()

    def take(self) -> bool:
        """Return whether one more line fits into the budget; if not, it counts as lost."""
        now = time.monotonic()
        self._tokens = min(self._tokens + (now - self._at) * self.per_s, self.per_s * _SAVED_S)
        self._at = now
        if self._tokens < 1.0:
            self._lost += 1
            return False
        self._tokens -= 1.0
        return True

    def take_lost(self) -> int:
        """Return the number of lines lost since the last call."""
        lost, self._lost = self._lost, 0
        return lost
