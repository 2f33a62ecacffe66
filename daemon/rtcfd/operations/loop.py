"""Starts and stops a runner's loop.  `stop` is final.

Functions on a RunnerCore.  No request from before a stop runs a cycle after it.  The
stop withdraws queued operations.  A running operation checks for a stop before it asks
the executor, and stops the loop again if the stop came in between.
"""

import asyncio

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.access import caller
from rtcfd.common.errors import FailedPrecondition, RequestError, Silent, Unavailable
from rtcfd.executor.executor import Executor
from rtcfd.executor.link import Progress
from rtcfd.operations.runner_core import RunnerCore

STOP_TIMEOUT_S = 30.0
_FROZEN_S = 1.0
_SILENT_S = 3.0  # longer than an executor's own timeout for a component that does not return


def asked_now(runner: RunnerCore) -> int:
    """Return the stop count at the time of the current call's request."""
    if caller.asked_ns() <= runner.loop.stopped_at_ns:
        return -1  # before a direct stop at the executor, as rtcfd did not answer
    return runner.loop.stops


def require_no_stop(runner: RunnerCore, asked: int) -> None:
    """Raise FailedPrecondition if the loop was stopped after the stop count was `asked`."""
    if runner.loop.stops != asked:
        raise FailedPrecondition(
            f"runner {runner.name}: its loop was stopped after this request: repeat the request",
            errors_pb2.REASON_LOOP_STOPPED,
        )


async def start_in_turn(
    runner: RunnerCore, asked: int, progress: Progress | None = None
) -> control_pb2.ChangeResult:
    """Start the loop, in a turn; `asked` is the stop count at the time of the request."""
    require_no_stop(runner, asked)
    if not runner.loop.running:
        await runner.begin_counting(reset=True)
        require_no_stop(runner, asked)
    request = wire.Request(start=wire.Start())
    response = await runner.ask(request, progress, lambda _: runner.loop.note_report(True, asked))
    if runner.loop.stops != asked:
        await _ask_to_stop(runner, None)
        require_no_stop(runner, asked)
    runner.notify_change()
    response.change.notes.extend(await runner.save())
    return response.change


async def stop(runner: RunnerCore, progress: Progress) -> control_pb2.ChangeResult:
    """Stop the loop at the next cycle boundary.  Never queues.

    A loop whose executor is dead counts as stopped.  Raises Unavailable if an executor does not
    confirm the stop; the stop then takes effect when it answers again.
    """
    runner.loop.stop()
    runner.operations.withdraw(
        "the loop was stopped after the request",
        errors_pb2.REASON_LOOP_STOPPED,
        only_cycles=True,
    )

    async def work() -> control_pb2.ChangeResult:
        runner.require_ours()
        # Concurrently: neither a slow disk nor a slow executor must delay the other.
        saving = asyncio.create_task(runner.save())
        try:
            if not runner.up and runner.silent is None:
                await runner.settle()  # its executor may be being adopted
                runner.require_ours()
            if runner.up:
                result = await _stop_at(runner, runner.alive(), progress)
                runner.log.info("loop stopped")
            elif (silent := runner.silent) is not None:
                result = await _stop_silent(runner, silent, progress)
                runner.log.info("loop stopped")
            else:
                result = control_pb2.ChangeResult(notes=[f"no loop to stop: {runner.down_reason}"])
        finally:
            notes = await saving
            runner.notify_change()
        result.notes.extend(notes)
        return result

    return await runner.operations.begin("the stop", work)


async def stop_quietly(runner: RunnerCore) -> None:
    """Stop the loop after the loss of a client; log an error."""
    try:
        await stop(runner, lambda _: None)
    except RequestError as error:
        runner.log.error("%s", error)


async def _stop_at(
    runner: RunnerCore, executor: Executor, progress: Progress
) -> control_pb2.ChangeResult:
    """Make an executor stop its loop.

    The executor's death ends the loop too, unless it may have kept a component from making its
    device safe.
    """
    try:
        # A frozen executor handles the request when it continues.
        hooks_s = max(STOP_TIMEOUT_S, 2 * runner.settings().hook_timeout_s)
        return await _ask_to_stop(runner, progress, _FROZEN_S if executor.frozen else hooks_s)
    except Unavailable as error:
        if frozen := executor.frozen:
            raise Unavailable(frozen, errors_pb2.REASON_EXECUTOR_SILENT) from None
        if not executor.ended.is_set() or not executor.safe:
            raise
        return control_pb2.ChangeResult(notes=[f"the loop has ended with its executor: {error}"])


async def _stop_silent(
    runner: RunnerCore, silent: Silent, progress: Progress
) -> control_pb2.ChangeResult:
    """Stop the loop of an executor that rtcfd could not adopt yet."""
    if await runner.stop_silent(_SILENT_S):
        runner.loop.note_report(False)
        return control_pb2.ChangeResult(
            notes=[f"the loop was stopped at its executor, because {silent}"]
        )
    if runner.up:  # adopted meanwhile
        return await _stop_at(runner, runner.alive(), progress)
    raise Unavailable(
        f"runner {runner.name}: its loop stops when its executor answers again: {silent}",
        errors_pb2.REASON_EXECUTOR_SILENT,
    )


async def stop_adopted(runner: RunnerCore) -> None:
    """Stop the loop of an adopted executor that did not answer when the stop was requested."""
    try:
        await _ask_to_stop(runner, None)
        runner.log.info("loop stopped, as requested while its executor did not answer")
    except RequestError as error:
        runner.log.error("the loop does not stop: %s", error)


async def _ask_to_stop(
    runner: RunnerCore, progress: Progress | None, timeout_s: float = STOP_TIMEOUT_S
) -> control_pb2.ChangeResult:
    request = wire.Request(stop=wire.Stop())
    try:
        response = await runner.ask(
            request, progress, lambda _: runner.loop.note_report(False), timeout_s
        )
    except Unavailable as error:
        if error.reason == errors_pb2.REASON_HOOK_STUCK:
            runner.loop.note_report(False)  # only hooks of its components have not ended
        raise
    return response.change
