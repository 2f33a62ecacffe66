"""The base of all operations on a runner: its executor, its desired state, its loop.

Base class of Runner, on rtcfd's one thread.  Only this module launches, adopts, asks
and leaves the executor.
"""

import asyncio
import contextlib
import logging
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, graph_pb2, ports_pb2, runner_pb2
from rtcf_shared.enums import word
from rtcf_shared.naming import closest, listing, suggestion

from rtcfd.access import caller
from rtcfd.catalog.catalog import Catalog
from rtcfd.common.background import WorkerThreads
from rtcfd.common.errors import NotFound, RequestError, Silent, Unavailable
from rtcfd.common.event_log import EventLog
from rtcfd.common.limits import Limits
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.executor import (
    CONNECT_TIMEOUT_S,
    QUERY_TIMEOUT_S,
    Executor,
    end_left_over,
    stop_left_over,
)
from rtcfd.executor.link import OnAnswer, OnPorts, Progress
from rtcfd.executor.notifications import logger_of
from rtcfd.executor.watched_process import End
from rtcfd.incidents.incident_files import Incidents
from rtcfd.operations.loaded_code import LoadedCode
from rtcfd.operations.loop_counters import LoopCounters
from rtcfd.operations.loop_state import LoopState
from rtcfd.operations.operations import Operations
from rtcfd.state.desired import Desired
from rtcfd.state.saver import Disk, Saver

CHANGE_TIMEOUT_S = 60.0  # for one change, including the wait for those before it
_LAST_WORDS_S = 2.0  # from the loss of a link to the end of its executor

Result = TypeVar("Result")


async def _number(uid: int) -> str:
    return f"#{uid}"


@dataclass
class SharedContext:
    """The objects that all runners share; a reload of rtcfd changes some."""

    command: ExecutorCommand
    catalog: Catalog
    disk: Disk
    defaults: runner_pb2.RunnerSettings  # complete
    on_change: Callable[[], None]  # called when summary() may have changed
    # Answers the calls of ROS services of a runner.
    serve_ros: Callable[["RunnerCore", wire.ServiceCall], Awaitable[wire.ServiceAnswer]]
    incidents: Incidents
    events: EventLog = field(default_factory=EventLog)
    limits: Limits = field(default_factory=Limits)
    keeping: Operations = field(  # incidents being written
        default_factory=lambda: Operations("incidents", logging.getLogger("rtcfd.incidents"))
    )
    rules: wire.AccessRules = field(default_factory=wire.AccessRules)  # for executors
    name_of: Callable[[int], Awaitable[str]] = _number  # returns the name of a uid
    folders: WorkerThreads = field(default_factory=lambda: WorkerThreads("folders of components"))


@dataclass(eq=False)
class PendingParameters:
    """A request to set parameters that the executor has not answered yet."""

    component: str  # full name
    settings: list[graph_pb2.ParameterSetting]
    before: Mapping[str, graph_pb2.ParameterValue]
    acting: caller.Caller | None


@dataclass(frozen=True)
class Change:
    """A change of a runner, made by RunnerCore.make() in its turn."""

    name: str  # for messages: "the load of demo/Fine"
    # The request to the executor, or a function that returns it in the turn of the change.  The
    # function may also ask the executor itself, and return the result.
    request: wire.Request | Callable[[], Awaitable[wire.Request | control_pb2.ChangeResult]]
    event: Callable[[control_pb2.ChangeResult], str]  # returns the line for the event and the log
    # Notes the adopted change in the desired state, which is then saved; None: it does not change.
    commit: Callable[[control_pb2.ChangeResult], None] | None = None
    kind: "control_pb2.Event.Kind | None" = control_pb2.Event.KIND_GRAPH  # None: only the log
    component: str | None = None  # of the event; None: that of the result
    patient: bool = False  # see RunnerCore.change()


