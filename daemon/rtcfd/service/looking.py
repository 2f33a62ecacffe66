"""The read-only calls of `rtcf.v1.Control`: queries and streams."""

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
    graph_pb2,
    incidents_pb2,
    ports_pb2,
    runner_pb2,
)

from rtcfd import VERSION
from rtcfd.catalog.catalog import Catalog
from rtcfd.common.event_log import EventLog
from rtcfd.common.names import absolute
from rtcfd.common.status_codes import abort
from rtcfd.operations import graph, parameters
from rtcfd.runners.runner import Runner
from rtcfd.runners.runners import Runners
from rtcfd.runners.status import statuses_of
from rtcfd.service.answers import answering
from rtcfd.service.pages import page
from rtcfd.service.ports import watch_ports
from rtcfd.service.watching import watch, watch_logs

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


class Looking(control_pb2_grpc.ControlServicer):
    """The read-only part of Control."""

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
        """Return the statuses of all runners, or of one."""
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
        """Return the statuses of all runners, in pages."""
        chosen, token = page(self._runners.all(), request, lambda each: str(each.name), _STATUS)
        runners = await statuses_of(chosen, self._runners.all())
        return control_pb2.ListRunnersResponse(runners=runners, next_page_token=token)

    @answering
    async def GetHistory(self, request: control_pb2.GetHistoryRequest) -> Any:
        """Return the changes of parameters, with their authors and times."""
        return parameters.history(self._runners.get(request.runner), request)

    @answering
    async def ListIncidents(self, request: incidents_pb2.ListIncidentsRequest) -> Any:
        """Return the incidents: files with the last cycles before faults."""
        found = await self._runners.incidents.all(request.runner)
        chosen, token = page(found, request, lambda each: str(each.name))
        return incidents_pb2.ListIncidentsResponse(incidents=chosen, next_page_token=token)

    async def ReadIncident(
        self, request: incidents_pb2.ReadIncidentRequest, context: Any
    ) -> AsyncIterator[incidents_pb2.ReadIncidentResponse]:
        """Stream the file of an incident, piece by piece."""
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
    async def ListComponents(self, request: control_pb2.ListComponentsRequest) -> Any:
        """Return all components in the order of the schedule, then those that are left out."""
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
        """Return one component, with values."""
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
        """Return the names of the components in the order of the schedule."""
        components = await self._components(request.runner)
        names = [str(component.full_name) for component in components]
        chosen, token = page(names, request, str)
        return control_pb2.GetOrderResponse(components=chosen, next_page_token=token)

    @answering
    async def ListConnections(self, request: control_pb2.ListConnectionsRequest) -> Any:
        """Return all connections, sorted by name."""
        query = wire.Request(list_connections=wire.ListConnections())
        response = await self._runners.get(request.runner).query(query)
        found = sorted(response.connections.connections, key=lambda each: str(each.name))
        chosen, token = page(found, request, lambda each: str(each.name))
        return control_pb2.ListConnectionsResponse(connections=chosen, next_page_token=token)

    @answering
    async def ListTypes(self, request: control_pb2.ListTypesRequest) -> Any:
        """Return the component types that can be loaded."""
        types, problems = await self._catalog.types(request.package)
        chosen, token = page(types, request, lambda each: f"{each.package}/{each.type}")
        return control_pb2.ListTypesResponse(
            types=chosen, problems=[] if request.page_token else problems, next_page_token=token
        )

    @answering
    async def GetStatistics(self, request: control_pb2.GetStatisticsRequest) -> Any:
        """Return the statistics of a runner."""
        statistics = await self._statistics(request.runner, request.buckets)
        return control_pb2.GetStatisticsResponse(statistics=statistics)

    async def WatchStatistics(
        self, request: control_pb2.WatchStatisticsRequest, context: Any
    ) -> AsyncIterator[control_pb2.WatchStatisticsResponse]:
        """Stream the statistics of a runner at an interval."""
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
        """Stream events."""
        try:
            require_some = partial(self._runners.require_some, request.runners)
            async for response in watch(self._events, request, require_some):
                yield response
        except Exception as error:
            await abort(context, error, request)

    async def WatchLogs(
        self, request: control_pb2.WatchLogsRequest, context: Any
    ) -> AsyncIterator[control_pb2.WatchLogsResponse]:
        """Stream log records."""
        try:
            async for response in watch_logs(self._runners.get(request.runner), request):
                yield response
        except Exception as error:
            await abort(context, error, request)

    async def WatchPorts(
        self, request: ports_pb2.WatchPortsRequest, context: Any
    ) -> AsyncIterator[ports_pb2.WatchPortsResponse]:
        """Stream the values of ports, cycle by cycle."""
        try:
            async for response in watch_ports(self._runners.get(request.runner), request):
                yield response
        except Exception as error:
            await abort(context, error, request)

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
