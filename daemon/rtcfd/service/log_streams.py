"""Streams of events and log records for one caller, from a number on or from now on."""

from collections.abc import AsyncGenerator, Callable, Iterable
from dataclasses import dataclass
from typing import Generic

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2

from rtcfd.common.errors import NotFound
from rtcfd.common.event_log import Entry, EventLog, NumberedLog
from rtcfd.common.names import absolute
from rtcfd.operations.runner_core import no_component
from rtcfd.runners.runner import Runner

_BATCH = 200


@dataclass
class _Piece(Generic[Entry]):
    """The entries since the last piece."""

    entries: list[Entry]
    lost: int  # number of entries lost before the first one
    last: int  # number of the last entry, or of the last one before if there is none


async def _follow(
    log: NumberedLog[Entry],
    request: control_pb2.WatchEventsRequest | control_pb2.WatchLogsRequest,
    check: Callable[[], None],
) -> AsyncGenerator[_Piece[Entry], None]:
    """Yield the caller's position, then new entries.

    Ends only if the request has `until_now`, or if `check`, called before each wait, raises.
    """
    number = log.last
    if request.HasField("after"):
        # A number in another log has no meaning in this one.
        number = min(request.after, log.last) if request.log_id == log.log_id else 0
    until = log.last
    while True:
        entries, lost = log.after(number, _BATCH)
        number += lost + len(entries)
        yield _Piece(entries, lost, number)
        if request.until_now and number >= until:
            return
        if number >= log.last:
            check()
        await log.beyond(number)


async def watch(
    log: EventLog, request: control_pb2.WatchEventsRequest, require_some: Callable[[], None]
) -> AsyncGenerator[control_pb2.WatchEventsResponse, None]:
    """Yield the caller's position, then events; ends only if the request has `until_now`.

    `require_some` raises an error if none of the watched runners exists.
    """
    runners = set(request.runners)
    first = True
    async for piece in _follow(log, request, require_some):
        events = [
            each for each in piece.entries
            if not runners or not each.runner or each.runner in runners
        ]  # fmt: skip
        if first or events or piece.lost:
            yield control_pb2.WatchEventsResponse(
                log_id=log.log_id, sequence=piece.last, lost=piece.lost, events=events
            )
        first = False


async def watch_logs(
    runner: Runner, request: control_pb2.WatchLogsRequest
) -> AsyncGenerator[control_pb2.WatchLogsResponse, None]:
    """Yield the caller's position, then log records.

    Ends only if the request has `until_now`, or when the runner is removed.
    """
    log = runner.logs
    components = {absolute(each) for each in request.components}
    _check_known(runner, components)

    def check() -> None:
        if log.ended:
            raise NotFound(
                f"runner {runner.name} no longer exists", errors_pb2.REASON_RUNNER_NOT_FOUND
            )

    first = True
    async for piece in _follow(log, request, check):
        begin = piece.last - len(piece.entries) + 1
        records = [
            _numbered(record, number)
            for number, record in enumerate(piece.entries, begin)
            if record.level >= request.level and (not components or record.component in components)
        ]
        if first or records or piece.lost:
            yield control_pb2.WatchLogsResponse(
                log_id=log.log_id, sequence=piece.last, lost=piece.lost, records=records
            )
        first = False


def _check_known(runner: Runner, names: Iterable[str]) -> None:
    """Raise NotFound for a component that does not exist and has logged nothing."""
    missing = [name for name in names if name not in runner.desired.components]
    if missing:
        kept, _ = runner.logs.after(0, runner.logs.last)
        spoke = {each.component for each in kept}
        for name in missing:
            if name not in spoke:
                raise no_component(runner, name, ", and no log record of one")


def _numbered(record: wire.LogRecord, number: int) -> control_pb2.LogRecord:
    return control_pb2.LogRecord(
        level=wire.LogRecord.Level.Name(record.level),
        time_ns=record.time_ns,
        iteration=record.iteration,
        component=record.component,
        message=record.message,
        sequence=number,
        file=record.file,
        line=record.line,
    )
