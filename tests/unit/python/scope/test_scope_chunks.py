"""Messages to the pages of a runner, and the history of cycles."""

import asyncio
from typing import Any

import numpy as np
import pytest
import rtcf
from rtcf.v1 import ports_pb2
from rtcf_scope import wire
from rtcf_scope.chunk import Chunk, History, column_of, split_element
from rtcf_scope.hub import Hub
from rtcf_scope.tab import Tab
from rtcf_shared.ports import PortBatch, PortSchema


def _batch(first: int, count: int, lost: int = 0) -> PortBatch:
    message = ports_pb2.PortBatch(
        first_cycle=first,
        stamps_ns=[1_000_000 * (first + i) for i in range(count)],
        latencies_ns=[1000] * count,
        durations_ns=[2000] * count,
    )
    return PortBatch(PortSchema(), 1, first, lost, False, message)


class _Listener:
    """A tab that stores its messages."""

    wants = True
    columns: tuple[str, ...] = ("/a.b",)

    def __init__(self) -> None:
        self.chunks: list[Chunk] = []
        self.errors: list[str] = []

    def take(self, chunk: Chunk) -> None:
        self.chunks.append(chunk)

    def set_schema(self, schema: PortSchema) -> None:
        pass

    def send(self, message: dict[str, Any]) -> None:
        pass

    def set_error(self, text: str) -> None:
        self.errors.append(text)


class _Loop:
    """An event loop in which no time passes."""

    def call_later(self, *_: object) -> None:
        pass

    def time(self) -> float:
        return 0.0


class _Reader:
    """A stream as the hub sees it."""

    loop = _Loop()
    schema = PortSchema()
    opened = 0.0
    error = ""

    def __init__(self, *columns: str) -> None:
        self.columns = frozenset(columns)

    @property
    def is_open(self) -> bool:
        return not self.error

    def release(self) -> None:
        pass

    def close(self) -> None:
        pass


def _hub(*listeners: _Listener) -> Any:
    hub: Any = Hub(rtcf.Client("/nowhere"), "it")
    hub._tabs.update(dict.fromkeys(listeners))
    return hub


def _two(listener: _Listener) -> tuple[Any, Any, Any]:
    """Return a hub, its stream, and a newer stream with another selection."""
    hub = _hub(listener)
    hub._reader, hub._next = _Reader("/a.b"), _Reader("/a.b", "/a.c")
    return hub, hub._reader, hub._next


def _cycles(listener: _Listener) -> list[int]:
    return [int(cycle) for chunk in listener.chunks for cycle in chunk.cycles]


def test_cycles_of_two_streams_are_sent_once() -> None:
    listener = _Listener()
    hub, old, new = _two(listener)
    hub.take(old, _batch(0, 10))
    hub.take(new, _batch(5, 10))
    hub.take(old, _batch(10, 5))  # after the switch
    hub.take(new, _batch(15, 5))
    assert _cycles(listener) == list(range(20))
    assert [each.at for each in listener.chunks] == [0, 10, 15]
    assert not any(each.lost for each in listener.chunks)


def test_a_stream_takes_over_once_the_previous_one_reaches_it() -> None:
    listener = _Listener()
    hub, old, new = _two(listener)
    hub.take(old, _batch(0, 10))
    hub.take(new, _batch(14, 4))
    hub.take(new, _batch(18, 4))
    hub.take(old, _batch(10, 2))
    hub.take(old, _batch(12, 2))
    hub.take(new, _batch(22, 2))
    assert _cycles(listener) == list(range(24))
    assert not any(each.lost for each in listener.chunks)


def test_cycles_between_two_streams_are_counted() -> None:
    listener = _Listener()
    hub, old, new = _two(listener)
    hub.take(old, _batch(0, 10))
    hub.take(new, _batch(12, 3))
    hub.failed(old, "it has ended")  # so that no more cycles arrive
    assert listener.chunks[-1].lost == 2


def test_cycles_dropped_by_a_stream_are_counted() -> None:
    listener = _Listener()
    hub, old, _ = _two(listener)
    hub.take(old, _batch(0, 10))
    hub.failed(old, "rtcfd restarts")
    hub.opened(old, PortSchema())
    hub.take(old, _batch(15, 5))
    hub.take(old, _batch(20, 0, lost=7))
    hub.take(old, _batch(27, 5))
    assert [each.lost for each in listener.chunks] == [0, 5, 7]


def test_errors_go_only_to_the_page_of_their_signals() -> None:
    one, other = _Listener(), _Listener()
    other.columns = ("/a.b", "/a.c")
    hub = _hub(one, other)
    hub._reader, hub._next = _Reader("/a.b"), _Reader("/a.b", "/a.c")
    hub.failed(hub._next, "too many streams")
    assert (one.errors[-1], other.errors[-1]) == ("", "too many streams")
    hub.failed(hub._reader, "rtcfd is away")
    assert (one.errors[-1], other.errors[-1]) == ("rtcfd is away", "rtcfd is away")


