"""What runs cycles of a loop: start, steps, replay.  An executor that is down is brought back
first.

Functions on a RunnerCore.  All that waits here is withdrawn by a stop.
"""

from collections.abc import Callable

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2

from rtcfd.executor.link import Progress
from rtcfd.operations.loop import asked_now, require_no_stop, start_in_turn
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.bring_up import bring_up


async def start(runner: RunnerCore, progress: Progress) -> control_pb2.ChangeResult:
    """Start the loop."""
    asked = asked_now(runner)

    async def work() -> control_pb2.ChangeResult:
        require_no_stop(runner, asked)
        await _need_executor(runner, progress)
        result = await start_in_turn(runner, asked, progress)
        runner.log.info("loop started")
        return result

    return await runner.change("the start", work, runs_cycles=True)


async def step(runner: RunnerCore, cycles: int, progress: Progress) -> control_pb2.ChangeResult:
    """Run cycles of a stopped loop on a simulated clock; takes as long as they take."""
    asked = asked_now(runner)

    async def work() -> control_pb2.ChangeResult:
        await _need_executor(runner, progress)
        require_no_stop(runner, asked)
        request = wire.Request(step=control_pb2.StepRequest(cycles=cycles))
        result = (await runner.ask(request, progress)).change
        runner.log.info("%d cycles stepped", cycles)
        return result

    return await runner.change("stepping", work, timeout_s=None, runs_cycles=True)


async def replay(
    runner: RunnerCore,
    request: control_pb2.ReplayRequest,
    on_done: Callable[[], None] = lambda: None,
) -> control_pb2.ReplayResponse:
    """Run a piece of a recording through the loop; takes as long as its cycles take.

    `on_done` is called when that was not refused, also if nobody waits any more.
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


async def _need_executor(runner: RunnerCore, progress: Progress) -> None:
    if not runner.up:
        progress("starting the executor")
        await bring_up(runner)
