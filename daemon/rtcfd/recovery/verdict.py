"""Judges the death of an executor: which code was running, and which component to quarantine.

Running is not guilty: a component is named because its code was running.  It is
quarantined only if the thread that died was running it.
"""

import signal
import time
from collections import deque
from dataclasses import dataclass, replace

from rtcfd.executor.flight_recorder import Note, Thread
from rtcfd.executor.watched_process import End, describe_signal

# After more than MOST_CRASHES deaths in WINDOW_S the loop is held under any policy; after
# MOST_ATTEMPTS no new executor is started.
WINDOW_S = 60.0
MOST_CRASHES = 3
MOST_ATTEMPTS = 6

# Signals that a process causes itself; other signals come from another process.
_OWN_SIGNALS = {
    int(number)
    for number in (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT,
                   signal.SIGSYS, signal.SIGTRAP)
}  # fmt: skip
_FIRST_HOOKS = ("constructor", "prepare", "configure", "start")
_ADDRESSED = {int(signal.SIGSEGV), int(signal.SIGBUS), int(signal.SIGFPE), int(signal.SIGILL)}


@dataclass(frozen=True)
class Verdict:
    """The verdict on a death, for messages and for the quarantine."""

    how: str  # "was killed by SIGSEGV …"
    running: str  # "while /H1.update was running in cycle 7"
    culprit: str = ""  # full name of the component to quarantine; empty = none
    orderly: bool = False  # the executor ended in order on request, e.g. by SIGTERM
    first: bool = False  # it died in a hook of the graph thread before the first update
    safe: bool = True  # False: it died in safe(), or in a hook of the graph thread, as stop()

    def __str__(self) -> str:
        return f"{self.how} {self.running}"


def judge(end: End, note: Note | None) -> Verdict:
    """Return the verdict on an unexpected death."""
    if note is None:
        return Verdict(str(end), "(there is no flight recorder)")
    safe = not (note.updating and note.cycle_hook == "safe") and not (note.hooking and note.hook)
    first = bool(note.hooking) and note.hook in _FIRST_HOOKS
    return replace(_judge(end, note), safe=safe, first=first)


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
    # Without a recorded crash: it ended by exit(), by a signal from outside, or unknown.
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
        """Count a death now."""
        self._times.append(time.monotonic())

    @property
    def recent(self) -> int:
        """The number of deaths in the last WINDOW_S."""
        while self._times and time.monotonic() - self._times[0] > WINDOW_S:
            self._times.popleft()
        return len(self._times)
