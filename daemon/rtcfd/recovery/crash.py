"""Recovers a runner from a crash of its executor: decides whether to start a new one, and whether
its loop resumes without the culprit.

Functions on a RunnerCore; recover() takes a turn of it.
"""

import time

from rtcf.v1 import runner_pb2
from rtcf_shared.naming import listing

from rtcfd.common.errors import RequestError
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.bring_up import bring_up, missing_parts, start_or_leave_out
from rtcfd.recovery.verdict import MOST_ATTEMPTS, MOST_CRASHES, WINDOW_S, Crashes, Verdict


def resumes(runner: RunnerCore, verdict: Verdict, crashes: Crashes) -> bool:
    """Return whether a loop that ran resumes without the culprit."""
    culprit = runner.desired.components.get(verdict.culprit)
    return (
        runner.settings().on_crash == runner_pb2.ON_CRASH_RESUME
        and culprit is not None
        and bool(culprit.optional)
        and crashes.recent <= MOST_CRASHES
    )


async def recover(runner: RunnerCore, verdict: Verdict, crashes: Crashes, cause: str) -> None:
    """Start a new executor after an unexpected end, with the graph without the culprit.

    `cause` is the cause of the end, for messages.
    """
    begin = time.monotonic()
    asked = runner.loop.stops

    async def work() -> None:
        # First of all, so that the culprit is not loaded again even if rtcfd dies now.
        await runner.save()
        if runner.up or runner.closing:
            return
        if crashes.recent >= MOST_ATTEMPTS:
            _give_up(runner, f"{cause}, the last of {crashes.recent} in {WINDOW_S:g} s")
            return
        agreed = {*runner.desired.left_out, verdict.culprit}
        await bring_up(runner)
        if not runner.up:
            return  # the new executor died too, and its own recovery follows
        not_resumed = ""
        missing = missing_parts(runner, agreed)
        if runner.loop.wanted and missing:
            not_resumed = f"; not resumed: left out of its loop: {listing(missing)}"
            runner.loop.want(False)
            await runner.save()
        elif runner.loop.wanted:
            try:
                await start_or_leave_out(runner, asked, agreed)
            except RequestError as error:
                not_resumed = f"; not resumed: {error}"
        held = _held(runner, verdict, cause) + not_resumed
        if runner.loop.stops == asked:  # a loop that was stopped in order is not held
            runner.loop.held = held
        took = time.monotonic() - begin
        runner.log.warning("executor restarted in %.2f s: %s", took, held)

    try:
        await runner.change("the recovery of its executor", work, patient=True)
    except RequestError as error:
        if not runner.up and not runner.closing:
            _give_up(runner, f"{cause}; not recovered: {error}")


def _give_up(runner: RunnerCore, cause: str) -> None:
    """Report why there is no executor; rtcfd starts no other on its own."""
    runner.down_reason = f"{cause}; `rtcfctl -r {runner.name} start` tries again"
    runner.log.error("%s", runner.down_reason)
    runner.notify_change()


def _held(runner: RunnerCore, verdict: Verdict, cause: str) -> str:
    """Return the text of the status after a recovery, without the present remedies."""
    loop = "its loop goes on" if runner.loop.running else "held"
    if verdict.culprit in runner.desired.quarantined:
        return f"{cause}; {loop}"
    return f"{cause}; {loop} with all its components"
