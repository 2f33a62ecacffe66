"""Writes incidents of a runner: its last cycles, with the facts about it.

Functions on a RunnerCore.
"""

import asyncio
import os
import time
from collections.abc import Awaitable, Callable
from typing import Any

from rtcf.v1 import errors_pb2, incidents_pb2

from rtcfd import VERSION
from rtcfd.access import caller
from rtcfd.common.errors import FailedPrecondition, Unavailable
from rtcfd.executor.executor import Executor
from rtcfd.operations import parameters
from rtcfd.operations.runner_core import RunnerCore

_EVENTS = 50
_CHANGES = 50  # of parameters
_LONGEST_REASON = 500  # characters
_PATIENCE_S = 2.0  # with a change that may have caused the fault
TAKE_TIMEOUT_S = 10.0


def keep(
    runner: RunnerCore, executor: Executor, reason: str, component: str = "", iteration: int = 0
) -> None:
    """Write an automatic incident, in the background."""
    if executor.frames is None or not runner.shared.incidents.wanted(runner.name):
        return
    facts = _facts(runner, executor, reason, component, iteration)
    # A duplicate: the executor's descriptor is closed soon.
    descriptor = os.dup(executor.frames)
    # Not an operation of the runner, so that its removal does not wait for the file.

    async def complete() -> None:
        # A `set` can cause the fault before rtcfd has the answer to it, and notes the change.
        await runner.operations.wait_for_current(_PATIENCE_S)
        facts.update(_recent(runner))

    runner.shared.keeping.in_background(
        f"an incident of {runner.name}", _keep(runner, descriptor, facts, complete)
    )


async def take(runner: RunnerCore, reason: str) -> incidents_pb2.Incident:
    """Write an incident now, on request."""
    executor = runner.alive()
    if executor.frames is None:
        raise FailedPrecondition(
            f"the executor of {runner.name} is of rtcf {executor.version}, which keeps no frames: "
            f"`rtcfctl runner restart {runner.name}` stops the loop and starts one that does",
            errors_pb2.REASON_EXECUTOR_FOREIGN,
        )
    acting = caller.current()
    reason = reason or f"taken by {acting.peer.user if acting else 'rtcfd'}"
    facts = _facts(runner, executor, reason, "", 0)
    descriptor = os.dup(executor.frames)
    # Runs to its end even if the caller disconnects: threads use the open files.
    work = runner.shared.keeping.begin(
        f"an incident of {runner.name}", lambda: _keep(runner, descriptor, facts)
    )
    try:
        return await asyncio.wait_for(work, TAKE_TIMEOUT_S)
    except TimeoutError:
        raise Unavailable(
            f"the incident of {runner.name} is not written after {TAKE_TIMEOUT_S:g} s: does the "
            "disk of the state directory answer? `rtcfctl incident list` shows it once it is "
            "written",
            errors_pb2.REASON_MACHINE_SILENT,
        ) from None


async def _keep(
    runner: RunnerCore,
    descriptor: int,
    facts: dict[str, Any],
    complete: Callable[[], Awaitable[None]] | None = None,
) -> incidents_pb2.Incident:
    kept = await runner.shared.incidents.keep(descriptor, facts, complete)
    runner.incident = kept.name
    runner.log.warning("incident %s kept in %s: %s", kept.name, kept.file, kept.reason)
    runner.notify_change()
    return kept


def _facts(
    runner: RunnerCore, executor: Executor, reason: str, component: str, iteration: int
) -> dict[str, Any]:
    note = executor.note()
    known = note.iteration if note is not None else 0
    return {
        "runner": runner.name,
        "reason": " ".join(reason.split())[:_LONGEST_REASON],
        "component": component,
        "iteration": iteration or known,
        "time_ns": time.time_ns(),
        "version": VERSION,
        "executor_version": executor.version,
        "graph": list(runner.desired.components.values()),
        "settings": runner.settings(),
        "libraries": runner.code.files(),
        **_recent(runner),
    }


def _recent(runner: RunnerCore) -> dict[str, Any]:
    """Return the last parameter changes and events."""
    events, _ = runner.shared.events.after(max(runner.shared.events.last - 500, 0), 500)
    changes = runner.desired.history.of()[-_CHANGES:]
    return {
        "parameters": [parameters.change_message(each) for each in changes],
        "events": [each for each in events if each.runner == runner.name][-_EVENTS:],
    }
