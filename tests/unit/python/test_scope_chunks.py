"""What tabs of a runner are told, and what is kept of it."""

import asyncio
from typing import Any

import numpy as np
import rtcf
from rtcf.streams.ports import PortBatch, PortSchema
from rtcf.v1 import ports_pb2
from rtcf_scope import wire
from rtcf_scope.chunk import Chunk, Memory, column_of, split_element
from rtcf_scope.hub import Hub
from rtcf_scope.tab import Tab


def _batch(first: int, count: int, lost: int = 0) -> PortBatch:
    message = ports_pb2.PortBatch(
        first_cycle=first,
        stamps_ns=[1_000_000 * (first + i) for i in range(count)],
        latencies_ns=[1000] * count,
        durations_ns=[2000] * count,
    )
    return PortBatch(PortSchema(), 1, first, lost, False, message)


class _Ear:
    """A listener that remembers."""

    columns: frozenset[str] = frozenset({"/a.b"})

    def __init__(self) -> None:
        self.chunks: list[Chunk] = []

    def take(self, chunk: Chunk) -> None:
        self.chunks.append(chunk)

    def tell(self, message: dict[str, Any]) -> None:
        pass


class _Reader:
    """A stream as the hub sees one."""

    def taken(self) -> None:
        pass

    def close(self) -> None:
        pass


def _hub(ear: _Ear) -> Any:
    hub: Any = Hub(rtcf.Client("/nowhere"), "it")
    hub._tabs.add(ear)
    return hub


def test_cycles_that_two_streams_told_are_told_once() -> None:
    ear = _Ear()
    hub = _hub(ear)
    old, new = _Reader(), _Reader()
    hub._reader, hub._next = old, new
    hub.take(old, _batch(0, 10))
    hub.take(new, _batch(5, 10))
    hub.take(old, _batch(10, 5))  # too late
    hub.take(new, _batch(15, 5))
    assert np.array_equal(np.hstack([each.cycles for each in ear.chunks]), np.arange(20))
    assert [each.at for each in ear.chunks] == [0, 10, 15]
    assert not any(each.lost for each in ear.chunks)


def test_cycles_between_two_streams_are_counted() -> None:
    ear = _Ear()
    hub = _hub(ear)
    old, new = _Reader(), _Reader()
    hub._reader, hub._next = old, new
    hub.take(old, _batch(0, 10))
    hub.take(new, _batch(12, 3))
    assert ear.chunks[-1].lost == 2


def test_a_slow_tab_loses_the_oldest_cycles_and_is_told_how_many() -> None:
    async def slow() -> None:
        hub = _hub(_Ear())
        tab = Tab(hub)
        tab._names = ["/a.b"]
        tab.tell({"kind": "first"})
        for number in range(2000):
            tab.take(Chunk(_batch(number * 1000, 1000), number * 1000, 0))
        waiting: Any = tab._waiting
        texts = [data for data, _ in waiting if isinstance(data, str)]
        assert texts[0] == '{"kind": "first"}'  # words are never lost
        cycles = [data for data, _ in waiting if isinstance(data, bytes)]
        assert sum(map(len, cycles)) <= 8 * 1024 * 1024
        told = lost = 0
        for data in cycles:
            head = wire._HEAD.unpack_from(data)
            told, lost = told + head[3], lost + head[6]
        assert told + lost + tab._lost == 2_000_000

    asyncio.run(slow())


def test_a_shot_waits_for_a_slow_tab_however_large_it_is() -> None:
    async def slow() -> None:
        tab = Tab(_hub(_Ear()))
        tab._names = ["/a.b"]
        tab.tell({"kind": "first"})
        shots = [bytes([number]) * 9_000_000 for number in (1, 2)]
        for shot in shots:
            tab._queue(shot, 0)
            tab.tell({"kind": "done"})
            for number in range(400):
                tab.take(Chunk(_batch(number * 1000, 1000), number * 1000, 0))
        waiting: Any = tab._waiting
        assert [data for data, cycles in waiting if isinstance(data, bytes) and not cycles] == [
            shots[1]  # of several the newest
        ]
        words = [data for data, _ in waiting if isinstance(data, str)]
        assert words[0] == '{"kind": "first"}'
        assert words.count('{"kind": "done"}') == 2
        cycles = [data for data, cycles in waiting if cycles]
        assert 0 < sum(map(len, cycles)) <= 8 * 1024 * 1024

    asyncio.run(slow())


def test_the_memory_is_bounded_and_finds_what_it_has() -> None:
    memory = Memory(200_000)
    for number in range(100):
        memory.add(Chunk(_batch(number * 100, 100), number * 100, 0))
    kept = list(memory)
    assert 20 < len(kept) < 60 and kept[-1].end == 10_000
    found = memory.between(9_750, 9_850)
    assert [each.at for each in found] == [9_700, 9_800]
    cut = wire.cut(found, [], 0, 9_750, 9_850)
    assert np.array_equal(cut[1], np.arange(9_750, 9_850))
    assert memory.between(0, 10) == []


def test_a_trace_is_of_an_output_or_state_and_an_element() -> None:
    assert split_element("/arm.q[2]") == ("/arm.q", 2)
    assert split_element("/arm.q[x]") == ("/arm.q[x]", 0)
    assert column_of("/arm.cmd.twist.linear.x") == "/arm.cmd"
    assert column_of("/arm.q[2]") == "/arm.q"
