"""One runner: handles the notifications of its executor, its holders, and its settings.

Owned by Runners.  operations/ has its base class and the operations on its components
and its loop; recovery/ brings up its executor.
"""

import asyncio
import contextlib
import time

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, runner_pb2

from rtcfd.common import runner_settings
from rtcfd.common.errors import InvalidArgument, RequestError, Unavailable
from rtcfd.common.event_log import NumberedLog
from rtcfd.common.names import absolute
from rtcfd.executor.command import settings_error
from rtcfd.executor.executor import Executor
from rtcfd.executor.link import Progress
from rtcfd.executor.notifications import Notifications
from rtcfd.executor.watched_process import End
from rtcfd.operations import graph
from rtcfd.operations.keep_incident import keep
from rtcfd.operations.parameters import follow_ros, note_unanswered
from rtcfd.operations.runner_core import RunnerCore, SharedContext
from rtcfd.recovery.bring_up import bring_up
from rtcfd.recovery.crash import recover, resumes
from rtcfd.recovery.crash_source import report_source
from rtcfd.recovery.verdict import Crashes, judge
from rtcfd.runners.component_leases import ComponentLeases
from rtcfd.runners.outbox import Outbox
from rtcfd.runners.status import status_of
from rtcfd.state.desired import Desired

# The events that leave an incident.
_INCIDENTS = (control_pb2.Event.KIND_LOOP_FAULT, control_pb2.Event.KIND_COMPONENT_FAULT)
LEAVE_TIMEOUT_S = 5.0  # for running changes when rtcfd is restarted

_Ended = control_pb2.LeaseEnded


