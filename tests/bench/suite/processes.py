"""Programs that a benchmark runs, each with a timeout."""

import contextlib
import os
import shutil
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence

_MARGIN_S = 60.0


class Failed(Exception):
    """A program that a benchmark needs failed. The text gives its name and the reason."""


def output_of(
    command: Sequence[str], seconds: float = 0.0, environment: Mapping[str, str] | None = None
) -> str:
    """Return the output of a program that should take `seconds`."""
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
        raise Failed(f"{command[0]} is not installed") from None
    except subprocess.TimeoutExpired:
        raise Failed(f"{command[0]} does not end") from None
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip().splitlines()
        raise Failed(f"{command[0]}: status {done.returncode}: {said[-1] if said else ''}")
    return done.stdout


def missing(*programs: str) -> str:
    """Return a text with the programs to install; empty if none is missing."""
    absent = [program for program in programs if shutil.which(program) is None]
    return f"not installed: {', '.join(absent)}" if absent else ""


@contextlib.contextmanager
def load(kind: str) -> Iterator[None]:
    """Load the machine as in the paper until the end of the block, if `kind` is "stress-ng"."""
    if kind != "stress-ng":
        yield
        return
    with _stress_ng("--cpu", "48", "--io", "48", "--timeout", "4h"):
        yield


@contextlib.contextmanager
def swept_caches(cpu: int) -> Iterator[None]:
    """Stream through more memory than the caches hold, on one CPU whenever it is idle."""
    stream = ("--stream", "1", "--stream-l3-size", "256M")
    with _stress_ng(*stream, "--taskset", str(cpu), "--timeout", "1h"):
        yield


@contextlib.contextmanager
def _stress_ng(*arguments: str) -> Iterator[None]:
    process = subprocess.Popen(["stress-ng", "--quiet", *arguments], start_new_session=True)
    try:
        yield
    finally:
        os.killpg(process.pid, signal.SIGTERM)
        process.wait()
