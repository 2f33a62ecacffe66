"""Saves the desired states of runners to disk, in threads.

A disk may hang for ever.  The event loop never waits for it: each work is a task, and the caller
decides how long to wait for it.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor

from rtcfd.state.desired import Desired
from rtcfd.state.store import Store

PATIENCE_S = 0.3  # longest wait for the disk before the response has _NOT_YET
_NOT_YET = "not saved yet: the disk of the state folder does not answer"

_THREADS = 4

Log = logging.Logger | logging.LoggerAdapter[logging.Logger]


class Disk:
    """Runs the work of a store in threads, in order for each runner; shared by all runners."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._threads = ThreadPoolExecutor(_THREADS, "rtcfd-store")
        # Stops are noted on another file system, which may answer if that of the state hangs.
        self._notes = ThreadPoolExecutor(1, "rtcfd-stops")
        self._last: dict[str, asyncio.Task[str]] = {}  # by runner

    def in_turn(self, runner: str, work: Callable[[], Awaitable[str]]) -> "asyncio.Task[str]":
        """Begin `work` when all earlier work on this runner is done."""
        before = self._last.get(runner)

        async def turn() -> str:
            if before is not None:
                await asyncio.wait({before})
            return await work()

        task = self._last[runner] = asyncio.create_task(turn())

        def forget(done: "asyncio.Task[str]") -> None:
            if self._last.get(runner) is done:
                del self._last[runner]

        task.add_done_callback(forget)
        return task

    async def do(self, work: Callable[..., None], *arguments: object) -> None:
        """Run a function of the store in a thread; raises OSError."""
        await asyncio.get_running_loop().run_in_executor(self._threads, work, *arguments)

    async def note_stop(self, runner: str) -> None:
        """Note a stop outside of the state folder; see Store.note_stop().  Raises no OSError."""
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(self._notes, self.store.note_stop, runner)


class Saver:
    """Saves `desired`, the state of one runner; owned by its RunnerCore.

    On rtcfd's one thread.  A save waits at most PATIENCE_S: a hanging disk is reported, and written
    when it answers.  Saves that wait are merged into one.
    """

    def __init__(self, desired: Desired, disk: Disk, log: Log) -> None:
        self.problem = ""  # why the disk has an older state
        self._desired = desired
        self._disk = disk
        self._log = log
        self._next: asyncio.Task[str] | None = None  # waits; will save the state of its begin
        self._last: asyncio.Task[str] | None = None
        self._noting: asyncio.Task[None] | None = None
        self._forgotten = False

    def begin(self) -> "asyncio.Task[str]":
        """Begin to save the desired state; the task returns the error, or an empty string."""
        if self._next is None:
            self._next = self._last = self._disk.in_turn(self._desired.runner, self._write)
        return self._next

    async def save(self) -> list[str]:
        """Save; return a note if the state is not on disk (yet).  The change itself stands."""
        saving = self.begin()
        if not await self._in_time(saving, PATIENCE_S):
            self.problem = _NOT_YET
            self._log.error("its state is %s", self.problem)
            return [self.problem]
        return [problem] if (problem := saving.result()) else []

    async def forget(self) -> None:
        """Remove the state from disk, permanently; later saves do nothing."""
        self._forgotten = True
        self._last = self._disk.in_turn(self._desired.runner, self._remove)
        if not await self._in_time(self._last, PATIENCE_S):
            self._log.error("its state stays on disk until the disk answers")

    async def finish(self, timeout_s: float) -> None:
        """Wait until the last save is done, at most `timeout_s`."""
        if self._last is not None and not await self._in_time(self._last, timeout_s):
            self._log.error("its state is %s", _NOT_YET)

    async def _in_time(self, task: "asyncio.Task[str]", timeout_s: float) -> bool:
        done, _ = await asyncio.wait({task}, timeout=timeout_s)
        if not done and (self._forgotten or not self._desired.running):
            # The next rtcfd must know of the stop before it starts loops.
            self._noting = asyncio.create_task(self._disk.note_stop(self._desired.runner))
            await asyncio.wait({self._noting}, timeout=PATIENCE_S)
        return bool(done)

    async def _write(self) -> str:
        self._next = None
        if self._forgotten:
            return ""
        if self._noting is not None:
            # Otherwise the note could be written after forget_stop() below.
            await asyncio.wait({self._noting})
        store, runner = self._disk.store, self._desired.runner
        text, running = store.text(self._desired), self._desired.running
        changes, anew = self._desired.history.to_write()
        try:
            await self._disk.do(store.save, runner, text, running)
            if self._next is None:  # else a newer state waits, which may be a stop
                await self._disk.do(store.forget_stop, runner)
            await self._disk.do(store.save_history, runner, changes, anew)
        except OSError as error:
            self._desired.history.not_written()
            self.problem = f"not saved: {error.strerror}"
            self._log.error("its state is %s", self.problem)
            return self.problem
        if self._next is None:
            self.problem = ""
        return ""

    async def _remove(self) -> str:
        try:
            await self._disk.do(self._disk.store.remove, self._desired.runner)
        except OSError as error:
            self._log.error("its state stays on disk: %s", error.strerror)
            await self._disk.note_stop(self._desired.runner)
            return f"not removed: {error.strerror}"
        return ""