class Runner(RunnerCore):
    """One control loop."""

    def __init__(self, desired: Desired, shared: SharedContext) -> None:
        super().__init__(desired, shared)
        self.leases = ComponentLeases(self, self.alarm)
        self.hold_outbox: Outbox | None = None  # of the holder, if it is connected
        self.logs = NumberedLog[wire.LogRecord]()  # of its components and its executor
        self.releasing = False  # its holder has ended, and cannot reconnect
        self._crashes = Crashes()
        self._changed_by_ros: dict[str, set[str]] = {}  # by component, parameters not noted yet
        self._notifications = Notifications(self.name, self, lambda: self.shared.limits)

    # -- life ---------------------------------------------------------------

    async def bring_up(self, only_left_over: bool = False, boot: bool = False) -> bool:
        """Adopt or start its executor; see recovery/bring_up.py."""

        async def work() -> bool:
            return await bring_up(self, only_left_over, boot)

        return await self.change("the start of its executor", work, patient=True)

    async def shut_down(
        self,
        why: "control_pb2.LeaseEnded.Why" = _Ended.WHY_UNLOADED,
        message: str = "it is removed",
        in_order: bool = False,
        spare_silent: bool = False,
    ) -> None:
        """Stop the loop in order and end the executor.

        Holders receive the last log records, then the reason (`why`, `message`).  `in_order`:
        permanently, so that the next rtcfd does not start the loop.  `spare_silent`: leave an
        executor alone that could not be adopted.
        """
        self.closing = True
        self.loop.stops += 1
        self.operations.withdraw(message, errors_pb2.REASON_RUNNER_ENDING)
        saving: list[asyncio.Task[list[str]]] = []
        if in_order and self.loop.wanted:
            self.loop.stop()
            saving.append(asyncio.create_task(self.save()))
        try:
            await self.end_executor("it is being ended", spare_silent)
        finally:
            await asyncio.gather(*saving)
        self.end_leases(why, f"runner {self.name}: {message}")
        self.logs.end()
        await self.operations.drain()
        await self.saver.finish(LEAVE_TIMEOUT_S)

    async def leave(self) -> None:
        """Leave the executor to the next rtcfd; its loop goes on.

        Running changes end first, unless they take longer than LEAVE_TIMEOUT_S: the next rtcfd
        takes over the graph that the executor has.
        """
        self.closing = self.leaving = True
        self.leases.lose_patience()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self.operations.drain(), LEAVE_TIMEOUT_S)
        self.operations.withdraw("rtcfd is being restarted", errors_pb2.REASON_DAEMON_ENDING)
        await self.leave_executor()
        await self.saver.finish(LEAVE_TIMEOUT_S)

    async def restart(self) -> None:
        """Replace the executor by a new one, even if it is stuck; load the graph, held."""
        self.loop.stop()
        self.saver.begin()
        self.operations.withdraw(
            "its executor is being restarted", errors_pb2.REASON_LOOP_STOPPED, only_cycles=True
        )

        async def fresh() -> None:
            if not self.up:
                await bring_up(self)
            await self.save()

        async def work() -> None:
            # Not in a turn: a hanging change only ends with its executor.
            stuck = await self.stuck()
            if stuck is not None and stuck.in_graph:
                self.leave_out(stuck)
                self.saver.begin()
            await self.end_executor("its executor is being restarted")
            self.loop.held = self.loop.fault = ""
            await self.change("the restart of its executor", fresh, patient=True)
            self.log.info("executor restarted")

        await self.operations.begin("the restart", work)

    async def restart_in_turn(self) -> None:
        """Replace the executor by a new one; to be called in a turn."""
        await self.end_executor("its executor is being restarted")
        self.loop.held = self.loop.fault = ""
        await bring_up(self)

    async def unload(
        self, request: control_pb2.UnloadRequest, progress: Progress
    ) -> control_pb2.ChangeResult:
        """Unload components; with `force`, even if a hook does not return."""
        if not request.force:
            return await graph.unload(self, request, progress)
        stuck = await self.stuck()
        if stuck is None:
            try:
                result = await graph.unload(self, request, progress)
            except Unavailable:
                if (stuck := await self.stuck()) is None:
                    raise
            else:
                if (stuck := await self.stuck()) is None:
                    return result
        names = [absolute(name) for name in request.components]
        hung = f"{stuck.component}.{stuck.hook}()"
        known = [*self.desired.components, stuck.component]
        graph.require_known(self, [name for name in names if name not in known])
        self.desired.drop(names)
        self.happened(control_pb2.Event.KIND_GRAPH, f"{', '.join(names)} unloaded by force")
        progress(f"ending the executor of {self.name}: {hung} does not return")
        await self.restart()
        note = (
            f"the executor has ended, and its loop, as {hung} did not return; the rest of the "
            f"graph is loaded again: `rtcfctl -r {self.name} start` starts it"
        )
        return control_pb2.ChangeResult(notes=[note])

    def end_leases(self, why: "control_pb2.LeaseEnded.Why", message: str) -> None:
        """Tell the holders of this runner and of its components that their leases have ended."""
        self.leases.end_all(why, message)
        # If the holder itself ends its lease, release() waits for this, and its call answers.
        if self.hold_outbox is not None and not self.releasing:
            self.hold_outbox.end(why, message)
            self.hold_outbox = None

    # -- notifications from the executor --------------------------------------

    def take_unasked(self, response: wire.Response) -> None:
        """Handle a notification from the executor."""
        self._notifications.take(response)

    def adopted(self) -> None:
        """Give holders time to reconnect, after a restart of rtcfd."""
        self.leases.await_holders()

    def executor_ended(self, executor: Executor, end: End, ours: bool) -> None:
        """Handle the death of an executor: report it, and begin the recovery."""
        # A loop that was stopped meanwhile must not run in the next executor.
        was_running = self.loop.running and self.loop.wanted
        self.loop.gone()
        verdict = judge(end, executor.note())
        executor.safe = verdict.safe
        note_unanswered(self)
        keep(self, executor, f"executor {verdict}", verdict.culprit)
        died = f"its executor (pid {executor.pid}) {verdict} at {time.strftime('%H:%M:%S')}"
        self.down_reason = executor.verdict = died
        self.log.logger.error(
            "executor (pid %d) %s: its loop is down",
            executor.pid,
            verdict,
            extra={"runner": self.name, "component": verdict.culprit},
        )
        self.happened(control_pb2.Event.KIND_EXECUTOR_FAULT, died, verdict.culprit)
        if (trace := executor.trace()) is not None:
            # Not an operation of this runner, so that its removal does not wait for it.
            self.shared.keeping.in_background(
                "finding the source lines of a crash", report_source(self, trace, verdict)
            )
        self.shared.on_change()
        if ours and verdict.orderly:
            self.down_reason += (
                f"; `rtcfctl -r {self.name} start` brings it back with its components"
            )
            self.loop_ended("", self.down_reason)
        elif ours:
            self._crashes.add()
            # A new component that crashes does not make the old one of its name guilty.
            if not (verdict.first and verdict.culprit == self.replacing):
                self.desired.quarantine(verdict.culprit, str(verdict))
            # Decided now, so that a `stop` from here on overrides it.
            self.loop.want(was_running and resumes(self, verdict, self._crashes))
            if not self.loop.wanted:
                self.loop.fault = died
            self.notify_change()
            self.operations.in_background(
                "the recovery of its executor", recover(self, verdict, self._crashes, died)
            )

    def loop_ended(self, component: str, reason: str) -> None:
        """Handle the end of the loop by a fault."""
        self.loop.ended(reason)
        self.notify_change()
        self.leases.failed(component, reason)
        self.operations.in_background("saving its state", self.save())

    def component_failed(self, component: str, reason: str) -> None:
        """Handle the failure of a component without which the loop goes on."""
        self.leases.failed(component, reason)

    def event_occurred(self, kind: "control_pb2.Event.Kind", event: wire.Event) -> None:
        """Handle an event, after its specific method: publish it, and write an incident."""
        self.happened(kind, event.message, event.component, event.iteration)
        if kind in _INCIDENTS and self.executor is not None:
            keep(self, self.executor, event.message, event.component, event.iteration)

    def late(self, message: str) -> None:
        """Handle a report of late cycles: ask for their number."""

        async def look() -> None:
            with contextlib.suppress(RequestError):
                answer = await self.query(wire.Request(get_status=wire.GetStatus()))
                self.counters.note_late_cycles(answer.status, message)

        self.operations.in_background("counting late cycles", look())

    def take_log(self, record: wire.LogRecord) -> None:
        """Keep a record, and send it to the holder of its component, or of the runner."""
        self.logs.append(record)
        if self.hold_outbox is None and not self.desired.leased:
            return
        copy = control_pb2.LogRecord(
            level=wire.LogRecord.Level.Name(record.level),
            time_ns=record.time_ns,
            iteration=record.iteration,
            component=record.component,
            message=record.message,
            file=record.file,
            line=record.line,
        )
        if not self.leases.take_log(copy) and self.hold_outbox is not None:
            self.hold_outbox.log(copy)

    def alarm(self, text: str) -> None:
        """Log an error, and send it to the holder of the runner."""
        self.log.error("%s", text)
        if self.hold_outbox is not None:
            self.hold_outbox.log(
                control_pb2.LogRecord(level="LEVEL_ERROR", time_ns=time.time_ns(), message=text)
            )

    def notify_change(self) -> None:
        """Notify systemd, event watchers and holders; to be called after each change."""
        super().notify_change()
        self.leases.settle()
        if self.hold_outbox is not None:
            loaded = sum(name not in self.desired.left_out for name in self.desired.components)
            self.hold_outbox.report(
                control_pb2.HoldReport(
                    components=loaded if self.up else 0,
                    running=self.loop.running,
                    fault=self.loop.fault,
                )
            )

    def called(self, call: wire.ServiceCall) -> None:
        """Handle a call of a service of the executor's ROS node."""
        self.operations.in_background("the answer to a ROS service", self._answer(call))

    async def _answer(self, call: wire.ServiceCall) -> None:
        answer = await self.shared.serve_ros(self, call)
        # If the executor has ended meanwhile, its caller has an error already.
        with contextlib.suppress(RequestError):
            await self.alive().request(wire.Request(service_answer=answer))

    def stopped_directly(self, stop: wire.DirectStop) -> None:
        """Handle a direct stop at the executor."""
        if stop.at_ns <= self.loop.stopped_at_ns:
            return  # repeated by a new connection
        self.loop.stopped_at_ns = stop.at_ns
        self.loop.stop()
        self.loop.note_report(False)
        self.operations.withdraw(
            "the loop was stopped at its executor", errors_pb2.REASON_LOOP_STOPPED, only_cycles=True
        )
        self.notify_change()
        self.operations.in_background("noting a stop", self._note_direct_stop(stop))

    async def _note_direct_stop(self, stop: wire.DirectStop) -> None:
        self.saver.begin()
        user = await self.shared.name_of(stop.uid)
        self.happened(
            control_pb2.Event.KIND_RUNNER_STATE,
            f"stopped at its executor by {user} (pid {stop.pid})",
            user=user,
        )
        self.log.warning(
            "loop stopped at its executor by %s (uid %d, pid %d)", user, stop.uid, stop.pid
        )
        await self.save()  # errors show in the status

    def parameters_changed(self, changed: wire.ParametersChanged) -> None:
        """Handle a change of a component's parameters by a ROS peer."""
        follows = bool(self._changed_by_ros)
        self._changed_by_ros.setdefault(changed.component, set()).update(changed.parameters)
        if not follows:
            self.operations.in_background(
                "noting parameters changed by ROS", self._follow_parameters()
            )

    async def _follow_parameters(self) -> None:
        """Note all changes until the turn begins, and save once."""

        async def work() -> None:
            changes, self._changed_by_ros = self._changed_by_ros, {}
            await follow_ros(self, changes)
            await self.save()

        try:
            await self.change("a change of parameters by ROS", work, patient=True)
        except RequestError as error:
            self._changed_by_ros = {}
            self.log.warning("parameters changed by ROS are not noted: %s", error)

    # -- queries ------------------------------------------------------------

    async def status(self) -> runner_pb2.RunnerStatus:
        """Return the status, in any state."""
        return await status_of(self)

    # -- settings -----------------------------------------------------------

    async def set(self, change: runner_pb2.RunnerSettings) -> None:
        """Change settings; those that an executor reads only at its start take effect when the
        loop is stopped."""
        runner_settings.check(change)

        async def work() -> None:
            if self.up:
                effect = self.desired.effect(change, self.shared.defaults)
                await self.ask(wire.Request(configure=effect))
            else:
                await self._require_acceptable(change)
                self._note_untried_settings()
            self.desired.choose(change)
            self.happened(control_pb2.Event.KIND_RUNNER_SETTINGS, "settings changed")
            await self.save()
            self.log.info("settings changed")

        await self.change("a change of settings", work)

    def _note_untried_settings(self) -> None:
        # The reason stays, because it may have nothing to do with the settings.
        untried = f"settings changed since then: `rtcfctl runner restart {self.name}` tries them"
        if untried not in self.down_reason:
            self.down_reason += f"; {untried}"

    async def _require_acceptable(self, change: runner_pb2.RunnerSettings) -> None:
        # Otherwise the next executor would reject them, and the runner would have none.
        after = runner_settings.merged(self.settings(), change)
        binary = self.shared.command.binary
        if error := await asyncio.to_thread(settings_error, binary, after):
            raise InvalidArgument(error, errors_pb2.REASON_VALUE_INVALID)

    async def follow_limits(self) -> None:
        """Apply changed limits and access rules."""
        try:
            await self.change("a change of limits", self.limit, patient=True)
        except RequestError as error:
            self.log.error("limits not changed: %s", error)

    async def follow_defaults(self, before: runner_pb2.RunnerSettings) -> list[str]:
        """Apply changed defaults; `before` are the old ones.  Return a line for each change."""
        change: runner_pb2.RunnerSettings = runner_settings.changed(
            self.desired.complete(before), self.settings()
        )
        lines = runner_settings.differences(self.desired.complete(before), change)
        if not lines:
            return []

        async def work() -> None:
            if self.up:
                await self.ask(wire.Request(configure=change))

        try:
            await self.change("a change of defaults", work, patient=True)
        except RequestError as error:
            return [f"{self.name}: not changed: {error}"]
        return [f"{self.name}: {line}" for line in lines]
