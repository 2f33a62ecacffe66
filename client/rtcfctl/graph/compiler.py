"""The process of rtcf-compile: one for a single compilation, or one that stays for the next."""

import contextlib
import json
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from subprocess import DEVNULL, PIPE
from typing import Protocol

import rtcf

# A line that tells what a long compilation does; other lines are errors.
_PREFIX, _PROGRESS = "rtcf-compile: ", "compiling "
_END_S = 5.0


class Compiler(Protocol):
    """Runs rtcf-compile."""

    def run(
        self, arguments: Sequence[str], progress: Callable[[str], None]
    ) -> tuple[int, list[str]]:
        """Return the exit code and the errors of a compilation, without their prefix."""


def program(build_tree: Path | None) -> str:
    """Return the path of rtcf-compile in a build tree, or of the installed one."""
    own = build_tree / "bin" / "rtcf-compile" if build_tree else Path("/usr/bin/rtcf-compile")
    found = str(own) if own.is_file() else shutil.which("rtcf-compile")
    if found is None:
        raise rtcf.RtcfError("rtcf-compile not found: sudo apt install rtcf-python")
    return found


class SingleCompiler:
    """Starts rtcf-compile for each compilation."""

    def __init__(self, program: str) -> None:
        """Use the program of this path."""
        self._program = program

    def run(
        self, arguments: Sequence[str], progress: Callable[[str], None]
    ) -> tuple[int, list[str]]:
        """Return the exit code and the errors of a compilation, without their prefix."""
        errors: list[str] = []
        with subprocess.Popen(
            [self._program, *arguments], stdout=DEVNULL, stderr=PIPE, text=True, errors="replace"
        ) as process:
            assert process.stderr is not None
            for line in process.stderr:
                _sort(line, errors, progress)
        return process.returncode, errors


class WarmCompiler:
    """Keeps a worker process of rtcf-compile, which has imported what it needs.

    The worker ends when it was idle for some minutes, and with this process.
    """

    def __init__(self, program: Callable[[], str], version: Callable[[], str]) -> None:
        """Use the program of a path; a worker of another version is replaced."""
        self._program, self._version = program, version
        self._process: subprocess.Popen[str] | None = None
        self._started = ""  # version of the worker

    def __enter__(self) -> "WarmCompiler":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def run(
        self, arguments: Sequence[str], progress: Callable[[str], None]
    ) -> tuple[int, list[str]]:
        """Return the exit code and the errors of a compilation, without their prefix."""
        if self._started != self._version():
            self.end()
        errors: list[str] = []
        # A worker that was idle may end just now.
        for _ in range(2):
            for message in self._answers(arguments):
                if "status" in message:
                    return int(str(message["status"])), errors
                _sort(str(message["line"]), errors, progress)
            self.end()
        return SingleCompiler(self._program()).run(arguments, progress)

    def end(self) -> None:
        """End the worker, if there is one."""
        process, self._process = self._process, None
        if process is None:
            return
        assert process.stdin is not None and process.stdout is not None
        for each in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                each.close()
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _answers(self, arguments: Sequence[str]) -> Iterator[dict[str, object]]:
        """Send a request; yield the answers until the worker ends."""
        if self._process is None:
            self._started = self._version()
            self._process = subprocess.Popen(
                [self._program(), "--worker"], stdin=PIPE, stdout=PIPE, stderr=DEVNULL, text=True
            )
        assert self._process.stdin is not None and self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError, ValueError):
            self._process.stdin.write(json.dumps({"arguments": list(arguments)}) + "\n")
            self._process.stdin.flush()
            for line in self._process.stdout:
                yield json.loads(line)


def _sort(line: str, errors: list[str], progress: Callable[[str], None]) -> None:
    """Pass on a line of progress, or add an error."""
    text = line.rstrip("\n").removeprefix(_PREFIX)
    if text.startswith(_PROGRESS):
        progress(text)
    elif text:
        errors.append(text)
