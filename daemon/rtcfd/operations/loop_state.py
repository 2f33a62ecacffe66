"""Whether a runner's loop runs, and whether it should: the one place that knows.

Owned by the runner, on rtcfd's one thread.  An executor tells by answers and
events on one connection; each is noted when it arrives, in the order they were
sent, so that the newest wins whoever waits for an answer.
"""

from rtcfd.state.desired import Desired, this_boot


class LoopState:
    """What is known of a loop.  What is to be known after rtcfd's end is in `desired`."""

    def __init__(self, desired: Desired) -> None:
        self._desired = desired
        self.running = False  # as far as told
        self.fault = ""  # why it ended by itself
        self.held = ""  # why it is not started, if that was not asked for
        self.stopped_at_ns = 0  # CLOCK_MONOTONIC, by somebody at its executor
        self.stops = 0  # how often it was to stop; what was asked before the last starts nothing

    @property
    def wanted(self) -> bool:
        """Tell whether it was started, and neither stopped nor ended by a fault."""
        return self._desired.running

    def stop(self) -> None:
        """It is to stop: from here on, whatever becomes of the loop."""
        self.stops += 1
        self.fault = ""
        self.want(False)

    def want(self, running: bool) -> None:
        """Note what is to be known after a restart of rtcfd."""
        self._desired.running = running
        self._desired.ended_boot = "" if running else this_boot()

    def told(self, running: bool, asked: int | None = None) -> None:
        """An executor says what its loop does: by its answer to what was asked at the stop of
        number `asked`, or by itself."""
        self.running = running
        if running and asked == self.stops:
            self.held = self.fault = ""
            self.want(True)

    def ended(self, why: str) -> None:
        """It has ended by itself."""
        self.running = False
        self.fault = why
        self.want(False)

    def gone(self) -> None:
        """There is no executor any more; whether the loop is wanted stays."""
        self.running = False

    def starts_at_boot(self, resume: bool, always: bool) -> bool:
        """Tell whether it starts with rtcfd: what ran until nobody stopped it, or `always`, once
        in each boot of the machine."""
        if self.running:
            return False
        if always:
            return self.wanted or self._desired.ended_boot != this_boot()
        return resume and self.wanted
