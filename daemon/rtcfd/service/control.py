"""The gRPC service `rtcf.v1.Control`: requests in, calls on runners, refusals out.

No logic: names and values are checked by what is called.
"""

import asyncio
import functools
import os
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any, Protocol

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, control_pb2_grpc, errors_pb2, graph_pb2, runner_pb2

from rtcfd import VERSION
from rtcfd.catalog.catalog import Catalog
from rtcfd.common.names import absolute
from rtcfd.common.refusals import InvalidArgument
from rtcfd.common.status_codes import abort
from rtcfd.executor.link import Progress
from rtcfd.operations import graph, parameters, snapshots
from rtcfd.operations.loop import stop
from rtcfd.recovery import starting
from rtcfd.runners.held_runners import Hold
from rtcfd.runners.leases import Lease
from rtcfd.runners.outbox import Outbox
from rtcfd.runners.runner import Runner
from rtcfd.runners.runners import Runners

_WATCH_MS = 1000
_SHORTEST_WATCH_MS = 100

Changes = AsyncIterator[control_pb2.ChangeResponse]


def _answering(method: Callable[..., Awaitable[Any]]) -> Any:
    """Turn a refusal of a unary method into a status."""

    @functools.wraps(method)
    async def wrapper(self: "Control", request: Any, context: Any) -> Any:
        try:
            return await method(self, request)
        except Exception as error:
            await abort(context, error, request)

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
            await abort(context, error, request)
        finally:
            if task is not None:
                task.cancel()  # one that has begun goes on: see operations/operations.py

    return wrapper


class _Tenancy(Protocol):
    """What a call holds for as long as it lasts: a runner, or a component."""

    async def open(self) -> None:
        """Take it."""

    async def end(self) -> None:
        """Give it back, at the caller's word."""

    def lost(self) -> None:
        """The caller has left without a word."""


def _holding(method: Callable[..., tuple[Outbox, _Tenancy]]) -> Any:
    """Serve a call that holds something: its first message opens, `end` or its death ends it."""

    @functools.wraps(method)
    async def wrapper(self: "Control", requests: Any, context: Any) -> AsyncIterator[Any]:
        tasks: list[asyncio.Future[None]] = []
        tenancy: _Tenancy | None = None
        opening_request: Any = None
        messages = aiter(requests)
        try:
            first = await anext(messages, None)
            if first is None or first.WhichOneof("kind") != "open":
                raise InvalidArgument(
                    "the first message of such a call is `open`",
                    errors_pb2.REASON_REQUEST_MALFORMED,
                )
            opening_request = first.open
            outbox, tenancy = method(self, opening_request)
            opening = asyncio.ensure_future(_open(tenancy, outbox))
            tasks = [opening, asyncio.ensure_future(_listen(messages, opening, tenancy, outbox))]
            async for response in outbox:
                yield response
        except Exception as error:
            await abort(context, error, opening_request)
        finally:
            if tenancy is not None and not outbox.ended:
                tenancy.lost()
            for task in tasks:
                task.cancel()

    return wrapper


async def _open(tenancy: _Tenancy, outbox: Outbox) -> None:
    try:
        await tenancy.open()
    except Exception as error:
        outbox.refuse(error)


