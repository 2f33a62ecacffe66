"""Writes incidents of a runner: its last cycles, with the facts about it.

Functions on a RunnerCore.
"""

import os
import time
from typing import Any

from rtcf.v1 import errors_pb2, incidents_pb2

from rtcfd import VERSION
from rtcfd.access import caller
from rtcfd.common.errors import FailedPrecondition
from rtcfd.executor.executor import Executor
from rtcfd.operations import parameters
from rtcfd.operations.runner_core import RunnerCore

_EVENTS = 50
_CHANGES = 50  # of parameters
_LONGEST_REASON = 500  # characters


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
    runner.shared.keeping.in_background(
        f"an incident of {runner.name}", _keep(runner, descriptor, facts)
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
    return await runner.shared.keeping.begin(
        f"an incident of {runner.name}", lambda: _keep(runner, descriptor, facts)
    )


async def _keep(
    runner: RunnerCore, descriptor: int, facts: dict[str, Any]
) -> incidents_pb2.Incident:
    kept = await runner.shared.incidents.keep(descriptor, facts)
    runner.incident = kept.name
    runner.log.warning("incident %s kept in %s: %s", kept.name, kept.file, kept.reason)
    runner.notify_change()
    return kept


def _facts(
    runner: RunnerCore, executor: Executor, reason: str, component: str, iteration: int
) -> dict[str, Any]:
    note = executor.note()
    known = note.iteration if note is not None else 0
    events, _ = runner.shared.events.after(max(runner.shared.events.last - 500, 0), 500)
    desired = runner.desired
    return {
        "runner": runner.name,
        "reason": " ".join(reason.split())[:_LONGEST_REASON],
        "component": component,
        "iteration": iteration or known,
        "time_ns": time.time_ns(),
        "version": VERSION,
        "executor_version": executor.version,
        "graph": list(desired.components.values()),
        "settings": runner.settings(),
        "parameters": [
            parameters.change_message(each) for each in desired.history.of()[-_CHANGES:]
        ],
        "events": [each for each in events if each.runner == runner.name][-_EVENTS:],
        "libraries": runner.code.files(),
    }
