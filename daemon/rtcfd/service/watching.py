"""Watching events: from a number on, or from now on, for one caller."""

from collections.abc import AsyncGenerator, Callable

from rtcf.v1 import control_pb2

from rtcfd.common.event_log import EventLog

_BATCH = 200


async def watch(
    log: EventLog, request: control_pb2.WatchEventsRequest, require_some: Callable[[], None]
) -> AsyncGenerator[control_pb2.WatchEventsResponse, None]:
    """Yield where the caller stands, then what happens; without end unless asked for.

    `require_some` refuses to wait when none of the runners that are watched is there.
    """
    number = log.last
    if request.HasField("after"):
        # Numbers of another log say nothing about this one.
        number = min(request.after, log.last) if request.log_id == log.log_id else 0
    runners = set(request.runners)
    until = log.last
    first = True
    while True:
        events, lost = log.after(number, _BATCH)
        number = events[-1].sequence if events else number + lost
        told = [each for each in events if not runners or not each.runner or each.runner in runners]
        if first or told or lost:
            yield control_pb2.WatchEventsResponse(
                log_id=log.log_id, sequence=number, lost=lost, events=told
            )
        first = False
        if request.until_now and number >= until:
            return
        if number >= log.last:
            require_some()
        await log.beyond(number)
