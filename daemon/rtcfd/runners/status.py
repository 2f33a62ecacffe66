"""The status of a runner, in any state.  Functions on a RunnerCore."""

import asyncio
from collections.abc import Sequence
from typing import Protocol

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import runner_pb2

from rtcfd import VERSION
from rtcfd.common import runner_settings
from rtcfd.common.background import log_failure
from rtcfd.common.errors import RequestError
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.bring_up import advice

_TIMEOUT_S = 2.0
_WORTH_SAYING_S = 2.0  # the status shows a change that takes longer
_NEIGHBOURS_S = 0.5  # longest wait for the statuses of other runners


class _HasStatus(Protocol):
    """An object with a status: a runner."""

    @property
    def name(self) -> str:
        """The name of the runner."""

    async def status(self) -> runner_pb2.RunnerStatus:
        """Return its status."""


async def statuses_of(
    chosen: Sequence[_HasStatus], everybody: Sequence[_HasStatus]
) -> list[runner_pb2.RunnerStatus]:
    """Return the statuses of the chosen runners, each with the loops that share its CPU.

    These loops are searched among `everybody`, without stuck runners: a stuck runner must not
    delay the status of another.
    """
    names = {each.name for each in chosen}
    mine = [asyncio.create_task(each.status()) for each in chosen]
    others = [
        log_failure(asyncio.create_task(each.status()), "a neighbour's status")
        for each in everybody
        if each.name not in names
    ]
    try:
        statuses = await asyncio.gather(*mine)
        if others:
            await asyncio.wait(others, timeout=_NEIGHBOURS_S)
        known = [each.result() for each in others if each.done() and not each.exception()]
    finally:
        for each in (*mine, *others):
            each.cancel()
    note_shared_cpus([*statuses, *known])
    return statuses


def note_shared_cpus(statuses: Sequence[runner_pb2.RunnerStatus]) -> None:
    """Add to each status the other loops on the same CPU."""
    pinned = [status for status in statuses if status.HasField("loop_cpu")]
    for status in pinned:
        for other in pinned:
            if other.loop_cpu == status.loop_cpu and other.runner != status.runner:
                status.shares_cpu_with.add(runner=other.runner, priority=other.settings.priority)


async def status_of(runner: RunnerCore) -> runner_pb2.RunnerStatus:
    """Return the status; asks the executor if there is one."""
    status = runner_pb2.RunnerStatus(runner=runner.name, state=runner_pb2.RUNNER_STATE_DOWN)
    executor = runner.executor
    lines = [runner.down_reason]
    if executor is not None:
        request = wire.Request(get_status=wire.GetStatus())
        try:
            status = (await executor.request(request, _TIMEOUT_S)).status
            lines.append(status.status)
            runner.counters.put_into(status)
        except RequestError as error:
            if executor is runner.executor:
                status.state = runner_pb2.RUNNER_STATE_STUCK
                lines.append(executor.frozen or str(error))
            else:
                lines.append(runner.down_reason)  # it has just died
        status.runner = runner.name
        status.pid = executor.pid if executor is runner.executor else 0
        status.version = executor.version
        if not executor.foreign and (executor.version != VERSION or executor.other_build):
            what = (
                f"another build of rtcf {VERSION}"
                if executor.version == VERSION
                else f"rtcf {executor.version}, rtcfd {VERSION}"
            )
            lines.append(
                f"restart pending: its executor is of {what}; `rtcfctl runner restart "
                f"{runner.name}` stops the loop and starts a new one"
            )
    # The executor does not know all settings.
    status.settings.CopyFrom(runner_settings.merged(runner.settings(), status.settings))
    desired = runner.desired
    status.incident = runner.incident
    rebuilt = await runner.code.changed()
    status.libraries_changed.extend(sorted(set(rebuilt.values())))
    status.chosen.CopyFrom(desired.chosen)
    if desired.hold is not None:
        status.holder, status.hold = desired.hold.holder, desired.hold.token
    if held := runner.loop.held:
        lines.append(held)
        if status.state == runner_pb2.RUNNER_STATE_STOPPED:
            status.state = runner_pb2.RUNNER_STATE_FAULTED
    lines.append(runner.operations.busy(longer_than_s=_WORTH_SAYING_S))
    # The line of a recovery names the cause and the culprit.
    lines += [
        f"{name} is left out: {reason}"
        for name, reason in desired.left_out.items()
        if reason not in held
    ]
    if status.state not in (runner_pb2.RUNNER_STATE_DOWN, runner_pb2.RUNNER_STATE_STUCK):
        lines.append(advice(runner))
    lines += [desired.replaced, runner.saver.problem]
    status.status = "; ".join(line for line in lines if line)
    return status
