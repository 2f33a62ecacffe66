"""Checks settings by an executor, in a process of its own that runs no loop.

So regular expressions, and other values that only the executor understands, are
checked by the code that will use them.
"""

import signal
import subprocess
from pathlib import Path

from rtcf.v1 import runner_pb2

from rtcfd.executor.command import ExecutorCommand

_TIMEOUT_S = 10.0
_REFUSED = 1
_BEGIN = "rtcf-executor: "
_MAX_LENGTH = 1500  # characters of the error, which may quote the longest allowed expression


def of_settings(binary: Path, settings: runner_pb2.RunnerSettings) -> str:
    """Return why an executor would reject the settings, in one line; empty = it accepts them, or
    there is no executor to ask.  Blocks."""
    try:
        asked = subprocess.run(
            [binary, "--check-settings"],
            input=settings.SerializeToString(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env=ExecutorCommand.environment(),
            timeout=_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    if asked.returncode < 0:
        return f"an executor crashes with it ({signal.Signals(-asked.returncode).name})"
    if asked.returncode != _REFUSED:
        return ""  # an executor of another version, or no executor
    said = asked.stderr.decode(errors="replace").partition(_BEGIN)[2]
    return " ".join(said.split())[:_MAX_LENGTH]  # an expression may have any characters
