"""The gRPC service `rtcf.v1.Control`: requests in, calls on runners, refusals out.

No logic: names and values are checked by what is called.
"""

import asyncio
import os
import time
from collections.abc import AsyncIterator
from functools import partial
from typing import Any, Protocol

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import (
    control_pb2,
    control_pb2_grpc,
    errors_pb2,
    graph_pb2,
    incidents_pb2,
    ports_pb2,
    runner_pb2,
)
from rtcf_shared.naming import listing

from rtcfd import VERSION
from rtcfd.catalog.catalog import Catalog
from rtcfd.common.event_log import EventLog
from rtcfd.common.names import DEFAULT_RUNNER, absolute
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
from rtcfd.runners.runners import Runners
from rtcfd.runners.status import statuses_of
from rtcfd.service.answers import answering, changing, holding, lasting
from rtcfd.service.pages import page
from rtcfd.service.ports import watch_ports
from rtcfd.service.replay import Replay
from rtcfd.service.watching import watch, watch_logs

_WATCH_MS = 1000
_SHORTEST_WATCH_MS = 100

_STATUS = 4096  # bytes of a runner's status, about


class Daemon(Protocol):
    """What the daemon itself does for its clients."""

    @property
    def refused(self) -> list[str]:
        """What of graphs.d is not applied, a line each."""

    def notes(self) -> list[str]:
        """Return what is to be said about rtcfd itself, a line each."""

    async def reload(self) -> list[str]:
        """Read settings and graphs.d again; return a line for each thing that has changed."""


