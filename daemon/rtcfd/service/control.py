"""The gRPC service `rtcf.v1.Control`: requests in, calls on runners, refusals out.

No logic: names and values are checked by what is called.
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
from rtcfd.operations import graph, incidents, inputs, parameters, snapshots
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
    """Serves one connection or many; owned by the daemon."""

    @lasting(control_pb2.ReloadResponse, "result")
    def Reload(self, request: control_pb2.ReloadRequest) -> Any:
        """Read the settings and graphs.d again."""

        async def work(progress: Progress) -> control_pb2.ReloadResult:
            progress("reading the settings")
            notes = await self._daemon.reload()
            return control_pb2.ReloadResult(notes=notes, refused=self._daemon.refused)

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def AddRunner(self, request: control_pb2.AddRunnerRequest) -> Any:
        """A new runner, its executor started."""

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"starting the executor of {request.runner or DEFAULT_RUNNER}")
            runner = await self._runners.add(request.runner, request.settings)
            return await runner.status()

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def SetRunner(self, request: control_pb2.SetRunnerRequest) -> Any:
        """Other settings."""
        runner = self._runners.get(request.runner)

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"changing settings of {runner.name}")
            await runner.set(request.settings)
            return await runner.status()

        return work

    @lasting(control_pb2.RemoveRunnerResponse, "result")
    def RemoveRunner(self, request: control_pb2.RemoveRunnerRequest) -> Any:
        """One runner less."""
        runner = self._named(request.runner, "RemoveRunner")

        async def work(progress: Progress) -> control_pb2.RemoveRunnerResult:
            progress(f"ending the executor of {runner.name}")
            await self._runners.remove(runner.name)
            return control_pb2.RemoveRunnerResult(runner=runner.name)

        return work

    @lasting(control_pb2.RunnerResponse, "runner")
    def RestartRunner(self, request: control_pb2.RestartRunnerRequest) -> Any:
        """A fresh executor."""
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
        """Stop the loop; a caller that names none is told of the others that still run."""
        runner = self._runners.get(request.runner)

        async def work(progress: Progress) -> control_pb2.ChangeResult:
            result = await stop(runner, progress)
            others = [each.name for each in self._runners.all() if each.loop.running]
            if not request.runner and others:
                result.notes.append(
                    f"runs on: {', '.join(others)}; `rtcfctl stop --all` ends all loops"
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
        """Run a recording, for as long as its caller is there."""
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
        """Make the graph what the request says."""
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
        """Take back what was changed last."""
        runner = self._runners.get(request.runner)
        return lambda progress: parameters.undo(runner, request, progress)

    @changing
    def ResetState(self, request: control_pb2.ResetStateRequest) -> Any:
        """Take a component's state back to its initial values."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.reset_state(runner, request, progress)

    @changing
    def SetState(self, request: control_pb2.SetStateRequest) -> Any:
        """Set values of a component's state."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_state(runner, request, progress)

    @changing
    def WritePort(self, request: control_pb2.WritePortRequest) -> Any:
        """Give an input a value."""
        runner = self._runners.get(request.runner)
        return lambda progress: inputs.write(runner, request, progress)

    @answering
    async def TakeSnapshot(self, request: control_pb2.TakeSnapshotRequest) -> Any:
        """All that the next cycle depends on."""
        return await snapshots.take(self._runners.get(request.runner))

    @answering
    async def TakeIncident(self, request: incidents_pb2.TakeIncidentRequest) -> Any:
        """Keep the last cycles now."""
        taken = await incidents.take(self._runners.get(request.runner), request.reason)
        return incidents_pb2.TakeIncidentResponse(incident=taken)

    @answering
    async def DeleteIncidents(self, request: incidents_pb2.DeleteIncidentsRequest) -> Any:
        """Remove files."""
        gone = await self._runners.incidents.remove(request.names)
        return incidents_pb2.DeleteIncidentsResponse(incidents=gone)

    @changing
    def RestoreSnapshot(self, request: control_pb2.RestoreSnapshotRequest) -> Any:
        """Go on from a snapshot."""
        runner = self._runners.get(request.runner)
        return lambda progress: snapshots.restore(runner, request.snapshot, progress)

    @holding
    def HoldRunner(self, request: control_pb2.OpenHold) -> Any:
        """A runner, for as long as the call lasts."""
        outbox = Outbox(control_pb2.HoldRunnerResponse)
        return outbox, Hold(self._runners, request, outbox)

    @holding
    def LeaseComponent(self, request: control_pb2.OpenLease) -> Any:
        """A component, for as long as the call lasts."""
        outbox = Outbox(control_pb2.LeaseComponentResponse)
        return outbox, Lease(self._runners.get(request.runner).leases, request, outbox)

    @answering
    async def ResetStatistics(self, request: control_pb2.ResetStatisticsRequest) -> Any:
        """New figures."""
        runner = self._runners.get(request.runner)
        await runner.settle()
        await runner.begin_figures(reset=True)
        return control_pb2.ResetStatisticsResponse()

    def _named(self, name: str, call: str) -> Runner:
        """Return a runner that a call which destroys something must name."""
        if not name:
            raise InvalidArgument(
                f"{call} takes the name of a runner: the default one is not meant unless it is "
                f"named (runners: {listing(each.name for each in self._runners.all())})",
                errors_pb2.REASON_NAME_MISSING,
                field="runner",
            )
        return self._runners.get(name)
