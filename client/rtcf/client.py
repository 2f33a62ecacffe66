"""The client of rtcfd: one method per call of `rtcf.v1.Control`."""

from collections.abc import Iterable
from typing import Any

from rtcf_shared.errors import RtcfError
from rtcf_shared.spec import parse_port, several

from rtcf import direct_stop
from rtcf.connection import CHANGE_TIMEOUT_S, QUERY_TIMEOUT_S, OnProgress
from rtcf.errors import DaemonUnreachableError
from rtcf.incidents import Incidents
from rtcf.replay_call import ReplayCall
from rtcf.tenancy import Tenancy
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

DEFAULT_RUNNER = "rt_runner"


class Client(Incidents):
    """A connection to rtcfd; opened with the first call, thread-safe.

    `runner` in the methods names one; empty is rt_runner.  All methods raise
    RefusedError, DaemonUnreachableError (the constructor too, of a path that no
    socket can have) or RtcfError; TypeError, before anything is asked, where a text
    stands for several names.  `on_progress` is called with a line for each
    step of a long call.
    """

    def get_status(
        self, runner: str = "", timeout_s: float = QUERY_TIMEOUT_S
    ) -> control_pb2.GetStatusResponse:
        """Return the status of rtcfd and of all runners, or of the one named."""
        request = control_pb2.GetStatusRequest(runner=runner)
        return self._ask(self._stub.GetStatus, request, timeout_s)  # type: ignore[no-any-return]

    def reload(self) -> list[str]:
        """Make rtcfd read its settings and graphs.d again; return a line for each change."""
        response = self._change(self._stub.Reload, control_pb2.ReloadRequest(), None)
        return list(response.result.notes)

    def list_runners(self) -> list[runner_pb2.RunnerStatus]:
        """Return the status of all runners by name, however many there are."""
        return self._pages(self._stub.ListRunners, control_pb2.ListRunnersRequest(), "runners")

    def add_runner(
        self,
        runner: str,
        settings: runner_pb2.RunnerSettings | None = None,
        on_progress: OnProgress | None = None,
    ) -> runner_pb2.RunnerStatus:
        """Add a runner and start its executor; what `settings` leave open takes its default."""
        request = control_pb2.AddRunnerRequest(runner=runner, settings=settings)
        return self._change(self._stub.AddRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def set_runner(
        self,
        settings: runner_pb2.RunnerSettings,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> runner_pb2.RunnerStatus:
        """Change settings; what `settings` leave open stays."""
        request = control_pb2.SetRunnerRequest(runner=runner, settings=settings)
        return self._change(self._stub.SetRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def remove_runner(self, runner: str, on_progress: OnProgress | None = None) -> None:
        """Stop a runner's loop, end its executor and forget it."""
        request = control_pb2.RemoveRunnerRequest(runner=runner)
        self._change(self._stub.RemoveRunner, request, on_progress)

    def restart_runner(
        self, runner: str, on_progress: OnProgress | None = None
    ) -> runner_pb2.RunnerStatus:
        """Begin anew with a fresh executor and the same graph, not started."""
        request = control_pb2.RestartRunnerRequest(runner=runner)
        return self._change(self._stub.RestartRunner, request, on_progress).runner  # type: ignore[no-any-return]

    def start(
        self,
        runner: str = "",
        on_progress: OnProgress | None = None,
        *,
        without: Iterable[str] = (),
        partial: bool = False,
    ) -> control_pb2.ChangeResult:
        """Start the loop; one that runs is left alone.

        Refused where components are left out of it that are not optional, unless they are
        named in `without`, or `partial` says that it may be any.
        """
        request = control_pb2.StartRequest(
            runner=runner, without=several("without", without), partial=partial
        )
        return self._changed(self._stub.Start, request, on_progress)

    def stop(
        self, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """End the loop at the next cycle boundary.

        Where rtcfd cannot be reached, has no place for another client, or does
        not answer within half a second, the loop's executor is asked itself; a note
        of the result says so.
        """

        request = control_pb2.StopRequest(runner=runner)
        return direct_stop.where_rtcfd_does_not(
            lambda heard: self._changed(self._stub.Stop, request, heard, patient=False),
            runner or DEFAULT_RUNNER,
            self.socket,
            on_progress,
        )

    def stop_all(self) -> list[direct_stop.Stopped]:
        """End all loops at once, at their executors; then tell rtcfd, if it answers soon.

        Raises nothing: what came of each loop is in the result, by runner.
        """
        trouble: RtcfError | None = None
        try:
            stopped = {each.runner: each for each in direct_stop.stop_all(self.socket)}
        except RtcfError as error:
            stopped, trouble = {}, error
        try:
            runners = [
                each.runner for each in self.get_status(timeout_s=direct_stop.PATIENCE_S).runners
            ]
        except RtcfError as error:
            if not stopped:
                # Of who may neither look nor ask, rtcfd's door says how to mend it.
                both = (
                    error if trouble is None else DaemonUnreachableError(str(trouble), str(error))
                )
                stopped[""] = direct_stop.Stopped("", both)
            runners = []
        # A runner without an executor may be about to get one.
        for runner in runners:
            request = control_pb2.StopRequest(runner=runner)
            try:
                result = self._changed(
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
        """Run cycles of a stopped loop on a simulated clock, as fast as they go.

        Goes on where the last call paused, until the next stop or start; takes
        as long as the cycles take.
        """
        request = control_pb2.StepRequest(runner=runner, cycles=cycles)
        return self._changed(self._stub.Step, request, on_progress, timeout_s=None)

    def replay(self) -> ReplayCall:
        """Open a replay, which lasts as long as the call; see rtcf.replay for whole recordings."""
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

        With `wait`, one whose hooks need a ROS master waits for it as long as it takes.
        """
        request = control_pb2.LoadRequest(runner=runner, component=component, wait=wait)
        if not wait:
            return self._changed(self._stub.Load, request, on_progress)
        return self._changed(self._stub.Load, request, on_progress, timeout_s=None)

    def unload(
        self,
        components: Iterable[str],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Unload components, all at one cycle boundary."""
        request = control_pb2.UnloadRequest(
            runner=runner, components=several("components", components)
        )
        return self._changed(self._stub.Unload, request, on_progress)

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
        """Put a new component in the place of an old one; what is empty in it is the old one's.

        So are parameters that it does not name, as the result's `kept` and `notes` tell; with
        `reset_parameters` they begin with their defaults.  With `given_before`, what the old one
        was loaded as, only those stay that were tuned since.
        """
        request = control_pb2.ReplaceRequest(
            runner=runner,
            component=component,
            replacement=replacement,
            reset_parameters=reset_parameters,
            given_before=given_before,
        )
        return self._changed(self._stub.Replace, request, on_progress)

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
        """Make the graph what `components` say, all at one cycle boundary.

        With `rebuilt`, components whose library has changed since they were loaded are
        replaced, too.  With `given_before`, what the last call said, parameters that were tuned
        since stay where they fit and `components` say nothing new.  The result's `differences`
        tell what was changed, or would be.
        """
        request = control_pb2.ApplyRequest(
            runner=runner,
            components=several("components", components),
            settings=settings,
            dry_run=dry_run,
            rebuilt=rebuilt,
            given_before=several("given_before", given_before),
        )
        return self._changed(self._stub.Apply, request, on_progress)

    def release(
        self,
        components: Iterable[str],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Load components anew that are left out of the loop, or that a fault has marked."""
        request = control_pb2.ReleaseRequest(
            runner=runner, components=several("components", components)
        )
        return self._changed(self._stub.Release, request, on_progress)

    def set_breaks(
        self,
        ports: Iterable[control_pb2.PortName],
        broken: bool,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Set (or remove) loop breaks on inputs, all at one cycle boundary."""
        request = control_pb2.SetBreaksRequest(
            runner=runner, ports=several("ports", ports), broken=broken
        )
        return self._changed(self._stub.SetBreaks, request, on_progress)

    def set_parameters(
        self,
        component: str,
        parameters: Iterable[graph_pb2.ParameterSetting],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Change parameters of a component, all at one cycle boundary."""
        request = control_pb2.SetParametersRequest(
            runner=runner, component=component, parameters=several("parameters", parameters)
        )
        return self._changed(self._stub.SetParameters, request, on_progress)

    def undo_parameters(
        self, component: str, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Take back what was changed last of a component's parameters; again, what was before."""
        request = control_pb2.UndoParametersRequest(runner=runner, component=component)
        return self._changed(self._stub.UndoParameters, request, on_progress)

    def get_history(
        self, component: str = "", parameter: str = "", runner: str = "", most: int = 0
    ) -> list[control_pb2.ParameterChange]:
        """Return who set which parameter to what, oldest first; `most`: the newest so many."""
        request = control_pb2.GetHistoryRequest(
            runner=runner, component=component, parameter=parameter, most=most
        )
        return list(self._ask(self._stub.GetHistory, request).changes)

    def reset_state(
        self, component: str, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Take a component's declared state back to its initial values, at one cycle boundary."""
        request = control_pb2.ResetStateRequest(runner=runner, component=component)
        return self._changed(self._stub.ResetState, request, on_progress)

    def set_state(
        self,
        component: str,
        states: Iterable[graph_pb2.ParameterSetting],
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Set values of a component's declared state, of a loop that does not run."""
        request = control_pb2.SetStateRequest(
            runner=runner, component=component, states=several("states", states)
        )
        return self._changed(self._stub.SetState, request, on_progress)

    def write(
        self,
        port: str,
        value: Any,
        runner: str = "",
        on_progress: OnProgress | None = None,
    ) -> control_pb2.ChangeResult:
        """Give the input "component.port" a value in the next cycle, as if it came from outside.

        A number, bool, list or NumPy array, fields of a message in a dict; a str is YAML, as in
        `rtcfctl write`.  Refused where a component feeds it or a ROS node publishes its topic;
        raises ValueError on a name that is no port's.
        """
        # Few commands need it, and each import is time.
        import json

        name = parse_port(port)
        if not isinstance(value, str):
            value = json.dumps(value, default=lambda array: array.tolist())
        request = control_pb2.WritePortRequest(
            runner=runner, component=name.component, port=name.port, value=value
        )
        return self._changed(self._stub.WritePort, request, on_progress)

    def take_snapshot(self, runner: str = "") -> control_pb2.TakeSnapshotResponse:
        """Copy all that a runner's next cycle depends on, of one cycle boundary."""
        request = control_pb2.TakeSnapshotRequest(runner=runner)
        return self._ask(self._stub.TakeSnapshot, request, CHANGE_TIMEOUT_S)  # type: ignore[no-any-return]

    def restore_snapshot(
        self, snapshot: bytes, runner: str = "", on_progress: OnProgress | None = None
    ) -> control_pb2.ChangeResult:
        """Go on from a snapshot, at one cycle boundary; a loop that does not run is paused."""
        request = control_pb2.RestoreSnapshotRequest(runner=runner, snapshot=snapshot)
        return self._changed(self._stub.RestoreSnapshot, request, on_progress)

    def hold_runner(self, opening: control_pb2.OpenHold) -> Tenancy:
        """Take a runner for as long as the tenancy lasts; its messages are HoldRunnerResponse."""
        return Tenancy(self._stub.HoldRunner, control_pb2.HoldRunnerRequest, opening, self.socket)

    def lease_component(self, opening: control_pb2.OpenLease) -> Tenancy:
        """Load a component for as long as the tenancy lasts; its messages are
        LeaseComponentResponse."""
        return Tenancy(
            self._stub.LeaseComponent, control_pb2.LeaseComponentRequest, opening, self.socket
        )

    def list_components(self, runner: str = "") -> list[graph_pb2.ComponentInfo]:
        """Return all components in order of the schedule, without values; then those left out."""
        request = control_pb2.ListComponentsRequest(runner=runner)
        return self._pages(self._stub.ListComponents, request, "components")

    def get_component(self, component: str, runner: str = "") -> graph_pb2.ComponentInfo:
        """Return one component with the values of its ports and parameters."""
        request = control_pb2.GetComponentRequest(runner=runner, component=component)
        return self._ask(self._stub.GetComponent, request).component  # type: ignore[no-any-return]

    def get_order(self, runner: str = "") -> list[str]:
        """Return the full names of the components in order of the schedule."""
        request = control_pb2.GetOrderRequest(runner=runner)
        return self._pages(self._stub.GetOrder, request, "components")

    def list_connections(self, runner: str = "") -> list[graph_pb2.Connection]:
        """Return all connections by name."""
        request = control_pb2.ListConnectionsRequest(runner=runner)
        return self._pages(self._stub.ListConnections, request, "connections")

    def list_types(self, package: str = "") -> control_pb2.ListTypesResponse:
        """Return the component types of a package, or of all, and what does not load."""
        request = control_pb2.ListTypesRequest(package=package)
        # Each library that rtcfd does not know yet is described in a process of its own.
        found = control_pb2.ListTypesResponse()
        while True:
            response = self._ask(self._stub.ListTypes, request, CHANGE_TIMEOUT_S)
            found.types.extend(response.types)
            found.problems.extend(response.problems)
            if not response.next_page_token:
                return found
            request.page_token = response.next_page_token

    def get_statistics(
        self, runner: str = "", buckets: bool = False, timeout_s: float = QUERY_TIMEOUT_S
    ) -> runner_pb2.RunnerStatistics:
        """Return the figures of a runner's loop and of its components; with `buckets`, how often
        the loop took how long, too."""
        request = control_pb2.GetStatisticsRequest(runner=runner, buckets=buckets)
        return self._ask(self._stub.GetStatistics, request, timeout_s).statistics  # type: ignore[no-any-return]

    def reset_statistics(self, runner: str = "") -> None:
        """Begin the figures anew."""
        self._ask(self._stub.ResetStatistics, control_pb2.ResetStatisticsRequest(runner=runner))
