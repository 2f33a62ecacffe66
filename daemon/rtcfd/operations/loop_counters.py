"""Corrects the counters of a loop's status, and detects loops whose cycles keep ending late.

Owned by a RunnerCore.  All counters begin at one time: the start of the loop, or the
last reset.  An executor of protocol 3 resets only its statistics, and its status counts
overruns from its own start; this class subtracts the earlier ones.
"""

import time
from dataclasses import dataclass

from rtcf.v1 import runner_pb2

# An executor reports late cycles at most every 10 s, as long as there are any.
_FRESH_S = 15.0
_MUCH = 0.01  # share of late cycles from which on the status mentions them


@dataclass
class _Report:
    at: float
    iteration: int
    overruns: int


class LoopCounters:
    """The counts to subtract from the status, and the last report of late cycles."""

    def __init__(self) -> None:
        self.overruns = 0
        self.missed = 0
        self._last: _Report | None = None
        self._late = ""

    def begin(self) -> None:
        """Subtract nothing, and forget the last report of late cycles."""
        self.overruns = self.missed = 0
        self._last, self._late = None, ""

    def leave_out(
        self, status: runner_pb2.RunnerStatus, counted: runner_pb2.RunnerStatistics
    ) -> None:
        """Make the status count from the same time as the statistics."""
        self.overruns = max(status.overruns - counted.overruns, 0)
        self.missed = max(status.missed - counted.missed, 0)

    def note_late_cycles(self, status: runner_pb2.RunnerStatus, message: str) -> None:
        """Note a report of late cycles; `message` has their cause and component."""
        before, now = self._last, time.monotonic()
        self._last = _Report(now, status.iteration, status.overruns)
        self._late = ""
        if before is None or now - before.at > _FRESH_S or status.iteration <= before.iteration:
            return
        share = (status.overruns - before.overruns) / (status.iteration - before.iteration)
        if share >= _MUCH:
            self._late = f"{min(share, 1.0):.0%} of its cycles: {message}"

    def put_into(self, status: runner_pb2.RunnerStatus) -> None:
        """Correct the counters of a status, and set its text on late cycles."""
        status.overruns = max(status.overruns - self.overruns, 0)
        status.missed = max(status.missed - self.missed, 0)
        fresh = self._last is not None and time.monotonic() - self._last.at <= _FRESH_S
        if fresh and status.state == runner_pb2.RUNNER_STATE_RUNNING:
            status.late = self._late