class RunnerCore(ABC):
    """A runner without its client-facing part."""

    def __init__(self, desired: Desired, shared: SharedContext) -> None:
        self.name = desired.runner
        self.desired = desired
        self.log = logger_of(self.name)
        self.loop = LoopState(desired)
        self.operations = Operations(f"runner {self.name}", self.log)
        self.shared = shared
        self.down_reason = "its executor is not started"  # why there is no executor
        self.tuned: dict[str, float] = {}  # by rate-limited parameter, the time it was last set
        self.pending_parameters: list[PendingParameters] = []
        self.closing = False
        self.leaving = False  # rtcfd ends, but the loop goes on
        self.saver = Saver(desired, shared.disk, self.log)
        self.code = LoadedCode(shared.folders)
        self.counters = LoopCounters()
        self.incident = ""  # the name of the newest incident
        self.replacing = ""  # component for which the executor is making a new one
        self._code_file = shared.command.folder / f"{self.name}.libraries"
        self._executor: Executor | None = None
        # Why the executor of an earlier rtcfd could not be adopted yet; its loop may run.
        self.silent: Silent | None = None
        self._changing_executor = asyncio.Lock()
        self._settled = asyncio.Event()  # not set while an executor is being started
        self._notified = (self.state, "")  # state and holder in the last events

    # -- implemented by Runner ------------------------------------------------

    @abstractmethod
    def take_unasked(self, response: wire.Response) -> None:
        """Handle a notification from the executor."""

    @abstractmethod
    def executor_ended(self, executor: Executor, end: End, ours: bool) -> None:
        """Handle the unexpected end of an executor; `ours` if it was the current one."""

    @abstractmethod
    def adopted(self) -> None:
        """Note that the executor of an earlier rtcfd was adopted."""

    def notify_change(self) -> None:
        """Notify systemd and event watchers; to be called after each change."""
        self.shared.on_change()
        holder = self.desired.hold.holder if self.desired.hold else ""
        before, self._notified = self._notified, (self.state, holder)
        if holder != before[1]:
            text = f"held by {holder}" if holder else f"given back by {before[1]}"
            self.happened(control_pb2.Event.KIND_RUNNER_SETTINGS, text)
        if self.state != before[0]:
            why = self.loop.fault or self.loop.held or (self.down_reason if not self.up else "")
            text = word(runner_pb2.RunnerState.DESCRIPTOR, self.state) + (why and f": {why}")
            self.happened(control_pb2.Event.KIND_RUNNER_STATE, text)

    def happened(
        self,
        kind: "control_pb2.Event.Kind",
        message: str,
        component: str = "",
        iteration: int = 0,
        user: str = "",
    ) -> None:
        """Add an event; `user` is its author, by default the current caller."""
        acting = caller.current()
        self.shared.events.add(
            kind,
            message,
            self.name,
            self.state,
            component=component,
            iteration=iteration,
            user=user or (acting.peer.user if acting else ""),
            holder=self.desired.hold.holder if self.desired.hold else "",
        )

    # -- state ------------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Whether there is an executor."""
        return self._executor is not None

    @property
    def state(self) -> "runner_pb2.RunnerState":
        """The state as far as known without asking the executor: never STUCK or STEPPING."""
        if not self.up:
            return runner_pb2.RUNNER_STATE_DOWN
        if self.loop.running:
            return runner_pb2.RUNNER_STATE_RUNNING
        if self.loop.fault or self.loop.held:
            return runner_pb2.RUNNER_STATE_FAULTED
        return runner_pb2.RUNNER_STATE_STOPPED

    def summary(self) -> str:
        """Return one word on the loop."""
        if not self.up:
            return "down"
        return "running" if self.loop.running else "stopped"

    @property
    def executor(self) -> Executor | None:
        """The executor, if there is one; callers must only read it."""
        return self._executor

    def settings(self) -> runner_pb2.RunnerSettings:
        """Return all settings."""
        return self.desired.complete(self.shared.defaults)

    # -- the executor -------------------------------------------------------------

    async def take_executor(self, only_left_over: bool = False) -> bool | None:
        """Adopt a left-over executor (returns True), or launch a new one (returns False).

        One that an earlier rtcfd launched, but did not configure, is a new one.  With
        `only_left_over`, launches none (returns None).  Waits for an executor that is being ended.
        """
        self._settled.clear()
        self.down_reason = "its executor is starting"
        command = self.shared.command
        try:
            async with self._changing_executor:
                executor = await Executor.adopt(self.name, command, self.take_unasked, self._ended)
                adopted = executor is not None and not executor.unconfigured
                if executor is None and only_left_over:
                    self.down_reason = "it has no executor"
                    self.silent = None
                    return None
                if executor is None and (self.leaving or not self.closing):
                    executor = await self._launch()
                elif executor is not None and not adopted:
                    await self._configure(executor)
                if self.closing:
                    if executor:
                        await (executor.leave() if self.leaving else executor.shut_down())
                    ending = f"runner {self.name} is being ended"
                    raise Unavailable(ending, errors_pb2.REASON_RUNNER_ENDING)
                self._executor, self.silent = executor, None
                self.counters = LoopCounters()
                if adopted:
                    self.code.restore(self._code_file)
                else:
                    self.code.clear()
        except Silent as error:
            self.down_reason, self.silent = str(error), error
            raise
        except RequestError as error:
            self.down_reason, self.silent = str(error), None
            raise
        except Exception as error:
            self.down_reason = f"its executor does not start: {type(error).__name__}: {error}"
            raise
        finally:
            self._settled.set()
        self.down_reason = ""
        return adopted

    async def end_executor(self, reason: str, spare_silent: bool = False) -> None:
        """Stop the loop in order and end the executor, even a busy or a frozen one.

        Also an executor that was not adopted, unless `spare_silent`; raises Unavailable if that
        cannot be ended.
        """
        executor, self._executor = self._executor, None
        if executor is not None:
            self.down_reason = executor.verdict = reason
            async with self._changing_executor:
                await executor.shut_down(self.settings().hook_timeout_s)
        elif not self.leaving and not spare_silent:
            async with self._changing_executor:  # after an attempt to adopt it
                if self._executor is None:
                    await end_left_over(self.name, self.shared.command)
                    self.silent = None
        self.loop.gone()

    async def stop_silent(self, patience_s: float) -> bool:
        """Stop the loop of an executor that was not adopted; see stop_left_over()."""
        return await stop_left_over(self.name, self.shared.command, patience_s)

    async def leave_executor(self) -> None:
        """Disconnect from the executor: its loop goes on, and the next rtcfd adopts it."""
        executor, self._executor = self._executor, None
        if executor is not None:
            self.code.store(self._code_file)
            await executor.leave()

    async def settle(self) -> None:
        """Wait while an executor is being started, at most for its start timeout."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CONNECT_TIMEOUT_S + 1.0):
                await self._settled.wait()

    async def limit(self) -> None:
        """Send the limits and the access rules to the executor."""
        if self._executor is not None:
            await self._executor.grant(self.shared.rules)
            # Last: fails while a hook is stuck.
            await self._executor.limit(self.shared.limits)

    async def query(self, request: wire.Request) -> wire.Response:
        """Send a query, which does not change the graph, to the executor."""
        await self.settle()
        await self.alive().require_not_frozen()
        return await self.ask(request, timeout_s=QUERY_TIMEOUT_S)

    async def ask(
        self,
        request: wire.Request,
        progress: Progress | None = None,
        on_answer: OnAnswer | None = None,
        timeout_s: float | None = None,
    ) -> wire.Response:
        """Send a request to the executor; for changes, the timeout of change() applies."""
        seen = await self.code.before(request)
        executor = self.alive()
        async with self._last_words(executor):
            response = await executor.request(request, timeout_s, progress, on_answer)
        self.code.after(request, response.change, seen)
        return response

    async def watch_ports(self, request: ports_pb2.WatchPortsRequest, on_ports: OnPorts) -> None:
        """Pass the values of ports on until cancelled, or until the executor ends."""
        await self.settle()
        executor = self.alive()
        async with self._last_words(executor):
            await executor.watch_ports(request, on_ports)

    @contextlib.asynccontextmanager
    async def _last_words(self, executor: Executor) -> AsyncIterator[None]:
        """Replace the error of a lost link by the cause of the executor's end, if it has ended."""
        try:
            yield
        except Unavailable:
            if executor.connected:
                raise
            # The request may have killed it: then the cause of its end is more helpful.
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(_LAST_WORDS_S):
                    await executor.ended.wait()
            if not executor.verdict:
                raise
            raise Unavailable(
                f"runner {self.name}: {executor.verdict}", errors_pb2.REASON_EXECUTOR_DOWN
            ) from None

    async def stuck(self) -> runner_pb2.HookStuck | None:
        """Return the hook that does not return; None if there is none, or no executor answers."""
        if self._executor is None:
            return None
        request = wire.Request(get_status=wire.GetStatus())
        try:
            status = (await self._executor.request(request)).status
        except RequestError:
            return None
        return status.stuck if status.HasField("stuck") else None

    def leave_out(self, stuck: runner_pb2.HookStuck) -> None:
        """Keep the component of a hook that did not return out of the loop until its release."""
        reason = f"its {stuck.hook}() did not return within {stuck.duration_s:.0f} s"
        if not self.desired.quarantine(str(stuck.component), reason):
            return
        self.log.logger.error(
            "%s is left out of the loop: %s", stuck.component, reason,
            extra={"runner": self.name, "component": stuck.component},
        )  # fmt: skip
        self.happened(
            control_pb2.Event.KIND_COMPONENT_FAULT, f"left out: {reason}", str(stuck.component)
        )

    async def begin_counting(self, reset: bool) -> None:
        """Count from now on (`reset`), or from the begin of the executor's statistics."""
        if reset:
            await self.ask(wire.Request(reset_statistics=wire.ResetStatistics()))
        self.counters.begin()
        if self.alive().resets_all_at_once:
            return
        status = (await self.ask(wire.Request(get_status=wire.GetStatus()))).status
        counted = await self.ask(wire.Request(get_statistics=wire.GetStatistics()))
        self.counters.leave_out(status, counted.statistics)

    def alive(self) -> Executor:
        """Return the executor; raises Unavailable if there is none."""
        if self._executor is None:
            raise Unavailable(
                f"runner {self.name} is down: {self.down_reason}", errors_pb2.REASON_EXECUTOR_DOWN
            )
        return self._executor

    def require_ours(self) -> None:
        """Raise Unavailable if executor and state are left to the next rtcfd: the loop may run."""
        if self.leaving and not self.up:
            raise Unavailable("rtcfd is being restarted", errors_pb2.REASON_DAEMON_ENDING)

    async def _launch(self) -> Executor:
        executor = await Executor.launch(
            self.name, self.shared.command, self.take_unasked, self._ended
        )
        await self._configure(executor)
        return executor

    async def _configure(self, executor: Executor) -> None:
        """Send a new executor the settings; end it if that fails."""
        try:
            await executor.request(wire.Request(configure=self.settings()))
        except BaseException:
            await executor.shut_down()
            raise

    def _ended(self, executor: Executor, end: End) -> None:
        """Handle the end of an executor."""
        ours = executor is self._executor
        if ours:
            self._executor = None
        if executor.expected or self.closing:
            self.loop.gone()
            self.log.info("executor (pid %d) %s", executor.pid, end)
            return
        self.executor_ended(executor, end, ours)

    # -- changes ------------------------------------------------------------------

    async def make(self, change: Change, progress: Progress) -> control_pb2.ChangeResult:
        """Make a change in its turn: ask the executor, then add the event, commit and save."""

        async def work() -> tuple[control_pb2.ChangeResult, str]:
            request = change.request
            result = request if isinstance(request, wire.Request) else await request()
            if isinstance(result, wire.Request):
                self.replacing = result.replace.component
                try:
                    result = (await self.ask(result, progress)).change
                finally:
                    self.replacing = ""
            line = change.event(result)
            if change.kind is not None:
                component = result.component if change.component is None else change.component
                self.happened(change.kind, line, component)
            if change.commit is not None:
                change.commit(result)
                result.notes.extend(await self.save())
            return result, line

        result, line = await self.change(change.name, work, patient=change.patient)
        self.log.info("%s", line)
        return result

    async def change(
        self,
        name: str,
        work: Callable[[], Awaitable[Result]],
        timeout_s: float | None = CHANGE_TIMEOUT_S,
        runs_cycles: bool = False,
        patient: bool = False,
    ) -> Result:
        """Run one change in its turn; see Operations.take_turn().

        Raises Unavailable soon if the executor is frozen, unless the change is `patient`.
        """
        if not patient and self._executor is not None:
            await self._executor.require_not_frozen()

        async def work_and_notify() -> Result:
            self.require_ours()
            try:
                return await work()
            finally:
                self.notify_change()

        return await self.operations.take_turn(name, work_and_notify, timeout_s, runs_cycles)

    async def save(self) -> list[str]:
        """Save the desired state; see Saver.save()."""
        return await self.saver.save()


def no_component(runner: RunnerCore, name: str, more: str = "") -> NotFound:
    """Return the error for an unknown component, given by its full name."""
    known = runner.desired.components
    return NotFound(
        f"no component {name} in runner {runner.name}{more}{suggestion(name, known)} "
        f"(components: {listing(known)})",
        errors_pb2.REASON_COMPONENT_NOT_FOUND,
        component=name,
        suggestion=closest(name, known),
    )
