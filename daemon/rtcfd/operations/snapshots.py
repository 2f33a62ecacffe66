"""Snapshots of a runner: the executor takes and restores them, rtcfd passes them on unparsed.

Functions on a RunnerCore.  Parameters that a snapshot changes are noted as if they had
been set.
"""

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2

from rtcfd.access import caller
from rtcfd.executor.link import Progress
from rtcfd.operations import parameters
from rtcfd.operations.loop import asked_now, require_no_stop
from rtcfd.operations.runner_core import RunnerCore


async def take(runner: RunnerCore) -> control_pb2.TakeSnapshotResponse:
    """Take a snapshot at a cycle boundary."""

    async def work() -> wire.Snapshot:
        return (await runner.ask(wire.Request(take_snapshot=wire.TakeSnapshot()))).snapshot

    taken = await runner.change("a snapshot", work)
    return control_pb2.TakeSnapshotResponse(
        snapshot=taken.snapshot, iteration=taken.iteration, notes=taken.notes
    )


async def restore(
    runner: RunnerCore, request: control_pb2.RestoreSnapshotRequest, progress: Progress
) -> control_pb2.ChangeResult:
    """Restore a snapshot at a cycle boundary; a loop that does not run is paused then."""
    asked = asked_now(runner)
    acting = caller.current()

    async def work() -> control_pb2.ChangeResult:
        require_no_stop(runner, asked)
        before = await _parameters(runner)
        restored = wire.RestoreSnapshot(snapshot=request.snapshot)
        result = (await runner.ask(wire.Request(restore_snapshot=restored), progress)).change
        for component, now in (await _parameters(runner)).items():
            old = before.get(component, {})
            changes = [each for name, each in now.items() if old.get(name) != each]
            if changes:
                runner.desired.set_parameters(component, changes)
                values = {name: each.value for name, each in old.items()}
                parameters.note(runner, component, changes, values, acting, "restore")
        result.notes.extend(await runner.save())
        return result

    result = await runner.change("the restoration of a snapshot", work, runs_cycles=True)
    runner.log.info("snapshot restored")
    return result


async def _parameters(
    runner: RunnerCore,
) -> dict[str, dict[str, graph_pb2.ParameterSetting]]:
    request = wire.Request(list_components=wire.ListComponents())
    found = (await runner.ask(request)).components.components
    return {
        component.full_name: {
            each.name: graph_pb2.ParameterSetting(name=each.name, value=each.value)
            for each in component.parameters
        }
        for component in found
    }