class Control(control_pb2_grpc.ControlServicer):
    """Serves one connection or many; owned by the daemon."""

    def __init__(
        self, runners: Runners, catalog: Catalog, daemon: Daemon, events: EventLog
    ) -> None:
        self._events = events
        self._runners = runners
        self._catalog = catalog
        self._daemon = daemon
        self._begin_ns = time.monotonic_ns()

    @answering
    async def GetStatus(self, request: control_pb2.GetStatusRequest) -> Any:
        """All runners, or one."""
        chosen = [self._runners.get(request.runner)] if request.runner else self._runners.all()
        return control_pb2.GetStatusResponse(
            version=VERSION,
            pid=os.getpid(),
            uptime_ns=time.monotonic_ns() - self._begin_ns,
            runners=await statuses_of(chosen, self._runners.all()),
            notes=self._daemon.notes(),
        )

    @answering
    async def ListRunners(self, request: control_pb2.ListRunnersRequest) -> Any:
        """All runners, in pages."""
        chosen, token = page(self._runners.all(), request, lambda each: str(each.name), _STATUS)
        runners = await statuses_of(chosen, self._runners.all())
        return control_pb2.ListRunnersResponse(runners=runners, next_page_token=token)

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
        return lambda progress: starting.start(runner, progress)

    @changing
    def Stop(self, request: control_pb2.StopRequest) -> Any:
        """Stop the loop."""
        runner = self._runners.get(request.runner)
        return lambda progress: stop(runner, progress)

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

    @answering
    async def GetHistory(self, request: control_pb2.GetHistoryRequest) -> Any:
        """Who set what when."""
        return parameters.history(self._runners.get(request.runner), request)

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
    async def ListIncidents(self, request: incidents_pb2.ListIncidentsRequest) -> Any:
        """Files with the last cycles before faults."""
        found = await self._runners.incidents.all(request.runner)
        chosen, token = page(found, request, lambda each: str(each.name))
        return incidents_pb2.ListIncidentsResponse(incidents=chosen, next_page_token=token)

    @answering
    async def TakeIncident(self, request: incidents_pb2.TakeIncidentRequest) -> Any:
        """Keep the last cycles now."""
        taken = await incidents.take(self._runners.get(request.runner), request.reason)
        return incidents_pb2.TakeIncidentResponse(incident=taken)

    async def ReadIncident(
        self, request: incidents_pb2.ReadIncidentRequest, context: Any
    ) -> AsyncIterator[incidents_pb2.ReadIncidentResponse]:
        """The file, piece by piece."""
        try:
            kept = self._runners.incidents
            found = await kept.get(request.name)
            yield incidents_pb2.ReadIncidentResponse(incident=found)
            at = 0
            while piece := await kept.read(found, at):
                at += len(piece)
                yield incidents_pb2.ReadIncidentResponse(data=piece)
        except Exception as error:
            await abort(context, error, request)

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
    async def ListComponents(self, request: control_pb2.ListComponentsRequest) -> Any:
        """All components, in order of the schedule; then those that are left out."""
        components = await self._components(request.runner)
        runner = self._runners.get(request.runner)
        found = components + graph.left_out(runner)
        rebuilt = await runner.code.changed()
        for info in found:
            info.library_changed = info.full_name in rebuilt
            _add_holder(runner, info)
        chosen, token = page(found, request, lambda each: str(each.full_name))
        return control_pb2.ListComponentsResponse(components=chosen, next_page_token=token)

    @answering
    async def GetComponent(self, request: control_pb2.GetComponentRequest) -> Any:
        """One component, with values."""
        name = absolute(request.component)
        query = control_pb2.GetComponentRequest(runner=request.runner, component=name)
        runner = self._runners.get(request.runner)
        for info in graph.left_out(runner):
            if info.full_name == name:
                return control_pb2.GetComponentResponse(component=_add_holder(runner, info))
        found = await runner.query(wire.Request(get_component=query))
        rebuilt = await runner.code.changed()
        found.component.library_changed = name in rebuilt
        return control_pb2.GetComponentResponse(component=_add_holder(runner, found.component))

    @answering
    async def GetOrder(self, request: control_pb2.GetOrderRequest) -> Any:
        """The schedule."""
        components = await self._components(request.runner)
        names = [str(component.full_name) for component in components]
        chosen, token = page(names, request, str)
        return control_pb2.GetOrderResponse(components=chosen, next_page_token=token)

    @answering
    async def ListConnections(self, request: control_pb2.ListConnectionsRequest) -> Any:
        """All connections, by name."""
        query = wire.Request(list_connections=wire.ListConnections())
        response = await self._runners.get(request.runner).query(query)
        found = sorted(response.connections.connections, key=lambda each: str(each.name))
        chosen, token = page(found, request, lambda each: str(each.name))
        return control_pb2.ListConnectionsResponse(connections=chosen, next_page_token=token)

    @answering
    async def ListTypes(self, request: control_pb2.ListTypesRequest) -> Any:
        """What can be loaded."""
        types, problems = await self._catalog.types(request.package)
        chosen, token = page(types, request, lambda each: f"{each.package}/{each.type}")
        return control_pb2.ListTypesResponse(
            types=chosen, problems=[] if request.page_token else problems, next_page_token=token
        )

    @answering
    async def GetStatistics(self, request: control_pb2.GetStatisticsRequest) -> Any:
        """The figures."""
        statistics = await self._statistics(request.runner, request.buckets)
        return control_pb2.GetStatisticsResponse(statistics=statistics)

    async def WatchStatistics(
        self, request: control_pb2.WatchStatisticsRequest, context: Any
    ) -> AsyncIterator[control_pb2.WatchStatisticsResponse]:
        """The figures, again and again."""
        interval_s = max(request.interval_ms or _WATCH_MS, _SHORTEST_WATCH_MS) / 1000
        try:
            while True:
                statistics = await self._statistics(request.runner)
                yield control_pb2.WatchStatisticsResponse(statistics=statistics)
                await asyncio.sleep(interval_s)
        except Exception as error:
            await abort(context, error, request)

    async def WatchEvents(
        self, request: control_pb2.WatchEventsRequest, context: Any
    ) -> AsyncIterator[control_pb2.WatchEventsResponse]:
        """What happens."""
        try:
            require_some = partial(self._runners.require_some, request.runners)
            async for response in watch(self._events, request, require_some):
                yield response
        except Exception as error:
            await abort(context, error, request)

    async def WatchLogs(
        self, request: control_pb2.WatchLogsRequest, context: Any
    ) -> AsyncIterator[control_pb2.WatchLogsResponse]:
        """What is logged."""
        try:
            async for response in watch_logs(self._runners.get(request.runner), request):
                yield response
        except Exception as error:
            await abort(context, error, request)

    async def WatchPorts(
        self, request: ports_pb2.WatchPortsRequest, context: Any
    ) -> AsyncIterator[ports_pb2.WatchPortsResponse]:
        """Values of every cycle."""
        try:
            async for response in watch_ports(self._runners.get(request.runner), request):
                yield response
        except Exception as error:
            await abort(context, error, request)

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

    async def _statistics(self, name: str, buckets: bool = False) -> runner_pb2.RunnerStatistics:
        runner = self._runners.get(name)
        query = wire.Request(get_statistics=wire.GetStatistics(buckets=buckets))
        statistics: runner_pb2.RunnerStatistics = (await runner.query(query)).statistics
        statistics.runner = runner.name
        return statistics

    async def _components(self, runner: str) -> list[graph_pb2.ComponentInfo]:
        query = wire.Request(list_components=wire.ListComponents())
        response = await self._runners.get(runner).query(query)
        found: list[graph_pb2.ComponentInfo] = list(response.components.components)
        found.sort(key=lambda component: int(component.position))
        return found


def _add_holder(runner: Runner, info: graph_pb2.ComponentInfo) -> graph_pb2.ComponentInfo:
    terms = runner.desired.leased.get(info.full_name)
    if terms is not None:
        info.holder = terms.holder or "a client"
    return info
