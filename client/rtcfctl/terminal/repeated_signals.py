"""Signals that one cause sends twice."""

import signal
import time

_REPETITION_S = 0.05


def kill_at_next(number: int) -> None:
    """Ignore signal `number` for 50 ms; the next one then kills the process at once.

    For a signal handler: timeout(1) signals the process and then its group.
    """
    signal.signal(number, signal.SIG_IGN)
    time.sleep(_REPETITION_S)
    signal.signal(number, signal.SIG_DFL)
