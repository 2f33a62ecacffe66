"""Logs a repeated message at growing intervals.

Used on rtcfd's one thread.
"""

import time


class GrowingInterval:
    """The times of one message: at once, after `first_s`, then at intervals that double up to
    `longest_s`.  Restarts if due() was not called for a little more than 2 * `first_s`."""

    def __init__(self, first_s: float, longest_s: float) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._interval_s = 0.0
        self._asked_at = 0.0
        self._said_at = 0.0
        self._left_out = 0

    def due(self) -> int | None:
        """Return None if the message must wait, else how many were suppressed since the last."""
        now = time.monotonic()
        if not self._interval_s or now - self._asked_at > 2 * self._first_s + 1.0:
            self._interval_s, self._left_out = self._first_s, 0
        elif now - self._said_at < self._interval_s:
            self._asked_at = now
            self._left_out += 1
            return None
        else:
            self._interval_s = min(2 * self._interval_s, self._longest_s)
        self._asked_at = self._said_at = now
        left_out, self._left_out = self._left_out, 0
        return left_out
