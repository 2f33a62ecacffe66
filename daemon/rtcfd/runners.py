"""All runners of this rtcfd.  Owned by the daemon (main.py)."""

import asyncio
import logging
from collections.abc import Iterable

from rtcf.v1 import runner_pb2

from rtcfd import settings
from rtcfd.desired import Desired
from rtcfd.errors import AlreadyExists, NotFound, Refusal, Unavailable
from rtcfd.names import DEFAULT_RUNNER, check_base_name, listing, suggestion
from rtcfd.runner import Runner, Surroundings

log = logging.getLogger(__name__)


class Runners:
    """The runners by name."""

    def __init__(self, surroundings: Surroundings) -> None:
        self._shared = surroundings
        self._runners: dict[str, Runner] = {}
        self._closing = False

    def adopt(self, states: Iterable[Desired]) -> None:
        """Take runners as they were kept, without starting them yet."""
        for desired in states:
            self._runners[desired.runner] = Runner(desired, self._shared)

    async def bring_up(self) -> None:
        """Start the executors of all runners; failures are reported and show in the status."""

        async def one(runner: Runner) -> None:
            try:
                await runner.bring_up()
            except Refusal as refusal:
                runner.log.error("%s", refusal)

        await asyncio.gather(*(one(runner) for runner in self._runners.values()))

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

    async def add(self, name: str, chosen: runner_pb2.RunnerSettings) -> Runner:
        """Add a runner and start its executor; if that fails there is no such runner."""
        if self._closing:
            raise Unavailable("rtcfd is ending")
        name = check_base_name("runner", name or DEFAULT_RUNNER)
        if name in self._runners:
            raise AlreadyExists(
                f"runner {name} is there already; `rtcfctl runner set {name}` changes it"
            )
        settings.check(chosen)
        desired = Desired(name)
        desired.choose(chosen)
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
        self._closing = True
        await asyncio.gather(*(runner.shut_down() for runner in self._runners.values()))
