"""Signals that end a command in order."""

import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_REPETITION_S = 0.05
_RETRY_S = 0.02
# Modules of Python's import system, to recognise their frames.
_IMPORTS = [sys.modules[name] for name in ("_frozen_importlib", "_frozen_importlib_external")]


def kill_at_next(number: int) -> None:
    """Ignore signal `number` for 50 ms; the next one then kills the process at once.

    For a signal handler: timeout(1) signals the process and then its group.
    """
    signal.signal(number, signal.SIG_IGN)
    time.sleep(_REPETITION_S)
    signal.signal(number, signal.SIG_DFL)


def interrupt(number: int, frame: FrameType | None) -> None:
    """Raise KeyboardInterrupt at the first signal; the next one kills the process at once.

    A signal handler.  During an import, try again 20 ms later: the import system would lose the
    exception, or report a missing module.
    """
    if number != signal.SIGALRM:
        kill_at_next(number)
    while frame is not None:
        if any(frame.f_globals is vars(each) for each in _IMPORTS):
            signal.signal(signal.SIGALRM, interrupt)
            signal.setitimer(signal.ITIMER_REAL, _RETRY_S)
            return
        frame = frame.f_back
    raise KeyboardInterrupt


@contextmanager
def interrupted_by_termination() -> Iterator[None]:
    """Let SIGTERM and SIGHUP act like Ctrl-C, for a command that has to clean up."""
    before = {}
    for number in (signal.SIGTERM, signal.SIGHUP):
        found = signal.getsignal(number)
        if found is signal.SIG_DFL:  # nohup ignores SIGHUP
            before[number] = found
            signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
