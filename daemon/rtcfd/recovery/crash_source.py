"""Reports the source line at which an executor crashed: in the journal, the events, the status.

A function on a RunnerCore; runs beside the recovery, without delaying it.
"""

import asyncio

from rtcf.v1 import control_pb2

from rtcfd.common.errors import Unavailable
from rtcfd.executor import source_lines
from rtcfd.executor.flight_recorder import Trace
from rtcfd.operations.runner_core import RunnerCore
from rtcfd.recovery.verdict import Verdict

_TIMEOUT_S = 15.0  # for all files


async def report_source(runner: RunnerCore, trace: Trace, verdict: Verdict) -> None:
    """Find the source lines of a crash, if there is debug information, and report them."""
    # Read the files first: the next executor is about to load its libraries.
    loaded = {path for path, *_ in runner.code.files().values()}
    changed = set((await runner.code.changed()).values())
    program = str(runner.shared.command.binary.resolve())
    try:
        async with asyncio.timeout(_TIMEOUT_S):
            folders = runner.shared.folders
            found = await source_lines.find(trace, loaded - changed, program, folders)
    except (TimeoutError, Unavailable):
        return
    if not found.lines:
        return
    place = f"it crashed in {found.place}"
    text = f"{place} (innermost first: {'; '.join(found.lines)})"
    extra = {"runner": runner.name, "component": verdict.culprit}
    runner.log.logger.error("%s", text, extra=extra)
    runner.happened(control_pb2.Event.KIND_EXECUTOR_FAULT, text, verdict.culprit)
    for known in (runner.desired.left_out, runner.desired.quarantined):
        if known.get(verdict.culprit) == str(verdict):
            known[verdict.culprit] = f"{verdict}: {place}"
    if not runner.closing:
        await runner.save()
        runner.notify_change()
