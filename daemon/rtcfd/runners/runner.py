"""One runner: its executor, its desired state, and its loop.

Owned by Runners.  Changes take turns; `stop` and queries wait for none of
them.  What changes the components is in operations/, how an executor gets its
graph (again) in recovery/.
"""

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, TypeVar

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

from rtcfd import VERSION
from rtcfd.catalog.catalog import Catalog
from rtcfd.common import runner_settings
from rtcfd.common.limits import Limits
from rtcfd.common.refusals import Refusal, Unavailable
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.events import Events, logger_of
from rtcfd.executor.executor import CONNECT_TIMEOUT_S, Executor
from rtcfd.executor.link import Progress
from rtcfd.executor.process import End
from rtcfd.operations.queue import Queue
from rtcfd.recovery import restore
from rtcfd.recovery.verdict import Crashes, judge
from rtcfd.runners.leases import Leases
from rtcfd.runners.outbox import Outbox
from rtcfd.state.desired import Desired
from rtcfd.state.store import Store

CHANGE_TIMEOUT_S = 60.0  # for one change, waiting for those before it included
STOP_TIMEOUT_S = 30.0
STATUS_TIMEOUT_S = 2.0
LEAVE_TIMEOUT_S = 5.0  # for changes under way when rtcfd is restarted
_LAST_WORDS_S = 2.0  # from the loss of a link to the end of its executor
_WORTH_SAYING_S = 2.0  # a change that takes longer shows in the status

_Ended = control_pb2.LeaseEnded

Result = TypeVar("Result")


@dataclass
class Surroundings:
    """What all runners share; a reload of rtcfd changes it."""

    command: ExecutorCommand
    catalog: Catalog
    store: Store
    defaults: runner_pb2.RunnerSettings  # complete
    on_change: Callable[[], None]  # what summary() says may have changed
    # Answers what ROS peers ask of a runner.
    serve_ros: Callable[["Runner", wire.ServiceCall], Awaitable[wire.ServiceAnswer]]
    limits: Limits = field(default_factory=Limits)


