"""Operations on one subject (a runner, or all of them), one after the other.

A queued operation can be withdrawn, and is when its caller disconnects or its timeout
passes.  A running operation runs to its end in a task that rtcfd owns, even without its
caller.  Its own work notes the result; if no caller waits any more, the log has it too.
On rtcfd's one thread.
"""

import asyncio
import contextvars
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from rtcf.v1 import errors_pb2

from rtcfd.common.errors import FailedPrecondition, RequestError, Unavailable

Result = TypeVar("Result")
Log = logging.Logger | logging.LoggerAdapter[logging.Logger]


@dataclass(eq=False)
class _Operation(Generic[Result]):
    name: str
    work: Callable[[], Awaitable[Result]]
    done: "asyncio.Future[Result]"
    runs_cycles: bool = False
    # The context of the caller, to which the work is attributed when its turn comes.
    context: contextvars.Context = field(default_factory=contextvars.copy_context)


class Operations:
    """The operations on `subject`."""

    def __init__(self, subject: str, log: Log) -> None:
        self._subject = subject
        self._log = log
        self._queue: deque[_Operation[Any]] = deque()
        self._current: _Operation[Any] | None = None  # has the turn
        self._since = 0.0
        self._tasks: set[asyncio.Task[None]] = set()

    async def take_turn(
        self,
        name: str,
        work: Callable[[], Awaitable[Result]],
        timeout_s: float | None,
        runs_cycles: bool = False,
    ) -> Result:
        """Run `work` in its turn: one at a time, in the order of the calls.

        `name` is for messages.  `timeout_s` counts from now, on the wall clock (None: no limit).
        Raises Unavailable after it.
        """
        operation = self._new(name, work, runs_cycles)
        self._queue.append(operation)
        self._next()
        try:
            done, _ = await asyncio.wait({operation.done}, timeout=timeout_s)
        except asyncio.CancelledError:
            if not self._withdraw(operation):
                self._report_late(operation)
            raise
        if done:
            return operation.done.result()
        how = f"after {timeout_s:g} s ({self.busy() or 'waiting'})"
        if self._withdraw(operation):
            raise Unavailable(
                f"{self._subject}: {name} was withdrawn, as it had not begun {how}: "
                "see `rtcfctl status`",
                errors_pb2.REASON_BUSY,
            )
        self._report_late(operation)
        raise Unavailable(
            f"{self._subject}: {name} is still running {how}: see `rtcfctl status`",
            errors_pb2.REASON_BUSY,
        )

    async def begin(self, name: str, work: Callable[[], Awaitable[Result]]) -> Result:
        """Run `work` at once, beside others."""
        operation = self._new(name, work)
        self._spawn(self._do(operation))
        try:
            await asyncio.wait({operation.done})
        except asyncio.CancelledError:
            self._report_late(operation)
            raise
        return operation.done.result()

    def in_background(self, name: str, work: Coroutine[Any, Any, object]) -> "asyncio.Task[None]":
        """Run `work` at once, without a waiting caller; log its errors."""

        async def run() -> None:
            try:
                await work
            except RequestError as error:
                self._log.error("%s: %s", name, error)
            except Exception:
                self._log.exception("%s failed", name)

        return self._spawn(run())

    def withdraw(self, cause: str, reason: errors_pb2.Reason, only_cycles: bool = False) -> None:
        """Withdraw the queued operations: all, or only those that would run cycles of a loop."""
        for operation in list(self._queue):
            if operation.runs_cycles or not only_cycles:
                self._queue.remove(operation)
                operation.done.set_exception(
                    FailedPrecondition(
                        f"{self._subject}: {operation.name} is withdrawn: {cause}", reason
                    )
                )

    def busy(self, longer_than_s: float = 0.0) -> str:
        """Return the current operation and its duration, or an empty string."""
        taken_s = time.monotonic() - self._since
        if self._current is None or taken_s <= longer_than_s:
            return ""
        return f"busy with {self._current.name} for {taken_s:.0f} s"

    async def wait_for_current(self, timeout_s: float) -> None:
        """Wait until the operation that has the turn has ended, at most `timeout_s`."""
        if self._current is not None:
            await asyncio.wait({self._current.done}, timeout=timeout_s)

    async def drain(self) -> None:
        """Wait until all operations have ended, including those that they begin."""
        while self._tasks:
            await asyncio.wait(self._tasks)

    def _new(
        self, name: str, work: Callable[[], Awaitable[Result]], runs_cycles: bool = False
    ) -> _Operation[Result]:
        return _Operation(name, work, asyncio.get_running_loop().create_future(), runs_cycles)

    def _next(self) -> None:
        if self._current is None and self._queue:
            self._current, self._since = self._queue.popleft(), time.monotonic()
            self._spawn(self._do(self._current), self._current.context)

    async def _do(self, operation: _Operation[Any]) -> None:
        try:
            result = await operation.work()
        except Exception as error:
            operation.done.set_exception(error)
        except BaseException:  # cancelled: rtcfd ends
            operation.done.cancel()
            raise
        else:
            operation.done.set_result(result)
        finally:
            if operation is self._current:
                self._current = None
                self._next()

    def _withdraw(self, operation: _Operation[Any]) -> bool:
        if operation not in self._queue:
            return False
        self._queue.remove(operation)
        operation.done.cancel()
        return True

    def _spawn(
        self, work: Coroutine[Any, Any, None], context: contextvars.Context | None = None
    ) -> "asyncio.Task[None]":
        task = asyncio.create_task(work, context=context)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def _report_late(self, operation: _Operation[Any]) -> None:
        def report(done: "asyncio.Future[Any]") -> None:
            if done.cancelled():
                return
            error = done.exception()
            if error is None:
                self._log.info("%s is done; its caller had disconnected", operation.name)
            elif isinstance(error, RequestError):
                self._log.warning(
                    "%s failed after its caller had disconnected: %s", operation.name, error
                )
            else:
                self._log.error(
                    "%s failed after its caller had disconnected", operation.name, exc_info=error
                )

        operation.done.add_done_callback(report)
