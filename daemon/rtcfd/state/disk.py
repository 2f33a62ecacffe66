"""The threads that write the state folder; owned by the objects that all runners share.

A disk may hang for ever.  The event loop never waits for it: each work is a task, and the caller
decides how long to wait for it.
"""

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor

from rtcfd.state.store import Store

_THREADS = 4


class Disk:
    """Runs the work of a store in threads; in order for each runner."""

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