class Runner:
    """One control loop as rtcfd sees it."""

    def __init__(self, desired: Desired, surroundings: Surroundings) -> None:
        self.name = desired.runner
        self.desired = desired
        self.crashes = Crashes()
        self.held = ""  # why the loop is not started, if that was not asked for
        self.running = False  # the loop, as far as told
        self.log = logger_of(self.name)
        self._shared = surroundings
        self._queue = Queue(self.name, self.log)
        self.leases = Leases(self)
        self.hold_outbox: Outbox | None = None  # of the holder, if it is there
        self.fault = ""  # why the loop ended by itself
        self._events = Events(self.name, self, lambda: self.limits)
        self._executor: Executor | None = None
        self._trouble = "its executor is not started"  # why there is none
        self._saving = asyncio.Lock()
        self._unsaved = ""  # why the desired state is not on disk
        self._closing = False
        self._leaving = False  # it ends for this rtcfd only
        self._settled = asyncio.Event()  # not set while an executor is being started
        self._background: set[asyncio.Task[None]] = set()

    @property
    def left_out(self) -> dict[str, str]:
        """Components that are desired and not loaded, and why."""
        return self.desired.left_out

    @left_out.setter
    def left_out(self, names: dict[str, str]) -> None:
        self.desired.left_out = names

    # -- life ---------------------------------------------------------------

    async def bring_up(self, only_left_over: bool = False) -> bool:
        """Adopt the executor that is there, or start one (unless `only_left_over`) and load
        the components; held, or as `on_boot` says.  Tell whether there is one."""

        async def work() -> bool:
            return await self.start_executor(only_left_over, boot=True)

        return await self.change("the start of its executor", work)

    async def shut_down(
        self,
        why: "control_pb2.LeaseEnded.Why" = _Ended.WHY_UNLOADED,
        message: str = "it is removed",
    ) -> None:
        """Stop the loop in order and end the executor; holders hear the last records, then why."""
        self._closing = True
        executor, self._executor = self._executor, None
        self._trouble = "it is being ended"
        if executor is not None:
            await executor.shut_down()
        self.end_leases(why, f"runner {self.name}: {message}")
        await self._queue.drain()
        await asyncio.gather(*self._background)

    async def leave(self) -> None:
        """Let go of the executor, whose loop goes on until the next rtcfd adopts it.

        Changes under way come first, but for those that take long: what an
        executor has then is what the next rtcfd takes over.
        """
        self._closing = self._leaving = True
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._queue.drain(), LEAVE_TIMEOUT_S)
        executor, self._executor = self._executor, None
        if executor is not None:
            await executor.leave()

    async def start_executor(self, only_left_over: bool = False, boot: bool = False) -> bool:
        """Do what bring_up() says, in a turn; without `boot` the loop is held."""
        self._settled.clear()
        self._trouble = "its executor is starting"
        try:
            executor = await Executor.adopt(
                self.name, self._shared.command.socket(self.name), self._events.take, self._ended
            )
            adopted = executor is not None
            if executor is None and only_left_over:
                self._trouble = "it has no executor"
                return False
            executor = executor or await self._launch()
            if self._closing:
                await (executor.leave() if self._leaving else executor.shut_down())
                raise Unavailable(f"runner {self.name} is being ended")
            self._executor = executor
        except Refusal as refusal:
            self._trouble = str(refusal)
            raise
        finally:
            self._settled.set()
        self._trouble = ""
        if executor.foreign:
            self.running = self.desired.running  # as far as can be known
            return True
        await self._limit()
        if adopted:
            await restore.follow(self)
        else:
            await restore.restore(self)
        if boot:
            await restore.resume(self)
        self._shared.on_change()
        return True

    async def restart(self) -> None:
        """Begin anew with a fresh executor, whatever the one of now is stuck in; what is desired
        is loaded, held."""

        async def work() -> None:
            if not self.up:
                await self.start_executor()
            await self.save()

        # Not in a turn: a change that hangs ends with the executor it hangs in.
        await self._end_executor()
        self.desired.running = False
        await self.change("the restart of its executor", work)
        self.log.info("executor restarted")

    async def restart_executor(self) -> None:
        """Begin anew with a fresh executor, in a turn; what is desired is loaded, held."""
        await self._end_executor()
        await self.start_executor()

    async def _end_executor(self) -> None:
        executor, self._executor = self._executor, None
        if executor is not None:
            self._trouble = "its executor is being restarted"
            await executor.shut_down()
        self.running, self.held, self.fault = False, "", ""

    def end_leases(self, why: "control_pb2.LeaseEnded.Why", message: str) -> None:
        """Tell the holders of this runner and of its components that it is over."""
        self.leases.end_all(why, message)
        if self.hold_outbox is not None:
            self.hold_outbox.end(why, message)
            self.hold_outbox = None

    async def _launch(self) -> Executor:
        executor = await Executor.launch(
            self.name, self._shared.command, self._events.take, self._ended
        )
        try:
            await executor.request(wire.Request(configure=self.settings()))
        except BaseException:
            await executor.shut_down()
            raise
        return executor

    def _ended(self, executor: Executor, end: End) -> None:
        """An executor of ours is dead."""
        was_running, self.running = self.running, False
        ours = executor is self._executor
        if ours:
            self._executor = None
        if executor.expected or self._closing:
            self.log.info("executor (pid %d) %s", executor.pid, end)
            return
        verdict = judge(end, executor.note())
        self._trouble = (
            f"its executor (pid {executor.pid}) {verdict} at {time.strftime('%H:%M:%S')}"
        )
        self.log.logger.error(
            "executor (pid %d) %s: its loop is down",
            executor.pid,
            verdict,
            extra={"runner": self.name, "component": verdict.culprit},
        )
        self._shared.on_change()
        if ours and verdict.orderly:
            self._trouble += f"; `rtcfctl -r {self.name} start` brings it back with its components"
            self.loop_ended("", self._trouble)
        elif ours:
            self.crashes.add()
            self.desired.quarantine(verdict.culprit, str(verdict))
            # From here on a `stop` counts.
            self.desired.running = was_running and restore.resumes(self, verdict)
            if not self.desired.running:
                self.fault = self._trouble
            self.tell()
            self.in_background(restore.recover(self, verdict, self._trouble))

    def loop_ended(self, component: str, reason: str) -> None:
        """The loop has ended by itself."""
        self.fault = reason
        self._note_running(False)
        self.leases.failed(component, reason)
        self.in_background(self._save_quietly())

    def component_failed(self, component: str, reason: str) -> None:
        """A component was taken out of the loop, which goes on."""
        self.leases.failed(component, reason)

    def take_log(self, record: wire.LogRecord) -> None:
        """Hand a record to whom it concerns: the holder of the component, or of the runner."""
        if self.hold_outbox is None and not self.desired.leased:
            return
        copy = control_pb2.LogRecord(
            level=wire.LogRecord.Level.Name(record.level),
            time_ns=record.time_ns,
            iteration=record.iteration,
            component=record.component,
            message=record.message,
        )
        if record.component:
            self.leases.take_log(copy)
        elif self.hold_outbox is not None:
            self.hold_outbox.log(copy)

    def alarm(self, text: str) -> None:
        """Say what went wrong, to the holder of the runner too."""
        self.log.error("%s", text)
        if self.hold_outbox is not None:
            self.hold_outbox.log(
                control_pb2.LogRecord(level="LEVEL_ERROR", time_ns=time.time_ns(), message=text)
            )

    def tell(self) -> None:
        """After any change: tell who wants to know."""
        self._shared.on_change()
        self.leases.settle()
        if self.hold_outbox is not None:
            loaded = sum(name not in self.left_out for name in self.desired.components)
            self.hold_outbox.report(
                control_pb2.HoldReport(
                    components=loaded if self.up else 0, running=self.running, fault=self.fault
                )
            )

    def called(self, call: wire.ServiceCall) -> None:
        """Somebody calls a service of the executor's ROS node."""
        self.in_background(self._answer(call))

    async def _answer(self, call: wire.ServiceCall) -> None:
        answer = await self._shared.serve_ros(self, call)
        # An executor that has ended since has told its caller so.
        with contextlib.suppress(Refusal):
            await self._alive().request(wire.Request(service_answer=answer))

    def parameters_changed(self, changed: wire.ParametersChanged) -> None:
        """A peer on ROS has changed parameters of a component."""
        names = ", ".join(changed.parameters)
        self.log.info("%s: %s set by dynamic_reconfigure", changed.component, names)
        self.in_background(self._follow_parameters(changed))

    async def _follow_parameters(self, changed: wire.ParametersChanged) -> None:
        async def work() -> None:
            # Not what was told: more may have happened since.
            request = control_pb2.GetComponentRequest(component=changed.component)
            response = await self.ask(wire.Request(get_component=request))
            settings = [
                graph_pb2.ParameterSetting(name=each.name, value=each.value)
                for each in response.component.parameters
                if each.name in changed.parameters
            ]
            self.desired.set_parameters(changed.component, settings)
            await self.save()

        with contextlib.suppress(Refusal):  # gone since, and its parameters with it
            await self.change("a change of parameters by ROS", work)

    def _note_running(self, running: bool) -> None:
        self.running = running
        # What ends because rtcfd does is to run again.
        if not self._closing:
            self.desired.running = running
        self.tell()

    async def _save_quietly(self) -> None:
        await self.save()

    def in_background(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        """Do what nobody waits for; it is waited for at the end of the runner."""
        task = asyncio.create_task(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)
        return task

    # -- queries ------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Tell whether there is an executor."""
        return self._executor is not None

    def summary(self) -> str:
        """Return one word on the loop."""
        if not self.up:
            return "down"
        return "running" if self.running else "stopped"

    def give_up(self, trouble: str) -> None:
        """Say why there is no executor, and no other is started by itself."""
        self._trouble = f"{trouble}; `rtcfctl -r {self.name} start` tries again"
        self.log.error("%s", self._trouble)
        self._shared.on_change()

    @property
    def closing(self) -> bool:
        """Tell whether it is being ended."""
        return self._closing

    def settings(self) -> runner_pb2.RunnerSettings:
        """Return all settings."""
        return self.desired.complete(self._shared.defaults)

    @property
    def limits(self) -> Limits:
        """What may be asked for."""
        return self._shared.limits

    @property
    def defaults(self) -> runner_pb2.RunnerSettings:
        """What settings are unless chosen."""
        return self._shared.defaults

    async def status(self) -> runner_pb2.RunnerStatus:
        """Return what the runner is doing, whatever state it is in."""
        status = runner_pb2.RunnerStatus(
            runner=self.name,
            state=runner_pb2.RUNNER_STATE_DOWN,
        )
        executor = self._executor
        lines = [self._trouble]
        if executor is not None:
            request = wire.Request(get_status=wire.GetStatus())
            try:
                status = (await executor.request(request, STATUS_TIMEOUT_S)).status
                lines.append(status.status)
            except Refusal as refusal:
                if executor is self._executor:
                    status.state = runner_pb2.RUNNER_STATE_STUCK
                    lines.append(str(refusal))
                else:
                    lines.append(self._trouble)  # it has just died
            status.runner = self.name
            status.pid = executor.pid if executor is self._executor else 0
            status.version = executor.version
            if executor.version != VERSION and not executor.foreign:
                lines.append(
                    f"restart pending: its executor is of rtcf {executor.version}, rtcfd "
                    f"{VERSION}; `rtcfctl runner restart {self.name}` stops the loop and starts "
                    "a new one"
                )
        # Some settings are rtcfd's alone.
        status.settings.CopyFrom(runner_settings.merged(self.settings(), status.settings))
        status.chosen.CopyFrom(self.desired.chosen)
        if self.desired.hold is not None:
            status.holder, status.hold = self.desired.hold.holder, self.desired.hold.token
        if self.held:
            lines.append(self.held)
            if status.state == runner_pb2.RUNNER_STATE_STOPPED:
                status.state = runner_pb2.RUNNER_STATE_FAULTED
        lines.append(self._queue.busy(longer_than_s=_WORTH_SAYING_S))
        lines += [f"{name} is left out: {reason}" for name, reason in self.left_out.items()]
        lines.append(self._unsaved)
        status.status = "; ".join(line for line in lines if line)
        return status

    async def query(self, request: wire.Request) -> wire.Response:
        """Ask the executor what changes nothing in the graph."""
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_S + 1.0):
                await self._settled.wait()
        except TimeoutError:
            raise Unavailable(f"runner {self.name} is down: {self._trouble}") from None
        return await self._alive().request(request)

    # -- changes ------------------------------------------------------------

    async def set(self, change: runner_pb2.RunnerSettings) -> None:
        """Change settings; what an executor reads only at its start waits for a stopped loop."""
        runner_settings.check(change)

        async def work() -> None:
            if self.up:
                await self.ask(wire.Request(configure=change))
            self.desired.choose(change)
            await self.save()

        await self.change("a change of settings", work)
        self.log.info("settings changed")

    async def follow_limits(self) -> None:
        """Take over limits that have changed."""

        async def work() -> None:
            if self.up:
                await self._limit()

        try:
            await self.change("a change of limits", work)
        except Refusal as refusal:
            self.log.error("limits not changed: %s", refusal)

    async def follow_defaults(self, before: runner_pb2.RunnerSettings) -> list[str]:
        """Take over defaults that are others than `before`; return a line for each setting."""
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
            await self.change("a change of defaults", work)
        except Refusal as refusal:
            return [f"{self.name}: not changed: {refusal}"]
        return [f"{self.name}: {line}" for line in lines]

    async def start(self, progress: Progress) -> control_pb2.ChangeResult:
        """Start the loop; an executor that is down is brought back first."""

        async def work() -> control_pb2.ChangeResult:
            await self._need_executor(progress)
            return await self.start_loop(progress)

        result = await self.change("the start", work)
        self.log.info("loop started")
        return result

    async def start_loop(self, progress: Progress | None = None) -> control_pb2.ChangeResult:
        """Start the loop, in a turn."""
        response = await self.ask(wire.Request(start=wire.Start()), progress)
        self.held = self.fault = ""
        self._note_running(True)
        response.change.notes.extend(await self.save())
        return response.change

    async def stop(self, progress: Progress) -> control_pb2.ChangeResult:
        """End the loop at the next boundary.  Never queues; a dead loop is a stopped loop."""
        if self.up:
            request = wire.Request(stop=wire.Stop())
            result = (await self._alive().request(request, STOP_TIMEOUT_S, progress)).change
            self.log.info("loop stopped")
        else:
            result = control_pb2.ChangeResult(notes=[f"no loop to stop: {self._trouble}"])
        self.fault = ""
        was_desired = self.desired.running
        self._note_running(False)
        if was_desired:
            result.notes.extend(await self.save())
        return result

    async def step(self, cycles: int, progress: Progress) -> control_pb2.ChangeResult:
        """Run cycles of a stopped loop on a simulated clock; takes as long as they take."""

        async def work() -> control_pb2.ChangeResult:
            await self._need_executor(progress)
            step = control_pb2.StepRequest(cycles=cycles)
            return (await self.ask(wire.Request(step=step), progress)).change

        result = await self.change("stepping", work, timeout_s=None)
        self.log.info("%d cycles stepped", cycles)
        return result

    async def replay(self, request: control_pb2.ReplayRequest) -> control_pb2.ReplayResponse:
        """Run a piece of a recording through the loop; takes as long as its cycles take."""

        async def work() -> control_pb2.ReplayResponse:
            if request.begin:
                await self._need_executor(lambda _: None)
            return (await self.ask(wire.Request(replay=request))).replay

        return await self.change("a replay", work, timeout_s=None)

    async def _limit(self) -> None:
        if self._executor is not None:
            await self._executor.limit(self.limits)

    async def _need_executor(self, progress: Progress) -> None:
        if not self.up:
            progress("starting the executor")
            await self.start_executor()

    # -- for graph.py and restore.py ----------------------------------------

    @property
    def catalog(self) -> Catalog:
        """Where libraries are found."""
        return self._shared.catalog

    async def change(
        self,
        what: str,
        work: Callable[[], Awaitable[Result]],
        timeout_s: float | None = CHANGE_TIMEOUT_S,
    ) -> Result:
        """Do one change in its turn."""
        try:
            return await self._queue.take(what, work, timeout_s)
        finally:
            self.tell()

    async def ask(self, request: wire.Request, progress: Progress | None = None) -> wire.Response:
        """Ask the executor for a change; its caller's limit is change()'s."""
        executor = self._alive()
        try:
            return await executor.request(request, None, progress)
        except Unavailable:
            if executor.connected:
                raise
            # It may have died of this change: then its end says more than the lost link.
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LAST_WORDS_S):
                    await executor.ended.wait()
            if executor is self._executor or self._closing:
                raise
            raise Unavailable(f"runner {self.name}: {self._trouble}") from None

    async def save(self) -> list[str]:
        """Save the desired state; return a note if that failed: the change stands."""
        try:
            async with self._saving:
                text = self._shared.store.text(self.desired)
                # Not here: fsync may take long.
                await asyncio.to_thread(self._shared.store.save, self.name, text)
        except OSError as error:
            self._unsaved = f"not saved: {error.strerror}"
            self.log.error("its state is %s", self._unsaved)
            return [self._unsaved]
        self._unsaved = ""
        return []

    def _alive(self) -> Executor:
        if self._executor is None:
            raise Unavailable(f"runner {self.name} is down: {self._trouble}")
        return self._executor
