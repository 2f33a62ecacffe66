"""Writes an executor's log records and events to rtcfd's log, and passes them on.

Owned by the Runner; called by its Link on rtcfd's one thread.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Protocol

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2

from rtcfd.common.budget import Budget
from rtcfd.common.growing_interval import GrowingInterval
from rtcfd.common.limits import Limits

log = logging.getLogger("rtcf-executor")
# The executor filters the records, by the level of each component's logger.
log.setLevel(logging.DEBUG)

_LEVELS: dict[int, int] = {
    wire.LogRecord.LEVEL_DEBUG: logging.DEBUG,
    wire.LogRecord.LEVEL_INFO: logging.INFO,
    wire.LogRecord.LEVEL_WARN: logging.WARNING,
    wire.LogRecord.LEVEL_ERROR: logging.ERROR,
    wire.LogRecord.LEVEL_FATAL: logging.CRITICAL,
}
_EVENT_LEVELS: dict[int, int] = {
    wire.Event.KIND_LOOP_ENDED: logging.ERROR,
    # An error, so that the terminal of a rtcfd in the foreground shows it.
    wire.Event.KIND_DEGRADED: logging.ERROR,
    wire.Event.KIND_ROS: logging.INFO,
    wire.Event.KIND_COMPONENT_FAILED: logging.WARNING,
    wire.Event.KIND_OVERRUNS: logging.WARNING,
    wire.Event.KIND_CLOCK: logging.INFO,
}


# The kinds of these events in the client protocol.
_KINDS: dict[int, "control_pb2.Event.Kind"] = {
    wire.Event.KIND_LOOP_ENDED: control_pb2.Event.KIND_LOOP_FAULT,
    wire.Event.KIND_DEGRADED: control_pb2.Event.KIND_DEGRADED,
    wire.Event.KIND_ROS: control_pb2.Event.KIND_ROS,
    wire.Event.KIND_COMPONENT_FAILED: control_pb2.Event.KIND_COMPONENT_FAULT,
    wire.Event.KIND_OVERRUNS: control_pb2.Event.KIND_OVERRUNS,
    wire.Event.KIND_CLOCK: control_pb2.Event.KIND_CLOCK,
}

# Intervals of journal lines about late cycles, which an executor reports every 10 s.
_LATE_S = 10.0
_LATE_LONGEST_S = 3600.0
_REPORT_S = 1.0  # from the first dropped record to the line with their number


class Listener(Protocol):
    """Receives the notifications: the Runner."""

    def loop_ended(self, component: str, reason: str) -> None:
        """The loop has ended because of a fault."""

    def late(self, message: str) -> None:
        """Cycles ended late."""

    def event_occurred(self, kind: "control_pb2.Event.Kind", event: wire.Event) -> None:
        """An event has occurred; called after the specific method, if there is one."""

    def component_failed(self, component: str, reason: str) -> None:
        """A component has failed; the loop goes on."""

    def take_log(self, record: wire.LogRecord) -> None:
        """A component has logged a record."""

    def called(self, call: wire.ServiceCall) -> None:
        """A ROS node calls a service of the executor's ROS node."""

    def stopped_directly(self, stop: wire.DirectStop) -> None:
        """A user has stopped the loop at its executor; repeated after each connection."""

    def parameters_changed(self, changed: wire.ParametersChanged) -> None:
        """A ROS node has changed parameters of a component."""


class Notifications:
    """The notifications of one runner's executor."""

    def __init__(self, runner: str, listener: Listener, limits: Callable[[], Limits]) -> None:
        self._runner = runner
        self._listener = listener
        self._limits = limits
        self._budget = Budget(limits().log_records_per_s)
        self._report: asyncio.TimerHandle | None = None  # on dropped records
        self._late = GrowingInterval(_LATE_S, _LATE_LONGEST_S)  # of lines about late cycles

    def take(self, response: wire.Response) -> None:
        """Handle one notification."""
        kind = response.WhichOneof("kind")
        if kind == "log":
            self._log(response.log)
        elif kind == "event":
            self._event(response.event)
        elif kind == "service_call":
            self._listener.called(response.service_call)
        elif kind == "parameters_changed":
            self._listener.parameters_changed(response.parameters_changed)
        elif kind == "direct_stop":
            self._listener.stopped_directly(response.direct_stop)
        elif kind == "error":
            log.error("%s", response.error.message, extra={"runner": self._runner})

    def _log(self, record: wire.LogRecord) -> None:
        if record.level not in _LEVELS:  # of a newer executor
            record.level = wire.LogRecord.LEVEL_INFO
        self._listener.take_log(record)
        level = _LEVELS[record.level]
        # A component that logs in each cycle must not fill the disk.
        self._budget.per_s = self._limits().log_records_per_s
        if not self._budget.take():
            if self._report is None:
                later = asyncio.get_running_loop().call_later
                self._report = later(_REPORT_S, self._tell_what_was_lost)
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
        # The time at which the component logged it, not of its arrival here.
        entry.created = record.time_ns / 1e9
        entry.msecs = record.time_ns // 1_000_000 % 1000
        log.handle(entry)

    def _tell_what_was_lost(self) -> None:
        self._report = None
        log.warning(
            "%d log records of its components were dropped: more than %d a second; see "
            "log_records_per_s under [limits]",
            self._budget.take_lost(),
            self._budget.per_s,
            extra={"runner": self._runner},
        )

    def _event(self, event: wire.Event) -> None:
        text = str(event.message)
        # A loop that is always late, as on a kernel without real time, must not fill the journal.
        left_out = self._late.due() if event.kind == wire.Event.KIND_OVERRUNS else 0
        if left_out:
            text += f" ({left_out} similar reports were suppressed since the last one)"
        if left_out is not None:
            log.log(
                _EVENT_LEVELS.get(event.kind, logging.WARNING),
                "%s",
                text,
                extra={
                    "runner": self._runner,
                    "component": event.component,
                    "iteration": event.iteration,
                },
            )
        if event.kind == wire.Event.KIND_LOOP_ENDED:
            self._listener.loop_ended(event.component, event.message)
        elif event.kind == wire.Event.KIND_COMPONENT_FAILED:
            self._listener.component_failed(event.component, event.message)
        elif event.kind == wire.Event.KIND_OVERRUNS:
            self._listener.late(event.message)
        if (kind := _KINDS.get(event.kind)) is not None:
            self._listener.event_occurred(kind, event)


def logger_of(runner: str) -> "logging.LoggerAdapter[logging.Logger]":
    """Return the logger for rtcfd's own messages about a runner."""
    return logging.LoggerAdapter(logging.getLogger("rtcfd"), {"runner": runner})
