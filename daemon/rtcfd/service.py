"""The gRPC service `rtcf.v1.Control`: requests in, calls on runners, refusals out.

No logic: names and values are checked by what is called.
"""

import asyncio
import functools
import logging
import os
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import grpc
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, control_pb2_grpc, graph_pb2, runner_pb2

from rtcfd import VERSION, errors, graph
from rtcfd.catalog import Catalog
from rtcfd.link import Progress
from rtcfd.names import absolute
from rtcfd.runners import Runners

log = logging.getLogger(__name__)

# The one place where refusals become gRPC status codes.
STATUS_CODES: dict[type[errors.Refusal], grpc.StatusCode] = {
    errors.InvalidArgument: grpc.StatusCode.INVALID_ARGUMENT,
    errors.NotFound: grpc.StatusCode.NOT_FOUND,
    errors.AlreadyExists: grpc.StatusCode.ALREADY_EXISTS,
    errors.FailedPrecondition: grpc.StatusCode.FAILED_PRECONDITION,
    errors.Unavailable: grpc.StatusCode.UNAVAILABLE,
}
_WATCH_MS = 1000
_SHORTEST_WATCH_MS = 100
# Tells a client that rtcfd itself spoke, and not gRPC about a lost connection.
REFUSAL_KEY = "rtcf-refusal"

Changes = AsyncIterator[control_pb2.ChangeResponse]


async def _abort(context: Any, error: Exception) -> None:
    if isinstance(error, errors.Refusal):
        code = STATUS_CODES.get(type(error), grpc.StatusCode.FAILED_PRECONDITION)
        text = " ".join(str(error).split())
    else:
        log.error("internal error", exc_info=error)
        code = grpc.StatusCode.INTERNAL
        text = f"internal error of rtcfd ({type(error).__name__}: {error}); its log has more"
    await context.abort(code, text, ((REFUSAL_KEY, "1"),))


def _answering(method: Callable[..., Awaitable[Any]]) -> Any:
    """Turn a refusal of a unary method into a status."""

    @functools.wraps(method)
    async def wrapper(self: "Control", request: Any, context: Any) -> Any:
        try:
            return await method(self, request)
        except Exception as error:
            await _abort(context, error)

    return wrapper


def _changing(
    method: Callable[..., Callable[[Progress], Awaitable[control_pb2.ChangeResult]]],
) -> Any:
    """Stream what a change does, then its result; or turn its refusal into a status."""

    @functools.wraps(method)
    async def wrapper(self: "Control", request: Any, context: Any) -> Changes:
        lines: asyncio.Queue[str | None] = asyncio.Queue()
        task: asyncio.Future[control_pb2.ChangeResult] | None = None
        try:
            change = method(self, request)
            task = asyncio.ensure_future(change(lines.put_nowait))
            task.add_done_callback(lambda _: lines.put_nowait(None))
            while (line := await lines.get()) is not None:
                yield control_pb2.ChangeResponse(progress=line)
            yield control_pb2.ChangeResponse(result=task.result())
        except Exception as error:
            await _abort(context, error)
        finally:
            if task is not None:
                task.cancel()  # a change that has begun goes on: see turns.py

    return wrapper


