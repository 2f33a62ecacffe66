"""Leases on runners: rt_runner holds a runner for the life of a launch.

A held runner has the settings of its holder.  It gets a new executor at the begin and at
the end of the launch, so that nothing of one launch, not even the ROS node's host name,
is left for the next.  Functions on Runners and a Runner.
"""

import asyncio
import contextlib

from rtcf.v1 import control_pb2, errors_pb2, runner_pb2
from rtcf_shared.naming import listing

from rtcfd.access import caller
from rtcfd.common import runner_settings
from rtcfd.common.errors import (
    FailedPrecondition,
    InvalidArgument,
    NotFound,
    RequestError,
    Unavailable,
)
from rtcfd.common.names import DEFAULT_RUNNER
from rtcfd.operations.loop import stop_quietly
from rtcfd.runners.component_leases import RETURN_S
from rtcfd.runners.outbox import Outbox
from rtcfd.runners.runner import Runner
from rtcfd.runners.runners import Runners
from rtcfd.state.desired import RunnerLeaseTerms


class RunnerLease:
    """The lease of one call on a runner.  `open` first, then `end` or `lost`."""

    def __init__(self, runners: Runners, request: control_pb2.OpenHold, outbox: Outbox) -> None:
        self._runners = runners
        self._request = request
        self._outbox = outbox
        self._runner: Runner | None = None

    async def open(self) -> None:
        """Take the runner, or attach to it again; send its status to the holder."""
        request = self._request
        if not request.token:
            raise InvalidArgument(
                "HoldRunner requires a token", errors_pb2.REASON_NAME_MISSING, field="token"
            )
        name = request.runner or DEFAULT_RUNNER
        self._outbox.progress(f"taking runner {name}")
        if request.attach:
            runner = _attach(self._runners, name, request.token)
            self._taken(runner)
        else:
            runner = await self._take(name)
        self._outbox.say(taken=await runner.status())
        runner.notify_change()

    async def end(self) -> None:
        """Give the runner back, on request of its holder."""
        if self._runner is not None:
            work = release(self._runners, self._runner, self._outbox)
            await self._runners.operations.begin("the end of a launch", lambda: work)

    def lost(self) -> None:
        """Give the runner back after the death of its holder."""
        self._outbox.gone = True
        runner = self._runner
        if runner is None or runner.closing or runner.releasing:
            return
        if runner.hold_outbox is self._outbox and runner.desired.hold:
            runner.log.error("%s has died: stopping the loop", runner.desired.hold.holder)
            self._runners.operations.in_background(
                "the end of a launch", release(self._runners, runner, self._outbox)
            )

    def _taken(self, runner: Runner) -> None:
        # From here on, lost() gives the runner back.
        self._runner = runner
        runner.hold_outbox = self._outbox

    def _require_holder(self, terms: RunnerLeaseTerms) -> None:
        if self._outbox.gone:
            raise Unavailable(
                f"{terms.holder}, which requested the runner, has disconnected",
                errors_pb2.REASON_CALLER_GONE,
            )

    async def _take(self, name: str) -> Runner:
        request = self._request
        runner_settings.check(request.settings)
        # ROS peers of a launch act for its user, so they get the right of the holder.
        holder = caller.current()
        if holder is not None and not request.settings.ros.HasField("peers"):
            request.settings.ros.peers = holder.level.right
        terms = RunnerLeaseTerms(
            request.token, request.holder or "a client", runner_pb2.RunnerSettings()
        )
        try:
            runner = self._runners.get(name)
        except NotFound:
            terms.added = True

            def taken(added: Runner) -> None:
                self._require_holder(terms)
                added.desired.hold = terms
                self._taken(added)

            return await self._runners.add(name, request.settings, taken)

        async def work() -> None:
            self._require_holder(terms)
            _require_free(runner)
            desired = runner.desired
            terms.parked.CopyFrom(desired.chosen)
            desired.hold = terms
            desired.choose(request.settings)
            self._taken(runner)
            try:
                await runner.restart_in_turn()
            except BaseException:
                desired.let_go()
                runner.hold_outbox = None
                if not runner.up:
                    await runner.restart_in_turn()
                raise
            await runner.save()
            runner.log.info("held by %s", terms.holder)

        await runner.change("the begin of a launch", work, patient=True)
        return runner


