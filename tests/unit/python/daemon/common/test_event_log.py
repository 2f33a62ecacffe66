"""The event log: nothing is lost without a count, for any reader."""

import asyncio

import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.v1 import control_pb2, errors_pb2
from rtcfd.common.errors import NotFound
from rtcfd.common.event_log import EventLog
from rtcfd.service.log_streams import watch

KIND = control_pb2.Event.KIND_GRAPH


@seed(3)
@settings(max_examples=300)
@given(
    st.integers(1, 12),
    st.lists(st.one_of(st.integers(1, 20).map(lambda n: ("add", n)), st.just(("read", 0))),
             max_size=20),
    st.integers(1, 7),
)  # fmt: skip
def test_events_read_and_dropped_add_up(
    kept: int, steps: list[tuple[str, int]], batch: int
) -> None:
    log = EventLog(kept)
    number = counted = 0
    for what, count in [*steps, ("read", 0)]:
        for _ in range(count if what == "add" else 0):
            log.add(KIND, f"event {log.last + 1}")
        while what == "read":
            events, lost = log.after(number, batch)
            assert len(events) <= batch
            expected = range(number + lost + 1, number + lost + 1 + len(events))
            assert [each.sequence for each in events] == list(expected)
            assert all(each.message == f"event {each.sequence}" for each in events)
            counted += lost + len(events)
            if not events:
                assert not lost
                break
            assert not lost or log.last - number > kept
            number = events[-1].sequence
    assert counted == log.last == number


def test_a_slow_watcher_gets_the_dropped_count_and_blocks_nobody() -> None:
    async def run() -> list[control_pb2.WatchEventsResponse]:
        log = EventLog(kept=3)
        watching = watch(log, control_pb2.WatchEventsRequest(), lambda: None)
        found = [await anext(watching)]
        for number in range(10):
            log.add(KIND, f"event {number}", runner="arm")
        found.append(await anext(watching))
        log.add(KIND, "one more", runner="arm")
        found.append(await anext(watching))
        await watching.aclose()
        return found

    first, second, third = asyncio.run(run())
    assert (first.sequence, first.lost, len(first.events)) == (0, 0, 0)
    assert (second.sequence, second.lost) == (10, 7)
    assert [each.sequence for each in second.events] == [8, 9, 10]
    assert (third.lost, [each.sequence for each in third.events]) == (0, [11])
    assert first.log_id == third.log_id != ""


def test_a_position_in_another_log_starts_with_all_stored_events() -> None:
    async def run(request: control_pb2.WatchEventsRequest) -> list[int]:
        log = EventLog()
        request.log_id = log.log_id if request.log_id == "this" else "another"
        for number in range(5):
            log.add(KIND, f"event {number}", runner="arm" if number % 2 else "leg")
        found: list[int] = []
        async for response in watch(log, request, lambda: None):
            found += [each.sequence for each in response.events]
        return found

    request = control_pb2.WatchEventsRequest
    assert asyncio.run(run(request(after=3, log_id="this", until_now=True))) == [4, 5]
    assert asyncio.run(run(request(after=3, log_id="x", until_now=True))) == [1, 2, 3, 4, 5]
    assert asyncio.run(run(request(after=99, log_id="this", until_now=True))) == []
    assert asyncio.run(run(request(until_now=True))) == []
    assert asyncio.run(run(request(after=0, runners=["arm"], until_now=True))) == [2, 4]


def test_a_watch_of_removed_runners_ends_after_their_stored_events() -> None:
    async def run() -> list[int]:
        log = EventLog()
        for _ in range(1000):
            log.add(KIND, "something", runner="arm")

        def nobody_there() -> None:
            raise NotFound("no runner", errors_pb2.REASON_RUNNER_NOT_FOUND)

        found: list[int] = []
        request = control_pb2.WatchEventsRequest(after=0, log_id=log.log_id, runners=["arm"])
        with pytest.raises(NotFound):
            async for response in watch(log, request, nobody_there):
                found += [each.sequence for each in response.events]
        return found

    assert asyncio.run(run()) == list(range(1, 1001))


def test_a_message_is_one_line_of_bounded_length() -> None:
    log = EventLog()
    log.add(KIND, "a\nb " + "x" * 5000)
    ((event,), _) = log.after(0, 1)
    assert event.message.startswith("a b x")
    assert len(event.message) == 1001
