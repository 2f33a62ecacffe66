"""One runner: its executor, its desired state, and its loop.

Owned by Runners.  Changes take turns; `stop` and queries wait for none of
them.  What changes the components is in graph.py.
"""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import TypeVar

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, runner_pb2

from rtcfd import settings
from rtcfd.catalog import Catalog
from rtcfd.command import ExecutorCommand
from rtcfd.desired import Desired
from rtcfd.errors import Refusal, Unavailable
from rtcfd.executor import CONNECT_TIMEOUT_S, Executor
from rtcfd.link import Progress
from rtcfd.relay import Relay, logger_of
from rtcfd.store import Store
from rtcfd.turns import Turns

CHANGE_TIMEOUT_S = 60.0  # for one change, waiting for those before it included
STOP_TIMEOUT_S = 30.0
STATUS_TIMEOUT_S = 2.0
_WORTH_SAYING_S = 2.0  # a change that takes longer shows in the status

Result = TypeVar("Result")


@dataclass(frozen=True)
class Surroundings:
    """What all runners share."""

    command: ExecutorCommand
    catalog: Catalog
    store: Store
    defaults: runner_pb2.RunnerSettings  # complete
    on_change: Callable[[], None]  # what summary() says may have changed


class Runner:
    """One control loop as rtcfd sees it."""

    def __init__(self, desired: Desired, surroundings: Surroundings) -> None:
        self.name = desired.runner
        self.desired = desired
        self.left_out: dict[str, str] = {}  # components that did not load, and why
        self.log = logger_of(self.name)
        self._shared = surroundings
        self._turns = Turns(self.name, self.log)
        self._relay = Relay(self.name, self._loop_ended)
        self._executor: Executor | None = None
        self._trouble = "its executor is not started"  # why there is none
        self._unsaved = ""  # why the desired state is not on disk
        self._running = False  # the loop, as far as told
        self._closing = False
        self._settled = asyncio.Event()  # not set while an executor is being started

    # -- life ---------------------------------------------------------------

    async def bring_up(self) -> None:
        """Start the executor and load the components, held: the loop is not started."""
        await self.change("the start of its executor", self._start_executor)

    async def shut_down(self) -> None:
        """Stop the loop in order and end the executor."""
        self._closing = True
        executor, self._executor = self._executor, None
        self._trouble = "it is being ended"
        if executor is not None:
            await executor.shut_down()
        await self._turns.drain()

    async def _start_executor(self) -> None:
        complete = self.desired.complete(self._shared.defaults)
        self._settled.clear()
        self._trouble = "its executor is starting"
        try:
            executor = await self._launch(complete)
            if self._closing:
                await executor.shut_down()
                raise Unavailable(f"runner {self.name} is being ended")
            self._executor = executor
        except Refusal as refusal:
            self._trouble = str(refusal)
            raise
        finally:
            self._settled.set()
        self._trouble = ""
        await self._restore()
        self._shared.on_change()

    async def _launch(self, complete: runner_pb2.RunnerSettings) -> Executor:
        executor = await Executor.launch(
            self.name,
            self._shared.command,
            self._relay.take,
            self._ended,
        )
        try:
            await executor.request(wire.Request(configure=complete))
        except BaseException:
            await executor.shut_down()
            raise
        return executor

    async def _restore(self) -> None:
        """Load what is desired; what does not load is left out and reported."""
        self.left_out.clear()
        for full_name, spec in self.desired.components.items():
            try:
                library = await self.library(spec.package, spec.type)
                load = wire.Load(component=spec, library=library)
                await self.ask(wire.Request(load=load))
            except Refusal as refusal:
                self.left_out[full_name] = str(refusal)
                self.log.error("%s is left out of the loop: %s", full_name, refusal)
                if not self.up:
                    return
        if self.desired.components:
            count = len(self.desired.components) - len(self.left_out)
            self.log.info("%d of its components restored, held", count)

    def _ended(self, executor: Executor, how: str) -> None:
        """An executor of ours is dead."""
        self._running = False
        if executor is self._executor:
            self._executor = None
            self._trouble = (
                f"its executor (pid {executor.pid}) {how} at {time.strftime('%H:%M:%S')}; "
                f"`rtcfctl -r {self.name} start` brings it back with its components"
            )
        if executor.expected:
            self.log.info("executor (pid %d) %s", executor.pid, how)
        else:
            self.log.error("executor (pid %d) %s: its loop is down", executor.pid, how)
        self._shared.on_change()

    def _loop_ended(self) -> None:
        self._running = False
        self._shared.on_change()

    # -- queries ------------------------------------------------------------

    @property
    def up(self) -> bool:
        """Tell whether there is an executor."""
        return self._executor is not None

    def summary(self) -> str:
        """Return one word on the loop."""
        if not self.up:
            return "down"
        return "running" if self._running else "stopped"

    async def status(self) -> runner_pb2.RunnerStatus:
        """Return what the runner is doing, whatever state it is in."""
        status = runner_pb2.RunnerStatus(
            runner=self.name,
            state=runner_pb2.RUNNER_STATE_DOWN,
            settings=self.desired.complete(self._shared.defaults),
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
        lines.append(self._turns.busy(longer_than_s=_WORTH_SAYING_S))
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
        settings.check(change)

        async def work() -> None:
            if self.up:
                await self.ask(wire.Request(configure=change))
            self.desired.choose(change)
            await self.save()

        await self.change("a change of settings", work)
        self.log.info("settings changed")

    async def start(self, progress: Progress) -> control_pb2.ChangeResult:
        """Start the loop; an executor that is down is brought back first."""

        async def work() -> control_pb2.ChangeResult:
            if not self.up:
                progress("starting the executor")
                await self._start_executor()
            response = await self.ask(wire.Request(start=wire.Start()), progress)
            self._running = True
            return response.change

        result = await self.change("the start", work)
        self.log.info("loop started")
        self._shared.on_change()
        return result

    async def stop(self, progress: Progress) -> control_pb2.ChangeResult:
        """End the loop at the next boundary.  Never queues; a dead loop is a stopped loop."""
        if not self.up:
            return control_pb2.ChangeResult(notes=[f"no loop to stop: {self._trouble}"])
        request = wire.Request(stop=wire.Stop())
        response = await self._alive().request(request, STOP_TIMEOUT_S, progress)
        self.log.info("loop stopped")
        self._loop_ended()
        return response.change

    # -- for graph.py -------------------------------------------------------

    async def library(self, package: str, type_name: str) -> str:
        """Return the library of a component type."""
        return await self._shared.catalog.find(package, type_name)

    async def change(self, what: str, work: Callable[[], Awaitable[Result]]) -> Result:
        """Do one change in its turn."""
        return await self._turns.take(what, work, CHANGE_TIMEOUT_S)

    async def ask(self, request: wire.Request, progress: Progress | None = None) -> wire.Response:
        """Ask the executor for a change; its caller's limit is change()'s."""
        return await self._alive().request(request, None, progress)

    async def save(self) -> list[str]:
        """Save the desired state; return a note if that failed: the change stands."""
        text = self._shared.store.text(self.desired)
        try:
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
