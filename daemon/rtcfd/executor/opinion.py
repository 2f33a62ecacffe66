"""What an executor would say of settings: asked in a process of its own, which runs no loop.

Expressions over names, and what else only the executor knows, are judged by
the code that will take them.
"""

import signal
import subprocess
from pathlib import Path

from rtcf.v1 import runner_pb2

from rtcfd.executor.command import ExecutorCommand

_TIMEOUT_S = 10.0
_REFUSED = 1
_BEGIN = "rtcf-executor: "
_MAX_LENGTH = 1500  # of a line, with an expression as long as they may be


def of_settings(binary: Path, settings: runner_pb2.RunnerSettings) -> str:
    """Return why they would be refused, in a line; nothing if they would not be, or if there is
    no executor to ask.  Blocks."""
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
        return f"an executor dies of it ({signal.Signals(-asked.returncode).name})"
    if asked.returncode != _REFUSED:
        return ""  # one of another version, or none at all
    said = asked.stderr.decode(errors="replace").partition(_BEGIN)[2]
    return " ".join(said.split())[:_MAX_LENGTH]  # there may be any text in an expression
