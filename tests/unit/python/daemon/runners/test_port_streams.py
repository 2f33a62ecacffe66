"""Port values on their way to a slow reader: the queue is bounded."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from rtcf.v1 import ports_pb2
from rtcfd.common.errors import InvalidArgument
from rtcfd.service import ports

Response = ports_pb2.WatchPortsResponse


class Teller:
    """A runner that sends everything at once, and then ends."""

    def __init__(self, responses: Sequence[Response]) -> None:
        self._responses = responses

    async def watch_ports(
        self, _: ports_pb2.WatchPortsRequest, on_ports: Callable[[Response], None]
    ) -> None:
        for response in self._responses:
            on_ports(response)


def read(responses: Sequence[Response], selection: Sequence[str] = ()) -> list[Response]:
    """Return the messages read by a caller that starts after all of them were sent."""

    async def run() -> list[Response]:
        runner: Any = Teller(responses)
        request = ports_pb2.WatchPortsRequest(selection=selection)
        return [each async for each in ports.watch_ports(runner, request)]

    return asyncio.run(run())


def schema(note: str, columns: int = 1) -> Response:
    several = [ports_pb2.PortColumn(component="/c", name=f"p{i}") for i in range(columns)]
    return Response(schema=ports_pb2.PortSchema(columns=several, notes=[note]))


def batch(first: int, cycles: int, columns: int = 1) -> Response:
    values = [bytes(8 * cycles)] * columns
    stamps = range(cycles)
    return Response(batch=ports_pb2.PortBatch(first_cycle=first, stamps_ns=stamps, values=values))


def test_a_fast_reader_gets_everything() -> None:
    told = [schema("a"), batch(0, 2), schema("b"), batch(2, 3)]
    assert read(told) == told


def test_only_the_last_of_several_empty_graphs_is_queued() -> None:
    told = [schema("x" * 1000, columns) for columns in range(1, 50)]
    assert read(told) == told[-1:]


def test_dropped_cycles_are_counted_across_dropped_graphs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, kept = schema("a"), batch(0, 2)
    monkeypatch.setattr(ports, "_MOST", first.ByteSize() + kept.ByteSize())
    told = [first, kept]
    for number in range(20):
        told += [schema(str(number), number + 1), batch(2 + 3 * number, 3, number + 1)]
    *before, last, lost = read(told)
    assert before == told[:2]
    assert last == told[-2]
    assert lost.batch.lost == 60
    assert lost.batch.first_cycle == 62
    assert list(lost.batch.values) == [b""] * 20


def test_too_many_patterns_or_names_are_rejected() -> None:
    components = [f"/c{number}" for number in range(257)]
    assert read([schema("a")], components[:-1])
    with pytest.raises(InvalidArgument, match="257 components and patterns .*, 256 at most"):
        read([schema("a")], components)
    with pytest.raises(InvalidArgument, match="257 components and patterns .*, 256 at most"):
        read([schema("a")], [f"/c*.p{number}" for number in range(257)])
    names = [f"/c{number}.p" for number in range(16385)]
    assert read([schema("a")], names[:-1])
    with pytest.raises(InvalidArgument, match="16385 names of ports are too many, 16384 at most"):
        read([schema("a")], names)
