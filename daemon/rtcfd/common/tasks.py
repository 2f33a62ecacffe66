"""Logs the failures of tasks that nobody awaits."""

import asyncio
import logging
from typing import Any

log = logging.getLogger("rtcfd")


def looked_at(task: "asyncio.Task[Any]", name: str) -> "asyncio.Task[Any]":
    """Return the task; if it fails, its exception goes to the log under `name`."""

    def look(done: "asyncio.Task[Any]") -> None:
        if not done.cancelled() and (problem := done.exception()):
            log.error("internal error: %s ended", name, exc_info=problem)

    task.add_done_callback(look)
    return task