async def _listen(
    messages: AsyncIterator[Any], opening: "asyncio.Future[None]", tenancy: _Tenancy, outbox: Outbox
) -> None:
    """Wait for the caller's `end`.  A stream that just ends says nothing: the connection counts."""
    async for message in messages:
        if message.WhichOneof("kind") == "end":
            await asyncio.wait({opening})
            try:
                await tenancy.end()
            except Exception as error:
                outbox.refuse(error)
            outbox.end(control_pb2.LeaseEnded.WHY_ASKED)
            return


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

    def __init__(self, runners: Runners, catalog: Catalog, daemon: Daemon) -> None:
        self._runners = runners
        self._catalog = catalog
        self._daemon = daemon
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
            notes=self._daemon.notes(),
        )

    @_answering
    async def Reload(self, request: control_pb2.ReloadRequest) -> Any:
        """Read the settings and graphs.d again."""
        notes = await self._daemon.reload()
        return control_pb2.ReloadResponse(notes=notes, refused=self._daemon.refused)

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

    @_answering
    async def RestartRunner(self, request: control_pb2.RestartRunnerRequest) -> Any:
        """A fresh executor."""
        runner = self._runners.get(request.runner)
        await runner.restart()
        return control_pb2.RunnerResponse(status=await runner.status())

    @_changing
    def Start(self, request: control_pb2.StartRequest) -> Any:
        """Start the loop."""
        runner = self._runners.get(request.runner)
        return lambda progress: starting.start(runner, progress)

    @_changing
    def Stop(self, request: control_pb2.StopRequest) -> Any:
        """Stop the loop."""
        runner = self._runners.get(request.runner)
        return lambda progress: stop(runner, progress)

    @_changing
    def Step(self, request: control_pb2.StepRequest) -> Any:
        """Run cycles on a simulated clock."""
        runner = self._runners.get(request.runner)
        return lambda progress: starting.step(runner, request.cycles, progress)

    @_answering
    async def Replay(self, request: control_pb2.ReplayRequest) -> Any:
        """Run a piece of a recording."""
        return await starting.replay(self._runners.get(request.runner), request)

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
        return lambda progress: graph.replace(runner, request, progress)

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
        return lambda progress: parameters.set_parameters(runner, request, progress)

    @_changing
    def UndoParameters(self, request: control_pb2.UndoParametersRequest) -> Any:
        """Take back what was changed last."""
        runner = self._runners.get(request.runner)
        return lambda progress: parameters.undo(runner, request, progress)

    @_answering
    async def GetHistory(self, request: control_pb2.GetHistoryRequest) -> Any:
        """Who set what when."""
        return parameters.history(self._runners.get(request.runner), request)

    @_changing
    def ResetState(self, request: control_pb2.ResetStateRequest) -> Any:
        """Take a component's state back to its initial values."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.reset_state(runner, request, progress)

    @_changing
    def SetState(self, request: control_pb2.SetStateRequest) -> Any:
        """Set values of a component's state."""
        runner = self._runners.get(request.runner)
        return lambda progress: graph.set_state(runner, request, progress)

    @_answering
    async def TakeSnapshot(self, request: control_pb2.TakeSnapshotRequest) -> Any:
        """All that the next cycle depends on."""
        return await snapshots.take(self._runners.get(request.runner))

    @_changing
    def RestoreSnapshot(self, request: control_pb2.RestoreSnapshotRequest) -> Any:
        """Go on from a snapshot."""
        runner = self._runners.get(request.runner)
        return lambda progress: snapshots.restore(runner, request.snapshot, progress)

    @_holding
    def HoldRunner(self, request: control_pb2.OpenHold) -> Any:
        """A runner, for as long as the call lasts."""
        outbox = Outbox(control_pb2.HoldRunnerResponse)
        return outbox, Hold(self._runners, request, outbox)

    @_holding
    def LeaseComponent(self, request: control_pb2.OpenLease) -> Any:
        """A component, for as long as the call lasts."""
        outbox = Outbox(control_pb2.LeaseComponentResponse)
        return outbox, Lease(self._runners.get(request.runner).leases, request, outbox)

    @_answering
    async def ListComponents(self, request: control_pb2.ListComponentsRequest) -> Any:
        """All components, in order of the schedule; then those that are left out."""
        components = await self._components(request.runner)
        runner = self._runners.get(request.runner)
        found = components + graph.left_out(runner)
        rebuilt = await asyncio.to_thread(runner.code.changed)
        for info in found:
            info.library_changed = info.full_name in rebuilt
            _add_holder(runner, info)
        return control_pb2.ListComponentsResponse(components=found)

    @_answering
    async def GetComponent(self, request: control_pb2.GetComponentRequest) -> Any:
        """One component, with values."""
        name = absolute(request.component)
        query = control_pb2.GetComponentRequest(runner=request.runner, component=name)
        runner = self._runners.get(request.runner)
        for info in graph.left_out(runner):
            if info.full_name == name:
                return _add_holder(runner, info)
        found = await runner.query(wire.Request(get_component=query))
        rebuilt = await asyncio.to_thread(runner.code.changed)
        found.component.library_changed = name in rebuilt
        return _add_holder(runner, found.component)

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
            await abort(context, error, request)

    @_answering
    async def ResetStatistics(self, request: control_pb2.ResetStatisticsRequest) -> Any:
        """New figures."""
        runner = self._runners.get(request.runner)
        await runner.settle()
        await runner.begin_figures(reset=True)
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


def _add_holder(runner: Runner, info: graph_pb2.ComponentInfo) -> graph_pb2.ComponentInfo:
    terms = runner.desired.leased.get(info.full_name)
    if terms is not None:
        info.holder = terms.holder or "a client"
    return info
