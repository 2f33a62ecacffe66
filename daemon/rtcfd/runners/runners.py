"""All runners of this rtcfd.  Owned by the daemon (main.py)."""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable, Sequence

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, runner_pb2
from rtcf_shared.naming import closest, listing, suggestion

from rtcfd.catalog.catalog import whole_graph
from rtcfd.common import runner_settings
from rtcfd.common.errors import AlreadyExists, NotFound, RequestError, Silent, Unavailable
from rtcfd.common.names import DEFAULT_RUNNER, check_base_name, check_graph, full_name
from rtcfd.executor.link import Progress
from rtcfd.incidents.incident_files import Incidents
from rtcfd.operations import graph
from rtcfd.operations.operations import Operations
from rtcfd.operations.runner_core import SharedContext
from rtcfd.runners.runner import LEAVE_TIMEOUT_S, Runner
from rtcfd.state.desired import Desired

log = logging.getLogger(__name__)

_Take = Callable[[Runner], Awaitable[None]]

_KEEP_S = 10.0  # at the end of rtcfd, for incidents that are being written
_LOOK_AGAIN_S = 2.0  # between attempts to adopt an executor that does not answer


class Runners:
    """The runners by name."""

    def __init__(self, shared: SharedContext) -> None:
        self._shared = shared
        self._runners: dict[str, Runner] = {}
        self._leaving: set[Runner] = set()  # being removed
        self.closing = asyncio.Event()
        self.operations = Operations("rtcfd", log)

    @property
    def incidents(self) -> Incidents:
        """The incidents of all runners."""
        return self._shared.incidents

    def adopt(self, states: Iterable[Desired]) -> None:
        """Add the runners of saved states, without starting them."""
        for desired in states:
            self._runners[desired.runner] = Runner(desired, self._shared)

    async def bring_up(self, left_over: Iterable[str] = ()) -> None:
        """Adopt or start the executors of all runners, and adopt left-over ones of unknown runners.

        Errors are logged, and show in the status.
        """

        async def one(runner: Runner) -> None:
            try:
                await self._bring_up_known(runner)
            except Silent as error:
                self._keep_looking(runner, error, self._bring_up_known)
            except RequestError as error:
                runner.log.error("%s", error)
            except Exception:  # it must not affect the other runners
                runner.log.exception("its executor does not start")

        unknown = [name for name in left_over if name not in self._runners]
        await asyncio.gather(
            *(one(runner) for runner in self._runners.values()),
            *(self._take_left_over(name) for name in unknown),
        )

    async def _bring_up_known(self, runner: Runner) -> None:
        if runner.desired.hold or runner.desired.leased:
            await self._bring_up_held(runner)
        else:
            await runner.bring_up(boot=True)

    def _keep_looking(self, runner: Runner, error: Silent, take: _Take) -> None:
        runner.log.error("%s", error)
        # Not an operation of the runner: this may end the runner, which waits for its operations.
        self.operations.in_background(
            f"the search for the executor of {runner.name}", self._look_again(runner, take)
        )

    async def _look_again(self, runner: Runner, take: _Take) -> None:
        """Retry until a delayed executor is taken over, as after a suspension of the machine.

        Without rtcfd its loop would end (`orphan_timeout_s`).
        """
        while True:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self.closing.wait(), _LOOK_AGAIN_S)
            if runner.up or self.closing.is_set() or self._runners.get(runner.name) is not runner:
                return
            if runner.closing:
                continue  # it is being removed, which may fail
            try:
                await take(runner)
                return
            except Silent:
                continue

    async def _bring_up_held(self, runner: Runner) -> None:
        """Bring up a runner of a launch; if it has no executor any more, the launch is over."""
        if await runner.bring_up(only_left_over=True, boot=True):
            return
        hold = runner.desired.hold
        runner.desired.let_go()
        runner.loop.want(False)  # it was the loop of the launch
        if hold is not None and hold.added:
            await self.remove(runner.name)
            return
        await runner.save()
        await runner.bring_up(boot=True)

    async def _take_left_over(self, name: str) -> None:
        runner = self._runners[name] = Runner(Desired(name), self._shared)
        try:
            await self._bring_up_unknown(runner)
        except Silent as error:
            self._keep_looking(runner, error, self._bring_up_unknown)

    async def _bring_up_unknown(self, runner: Runner) -> None:
        try:
            if await runner.bring_up(only_left_over=True, boot=True):
                runner.log.warning("runner %s was not in the saved state", runner.name)
                await runner.save()
                return
        except Silent:
            raise
        except RequestError as error:
            runner.log.error("%s", error)
        except Exception:
            runner.log.exception("its executor cannot be adopted")
        if self._runners.get(runner.name) is runner:
            del self._runners[runner.name]

    def get(self, name: str) -> Runner:
        """Return a runner; empty is the default one."""
        wanted = name or DEFAULT_RUNNER
        runner = self._runners.get(wanted)
        if runner is None:
            raise NotFound(
                f'no runner "{wanted}"{suggestion(wanted, self._runners)} '
                f"(runners: {listing(self._runners)}); `rtcfctl runner add {wanted}` adds it",
                errors_pb2.REASON_RUNNER_NOT_FOUND,
                runner=wanted,
                suggestion=closest(wanted, self._runners),
            )
        return runner

    def require_some(self, names: Sequence[str]) -> None:
        """Raise NotFound if there are names, but none is that of a runner."""
        if names and not any((name or DEFAULT_RUNNER) in self._runners for name in names):
            self.get(names[0])

    def all(self) -> list[Runner]:
        """Return the runners by name."""
        return [self._runners[name] for name in sorted(self._runners)]

    def summary(self) -> str:
        """Return one line on all loops."""
        return ", ".join(f"{runner.name} {runner.summary()}" for runner in self.all()) or "none"

    async def add(
        self,
        name: str,
        chosen: runner_pb2.RunnerSettings,
        on_added: Callable[[Runner], None] | None = None,
    ) -> Runner:
        """Add a runner and start its executor; if that fails, the runner does not exist.

        `on_added` is called with it before all else, and may raise an error to reject it.
        """

        async def work() -> Runner:
            return await self._add(name, chosen, on_added)

        return await self.operations.begin(f"the addition of runner {name}", work)

    async def _add(
        self,
        name: str,
        chosen: runner_pb2.RunnerSettings,
        on_added: Callable[[Runner], None] | None = None,
    ) -> Runner:
        if self.closing.is_set():
            raise Unavailable("rtcfd is ending", errors_pb2.REASON_DAEMON_ENDING)
        name = check_base_name("runner", name or DEFAULT_RUNNER)
        if name in self._runners:
            raise AlreadyExists(
                f"runner {name} exists already; `rtcfctl runner set {name}` changes it",
                errors_pb2.REASON_RUNNER_EXISTS,
            )
        self._shared.limits.check_runners(len(self._runners) + 1)
        runner_settings.check(chosen)
        desired = Desired(name)
        desired.choose(chosen)
        runner = Runner(desired, self._shared)
        if on_added is not None:
            on_added(runner)
        self._runners[name] = runner
        runner.happened(control_pb2.Event.KIND_RUNNER_ADDED, "runner added")
        try:
            await runner.bring_up()
        except BaseException as error:
            runner.hold_outbox = None  # its holder receives the error
            await self._remove(runner, spare_silent=isinstance(error, Silent))
            raise
        await runner.save()
        runner.log.info("runner added")
        return runner

    async def apply(
        self, request: control_pb2.ApplyRequest, progress: Progress
    ) -> control_pb2.ChangeResult:
        """Apply a graph to a runner, which is added if needed."""
        name = request.runner or DEFAULT_RUNNER
        if name in self._runners:
            return await graph.apply(self._runners[name], request, progress)
        check_base_name("runner", name)
        runner_settings.check(request.settings)
        check_graph(request.components)
        self._shared.limits.check_components(len(request.components))
        if request.dry_run:
            await self._try_elsewhere(request, progress)
            return control_pb2.ChangeResult(
                notes=[f"runner {name} would be added"],
                differences=[
                    control_pb2.Difference(
                        kind=control_pb2.Difference.KIND_LOAD, component=full_name(spec)
                    )
                    for spec in request.components
                ],
            )
        progress(f"adding runner {name}")

        async def work() -> control_pb2.ChangeResult:
            runner = await self._add(name, request.settings)
            try:
                return await graph.apply(runner, request, progress)
            except BaseException:
                await self._remove(runner)
                raise

        return await self.operations.begin(f"the application of a graph to {name}", work)

    async def _try_elsewhere(self, request: control_pb2.ApplyRequest, progress: Progress) -> None:
        """Check the graph of a runner that does not exist, by the executor of another one.

        Raises the error that applying it would raise; without an executor, only errors of types.
        """
        apply = await whole_graph(self._shared.catalog, request.components, dry_run=True)
        for runner in self._runners.values():
            if not runner.up:
                continue

            async def work(runner: Runner = runner) -> None:
                await runner.ask(wire.Request(apply=apply), progress)

            await runner.change(f"the check of a graph for {request.runner}", work)
            return

    async def remove(self, name: str) -> None:
        """Stop and remove a runner."""
        runner = self.get(name)

        async def work() -> None:
            if runner.closing:
                raise Unavailable(
                    f"runner {runner.name} is being ended", errors_pb2.REASON_RUNNER_ENDING
                )
            await self._remove(runner)

        await self.operations.begin(f"the removal of runner {runner.name}", work)

    async def _remove(self, runner: Runner, spare_silent: bool = False) -> None:
        if runner in self._leaving:
            return  # it is already being removed
        self._leaving.add(runner)
        try:
            await runner.shut_down(spare_silent=spare_silent)
            await runner.saver.forget()
        except RequestError:  # it runs on
            runner.closing = False
            raise
        finally:
            self._leaving.discard(runner)
        # Not earlier: its executor must have ended before another runner takes the name.
        if self._runners.get(runner.name) is runner:
            del self._runners[runner.name]
        runner.happened(control_pb2.Event.KIND_RUNNER_REMOVED, "runner removed")
        runner.log.info("runner removed")
        self._shared.on_change()

    async def close(self, in_order: bool) -> None:
        """Stop all loops in order and end all executors, concurrently.

        `in_order`: permanently, that is, not because the machine shuts down.
        """
        self.closing.set()
        self.operations.withdraw("rtcfd is ending", errors_pb2.REASON_DAEMON_ENDING)
        cause = control_pb2.LeaseEnded.WHY_DAEMON_ENDED
        runners = list(self._runners.values())

        async def end(runner: Runner) -> None:
            try:
                await runner.shut_down(cause, "rtcfd is being ended", in_order)
            except RequestError as error:
                runner.log.error("%s", error)

        await asyncio.gather(*(end(each) for each in runners))
        await self._drain()

    async def leave(self) -> None:
        """Leave all executors to the next rtcfd; their loops go on."""
        self.closing.set()
        await asyncio.gather(*(runner.leave() for runner in self._runners.values()))
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._drain(), LEAVE_TIMEOUT_S)

    async def _drain(self) -> None:
        await self.operations.drain()
        try:
            await asyncio.wait_for(self._shared.keeping.drain(), _KEEP_S)
        except TimeoutError:
            log.error(
                "an incident is not written after %g s, and lost: does the disk of the state "
                "directory answer?",
                _KEEP_S,
            )