class Control(control_pb2_grpc.ControlServicer):
    """Serves one connection or many; owned by the daemon."""

    def __init__(self, runners: Runners, catalog: Catalog) -> None:
        self._runners = runners
        self._catalog = catalog
        self._begin_ns = time.monotonic_ns()

    @_answering
    async def GetStatus(self, request: control_pb2.GetStatusRequest) -> Any:
        """All runners, or one."""
        chosen = [self._runners.get(request.runner)] if request.runner else self._runners.all()
        return control_pb2.GetStatusResponse(
            version=VERSION,
            pid=os.getpid(),
            uptime_ns=time.monotonic_ns() - self._begin_ns,
            runners=await asyncio.gather(*(runner.status() for runner in chosen)),
        )

    @_answering
    async def AddRunner(self, request: control_pb2.AddRunnerRequest) -> Any:
        """A new runner, its executor started."""
        runner = await self._runners.add(request.runner, request.settings)
        return control_pb2.RunnerResponse(status=await runner.status())

    @_answering
    async def SetRunner(self, request: control_pb2.SetRunnerRequest) -> Any:
        """Other settings."""
        runner = self._runners.get(request.runner)
        await runner.set(request.settings)
        return control_pb2.RunnerResponse(status=await runner.status())

    @_answering
    async def RemoveRunner(self, request: control_pb2.RemoveRunnerRequest) -> Any:
        """One runner less."""
        await self._runners.remove(request.runner)
        return control_pb2.RemoveRunnerResponse()

    @_changing
    def Start(self, request: control_pb2.StartRequest) -> Any:
        """Start the loop."""
        return self._runners.get(request.runner).start

    @_changing
    def Stop(self, request: control_pb2.StopRequest) -> Any:
        """Stop the loop."""
        return self._runners.get(request.runner).stop

    @_changing
    def Step(self, request: control_pb2.StepRequest) -> Any:
        """Run cycles on a simulated clock."""
        runner = self._runners.get(request.runner)
        return lambda progress: runner.step(request.cycles, progress)

    @_changing
    def Load(self, request: control_pb2.LoadRequest) -> Any:
        """Load a component."""
        runner = self._runners.get(request.runner)
        load = graph.load_when_master if request.wait else graph.load
        return lambda progress: load(runner, request.component, progress)

    @_changing
    def Unload(self, request: control_pb2.UnloadRequest) -> Any:
        """Unload components."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.unload(runner, list(request.components), progress)

    @_changing
    def Replace(self, request: control_pb2.ReplaceRequest) -> Any:
        """Replace a component."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.replace(
            runner, request.component, request.replacement, progress
        )

    @_changing
    def Apply(self, request: control_pb2.ApplyRequest) -> Any:
        """Make the graph what the request says."""
        return lambda progress: self._runners.apply(request, progress)

    @_changing
    def Release(self, request: control_pb2.ReleaseRequest) -> Any:
        """Load components again."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.release(runner, list(request.components), progress)

    @_changing
    def SetBreaks(self, request: control_pb2.SetBreaksRequest) -> Any:
        """Set or remove loop breaks."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_breaks(runner, request, progress)

    @_changing
    def SetParameters(self, request: control_pb2.SetParametersRequest) -> Any:
        """Change parameters."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_parameters(runner, request, progress)

    @_answering
    async def ListComponents(self, request: control_pb2.ListComponentsRequest) -> Any:
        """All components, in order of the schedule; then those that are left out."""
        components = await self._components(request.runner)
        left_out = graph.left_out(self._runners.get(request.runner))
        return control_pb2.ListComponentsResponse(components=components + left_out)

    @_answering
    async def GetComponent(self, request: control_pb2.GetComponentRequest) -> Any:
        """One component, with values."""
        name = absolute(request.component)
        query = control_pb2.GetComponentRequest(runner=request.runner, component=name)
        runner = self._runners.get(request.runner)
        for info in graph.left_out(runner):
            if info.full_name == name:
                return info
        return (await runner.query(wire.Request(get_component=query))).component

    @_answering
    async def GetOrder(self, request: control_pb2.GetOrderRequest) -> Any:
        """The schedule."""
        components = await self._components(request.runner)
        return control_pb2.GetOrderResponse(
            components=[component.full_name for component in components]
        )

    @_answering
    async def ListConnections(self, request: control_pb2.ListConnectionsRequest) -> Any:
        """All connections, by name."""
        query = wire.Request(list_connections=wire.ListConnections())
        response = await self._runners.get(request.runner).query(query)
        found = sorted(response.connections.connections, key=lambda each: str(each.name))
        return control_pb2.ListConnectionsResponse(connections=found)

    @_answering
    async def ListTypes(self, request: control_pb2.ListTypesRequest) -> Any:
        """What can be loaded."""
        types, problems = await self._catalog.types(request.package)
        return control_pb2.ListTypesResponse(types=types, problems=problems)

    @_answering
    async def GetStatistics(self, request: control_pb2.GetStatisticsRequest) -> Any:
        """The figures."""
        return await self._statistics(request.runner)

    async def WatchStatistics(
        self, request: control_pb2.WatchStatisticsRequest, context: Any
    ) -> AsyncIterator[runner_pb2.RunnerStatistics]:
        """The figures, again and again."""
        interval_s = max(request.interval_ms or _WATCH_MS, _SHORTEST_WATCH_MS) / 1000
        try:
            while True:
                yield await self._statistics(request.runner)
                await asyncio.sleep(interval_s)
        except Exception as error:
            await _abort(context, error)

    @_answering
    async def ResetStatistics(self, request: control_pb2.ResetStatisticsRequest) -> Any:
        """New figures."""
        runner = self._runners.get(request.runner)
        await runner.query(wire.Request(reset_statistics=wire.ResetStatistics()))
        return control_pb2.ResetStatisticsResponse()

    async def _statistics(self, name: str) -> runner_pb2.RunnerStatistics:
        runner = self._runners.get(name)
        query = wire.Request(get_statistics=wire.GetStatistics())
        statistics: runner_pb2.RunnerStatistics = (await runner.query(query)).statistics
        statistics.runner = runner.name
        return statistics

    async def _components(self, runner: str) -> list[graph_pb2.ComponentInfo]:
        query = wire.Request(list_components=wire.ListComponents())
        response = await self._runners.get(runner).query(query)
        found: list[graph_pb2.ComponentInfo] = list(response.components.components)
        found.sort(key=lambda component: int(component.position))
        return found
