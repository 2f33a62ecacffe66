"""Changes of one runner take turns: one at a time, in the order they came.

Each runs in a task of its own, so that a caller that leaves or runs out of
time does not tear a change in two: what the executor adopts is always noted.
"""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from rtcfd.common.refusals import Refusal, Unavailable

Result = TypeVar("Result")


class Queue:
    """The queue of one runner's changes."""

    def __init__(self, runner: str, log: "logging.LoggerAdapter[logging.Logger]") -> None:
        self._runner = runner
        self._log = log
        self._lock = asyncio.Lock()
        self._current = ""
        self._since = 0.0
        self._tasks: set[asyncio.Task[Any]] = set()

    async def take(
        self, what: str, work: Callable[[], Awaitable[Result]], timeout_s: float | None
    ) -> Result:
        """Do `work` when it is its turn; `timeout_s` counts from now, on the wall clock (None:
        no limit)."""
        task = asyncio.create_task(self._run(what, work))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        try:
            done, _ = await asyncio.wait({task}, timeout=timeout_s)
        except asyncio.CancelledError:
            task.add_done_callback(lambda task: self._report_late(what, task))
            raise
        if not done:
            task.add_done_callback(lambda task: self._report_late(what, task))
            raise Unavailable(
                f"runner {self._runner}: {what} is not done after {timeout_s:g} s "
                f"({self.busy() or 'waiting'}); it may still be adopted: see `rtcfctl status`"
            )
        return task.result()

    def busy(self, longer_than_s: float = 0.0) -> str:
        """Return what is going on for how long, or nothing."""
        taken_s = time.monotonic() - self._since
        if not self._current or taken_s <= longer_than_s:
            return ""
        return f"busy with {self._current} for {taken_s:.0f} s"

    async def drain(self) -> None:
        """Wait until no change is left; the executor must have ended."""
        if self._tasks:
            await asyncio.wait(self._tasks)

    async def _run(self, what: str, work: Callable[[], Awaitable[Result]]) -> Result:
        async with self._lock:
            self._current, self._since = what, time.monotonic()
            try:
                return await work()
            finally:
                self._current = ""

    def _report_late(self, what: str, task: "asyncio.Task[Any]") -> None:
        if task.cancelled():
            return
        error = task.exception()
        if error is None:
            self._log.info("%s is done; its caller had left", what)
        elif isinstance(error, Refusal):
            self._log.warning("%s failed after its caller had left: %s", what, error)
        else:
            self._log.error("%s failed after its caller had left", what, exc_info=error)
