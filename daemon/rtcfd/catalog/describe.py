"""Describes component libraries, each in a throw-away process.

Loading a library runs foreign code.  In a process of its own, that code can crash
neither rtcfd nor a loop: the crash becomes an error.
"""

import asyncio
import contextlib
import os
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

from google.protobuf.message import DecodeError
from rtcf.executor.v1 import executor_pb2 as wire

from rtcfd.common import regular_files
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import RequestError
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.watched_process import describe_exit

TIMEOUT_S = 10.0
FAILURE_KEPT_S = 5.0
_AT_ONCE = 2
_MAX_STDERR_LINE = 300
# Bytes of the output of a process that describes.
_LONGEST_ANSWER = 4 * 1024 * 1024
_LONGEST_STDERR = 64 * 1024
_CHUNK = 64 * 1024
_OOM_SCORE = "500"  # proc(5): if memory runs out, the kernel kills this process before a loop

_File = tuple[str, int | None]  # path, and the uid whose libraries are trusted
_Identity = tuple[int, ...]  # inode, modification time, size, mode, owner, group
# Signals of a crash that the library itself causes.  SIGKILL and SIGBUS may mean a lack of memory.
_CRASHES = (signal.SIGSEGV, signal.SIGILL, signal.SIGFPE, signal.SIGABRT, signal.SIGTRAP,
            signal.SIGSYS)  # fmt: skip


class _Failed(Exception):
    """Describing failed; `own`: because of the library itself, not of its environment."""

    def __init__(self, problem: str, own: bool = False) -> None:
        super().__init__(problem)
        self.own = own


@dataclass
class _Known:
    """A cached description of one version of a file."""

    identity: _Identity
    description: wire.LibraryDescription
    lasting: bool  # valid until the file changes
    since: float = field(default_factory=time.monotonic)

    def valid(self, identity: _Identity) -> bool:
        """Return whether the description still holds.

        A library that does not load may load later, when its dependencies are installed.
        One that crashes will crash again.
        """
        if identity != self.identity:
            return False
        return self.lasting or time.monotonic() - self.since < FAILURE_KEPT_S


@dataclass
class Describer:
    """Describes libraries, and caches each description until the file changes."""

    binary: Path

    def __post_init__(self) -> None:
        self._known: dict[_File, _Known] = {}
        self._running: dict[tuple[_File, _Identity], asyncio.Task[wire.LibraryDescription]] = {}
        self._threads = WorkerThreads("folders of components")
        self._slots = asyncio.Semaphore(_AT_ONCE)

    @property
    def kept(self) -> list[str]:
        """The paths of the libraries in the cache."""
        return [path for path, _ in self._known]

    def forget_failures(self) -> None:
        """Remove all failures from the cache."""
        failed = [file for file, known in self._known.items() if known.description.problem]
        for file in failed:
            del self._known[file]

    async def describe(
        self, library: Path, package: str, owner: int | None = None
    ) -> wire.LibraryDescription:
        """Return the description; if there is none, its field `problem` has the reason.

        `owner` is a uid whose libraries are trusted besides root's and our own.
        """
        try:
            found = await self._threads.run(library.stat, TIMEOUT_S)
            # Loading a FIFO would wait for its other end.
            regular_files.require_regular(library, found)
        except OSError as error:
            return _problem(f"cannot read it: {error.strerror}")
        except RequestError as error:
            return _problem(str(error))
        file = (str(library), owner)
        identity = (
            *(found.st_ino, found.st_mtime_ns, found.st_size),
            *(found.st_mode, found.st_uid, found.st_gid),
        )
        known = self._known.get(file)
        if known is not None and known.valid(identity):
            return known.description
        # Concurrent calls for one file share one process; a cancelled call does not end it.
        key = (file, identity)
        running = self._running.get(key)
        if running is None:
            finding = self._find(file, identity, package)
            running = self._running[key] = asyncio.create_task(finding)
            running.add_done_callback(lambda _: self._running.pop(key, None))
        return await asyncio.shield(running)

    async def _find(
        self, file: _File, identity: _Identity, package: str
    ) -> wire.LibraryDescription:
        path, owner = file
        async with self._slots:
            try:
                description = await self._run(Path(path), package, owner)
                lasting = not description.problem
            except _Failed as failure:
                description, lasting = _problem(str(failure)), failure.own
        self._known[file] = _Known(identity, description, lasting)
        return description

    async def _run(self, library: Path, package: str, owner: int | None) -> wire.LibraryDescription:
        try:
            process = await asyncio.create_subprocess_exec(
                self.binary,
                "--describe",
                library,
                "--package",
                package,
                *(() if owner is None else ("--trust", str(owner))),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
                env=ExecutorCommand.environment(),
                start_new_session=True,
            )
        except OSError as error:
            raise _Failed(f"cannot run {self.binary}: {error.strerror}") from None
        with contextlib.suppress(OSError):  # it has ended already
            Path(f"/proc/{process.pid}/oom_score_adj").write_text(_OOM_SCORE)
        reading = asyncio.gather(
            _until_end(process, process.stdout, _LONGEST_ANSWER),
            _until_end(process, process.stderr, _LONGEST_STDERR),
        )
        try:
            async with asyncio.timeout(TIMEOUT_S):
                output, stderr = await asyncio.shield(reading)
                await process.wait()
        except TimeoutError:
            raise _Failed(f"loading it did not end within {TIMEOUT_S:g} s") from None
        finally:
            _end(process)
            await process.wait()
        if len(output) > _LONGEST_ANSWER or len(stderr) > _LONGEST_STDERR:
            raise _Failed("the process that loaded it wrote without end", own=True)
        status = process.returncode or 0
        if status < 0:
            raise _Failed(
                f"the process that loaded it {describe_exit(status)}", own=-status in _CRASHES
            )
        try:
            description: wire.LibraryDescription = wire.LibraryDescription.FromString(output)
        except DecodeError:
            raise _Failed("the process that loaded it wrote no valid description") from None
        if status and not description.problem:
            raise _Failed(f"the process that loaded it {describe_exit(status)}{_last_line(stderr)}")
        return description


async def _until_end(
    process: asyncio.subprocess.Process, pipe: asyncio.StreamReader | None, longest: int
) -> bytes:
    """Return a process's output from a pipe; kill it if it writes more than `longest` bytes."""
    assert pipe is not None
    data = b""
    # Read even too long output to its end: asyncio's wait() for the process needs closed pipes.
    while more := await pipe.read(_CHUNK):
        if len(data) <= longest:
            data += more
            if len(data) > longest:
                _end(process)
    return data


def _end(process: asyncio.subprocess.Process) -> None:
    """Kill a process and its children, which are in its own session."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def _problem(text: str) -> wire.LibraryDescription:
    return wire.LibraryDescription(problem=text)


def _last_line(output: bytes) -> str:
    lines = output.decode(errors="replace").strip().splitlines()
    return f": {lines[-1][:_MAX_STDERR_LINE]}" if lines else ""
