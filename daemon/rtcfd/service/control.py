"""The gRPC service `rtcf.v1.Control`: maps requests to calls on runners, and errors to statuses.

No logic: the called functions check names and values.
"""

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable, Coroutine
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
from rtcfd.common.errors import InvalidArgument, NotFound
from rtcfd.common.event_log import EventLog
from rtcfd.common.names import DEFAULT_RUNNER, absolute
from rtcfd.common.status_codes import abort
from rtcfd.executor.link import Progress
from rtcfd.operations import graph, keep_incident, parameters, snapshots
from rtcfd.operations.loop import stop
from rtcfd.recovery import cycles
from rtcfd.runners.component_leases import ComponentLease
from rtcfd.runners.outbox import Outbox
from rtcfd.runners.runner import Runner
from rtcfd.runners.runner_leases import RunnerLease
from rtcfd.runners.runners import Runners
from rtcfd.runners.status import statuses_of
from rtcfd.service.log_streams import watch, watch_logs
from rtcfd.service.methods import Work, stream, unary, with_lease, with_progress
from rtcfd.service.pages import page
from rtcfd.service.ports import watch_ports
from rtcfd.service.replay import Replay

_WATCH_MS = 1000
_SHORTEST_WATCH_MS = 100

_STATUS = 4096  # approximate size of a runner's status, in bytes


class Daemon(Protocol):
    """The part of the daemon that the service calls."""

    @property
    def refused(self) -> list[str]:
        """The errors of graphs.d, a line each."""

    def notes(self) -> list[str]:
        """Return notes on rtcfd itself, a line each."""

    async def reload(self) -> list[str]:
        """Reload settings and graphs.d; return a line for each change."""


_Change = Callable[[Runner, Any, Progress], Coroutine[Any, Any, control_pb2.ChangeResult]]
_change_with_progress = with_progress(control_pb2.ChangeResponse, "result")


def _changing(change: _Change) -> Any:
    """Return the method of a call that changes the runner which its request names."""

    def method(control: "Control", request: Any) -> Work:
        return partial(change, control.runners.get(request.runner), request)

    return _change_with_progress(method)


