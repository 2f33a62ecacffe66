"""Runs rtcf-compile in a child process, so that a crash of the compiler is an error in one line."""

import ctypes
import mmap
import os
import signal
import sys
import traceback
from pathlib import Path

from rtcf_compile.main import REFUSED, main
from rtcf_compile.source import progress
from rtcf_compile.source.mistake import Mistake

_PR_SET_PDEATHSIG = 1


def guarded() -> int:
    """Run the command; return its exit code."""
    with mmap.mmap(-1, progress.BYTES) as shared:
        parent, child = os.getpid(), os.fork()
        if child == 0:
            _end_with(parent)
            progress.note_in(shared)
            status = REFUSED
            try:
                status = main()
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else REFUSED
            except Exception as error:
                _report(_failure(error), *progress.noted(shared))
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(status)
        status = _end_of(child)
        if status >= 0:
            return status
        what = f"the compiler ended with {signal.Signals(-status).name}"
        _report(what, *progress.noted(shared))
        return REFUSED


def _failure(error: Exception) -> str:
    """Return the error of the compiler itself, and its place in the compiler."""
    place = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__}: {error}".split())
    return f"the compiler failed at {Path(place.filename).name}:{place.lineno}: {what}"


def _report(what: str, file: str, line: int) -> None:
    mistake = Mistake(file, line, what, "write this function in another way")
    print(f"rtcf-compile: {mistake}", file=sys.stderr)


def _end_with(parent: int) -> None:
    """Let the kernel end this process when its parent ends: nobody would use its results."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os._exit(REFUSED)


def _end_of(child: int) -> int:
    """Wait for a child, which a Ctrl-C ends, too; return its exit code."""
    while True:
        try:
            return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        except KeyboardInterrupt:
            continue
