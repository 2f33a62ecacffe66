"""Runs rtcf-compile in a child process, so that a crash of the compiler is an error in one line."""

import mmap
import os
import sys

from rtcf_compile import child, instructions
from rtcf_compile.main import REFUSED
from rtcf_compile.source import progress


def guarded() -> int:
    """Run the command; return its exit code."""
    instructions.choose()
    if sys.argv[1:] == ["--worker"]:
        from rtcf_compile.worker import serve

        return serve()
    with mmap.mmap(-1, progress.BYTES) as shared:
        status = _end_of(child.started(shared))
        if status >= 0:
            return status
        print(child.crash(status, shared), file=sys.stderr)
        return REFUSED


def _end_of(process: int) -> int:
    """Wait for a child, which a Ctrl-C ends, too; return its exit code."""
    while True:
        try:
            return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        except KeyboardInterrupt:
            continue
