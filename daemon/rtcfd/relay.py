"""Log records and events of an executor, into rtcfd's log.

Owned by the Runner; called by its Link on rtcfd's one thread.
"""

import logging
from collections.abc import Callable

from rtcf.executor.v1 import executor_pb2 as wire

log = logging.getLogger("rtcf-executor")

_LEVELS: dict[int, int] = {
    wire.LogRecord.LEVEL_DEBUG: logging.DEBUG,
    wire.LogRecord.LEVEL_INFO: logging.INFO,
    wire.LogRecord.LEVEL_WARN: logging.WARNING,
    wire.LogRecord.LEVEL_ERROR: logging.ERROR,
    wire.LogRecord.LEVEL_FATAL: logging.CRITICAL,
}
_EVENT_LEVELS: dict[int, int] = {
    wire.Event.KIND_LOOP_ENDED: logging.ERROR,
    wire.Event.KIND_DEGRADED: logging.WARNING,
    wire.Event.KIND_ROS: logging.INFO,
    wire.Event.KIND_COMPONENT_FAILED: logging.WARNING,
    wire.Event.KIND_OVERRUNS: logging.WARNING,
}


class Relay:
    """The unasked frames of one runner's executor."""

    def __init__(
        self,
        runner: str,
        on_loop_ended: Callable[[], None],
        on_call: Callable[[wire.ServiceCall], None],
    ) -> None:
        self._runner = runner
        self._on_loop_ended = on_loop_ended
        self._on_call = on_call

    def take(self, response: wire.Response) -> None:
        """Take one unasked frame."""
        kind = response.WhichOneof("kind")
        if kind == "log":
            self._log(response.log)
        elif kind == "event":
            self._event(response.event)
        elif kind == "service_call":
            self._on_call(response.service_call)
        elif kind == "error":
            log.error("%s", response.error.message, extra={"runner": self._runner})

    def _log(self, record: wire.LogRecord) -> None:
        level = _LEVELS.get(record.level, logging.INFO)
        if not log.isEnabledFor(level):
            return
        entry = log.makeRecord(
            log.name,
            level,
            record.file,
            record.line,
            "%s",
            (record.message,),
            None,
            record.function,
            {
                "runner": self._runner,
                "component": record.component,
                "iteration": record.iteration,
            },
        )
        # The time of the call, not of its arrival here.
        entry.created = record.time_ns / 1e9
        entry.msecs = record.time_ns // 1_000_000 % 1000
        log.handle(entry)

    def _event(self, event: wire.Event) -> None:
        log.log(
            _EVENT_LEVELS.get(event.kind, logging.WARNING),
            "%s",
            event.message,
            extra={
                "runner": self._runner,
                "component": event.component,
                "iteration": event.iteration,
            },
        )
        if event.kind == wire.Event.KIND_LOOP_ENDED:
            self._on_loop_ended()


def logger_of(runner: str) -> "logging.LoggerAdapter[logging.Logger]":
    """Return the logger for what rtcfd itself says about a runner."""
    return logging.LoggerAdapter(logging.getLogger("rtcfd"), {"runner": runner})