class Control(control_pb2_grpc.ControlServicer):
    """Serves all connections; owned by the daemon."""

    # The changes of one runner: `change(runner, request, progress)`.
    Start = _changing(cycles.start)
    Step = _changing(cycles.step)
    Load = _changing(graph.load)
    Unload = _changing(Runner.unload)
    Replace = _changing(graph.replace)
    Release = _changing(graph.release)
    SetBreaks = _changing(graph.set_breaks)
    SetParameters = _changing(parameters.set_parameters)
    UndoParameters = _changing(parameters.undo)
    ResetState = _changing(graph.reset_state)
    SetState = _changing(graph.set_state)
    WritePort = _changing(parameters.write_input)
    RestoreSnapshot = _changing(snapshots.restore)

    def __init__(
        self, runners: Runners, catalog: Catalog, daemon: Daemon, events: EventLog
    ) -> None:
        self._events = events
        self.runners = runners
        self._catalog = catalog
        self._daemon = daemon
        self._begin_ns = time.monotonic_ns()

    # -- queries and streams ------------------------------------------------

    @unary
    async def GetStatus(self, request: control_pb2.GetStatusRequest) -> Any:
        """Return the statuses of all runners, or of one."""
        chosen = [self.runners.get(request.runner)] if request.runner else self.runners.all()
        return control_pb2.GetStatusResponse(
            version=VERSION,
            pid=os.getpid(),
            uptime_ns=time.monotonic_ns() - self._begin_ns,
            runners=await statuses_of(chosen, self.runners.all()),
            notes=self._daemon.notes(),
        )

    @unary
    async def ListRunners(self, request: control_pb2.ListRunnersRequest) -> Any:
        """Return the statuses of all runners, in pages."""
        chosen, token = page(self.runners.all(), request, lambda each: str(each.name), _STATUS)
        runners = await statuses_of(chosen, self.runners.all())
        return control_pb2.ListRunnersResponse(runners=runners, next_page_token=token)

    @unary
    async def GetHistory(self, request: control_pb2.GetHistoryRequest) -> Any:
        """Return the changes of parameters, with their authors and times."""
        return parameters.history(self.runners.get(request.runner), request)

    @unary
    async def ListIncidents(self, request: incidents_pb2.ListIncidentsRequest) -> Any:
        """Return the incidents: files with the last cycles before faults."""
        found = await self.runners.incidents.all(request.runner)
        chosen, token = page(found, request, lambda each: str(each.name))
        return incidents_pb2.ListIncidentsResponse(incidents=chosen, next_page_token=token)

    @stream
    async def ReadIncident(
        self, request: incidents_pb2.ReadIncidentRequest
    ) -> AsyncIterator[incidents_pb2.ReadIncidentResponse]:
        """Stream the file of an incident, piece by piece."""
        kept = self.runners.incidents
        found = await kept.get(request.name)
        yield incidents_pb2.ReadIncidentResponse(incident=found)
        at = 0
        while piece := await kept.read(found, at):
            at += len(piece)
            yield incidents_pb2.ReadIncidentResponse(data=piece)
        await kept.note_seen(found)

    @unary
    async def ListComponents(self, request: control_pb2.ListComponentsRequest) -> Any:
        """Return all components in the order of the schedule, then those that are left out."""
        components = await self._components(request.runner)
        runner = self.runners.get(request.runner)
        found = components + graph.left_out(runner)
        await graph.mark_stuck(runner, found)
        rebuilt = await runner.code.changed()
        for info in found:
            info.library_changed = info.full_name in rebuilt
            _add_holder(runner, info)
        chosen, token = page(found, request, lambda each: str(each.full_name))
        return control_pb2.ListComponentsResponse(components=chosen, next_page_token=token)

    @unary
    async def GetComponent(self, request: control_pb2.GetComponentRequest) -> Any:
        """Return one component, with values."""
        name = absolute(request.component)
        query = control_pb2.GetComponentRequest(runner=request.runner, component=name)
        runner = self.runners.get(request.runner)
        for info in graph.left_out(runner):
            if info.full_name == name:
                return control_pb2.GetComponentResponse(component=_add_holder(runner, info))
        found: list[graph_pb2.ComponentInfo] = []
        missing: NotFound | None = None
        try:
            found.append((await runner.query(wire.Request(get_component=query))).component)
        except NotFound as error:
            missing = error
        await graph.mark_stuck(runner, found)
        for info in found:
            if info.full_name == name:
                info.library_changed = name in await runner.code.changed()
                return control_pb2.GetComponentResponse(component=_add_holder(runner, info))
        raise missing or NotFound(name, errors_pb2.REASON_COMPONENT_NOT_FOUND)

    @unary
    async def GetOrder(self, request: control_pb2.GetOrderRequest) -> Any:
        """Return the names of the components in the order of the schedule."""
        components = await self._components(request.runner)
        names = [str(component.full_name) for component in components]
        chosen, token = page(names, request, str)
        return control_pb2.GetOrderResponse(components=chosen, next_page_token=token)

    @unary
    async def ListConnections(self, request: control_pb2.ListConnectionsRequest) -> Any:
        """Return all connections, sorted by name."""
        query = wire.Request(list_connections=wire.ListConnections())
        response = await self.runners.get(request.runner).query(query)
        found = sorted(response.connections.connections, key=lambda each: str(each.name))
        chosen, token = page(found, request, lambda each: str(each.name))
        return control_pb2.ListConnectionsResponse(connections=chosen, next_page_token=token)

    @unary
    async def ListTypes(self, request: control_pb2.ListTypesRequest) -> Any:
        """Return the component types that can be loaded."""
        types, problems = await self._catalog.types(request.package)
        chosen, token = page(types, request, lambda each: f"{each.package}/{each.type}")
        return control_pb2.ListTypesResponse(
            types=chosen, problems=[] if request.page_token else problems, next_page_token=token
        )

    @unary
    async def GetStatistics(self, request: control_pb2.GetStatisticsRequest) -> Any:
        """Return the statistics of a runner."""
        statistics = await self._statistics(request.runner, request.buckets)
        return control_pb2.GetStatisticsResponse(statistics=statistics)

    @stream
    async def WatchStatistics(
        self, request: control_pb2.WatchStatisticsRequest
    ) -> AsyncIterator[control_pb2.WatchStatisticsResponse]:
        """Stream the statistics of a runner at an interval."""
        interval_s = max(request.interval_ms or _WATCH_MS, _SHORTEST_WATCH_MS) / 1000
        while True:
            statistics = await self._statistics(request.runner)
            yield control_pb2.WatchStatisticsResponse(statistics=statistics)
            await asyncio.sleep(interval_s)

    @stream
    def WatchEvents(
        self, request: control_pb2.WatchEventsRequest
    ) -> AsyncIterator[control_pb2.WatchEventsResponse]:
        """Stream events."""
        require_some = partial(self.runners.require_some, request.runners)
        return watch(self._events, request, require_some)

    @stream
    def WatchLogs(
        self, request: control_pb2.WatchLogsRequest
    ) -> AsyncIterator[control_pb2.WatchLogsResponse]:
        """Stream log records."""
        return watch_logs(self.runners.get(request.runner), request)

    @stream
    def WatchPorts(
        self, request: ports_pb2.WatchPortsRequest
    ) -> AsyncIterator[ports_pb2.WatchPortsResponse]:
        """Stream the values of ports, cycle by cycle."""
        return watch_ports(self.runners.get(request.runner), request)

    # -- changes ----------------------------------------------------------------

    @with_progress(control_pb2.ReloadResponse, "result")
    def Reload(self, request: control_pb2.ReloadRequest) -> Any:
        """Reload the settings and graphs.d."""

        async def work(progress: Progress) -> control_pb2.ReloadResult:
            progress("reading the settings")
            notes = await self._daemon.reload()
            return control_pb2.ReloadResult(notes=notes, refused=self._daemon.refused)

        return work

    @with_progress(control_pb2.RunnerResponse, "runner")
    def AddRunner(self, request: control_pb2.AddRunnerRequest) -> Any:
        """Add a runner and start its executor."""

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"starting the executor of {request.runner or DEFAULT_RUNNER}")
            runner = await self.runners.add(request.runner, request.settings)
            return await runner.status()

        return work

    @with_progress(control_pb2.RunnerResponse, "runner")
    def SetRunner(self, request: control_pb2.SetRunnerRequest) -> Any:
        """Change the settings of a runner."""
        runner = self.runners.get(request.runner)

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"changing settings of {runner.name}")
            await runner.set(request.settings)
            return await runner.status()

        return work

    @with_progress(control_pb2.RemoveRunnerResponse, "result")
    def RemoveRunner(self, request: control_pb2.RemoveRunnerRequest) -> Any:
        """Remove a runner."""
        runner = self._named(request.runner, "RemoveRunner")

        async def work(progress: Progress) -> control_pb2.RemoveRunnerResult:
            progress(f"ending the executor of {runner.name}")
            await self.runners.remove(runner.name)
            return control_pb2.RemoveRunnerResult(runner=runner.name)

        return work

    @with_progress(control_pb2.RunnerResponse, "runner")
    def RestartRunner(self, request: control_pb2.RestartRunnerRequest) -> Any:
        """Restart the executor of a runner."""
        runner = self._named(request.runner, "RestartRunner")

        async def work(progress: Progress) -> runner_pb2.RunnerStatus:
            progress(f"ending the executor of {runner.name}")
            await runner.restart()
            return await runner.status()

        return work

    @_change_with_progress
    def Stop(self, request: control_pb2.StopRequest) -> Any:
        """Stop the loop; if the request names no runner, the response lists the running loops."""
        runner = self.runners.get(request.runner)

        async def work(progress: Progress) -> control_pb2.ChangeResult:
            result = await stop(runner, progress)
            others = [each.name for each in self.runners.all() if each.loop.running]
            if not request.runner and others:
                result.notes.append(
                    f"still running: {', '.join(others)}; `rtcfctl stop --all` stops all loops"
                )
            return result

        return work

    async def Replay(
        self, requests: AsyncIterator[control_pb2.ReplayRequest], context: Any
    ) -> AsyncIterator[control_pb2.ReplayResponse]:
        """Replay a recording while its caller is connected."""
        replay = Replay(self.runners)
        try:
            async for request in requests:
                yield await replay.take(request)
            await replay.end()
        except Exception as error:
            await replay.end()
            await abort(context, error)
        finally:
            replay.lost()

    @_change_with_progress
    def Apply(self, request: control_pb2.ApplyRequest) -> Any:
        """Apply a graph."""
        return lambda progress: self.runners.apply(request, progress)

    @unary
    async def TakeSnapshot(self, request: control_pb2.TakeSnapshotRequest) -> Any:
        """Take a snapshot of a runner."""
        return await snapshots.take(self.runners.get(request.runner))

    @unary
    async def TakeIncident(self, request: incidents_pb2.TakeIncidentRequest) -> Any:
        """Write an incident with the last cycles now."""
        taken = await keep_incident.take(self.runners.get(request.runner), request.reason)
        return incidents_pb2.TakeIncidentResponse(incident=taken)

    @unary
    async def DeleteIncidents(self, request: incidents_pb2.DeleteIncidentsRequest) -> Any:
        """Remove incident files."""
        gone = await self.runners.incidents.remove(request.names)
        return incidents_pb2.DeleteIncidentsResponse(incidents=gone)

    @with_lease
    def HoldRunner(self, request: control_pb2.OpenHold) -> Any:
        """Hold a runner while the call lasts."""
        outbox = Outbox(control_pb2.HoldRunnerResponse)
        return outbox, RunnerLease(self.runners, request, outbox)

    @with_lease
    def LeaseComponent(self, request: control_pb2.OpenLease) -> Any:
        """Lease a component while the call lasts."""
        outbox = Outbox(control_pb2.LeaseComponentResponse)
        return outbox, ComponentLease(self.runners.get(request.runner).leases, request, outbox)

    @unary
    async def ResetStatistics(self, request: control_pb2.ResetStatisticsRequest) -> Any:
        """Reset the statistics."""
        runner = self.runners.get(request.runner)
        await runner.settle()
        await runner.begin_counting(reset=True)
        return control_pb2.ResetStatisticsResponse()

    async def _statistics(self, name: str, buckets: bool = False) -> runner_pb2.RunnerStatistics:
        runner = self.runners.get(name)
        query = wire.Request(get_statistics=wire.GetStatistics(buckets=buckets))
        statistics: runner_pb2.RunnerStatistics = (await runner.query(query)).statistics
        statistics.runner = runner.name
        return statistics

    async def _components(self, runner: str) -> list[graph_pb2.ComponentInfo]:
        query = wire.Request(list_components=wire.ListComponents())
        response = await self.runners.get(runner).query(query)
        found: list[graph_pb2.ComponentInfo] = list(response.components.components)
        found.sort(key=lambda component: int(component.position))
        return found

    def _named(self, name: str, call: str) -> Runner:
        """Return the runner of a destructive call, which must name it."""
        if not name:
            raise InvalidArgument(
                f"{call} requires the name of a runner, even of the default one "
                f"(runners: {listing(each.name for each in self.runners.all())})",
                errors_pb2.REASON_NAME_MISSING,
                field="runner",
            )
        return self.runners.get(name)


def _add_holder(runner: Runner, info: graph_pb2.ComponentInfo) -> graph_pb2.ComponentInfo:
    terms = runner.desired.leased.get(info.full_name)
    if terms is not None:
        info.holder = terms.holder or "a client"
    return info
