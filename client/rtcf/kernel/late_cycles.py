"""The late cycles of a trace, each with its cause."""

import time
from collections import Counter, deque

from rtcf.kernel.culprit import Culprit, LateCycle
from rtcf.kernel.tracefs import KernelTrace
from rtcf.recording.trace import Trace

_SHORT_S = 0.02
_FINISH_S = 1.0


class LateCycles:
    """Finds the culprits of late cycles; one thread.

    `found` has the cycle numbers with their culprits, in order.
    """

    def __init__(self, trace: Trace, kernel: KernelTrace) -> None:
        self.found: list[tuple[int, Culprit]] = []
        self._trace = trace
        self._kernel = kernel
        self._waiting: deque[tuple[int, int, LateCycle]] = deque()

    def add(self, cycle: int, stamp_ns: int, begin_ns: int, end_ns: int, late_ns: int) -> None:
        """Queue a late cycle by its stamps; its kernel events may not have arrived yet."""
        # Stamps use the wall clock, the kernel's trace the monotonic clock.
        offset = time.clock_gettime_ns(time.CLOCK_REALTIME) - time.monotonic_ns()
        late = LateCycle(stamp_ns - offset, begin_ns - offset, end_ns - offset, late_ns)
        self._waiting.append((cycle, end_ns, late))

    def ask(self) -> None:
        """Find the culprits of the cycles with complete events."""
        while self._waiting and self._kernel.settled(self._waiting[0][2]):
            cycle, end_ns, late = self._waiting.popleft()
            culprit = self._kernel.culprit(late)
            self.found.append((cycle, culprit))
            self._trace.add_culprit(cycle, end_ns, str(culprit))

    def finish(self) -> None:
        """Wait briefly for the remaining culprits.

        If the wall clock was set, events for a time in the future may never arrive.
        """
        until = time.monotonic() + _FINISH_S
        while self._waiting and time.monotonic() < until:
            self.ask()
            time.sleep(_SHORT_S)

    def counts(self) -> list[tuple[str, int]]:
        """Return the number of late cycles of each culprit, the most frequent first."""
        return Counter(culprit.words for _, culprit in self.found).most_common()

    @property
    def problem(self) -> str:
        """Why the kernel's trace ended; empty if it did not."""
        return self._kernel.problem
