"""The gRPC service `rtcf.v1.Control`: maps requests to calls on runners, and errors to statuses.

No logic: the called functions check names and values.
"""

from collections.abc import AsyncIterator
from typing import Any

from rtcf.v1 import (
    control_pb2,
    errors_pb2,
    incidents_pb2,
    runner_pb2,
)
from rtcf_shared.naming import listing

from rtcfd.common.names import DEFAULT_RUNNER
from rtcfd.common.refusals import InvalidArgument
from rtcfd.common.status_codes import abort
from rtcfd.executor.link import Progress
from rtcfd.operations import graph, incidents, parameters, snapshots
from rtcfd.operations.loop import stop
from rtcfd.recovery import starting
from rtcfd.runners.held_runners import Hold
from rtcfd.runners.leases import Lease
from rtcfd.runners.outbox import Outbox
from rtcfd.runners.runner import Runner
from rtcfd.service.answers import answering, changing, holding, lasting
from rtcfd.service.looking import Looking
from rtcfd.service.replay import Replay


class Control(Looking):
    """Serves all connections; owned by the daemon."""

    @lasting(control_pb2.ReloadResponse, "result")
    def Reload(self, request: control_pb2.ReloadRequest) -> Any:
        """Reload the settings and graphs.d."""

        async def work(progress: Progress) -> control_pb2.ReloadResult:
            progress("reading the settings")
            notes = await self._daemon.reload()
            return control_pb2.ReloadResult(notes=notes, refused=self._daemon.refused)

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def AddRunner(self, request: control_pb2.AddRunnerRequest) -> Any:
        """Add a runner and start its executor."""

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"starting the executor of {request.runner or DEFAULT_RUNNER}")
            runner = await self._runners.add(request.runner, request.settings)
            return await runner.status()

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def SetRunner(self, request: control_pb2.SetRunnerRequest) -> Any:
        """Change the settings of a runner."""
        runner = self._runners.get(request.runner)

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"changing settings of {runner.name}")
            await runner.set(request.settings)
            return await runner.status()

        return work

    @lasting(control_pb2.RemoveRunnerResponse, "result")
    def RemoveRunner(self, request: control_pb2.RemoveRunnerRequest) -> Any:
        """Remove a runner."""
        runner = self._named(request.runner, "RemoveRunner")

        async def work(progress: Progress) -> control_pb2.RemoveRunnerResult:
            progress(f"ending the executor of {runner.name}")
            await self._runners.remove(runner.name)
            return control_pb2.RemoveRunnerResult(runner=runner.name)

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def RestartRunner(self, request: control_pb2.RestartRunnerRequest) -> Any:
        """Restart the executor of a runner."""
        runner = self._named(request.runner, "RestartRunner")

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"ending the executor of {runner.name}")
            await runner.restart()
            return await runner.status()

        return work

    @changing
    def Start(self, request: control_pb2.StartRequest) -> Any:
        """Start the loop."""
        runner = self._runners.get(request.runner)
        return lambda progress: starting.start(runner, request, progress)

    @changing
    def Stop(self, request: control_pb2.StopRequest) -> Any:
        """Stop the loop; if the request names no runner, the response lists the running loops."""
        runner = self._runners.get(request.runner)

        async def work(progress: Progress) -> control_pb2.ChangeResult:
            result = await stop(runner, progress)
            others = [each.name for each in self._runners.all() if each.loop.running]
            if not request.runner and others:
                result.notes.append(
                    f"still running: {', '.join(others)}; `rtcfctl stop --all` stops all loops"
                )
            return result

        return work

    @changing
    def Step(self, request: control_pb2.StepRequest) -> Any:
        """Run cycles on a simulated clock."""
        runner = self._runners.get(request.runner)
        return lambda progress: starting.step(runner, request.cycles, progress)

    async def Replay(
        self, requests: AsyncIterator[control_pb2.ReplayRequest], context: Any
    ) -> AsyncIterator[control_pb2.ReplayResponse]:
        """Replay a recording while its caller is connected."""
        replay = Replay(self._runners)
        try:
            async for request in requests:
                yield await replay.take(request)
            await replay.end()
        except Exception as error:
            await replay.end()
            await abort(context, error)
        finally:
            replay.lost()

    @changing
    def Load(self, request: control_pb2.LoadRequest) -> Any:
        """Load a component."""
        runner = self._runners.get(request.runner)
        load = graph.load_when_master if request.wait else graph.load
        return lambda progress: load(runner, request.component, progress)

    @changing
    def Unload(self, request: control_pb2.UnloadRequest) -> Any:
        """Unload components."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.unload(runner, list(request.components), progress)

    @changing
    def Replace(self, request: control_pb2.ReplaceRequest) -> Any:
        """Replace a component."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.replace(runner, request, progress)

    @changing
    def Apply(self, request: control_pb2.ApplyRequest) -> Any:
        """Apply a graph."""
        return lambda progress: self._runners.apply(request, progress)

    @changing
    def Release(self, request: control_pb2.ReleaseRequest) -> Any:
        """Load components again."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.release(runner, list(request.components), progress)

    @changing
    def SetBreaks(self, request: control_pb2.SetBreaksRequest) -> Any:
        """Set or remove loop breaks."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_breaks(runner, request, progress)

    @changing
    def SetParameters(self, request: control_pb2.SetParametersRequest) -> Any:
        """Change parameters."""
        runner = self._runners.get(request.runner)
        return lambda progress: parameters.set_parameters(runner, request, progress)

    @changing
    def UndoParameters(self, request: control_pb2.UndoParametersRequest) -> Any:
        """Undo the last change of parameters."""
        runner = self._runners.get(request.runner)
        return lambda progress: parameters.undo(runner, request, progress)

    @changing
    def ResetState(self, request: control_pb2.ResetStateRequest) -> Any:
        """Reset a component's state to its initial values."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.reset_state(runner, request, progress)

    @changing
    def SetState(self, request: control_pb2.SetStateRequest) -> Any:
        """Set values of a component's state."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_state(runner, request, progress)

    @changing
    def WritePort(self, request: control_pb2.WritePortRequest) -> Any:
        """Write a value to an input."""
        runner = self._runners.get(request.runner)
        return lambda progress: parameters.write_input(runner, request, progress)

    @answering
    async def TakeSnapshot(self, request: control_pb2.TakeSnapshotRequest) -> Any:
        """Take a snapshot of a runner."""
        return await snapshots.take(self._runners.get(request.runner))

    @answering
    async def TakeIncident(self, request: incidents_pb2.TakeIncidentRequest) -> Any:
        """Write an incident with the last cycles now."""
        taken = await incidents.take(self._runners.get(request.runner), request.reason)
        return incidents_pb2.TakeIncidentResponse(incident=taken)

    @answering
    async def DeleteIncidents(self, request: incidents_pb2.DeleteIncidentsRequest) -> Any:
        """Remove incident files."""
        gone = await self._runners.incidents.remove(request.names)
        return incidents_pb2.DeleteIncidentsResponse(incidents=gone)

    @changing
    def RestoreSnapshot(self, request: control_pb2.RestoreSnapshotRequest) -> Any:
        """Restore a snapshot."""
        runner = self._runners.get(request.runner)
        return lambda progress: snapshots.restore(runner, request.snapshot, progress)

    @holding
    def HoldRunner(self, request: control_pb2.OpenHold) -> Any:
        """Hold a runner while the call lasts."""
        outbox = Outbox(control_pb2.HoldRunnerResponse)
        return outbox, Hold(self._runners, request, outbox)

    @holding
    def LeaseComponent(self, request: control_pb2.OpenLease) -> Any:
        """Lease a component while the call lasts."""
        outbox = Outbox(control_pb2.LeaseComponentResponse)
        return outbox, Lease(self._runners.get(request.runner).leases, request, outbox)

    @answering
    async def ResetStatistics(self, request: control_pb2.ResetStatisticsRequest) -> Any:
        """Reset the statistics."""
        runner = self._runners.get(request.runner)
        await runner.settle()
        await runner.begin_figures(reset=True)
        return control_pb2.ResetStatisticsResponse()

    def _named(self, name: str, call: str) -> Runner:
        """Return the runner of a destructive call, which must name it."""
        if not name:
            raise InvalidArgument(
                f"{call} requires the name of a runner, even of the default one "
                f"(runners: {listing(each.name for each in self._runners.all())})",
                errors_pb2.REASON_NAME_MISSING,
                field="runner",
            )
        return self._runners.get(name)
