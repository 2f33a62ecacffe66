"""Tasks that nobody waits for: what goes wrong in one is said, not lost."""

import asyncio
import logging
from typing import Any

log = logging.getLogger("rtcfd")


def looked_at(task: "asyncio.Task[Any]", what: str) -> "asyncio.Task[Any]":
    """Return the task; how it fails, if it does, goes to the log."""

    def look(done: "asyncio.Task[Any]") -> None:
        if not done.cancelled() and (problem := done.exception()):
            log.error("internal error: %s ended", what, exc_info=problem)

    task.add_done_callback(look)
    return task
