"""All runners of this rtcfd.  Owned by the daemon (main.py)."""

import asyncio
import logging
from collections.abc import Coroutine, Iterable
from typing import Any

from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.naming import listing, suggestion

from rtcfd.catalog.catalog import loads
from rtcfd.common import runner_settings
from rtcfd.common.names import DEFAULT_RUNNER, check_base_name, full_name
from rtcfd.common.refusals import AlreadyExists, NotFound, Refusal, Unavailable
from rtcfd.executor.link import Progress
from rtcfd.operations import graph
from rtcfd.runners.runner import Runner, Surroundings
from rtcfd.state.desired import Desired, HoldTerms

log = logging.getLogger(__name__)


class Runners:
    """The runners by name."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._shared = surroundings
        self._runners: dict[str, Runner] = {}
        self.closing = asyncio.Event()
        self._background: set[asyncio.Task[None]] = set()

    def adopt(self, states: Iterable[Desired]) -> None:
        """Take runners as they were kept, without starting them yet."""
        for desired in states:
            self._runners[desired.runner] = Runner(desired, self._shared)

    async def bring_up(self, left_over: Iterable[str] = ()) -> None:
        """Adopt or start the executors of all runners, and adopt those of runners that are not
        known but have left an executor; failures are reported and show in the status."""

        async def one(runner: Runner) -> None:
            try:
                if runner.desired.hold or runner.desired.leased:
                    await self._bring_up_held(runner)
                else:
                    await runner.bring_up()
            except Refusal as refusal:
                runner.log.error("%s", refusal)

        unknown = [name for name in left_over if name not in self._runners]
        await asyncio.gather(
            *(one(runner) for runner in self._runners.values()),
            *(self._take_left_over(name) for name in unknown),
        )

    async def _bring_up_held(self, runner: Runner) -> None:
        """Of a launch: it goes on if its loop does; otherwise it is over."""
        if await runner.bring_up(only_left_over=True):
            return
        hold = runner.desired.hold
        runner.desired.let_go()
        runner.desired.running = False  # that was the launch's loop
        if hold is not None and hold.added:
            await self.remove(runner.name)
            return
        await runner.save()
        await runner.bring_up()

    async def _take_left_over(self, name: str) -> None:
        runner = self._runners[name] = Runner(Desired(name), self._shared)
        try:
            if await runner.bring_up(only_left_over=True):
                runner.log.warning("runner %s was not in the saved state", name)
                await runner.save()
                return
        except Refusal as refusal:
            runner.log.error("%s", refusal)
        del self._runners[name]

    def get(self, name: str) -> Runner:
        """Return a runner; empty is the default one."""
        wanted = name or DEFAULT_RUNNER
        runner = self._runners.get(wanted)
        if runner is None:
            raise NotFound(
                f'no runner "{wanted}"{suggestion(wanted, self._runners)} '
                f"(runners: {listing(self._runners)}); `rtcfctl runner add {wanted}` makes it"
            )
        return runner

    def all(self) -> list[Runner]:
        """Return the runners by name."""
        return [self._runners[name] for name in sorted(self._runners)]

    def summary(self) -> str:
        """Return one line on all loops."""
        return ", ".join(f"{runner.name} {runner.summary()}" for runner in self.all()) or "none"

    async def add(
        self, name: str, chosen: runner_pb2.RunnerSettings, hold: HoldTerms | None = None
    ) -> Runner:
        """Add a runner and start its executor; if that fails there is no such runner."""
        if self.closing.is_set():
            raise Unavailable("rtcfd is ending")
        name = check_base_name("runner", name or DEFAULT_RUNNER)
        if name in self._runners:
            raise AlreadyExists(
                f"runner {name} is there already; `rtcfctl runner set {name}` changes it"
            )
        self._shared.limits.check_runners(len(self._runners) + 1)
        runner_settings.check(chosen)
        desired = Desired(name)
        desired.choose(chosen)
        desired.hold = hold
        runner = self._runners[name] = Runner(desired, self._shared)
        try:
            await runner.bring_up()
        except BaseException:
            del self._runners[name]
            await runner.shut_down()
            raise
        await runner.save()
        runner.log.info("runner added")
        return runner

    async def apply(
        self, request: control_pb2.ApplyRequest, progress: Progress
    ) -> control_pb2.ChangeResult:
        """Apply a graph to a runner that may have to be added."""
        name = request.runner or DEFAULT_RUNNER
        if name in self._runners:
            return await graph.apply(self._runners[name], request, progress)
        check_base_name("runner", name)
        runner_settings.check(request.settings)
        graph.check_graph(request.components)
        self._shared.limits.check_components(len(request.components))
        if request.dry_run:
            await loads(self._shared.catalog, request.components)
            return control_pb2.ChangeResult(
                notes=[f"runner {name} would be added; its graph is wired when it is applied"],
                differences=[
                    control_pb2.Difference(
                        kind=control_pb2.Difference.KIND_LOAD, component=full_name(spec)
                    )
                    for spec in request.components
                ],
            )
        progress(f"adding runner {name}")
        runner = await self.add(name, request.settings)
        try:
            return await graph.apply(runner, request, progress)
        except Refusal:
            await self.remove(name)
            raise

    async def remove(self, name: str) -> None:
        """Stop a runner and forget it."""
        runner = self.get(name)
        await runner.shut_down()
        self._runners.pop(runner.name, None)
        try:
            self._shared.store.remove(runner.name)
        except OSError as error:
            runner.log.error("its state stays on disk: %s", error.strerror)
        runner.log.info("runner removed")
        self._shared.on_change()

    async def close(self) -> None:
        """Stop all loops in order and end all executors, at once."""
        self.closing.set()
        why = control_pb2.LeaseEnded.WHY_DAEMON_ENDED
        runners = list(self._runners.values())
        await asyncio.gather(*(each.shut_down(why, "rtcfd is being ended") for each in runners))
        await asyncio.gather(*self._background)

    async def leave(self) -> None:
        """Let go of all executors, whose loops go on: the next rtcfd adopts them."""
        self.closing.set()
        await asyncio.gather(*(runner.leave() for runner in self._runners.values()))

    def in_background(self, work: Coroutine[Any, Any, None]) -> None:
        """Do what nobody waits for; it is waited for at the end."""
        task = asyncio.create_task(work)
        self._background.add(task)
        task.add_done_callback(self._background.discard)