def await_holder(runners: Runners, runner: Runner) -> None:
    """Give the holder time to reconnect, after a restart of rtcfd."""

    async def wait() -> None:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(runners.closing.wait(), RETURN_S)
        if runner.desired.hold and runner.hold_outbox is None and not runner.closing:
            runner.log.error(
                "%s did not come back within %g s: stopping the loop",
                runner.desired.hold.holder, RETURN_S,
            )  # fmt: skip
            await release(runners, runner, None)

    if runner.desired.hold:
        runners.operations.in_background("waiting for a holder", wait())


async def release(runners: Runners, runner: Runner, outbox: Outbox | None) -> None:
    """Stop the loop, unload leased components, and restore the runner's settings or remove it."""
    hold = runner.desired.hold
    if hold is None or runner.hold_outbox is not outbox or runner.releasing or runner.closing:
        return
    runner.releasing = True
    try:
        # Its holder still receives the log records of the hooks `stop` and `cleanup`.
        await _release(runners, runner, hold)
    finally:
        runner.releasing = False
        if runner.hold_outbox is outbox:
            runner.hold_outbox = None


async def _release(runners: Runners, runner: Runner, hold: RunnerLeaseTerms) -> None:
    await stop_quietly(runner)
    await runner.leases.unload_all()
    runner.leases.end_all(
        control_pb2.LeaseEnded.WHY_RUNNER_ENDED, f"{hold.holder}, which held its runner, has ended"
    )
    if hold.added:
        await runners.remove(runner.name)
        return

    async def work() -> None:
        # A loop that was started meanwhile belongs to the launch that ends now.
        runner.loop.stop()
        runner.desired.let_go()
        await runner.end_executor("its launch has ended")
        runner.hold_outbox = None  # the records of the next executor are not for this holder
        await runner.restart_in_turn()
        await runner.save()

    try:
        await runner.change("the end of its launch", work, patient=True)
    except RequestError as error:
        runner.log.error("%s", error)
    runner.log.info("given back by %s", hold.holder)


def _attach(runners: Runners, name: str, token: str) -> Runner:
    runner = runners.get(name)
    hold = runner.desired.hold
    if hold is not None and runner.releasing:
        raise NotFound(
            f"runner {name} is being given back, as {hold.holder} was gone: request it again",
            errors_pb2.REASON_HOLD_NOT_FOUND,
        )
    if hold is None or hold.token != token or runner.hold_outbox is not None:
        raise NotFound(
            f"runner {name} is not kept for its holder any more", errors_pb2.REASON_HOLD_NOT_FOUND
        )
    runner.log.info("%s is back", hold.holder)
    return runner


def _require_free(runner: Runner) -> None:
    desired = runner.desired
    if desired.hold is not None:
        raise FailedPrecondition(
            f"runner {runner.name} is held by {desired.hold.holder}: end that launch, "
            "or give the runner of this one another name",
            errors_pb2.REASON_RUNNER_HELD,
            holder=desired.hold.holder,
        )
    if desired.components:
        raise FailedPrecondition(
            f"runner {runner.name} has components of its own ({listing(desired.components)}): "
            "unload them, or give the runner of this launch another name",
            errors_pb2.REASON_RUNNER_NOT_EMPTY,
        )
    if runner.loop.running:
        raise FailedPrecondition(
            f"the loop of runner {runner.name} runs: stop it, or give the runner of this launch "
            "another name",
            errors_pb2.REASON_LOOP_RUNS,
        )
