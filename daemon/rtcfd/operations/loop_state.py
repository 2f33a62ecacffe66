"""The only record of whether a runner's loop runs, and whether it should.

Owned by the runner, on rtcfd's one thread.  The responses and events of an executor
arrive on one connection.  Each is noted when it arrives, so that the newest one wins,
no matter when the caller that waits for a response continues.
"""

from rtcfd.state.desired import Desired, this_boot


class LoopState:
    """The state of a loop.  The part that must outlive rtcfd is in `desired`."""

    def __init__(self, desired: Desired) -> None:
        self._desired = desired
        self.running = False  # by the last report of the executor
        self.fault = ""  # the fault that ended it
        self.held = ""  # why rtcfd did not start it
        self.stopped_at_ns = 0  # CLOCK_MONOTONIC of the last direct stop at the executor
        # No executor has confirmed the last stop: one that is adopted may run the loop.
        self.stop_owed = False
        self.stops = 0  # stop count; a request from before the last stop must not start the loop

    @property
    def wanted(self) -> bool:
        """Whether the loop was started, and neither stopped nor ended by a fault."""
        return self._desired.running

    def stop(self) -> None:
        """Note a request to stop.  It is valid from here on, even if the executor fails to stop."""
        self.stops += 1
        self.stop_owed = True
        self.held = self.fault = ""
        self.want(False)

    def want(self, running: bool) -> None:
        """Note whether the loop is wanted, also for the time after a restart of rtcfd."""
        self._desired.running = running
        self._desired.ended_boot = "" if running else this_boot()

    def note_report(self, running: bool, asked: int | None = None) -> None:
        """Note an executor's report on its loop.

        If it is a response, `asked` is the stop count at the time of the request.
        """
        self.running = running
        if not running:
            self.stop_owed = False
        elif asked == self.stops:
            self.stop_owed = False
            self.held = self.fault = ""
            self.want(True)

    def ended(self, why: str) -> None:
        """Note that a fault has ended the loop."""
        self.running = self.stop_owed = False
        self.fault = why
        self.want(False)

    def gone(self) -> None:
        """Note that there is no executor any more; `wanted` stays."""
        self.running = self.stop_owed = False

    def starts_at_boot(self, resume: bool, always: bool) -> bool:
        """Return whether the loop starts with rtcfd.

        With `resume`, if it ran and was not stopped.  With `always`, also once after each boot of
        the machine.
        """
        if self.running:
            return False
        if always:
            return self.wanted or self._desired.ended_boot != this_boot()
        return resume and self.wanted
