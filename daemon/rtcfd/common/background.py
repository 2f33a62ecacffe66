"""Work beside the caller: blocking work in threads, and tasks that nobody awaits.

Blocking work is that of the user database, of folders that may be remote, and of files.  Its
threads are daemon threads: one that hangs for ever delays neither the event loop nor the end of
rtcfd.  Each kind of work has its own, so that one that hangs does not block the others.
"""

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from typing import Any, TypeVar

from rtcf.v1 import errors_pb2

from rtcfd.common.errors import Unavailable

Result = TypeVar("Result")

log = logging.getLogger("rtcfd")


class WorkerThreads:
    """A limited number of threads for one kind of work; `name` names it in errors."""

    def __init__(self, name: str, threads: int = 2) -> None:
        self._name = name
        self._places = asyncio.Semaphore(threads)

    async def run(self, work: Callable[[], Result], timeout_s: float) -> Result:
        """Return the result of `work`, or raise its exception; Unavailable after `timeout_s`.

        Work that has timed out keeps its thread until it returns.
        """
        loop = asyncio.get_running_loop()
        done: asyncio.Future[Result] = loop.create_future()

        def finish(result: Result | None, error: BaseException | None) -> None:
            self._places.release()
            if done.done():
                return
            if error is None:
                done.set_result(result)  # type: ignore[arg-type]
            else:
                done.set_exception(error)

        def thread() -> None:
            result, problem = None, None
            try:
                result = work()
            except BaseException as error:
                problem = error
            # RuntimeError: the event loop is closed, rtcfd has ended.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(finish, result, problem)

        try:
            async with asyncio.timeout(timeout_s):
                await self._places.acquire()
                try:
                    threading.Thread(target=thread, name=f"rtcfd-{self._name}", daemon=True).start()
                except BaseException:
                    self._places.release()
                    raise
                return await done
        except TimeoutError:
            raise Unavailable(
                f"no answer from the {self._name} within {timeout_s:g} s",
                errors_pb2.REASON_MACHINE_SILENT,
            ) from None


def log_failure(task: "asyncio.Task[Any]", name: str) -> "asyncio.Task[Any]":
    """Return the task; if it fails, its exception goes to the log under `name`."""

    def look(done: "asyncio.Task[Any]") -> None:
        if not done.cancelled() and (error := done.exception()):
            log.error("internal error: %s ended", name, exc_info=error)

    task.add_done_callback(look)
    return task
