"""Programs that a bench runs, each with an end in sight."""

import contextlib
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence

_MARGIN_S = 60.0


class Failed(Exception):
    """A program that a bench needs failed; the text says which and why."""


def output_of(
    command: Sequence[str], seconds: float = 0.0, environment: Mapping[str, str] | None = None
) -> str:
    """Return what a program prints that is to take about so long."""
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=seconds + _MARGIN_S,
            env=None if environment is None else {**os.environ, **environment},
            check=False,
        )
    except FileNotFoundError:
        raise Failed(f"there is no {command[0]}") from None
    except subprocess.TimeoutExpired:
        raise Failed(f"{command[0]} does not end") from None
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise Failed(f"{command[0]}: status {done.returncode}: {said[-1] if said else ''}")
    return done.stdout


def missing(*programs: str) -> str:
    """Return what has to be installed; empty if all programs are there."""
    absent = [program for program in programs if shutil.which(program) is None]
    return f"not installed: {', '.join(absent)}" if absent else ""


@contextlib.contextmanager
def load(kind: str) -> Iterator[None]:
    """Load the machine as the paper did, if `kind` is "stress-ng", until the end of the block."""
    if kind != "stress-ng":
        yield
        return
    process = subprocess.Popen(
        ["stress-ng", "--quiet", "--cpu", "48", "--io", "48", "--timeout", "4h"],
        start_new_session=True,
    )
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