def test_a_failing_page_does_not_affect_others(
    capsys: pytest.CaptureFixture[str],
) -> None:
    class Failing(_Listener):
        def take(self, chunk: Chunk) -> None:
            raise ArithmeticError("no such cycle")

    listeners = [_Listener(), Failing(), _Listener()]
    hub = _hub(*listeners)
    hub._reader = _Reader("/a.b")
    hub.take(hub._reader, _batch(0, 10))
    assert _cycles(listeners[0]) == _cycles(listeners[2]) == list(range(10))
    assert capsys.readouterr().err == (
        "rtcf-scope: a page of it failed: ArithmeticError('no such cycle')\n"
    )


def test_cycles_before_a_page_opens_do_not_count_as_lost() -> None:
    async def late() -> None:
        hub = _hub(_Listener())
        tab = Tab(hub)
        tab._shows = True
        for first, lost in ((1000, 900), (1110, 100)):
            tab.take(Chunk(_batch(first, 10), first, lost))
        waiting: Any = tab._waiting
        heads = [wire._HEAD.unpack_from(data) for data, cycles in waiting if cycles]
        assert [head[6] for head in heads] == [0, 100]

    asyncio.run(late())


def test_cycles_without_watched_signals_do_not_count_as_lost() -> None:
    listener = _Listener()
    hub = _hub(listener)
    for first in (0, 5000):
        hub._reader = _Reader("/a.b")
        hub.take(hub._reader, _batch(first, 10))
        hub.close()
    assert [each.lost for each in listener.chunks] == [0, 0]
    assert hub.since == 20


def test_a_slow_page_loses_the_oldest_cycles_with_a_count() -> None:
    async def slow() -> None:
        hub = _hub(_Listener())
        tab = Tab(hub)
        tab._shows = True
        tab.send({"kind": "first"})
        for number in range(2000):
            tab.take(Chunk(_batch(number * 1000, 1000), number * 1000, 0))
        waiting: Any = tab._waiting
        texts = [data for data, _ in waiting if isinstance(data, str)]
        assert texts[0] == '{"kind": "first"}'  # texts are never dropped
        cycles = [data for data, _ in waiting if isinstance(data, bytes)]
        assert sum(map(len, cycles)) <= 8 * 1024 * 1024
        sent = lost = 0
        for data in cycles:
            head = wire._HEAD.unpack_from(data)
            sent, lost = sent + head[3], lost + head[6]
        assert sent + lost + tab._lost == 2_000_000

    asyncio.run(slow())


def test_a_shot_of_any_size_waits_for_a_slow_page() -> None:
    async def slow() -> None:
        tab = Tab(_hub(_Listener()))
        tab._shows = True
        tab.send({"kind": "first"})
        shots = [bytes([number]) * 9_000_000 for number in (1, 2)]
        for shot in shots:
            tab._queue(shot, 0)
            tab.send({"kind": "done"})
            for number in range(400):
                tab.take(Chunk(_batch(number * 1000, 1000), number * 1000, 0))
        waiting: Any = tab._waiting
        assert [data for data, cycles in waiting if isinstance(data, bytes) and not cycles] == [
            shots[1]  # only the newest of several
        ]
        words = [data for data, _ in waiting if isinstance(data, str)]
        assert words[0] == '{"kind": "first"}'
        assert words.count('{"kind": "done"}') == 2
        cycles = [data for data, cycles in waiting if cycles]
        assert 0 < sum(map(len, cycles)) <= 8 * 1024 * 1024

    asyncio.run(slow())


def test_the_history_of_cycles_is_bounded_and_searchable() -> None:
    history = History(200_000)
    for number in range(100):
        history.add(Chunk(_batch(number * 100, 100), number * 100, 0))
    kept = list(history)
    assert 20 < len(kept) < 60 and kept[-1].end == 10_000
    found = history.between(9_750, 9_850)
    assert [each.at for each in found] == [9_700, 9_800]
    cut = wire.cut(found, [], 0, 9_750, 9_850)
    assert np.array_equal(cut[1], np.arange(9_750, 9_850))
    assert history.between(0, 10) == []


def test_a_trace_names_an_output_or_state_and_an_element() -> None:
    assert split_element("/arm.q[2]") == ("/arm.q", 2)
    assert split_element("/arm.q[x]") == ("/arm.q[x]", 0)
    assert column_of("/arm.cmd.twist.linear.x") == "/arm.cmd"
    assert column_of("/arm.q[2]") == "/arm.q"
    assert column_of("/arm.q[state][2]") == "/arm.q"


@pytest.mark.parametrize(
    "name",
    ["", "/", "arm.q", "/arm", "/arm.", "/*.q", "/arm.*", "**", "/a[bc].q", "/arm?.q", "/\ud800.q",
     "/arm.q" + "x" * 1000, "/ä.q", "/arm\n.q"],
)  # fmt: skip
def test_invalid_signal_names_are_not_requested(name: str) -> None:
    assert column_of(name) == ""
    assert split_element(name + "[" + "9" * 5000 + "]") == (name + "[" + "9" * 5000 + "]", 0)
