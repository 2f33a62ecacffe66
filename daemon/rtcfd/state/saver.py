"""Saves the desired state of one runner to disk; owned by its RunnerCore.

On rtcfd's one thread; other threads write to the disk.  A save waits at most PATIENCE_S: a
hanging disk is reported, and written when it answers.  Saves that wait are merged into one.
"""

import asyncio
import logging

from rtcfd.state.desired import Desired
from rtcfd.state.disk import Disk

PATIENCE_S = 0.3  # longest wait for the disk before the response has _NOT_YET
_NOT_YET = "not saved yet: the disk of the state folder does not answer"

Log = logging.Logger | logging.LoggerAdapter[logging.Logger]


class Saver:
    """Saves `desired`, the newest state last."""

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
