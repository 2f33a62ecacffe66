"""A child process that runs rtcf-compile, and the message if it crashes."""

import ctypes
import mmap
import os
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from rtcf_compile.main import REFUSED, main
from rtcf_compile.source import progress
from rtcf_compile.source.mistake import Mistake

_PR_SET_PDEATHSIG = 1


def started(
    shared: mmap.mmap,
    arguments: Sequence[str] | None = None,
    prepare: Callable[[], None] = lambda: None,
) -> int:
    """Start a child process that runs the command; return its id.

    `shared`: memory for notes about a crash. `prepare` runs first, in the child.
    """
    parent, child = os.getpid(), os.fork()
    if child:
        return child
    _end_with(parent)
    status = REFUSED
    try:
        progress.note_in(shared)
        prepare()
        status = main(arguments)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else REFUSED
    except Exception as error:
        print(_failure(error, shared), file=sys.stderr)
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def crash(status: int, shared: mmap.mmap) -> str:
    """Return the message for a child that a signal has ended."""
    return _message(f"the compiler ended with {signal.Signals(-status).name}", shared)


def _failure(error: Exception, shared: mmap.mmap) -> str:
    """Return the error of the compiler itself, and its place in the compiler."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__}: {error}".split())
    where = f"{Path(place.filename).name}:{place.lineno}"
    return _message(f"the compiler failed at {where}: {what}", shared)


def _message(what: str, shared: mmap.mmap) -> str:
    file, line = progress.noted(shared)
    return f"rtcf-compile: {Mistake(file, line, what, 'write this function in another way')}"


def _end_with(parent: int) -> None:
    """Let the kernel end this process when its parent ends: nobody would use its results."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(REFUSED)
