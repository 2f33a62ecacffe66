"""The client of rtcfd: one method per call of `rtcf.v1.Control`."""

import os
from collections.abc import Iterable, Iterator
from queue import SimpleQueue
from typing import IO, TYPE_CHECKING, Any

import grpc
from rtcf_shared.enums import choices
from rtcf_shared.errors import RtcfError
from rtcf_shared.spec import parse_port, several

from rtcf import direct_stop, failures
from rtcf.connection import CHANGE_TIMEOUT_S, QUERY_TIMEOUT_S, Closing, Connection, OnProgress
from rtcf.errors import DaemonUnreachableError
from rtcf.lease import Lease
from rtcf.streams.numbered import NumberedStream, Place
from rtcf.v1 import control_pb2, graph_pb2, incidents_pb2, ports_pb2, runner_pb2

if TYPE_CHECKING:
    from rtcf.streams.ports import PortStream

DEFAULT_RUNNER = "rt_runner"
# The levels of log records by name: "debug" to "fatal".
LOG_LEVELS = choices(control_pb2.LogRecord.Level.DESCRIPTOR)


class Client(Closing):
    """A connection to rtcfd, opened by the first call; thread-safe.

    Methods with `runner` use rt_runner if it is empty.  All methods raise RefusedError,
    DaemonUnreachableError or RtcfError, and TypeError if a single text is passed for a list of
    names.  The constructor raises DaemonUnreachableError if the socket's path is too long.  Long
    calls pass a line for each step to `on_progress`.
    """

    def __init__(self, socket: str | os.PathLike[str] | None = None) -> None:
        self._connection = Connection(socket)
        self.socket = self._connection.socket

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    @property
    def _stub(self) -> Any:
        return self._connection.stub  # another one after KeyboardInterrupt

    def get_status(
        self, runner: str = "", timeout_s: float = QUERY_TIMEOUT_S
    ) -> control_pb2.GetStatusResponse:
        """Return the status of rtcfd and of all runners, or of `runner` only."""
        request = control_pb2.GetStatusRequest(runner=runner)
        return self._connection.ask(self._stub.GetStatus, request, timeout_s)  # type: ignore[no-any-return]

    def reload(self) -> list[str]:
        """Reload the settings of rtcfd and graphs.d; return a line for each change."""
        response = self._connection.change(self._stub.Reload, control_pb2.ReloadRequest(), None)
        return list(response.result.notes)

    def list_runners(self) -> list[runner_pb2.RunnerStatus]:
        """Return the status of all runners, sorted by name."""
        return self._connection.pages(
            self._stub.ListRunners, control_pb2.ListRunnersRequest(), "runners"
        )

    def add_runner(
        self,
        runner: str,
        settings: runner_pb2.RunnerSettings | None = None,
        on_progress: OnProgress | None = None,
    ) -> runner_pb2.RunnerStatus:
        """Add a runner and start its executor; unset `settings` have their defaults."""
        request = control_pb2.AddRunnerRequest(runner=runner, settings=settings)
        return self._connection.change(self._stub.AddRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def set_runner(
        self,
        settings: runner_pb2.RunnerSettings,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> runner_pb2.RunnerStatus:
        """Change settings of a runner; unset `settings` keep their values."""
        request = control_pb2.SetRunnerRequest(runner=runner, settings=settings)
        return self._connection.change(self._stub.SetRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def remove_runner(self, runner: str, on_progress: OnProgress | None = None) -> None:
        """Stop a runner's loop, end its executor and remove the runner."""
        request = control_pb2.RemoveRunnerRequest(runner=runner)
        self._connection.change(self._stub.RemoveRunner, request, on_progress)

    def restart_runner(
        self, runner: str, on_progress: OnProgress | None = None
    ) -> runner_pb2.RunnerStatus:
        """Replace the executor by a new one with the same graph; the loop is not started."""
        request = control_pb2.RestartRunnerRequest(runner=runner)
        return self._connection.change(self._stub.RestartRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def start(
        self,
        runner: str = "",
        on_progress: OnProgress | None = None,
        *,
        without: Iterable[str] = (),
        partial: bool = False,
    ) -> control_pb2.ChangeResult:
        """Start the loop; no effect if it runs.

        If non-optional components have been left out of the loop after a fault, the call raises
        ComponentLeftOutError unless `without` names them or `partial` is set.
        """
        request = control_pb2.StartRequest(
            runner=runner, without=several("without", without), partial=partial
        )
        return self._connection.changed(self._stub.Start, request, on_progress)

    def stop(
        self, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Stop the loop at the next cycle boundary.

        If rtcfd is unreachable, has no free connection, or does not answer within half a second,
        the call stops the loop directly at its executor.  A note in the result then says so.
        """

        request = control_pb2.StopRequest(runner=runner)
        return direct_stop.stop_with_fallback(
            lambda heard: self._connection.changed(self._stub.Stop, request, heard, patient=False),
            runner or DEFAULT_RUNNER,
            self.socket,
            on_progress,
        )

    def stop_all(self) -> list[direct_stop.Stopped]:
        """Stop all loops at once, directly at their executors, then inform rtcfd if it answers.

        Raises nothing.  Returns the result of each loop, sorted by runner.
        """
        direct: RtcfError | None = None
        try:
            stopped = {each.runner: each for each in direct_stop.stop_all(self.socket)}
        except RtcfError as error:
            stopped, direct = {}, error
        try:
            runners = [
                each.runner for each in self.get_status(timeout_s=direct_stop.PATIENCE_S).runners
            ]
        except RtcfError as error:
            if not stopped:
                # Without access to the executors either, rtcfd's error names the remedy.
                both = error if direct is None else DaemonUnreachableError(str(direct), str(error))
                stopped[""] = direct_stop.Stopped("", both)
            runners = []
        # Include runners without an executor: one may be starting.
        for runner in runners:
            request = control_pb2.StopRequest(runner=runner)
            try:
                result = self._connection.changed(
                    self._stub.Stop, request, None, timeout_s=direct_stop.TIMEOUT_S
                )
            except RtcfError as error:
                stopped.setdefault(runner, direct_stop.Stopped(runner, error))
            else:
                notes = tuple(each for each in result.notes if direct_stop.is_unsaved(each))
                stopped[runner] = direct_stop.Stopped(runner, notes=notes)
        return [stopped[runner] for runner in sorted(stopped)]

    def step(
        self, cycles: int, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Run cycles of a stopped loop on a simulated clock, as fast as possible.

        The next call continues from this cycle, until the loop is stopped or started.  The call
        returns after the last cycle and has no timeout.
        """
        request = control_pb2.StepRequest(runner=runner, cycles=cycles)
        return self._connection.changed(self._stub.Step, request, on_progress, timeout_s=None)

    def replay(self) -> "ReplayCall":
        """Open a replay, which ends with the call; rtcf.replay replays whole recordings."""
        return ReplayCall(self._stub.Replay, self.socket)

    def load(
        self,
        component: graph_pb2.ComponentSpec,
        runner: str = "",
        on_progress: OnProgress | None = None,
        *,
        wait: bool = False,
    ) -> control_pb2.ChangeResult:
        """Load a component (see rtcf.component); the loop misses no cycle.

        With `wait`, a component whose hooks need a ROS master waits for it without a timeout.
        """
        request = control_pb2.LoadRequest(runner=runner, component=component, wait=wait)
        if not wait:
            return self._connection.changed(self._stub.Load, request, on_progress)
        return self._connection.changed(self._stub.Load, request, on_progress, timeout_s=None)

    def unload(
        self,
        components: Iterable[str],
        runner: str = "",
        on_progress: OnProgress | None = None,
        *,
        force: bool = False,
    ) -> control_pb2.ChangeResult:
        """Unload components, all at one cycle boundary.

        `force`: if a hook of a component does not return, end the executor, and its loop, and load
        the rest of the graph into a new one.
        """
        request = control_pb2.UnloadRequest(
            runner=runner, components=several("components", components), force=force
        )
        return self._connection.changed(self._stub.Unload, request, on_progress)

    def replace(
        self,
        component: str,
        replacement: graph_pb2.ComponentSpec,
        runner: str = "",
        on_progress: OnProgress | None = None,
        *,
        reset_parameters: bool = False,
        given_before: graph_pb2.ComponentSpec | None = None,
    ) -> control_pb2.ChangeResult:
        """Replace a component; empty fields of `replacement` keep the old component's values.

        Parameters that `replacement` does not set keep their values, too; `kept` and `notes` of
        the result list them.  With `reset_parameters` they have their defaults instead.  With
        `given_before`, the specification used to load the old component, only parameters changed
        since then keep their values.
        """
        request = control_pb2.ReplaceRequest(
            runner=runner,
            component=component,
            replacement=replacement,
            reset_parameters=reset_parameters,
            given_before=given_before,
        )
        return self._connection.changed(self._stub.Replace, request, on_progress)

    def apply(
        self,
        components: Iterable[graph_pb2.ComponentSpec],
        runner: str = "",
        settings: runner_pb2.RunnerSettings | None = None,
        dry_run: bool = False,
        on_progress: OnProgress | None = None,
        *,
        rebuilt: bool = False,
        given_before: Iterable[graph_pb2.ComponentSpec] = (),
    ) -> control_pb2.ChangeResult:
        """Change the graph to `components`, at one cycle boundary.

        settings      settings of the runner to change, too
        dry_run       change nothing; only report the differences
        rebuilt       also replace components whose libraries have changed since loading
        given_before  the `components` of the last call: parameters changed since then keep their
                      values if these are valid and `components` has no new value for them

        `differences` of the result lists the changes.
        """
        request = control_pb2.ApplyRequest(
            runner=runner,
            components=several("components", components),
            settings=settings,
            dry_run=dry_run,
            rebuilt=rebuilt,
            given_before=several("given_before", given_before),
        )
        return self._connection.changed(self._stub.Apply, request, on_progress)

    def release(
        self,
        components: Iterable[str],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Reload components left out of the loop or marked as faulted."""
        request = control_pb2.ReleaseRequest(
            runner=runner, components=several("components", components)
        )
        return self._connection.changed(self._stub.Release, request, on_progress)

    def set_breaks(
        self,
        ports: Iterable[control_pb2.PortName],
        broken: bool,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Set or remove loop breaks on inputs, all at one cycle boundary."""
        request = control_pb2.SetBreaksRequest(
            runner=runner, ports=several("ports", ports), broken=broken
        )
        return self._connection.changed(self._stub.SetBreaks, request, on_progress)

    def set_parameters(
        self,
        component: str,
        parameters: Iterable[graph_pb2.ParameterSetting],
        runner: str = "",
        on_progress: OnProgress | None = None,
        lists: Iterable[graph_pb2.ListLength] = (),
        undo_with: str = "",
    ) -> control_pb2.ChangeResult:
        """Set parameters of a component, all at one cycle boundary.

        lists      lists of which `parameters` has the elements; they set the sizes of vectors
        undo_with  a leased component: rtcfd undoes the change if the holder of the lease dies
        """
        request = control_pb2.SetParametersRequest(
            runner=runner,
            component=component,
            parameters=several("parameters", parameters),
            lists=several("lists", lists),
            undo_with=undo_with,
        )
        return self._connection.changed(self._stub.SetParameters, request, on_progress)

    def undo_parameters(
        self, component: str, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Undo the last change of a component's parameters; a second call undoes the previous."""
        request = control_pb2.UndoParametersRequest(runner=runner, component=component)
        return self._connection.changed(self._stub.UndoParameters, request, on_progress)

    def get_history(
        self, component: str = "", parameter: str = "", runner: str = "", most: int = 0
    ) -> list[control_pb2.ParameterChange]:
        """Return the parameter changes, oldest first; at most the last `most` (0: all)."""
        request = control_pb2.GetHistoryRequest(
            runner=runner, component=component, parameter=parameter, most=most
        )
        return list(self._connection.ask(self._stub.GetHistory, request).changes)

    def reset_state(
        self, component: str, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Reset a component's declared state to its initial values, at one cycle boundary."""
        request = control_pb2.ResetStateRequest(runner=runner, component=component)
        return self._connection.changed(self._stub.ResetState, request, on_progress)

    def set_state(
        self,
        component: str,
        states: Iterable[graph_pb2.ParameterSetting],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Set values of a component's declared state while the loop does not run."""
        request = control_pb2.SetStateRequest(
            runner=runner, component=component, states=several("states", states)
        )
        return self._connection.changed(self._stub.SetState, request, on_progress)

    def write(
        self,
        port: str,
        value: Any,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Write a value to the input "component.port"; the component reads it in the next cycle.

        `value` is a number, bool, list, NumPy array, dict of message fields, or YAML text as in
        `rtcfctl write`.  rtcfd rejects the call if an output is connected to the input or a ROS
        node publishes its topic.  Raises ValueError if `port` is not a port name.
        """
        # Imported here to keep other commands fast.
        import json

        name = parse_port(port)
        if not isinstance(value, str):
            value = json.dumps(value, separators=(",", ":"), default=lambda array: array.tolist())
        request = control_pb2.WritePortRequest(
            runner=runner, component=name.component, port=name.port, value=value
        )
        return self._connection.changed(self._stub.WritePort, request, on_progress)

    def take_snapshot(self, runner: str = "") -> control_pb2.TakeSnapshotResponse:
        """Take a snapshot of a runner at a cycle boundary."""
        request = control_pb2.TakeSnapshotRequest(runner=runner)
        return self._connection.ask(self._stub.TakeSnapshot, request, CHANGE_TIMEOUT_S)  # type: ignore[no-any-return]

    def restore_snapshot(
        self, snapshot: bytes, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Restore a snapshot at a cycle boundary; a stopped loop is paused there."""
        request = control_pb2.RestoreSnapshotRequest(runner=runner, snapshot=snapshot)
        return self._connection.changed(self._stub.RestoreSnapshot, request, on_progress)

    def hold_runner(self, opening: control_pb2.OpenHold) -> Lease:
        """Hold a runner until the Lease ends; its messages are HoldRunnerResponse."""
        return Lease(self._stub.HoldRunner, control_pb2.HoldRunnerRequest, opening, self.socket)

    def lease_component(self, opening: control_pb2.OpenLease) -> Lease:
        """Load a component until the Lease ends; its messages are LeaseComponentResponse."""
        return Lease(
            self._stub.LeaseComponent, control_pb2.LeaseComponentRequest, opening, self.socket
        )

    def list_components(self, runner: str = "") -> list[graph_pb2.ComponentInfo]:
        """Return all components in schedule order, without values, then the left-out ones."""
        request = control_pb2.ListComponentsRequest(runner=runner)
        return self._connection.pages(self._stub.ListComponents, request, "components")

    def get_component(self, component: str, runner: str = "") -> graph_pb2.ComponentInfo:
        """Return a component with the values of its ports and parameters."""
        request = control_pb2.GetComponentRequest(runner=runner, component=component)
        return self._connection.ask(self._stub.GetComponent, request).component  # type: ignore[no-any-return]

    def get_order(self, runner: str = "") -> list[str]:
        """Return the full names of the components in schedule order."""
        request = control_pb2.GetOrderRequest(runner=runner)
        return self._connection.pages(self._stub.GetOrder, request, "components")

    def list_connections(self, runner: str = "") -> list[graph_pb2.Connection]:
        """Return all connections, sorted by name."""
        request = control_pb2.ListConnectionsRequest(runner=runner)
        return self._connection.pages(self._stub.ListConnections, request, "connections")

    def list_types(self, package: str = "") -> control_pb2.ListTypesResponse:
        """Return the component types of `package` or of all packages, and the load errors."""
        request = control_pb2.ListTypesRequest(package=package)
        # CHANGE_TIMEOUT_S: rtcfd starts a process for each library not described yet.
        found = control_pb2.ListTypesResponse()
        while True:
            response = self._connection.ask(self._stub.ListTypes, request, CHANGE_TIMEOUT_S)
            found.types.extend(response.types)
            found.problems.extend(response.problems)
            if not response.next_page_token:
                return found
            request.page_token = response.next_page_token

    def get_statistics(
        self, runner: str = "", buckets: bool = False, timeout_s: float = QUERY_TIMEOUT_S
    ) -> runner_pb2.RunnerStatistics:
        """Return the statistics of a loop and its components; with `buckets`, with histograms."""
        request = control_pb2.GetStatisticsRequest(runner=runner, buckets=buckets)
        return self._connection.ask(self._stub.GetStatistics, request, timeout_s).statistics  # type: ignore[no-any-return]

    def reset_statistics(self, runner: str = "") -> None:
        """Reset the statistics of a runner."""
        self._connection.ask(
            self._stub.ResetStatistics, control_pb2.ResetStatisticsRequest(runner=runner)
        )

    def watch_statistics(
        self, runner: str = "", interval_s: float = 1.0
    ) -> Iterator[runner_pb2.RunnerStatistics]:
        """Yield the statistics of a runner now and after each interval (at least 0.1 s).

        The stream only ends with an error, for example after removal of the runner.
        """
        request = control_pb2.WatchStatisticsRequest(
            runner=runner, interval_ms=round(interval_s * 1000)
        )
        for response in self._connection.stream(self._stub.WatchStatistics, request):
            yield response.statistics

    def watch_events(
        self,
        runners: Iterable[str] = (),
        after: Place | None = None,
        *,
        until_now: bool = False,
    ) -> NumberedStream[control_pb2.Event]:
        """Open a stream of events of some runners (default: all) and of rtcfd.

        after      the `place` of an earlier stream; Place() starts with the oldest event that
                   rtcfd keeps, None with new events
        until_now  end after the events so far; otherwise the stream ends with an error when none
                   of the runners exists
        """
        request = control_pb2.WatchEventsRequest(runners=several("runners", runners))
        return NumberedStream(
            self._stub.WatchEvents, self.socket, request, after, until_now, "events"
        )

    def watch_logs(
        self,
        runner: str = "",
        components: Iterable[str] = (),
        level: str = "debug",
        after: Place | None = None,
        *,
        until_now: bool = False,
    ) -> NumberedStream[control_pb2.LogRecord]:
        """Open a stream of log records of a runner's components and executor.

        components  if not empty, only records of these
        level       the lowest level: "debug", "info", "warn", "error" or "fatal"

        `after` and `until_now` are as in watch_events.  The stream ends with an error after removal
        of the runner.  Raises ValueError for an unknown level.
        """
        if level not in LOG_LEVELS:
            raise ValueError(f'level "{level}": must be one of {", ".join(LOG_LEVELS)}')
        request = control_pb2.WatchLogsRequest(
            runner=runner, components=several("components", components)
        )
        request.level = LOG_LEVELS[level]  # type: ignore[assignment]
        return NumberedStream(
            self._stub.WatchLogs, self.socket, request, after, until_now, "records"
        )

    def watch_ports(
        self,
        selection: Iterable[str] = (),
        runner: str = "",
        every: int = 1,
        *,
        min_max: bool = False,
        component_times: bool = False,
        allow_missing: bool = False,
    ) -> "PortStream":
        """Open a stream of values of outputs and declared state, of each `every`-th cycle.

        selection        names with the wildcards of a shell, e.g. "/arm/*.effort" (default: all)
        min_max          minima and maxima of each `every` cycles instead, see PortBatch.minima()
        component_times  also the time at which each component's update() ended, see
                         PortBatch.turns_ns; not with `min_max`
        allow_missing    permit patterns without a match, for components to be loaded later;
                         otherwise such patterns are errors

        The stream has all cycles after the return of this call.  Cycles dropped because the caller
        is slow are counted.
        """
        # Imported here to keep other commands fast.
        from rtcf.streams.ports import PortStream

        return PortStream(
            self._stub.WatchPorts,
            self.socket,
            ports_pb2.WatchPortsRequest(
                runner=runner,
                selection=several("selection", selection),
                every=every,
                min_max=min_max,
                component_times=component_times,
                allow_missing=allow_missing,
            ),
        )

    def list_incidents(self, runner: str = "") -> list[incidents_pb2.Incident]:
        """Return the incidents of `runner` or of all runners, oldest first."""
        request = incidents_pb2.ListIncidentsRequest(runner=runner)
        return self._connection.pages(self._stub.ListIncidents, request, "incidents")

    def take_incident(self, runner: str = "", reason: str = "") -> incidents_pb2.Incident:
        """Save the last cycles of a runner as an incident."""
        request = incidents_pb2.TakeIncidentRequest(runner=runner, reason=reason)
        return self._connection.ask(self._stub.TakeIncident, request, CHANGE_TIMEOUT_S).incident  # type: ignore[no-any-return]

    def get_incident(self, to: IO[bytes], name: str = "") -> incidents_pb2.Incident:
        """Write the content of an incident, by default the newest, to the open file `to`."""
        request = incidents_pb2.ReadIncidentRequest(name=name)
        incident = incidents_pb2.Incident()
        responses = self._connection.stream(self._stub.ReadIncident, request, CHANGE_TIMEOUT_S)
        for response in responses:
            if response.HasField("incident"):
                incident = response.incident
            to.write(response.data)
        return incident

    def remove_incidents(self, names: Iterable[str]) -> list[incidents_pb2.Incident]:
        """Remove incidents, all of them or none; return the removed ones."""
        request = incidents_pb2.DeleteIncidentsRequest(names=several("names", names))
        return list(self._connection.ask(self._stub.DeleteIncidents, request).incidents)


class ReplayCall(Closing):
    """A call of Client.replay, used by one thread; closing it early ends the replay."""

    def __init__(self, method: Any, socket: str) -> None:
        self._socket = socket
        self._requests: SimpleQueue[control_pb2.ReplayRequest | None] = SimpleQueue()
        self._call = method(iter(self._requests.get, None))

    def run(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Replay one part of the recording; return after its cycles, without a timeout.

        Raises RefusedError, which ends the replay, or DaemonUnreachableError.
        """
        self._requests.put(request)
        try:
            return next(self._call)  # type: ignore[no-any-return]
        except grpc.RpcError as error:
            raise failures.from_grpc(error, self._socket) from None

    def cycles(
        self, messages: list[control_pb2.RecordedMessage], until_ns: int, end: bool = False
    ) -> Iterator[control_pb2.ReplayResponse]:
        """Run all cycles up to `until_ns`; yield one or more responses.

        No message may be later than `until_ns`.  Consumed ones are removed from `messages`.  `end`
        ends the replay.
        """
        more = True
        while more:
            response = self.run(
                control_pb2.ReplayRequest(messages=messages, until_ns=until_ns, end=end)
            )
            del messages[: response.consumed]
            yield response
            more = response.more

    def close(self) -> None:
        """End the call; rtcfd then ends the replay if `end` has not."""
        self._requests.put(None)
        self._call.cancel()
