"""What an executor's death means: what was running, and whether it is taken out.

Running is not guilty: a component is named because its code was executing.
It is quarantined only if the thread that died was executing it.
"""

import signal
import time
from collections import deque
from dataclasses import dataclass, replace

from rtcfd.executor.flight_recorder import Note, Thread
from rtcfd.executor.process import End, describe_signal

# More deaths in this time hold the loop, whatever the policy; still more end the attempts.
WINDOW_S = 60.0
MOST_CRASHES = 3
MOST_ATTEMPTS = 6

# Signals that a process brings upon itself; others were sent to it.
_OWN_SIGNALS = {
    int(number)
    for number in (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT,
                   signal.SIGSYS, signal.SIGTRAP)
}  # fmt: skip
_ADDRESSED = {int(signal.SIGSEGV), int(signal.SIGBUS), int(signal.SIGFPE), int(signal.SIGILL)}


@dataclass(frozen=True)
class Verdict:
    """What is said and done about a death."""

    how: str  # "was killed by SIGSEGV …"
    running: str  # "while /H1.update was running in cycle 7"
    culprit: str = ""  # full name of the component to quarantine; empty = none
    orderly: bool = False  # somebody asked the executor itself to end, e.g. by SIGTERM
    safe: bool = True  # it died in no hook that makes things safe or stops them

    def __str__(self) -> str:
        return f"{self.how} {self.running}"


def judge(end: End, note: Note | None) -> Verdict:
    """Return the verdict on a death that nobody asked for."""
    if note is None:
        return Verdict(str(end), "(there is no flight recorder)")
    safe = not (note.updating and note.cycle_hook == "safe") and not (note.hooking and note.hook)
    return replace(_judge(end, note), safe=safe)


def _judge(end: End, note: Note) -> Verdict:
    update = f"{note.updating}.{note.cycle_hook}" if note.updating else ""
    hook = f"{note.hooking}.{note.hook}" if note.hooking else ""
    cycle = f"in cycle {note.iteration}"
    how = str(end)
    if note.stalled:
        how = "was ended because a cycle made no progress"
    elif note.signal:
        how = f"was killed by {describe_signal(note.signal)}"
        if note.signal in _ADDRESSED:
            how += f" at address {note.address:#x}"
    if note.thread == Thread.REALTIME:
        running = f"while {update} was running {cycle}" if update else f"in its loop {cycle}"
        return Verdict(how, running, note.updating)
    if note.thread == Thread.GRAPH:
        running = f"while {hook} was running" if hook else "while it changed the graph"
        return Verdict(how, running, note.hooking)
    if note.thread == Thread.OTHER:
        return Verdict(how, "in a thread that belongs to no component")
    # No note of a crash: it ended by exit(), by a signal from outside, or in an unknown way.
    busy = " and ".join([f"{update} {cycle}"] * bool(update) + [hook] * bool(hook))
    running = f"while {busy} was running" if busy else "while no component was running"
    own = end.status is not None and (end.status >= 0 or -end.status in _OWN_SIGNALS)
    alone = bool(update) != bool(hook)
    return Verdict(
        how,
        running,
        culprit=(note.updating or note.hooking) if own and alone else "",
        orderly=end.status == 0 and not busy,
    )


class Crashes:
    """Counts the deaths of one runner's executors."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()

    def add(self) -> None:
        """Note one, now."""
        self._times.append(time.monotonic())

    @property
    def recent(self) -> int:
        """How many there were in the last minute."""
        while self._times and time.monotonic() - self._times[0] > WINDOW_S:
            self._times.popleft()
        return len(self._times)
