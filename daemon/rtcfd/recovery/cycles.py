"""The operations that run cycles of a loop: start, step, replay.  They bring up the executor first
if it is down.

Functions on a RunnerCore.  A stop withdraws all that are queued.
"""

import asyncio
import contextlib
from collections.abc import Callable

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2
from rtcf_shared.naming import listing

from rtcfd.common.errors import NotFound, RequestError
from rtcfd.common.names import absolute
from rtcfd.executor.link import Progress
from rtcfd.operations.loop import asked_now, require_no_stop, start_in_turn
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.bring_up import bring_up, require_whole


async def start(
    runner: RunnerCore, request: control_pb2.StartRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Start the loop.

    Raises FailedPrecondition if a component is left out that is not optional, unless the
    request names it.
    """
    asked = asked_now(runner)

    async def work() -> control_pb2.ChangeResult:
        require_no_stop(runner, asked)
        await _need_executor(runner, progress)
        if not runner.loop.running:
            _require_complete(runner, request)
        result = await start_in_turn(runner, asked, progress)
        runner.log.info("loop started")
        for name, reason in sorted(runner.desired.left_out.items()):
            result.notes.append(f"without {name}: {reason}")
        return result

    return await runner.change("the start", work, runs_cycles=True)


async def step(
    runner: RunnerCore, request: control_pb2.StepRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Run cycles of a stopped loop on a simulated clock.

    Without timeout; ends at a cycle boundary if its caller disconnects.
    """
    asked = asked_now(runner)
    left = asyncio.Event()  # the caller has disconnected

    async def work() -> control_pb2.ChangeResult:
        await _need_executor(runner, progress)
        require_no_stop(runner, asked)
        step = wire.Request(step=control_pb2.StepRequest(cycles=request.cycles))
        ending = asyncio.create_task(_end_step(runner, step, left))
        try:
            result = (await runner.ask(step, progress)).change
        finally:
            ending.cancel()
        runner.log.info("%d cycles stepped", result.cycles)
        return result

    try:
        return await runner.change("stepping", work, timeout_s=None, runs_cycles=True)
    except asyncio.CancelledError:
        left.set()
        raise


async def _end_step(runner: RunnerCore, step: wire.Request, left: asyncio.Event) -> None:
    """End a running step at the next cycle boundary, once its caller has disconnected."""
    await left.wait()
    with contextlib.suppress(RequestError):
        await runner.ask(wire.Request(end_step=wire.EndStep(step=step.id)))


async def replay(
    runner: RunnerCore,
    request: control_pb2.ReplayRequest,
    on_done: Callable[[], None] = lambda: None,
) -> control_pb2.ReplayResponse:
    """Run a piece of a recording through the loop, without timeout.

    `on_done` is called after a success, even if the caller has disconnected.
    """
    asked = asked_now(runner)

    async def work() -> control_pb2.ReplayResponse:
        if request.begin:
            await _need_executor(runner, lambda _: None)
        require_no_stop(runner, asked)
        response = (await runner.ask(wire.Request(replay=request))).replay
        on_done()
        return response

    return await runner.change("a replay", work, timeout_s=None, runs_cycles=True)


def _require_complete(runner: RunnerCore, request: control_pb2.StartRequest) -> None:
    """Raise an error if a component is left out, unless the request allows its absence."""
    without = {absolute(name) for name in request.without}
    if unknown := sorted(without - runner.desired.left_out.keys()):
        raise NotFound(
            f"{unknown[0]} is not left out of runner {runner.name} "
            f"(left out: {listing(runner.desired.left_out)}): "
            f"`rtcfctl -r {runner.name} unload` removes a component",
            errors_pb2.REASON_COMPONENT_NOT_LEFT_OUT,
            component=unknown[0],
        )
    if not request.partial:
        require_whole(runner, without)


async def _need_executor(runner: RunnerCore, progress: Progress) -> None:
    if not runner.up:
        progress("starting the executor")
        await bring_up(runner)
