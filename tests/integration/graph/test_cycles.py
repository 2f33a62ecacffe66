"""Graphs with loops of connections of every kind, through the executor: it rejects each of
them, and its error is correct."""

import itertools
import random
import re

import pytest
import rtcf
from rtcf.v1 import graph_pb2

SAMPLES = 40
MOST = 5
INPUTS = ("in1", "in2", "in3", "in4", "in5")

Edge = tuple[int, int]


def has_loop(nodes: int, edges: set[Edge]) -> bool:
    """Return whether a path leads back to its start."""
    reached = [{to for origin, to in edges if origin == node} for node in range(nodes)]
    for _ in range(nodes):
        for node in range(nodes):
            reached[node] |= set().union(*(reached[each] for each in reached[node]))
    return any(node in reached[node] for node in range(nodes))


def pairs(nodes: int) -> list[Edge]:
    return [(origin, to) for origin in range(nodes) for to in range(nodes)]


def samples() -> list[tuple[int, set[Edge]]]:
    """All graphs with a loop of up to 2 components, and some graphs of up to 5."""
    every = [
        (nodes, set(edges))
        for nodes in (1, 2)
        for count in range(1, nodes * nodes + 1)
        for edges in itertools.combinations(pairs(nodes), count)
    ]
    chance = random.Random(5)
    while len(every) < SAMPLES:
        nodes = chance.randint(3, MOST)
        chosen = chance.sample(pairs(nodes), chance.randint(nodes, 2 * nodes))
        every.append((nodes, set(chosen)))
    return [each for each in every if has_loop(*each)]


def gather(nodes: int, edges: set[Edge]) -> list[graph_pb2.ComponentSpec]:
    """Return a component for each node, with an input for each edge into it."""
    specs = []
    for node in range(nodes):
        remaps = [f"out:=/x{node}"]
        for origin, port in zip(range(nodes), INPUTS, strict=False):
            connected = (origin, node) in edges
            remaps.append(f"{port}:=/x{origin}" if connected else f"{port}:=~{port}")
        specs.append(rtcf.component("rtcf_test", "Gather", name=f"n{node}", remaps=remaps))
    return specs


def check_loop(line: str, edges: set[Edge]) -> None:
    """Check that the loop in an error exists: a closed path of existing connections."""
    (text,) = re.findall(r"form a loop: (.*?);", line)
    steps = re.findall(r"/n(\d)\.out → /n(\d)\.in(\d)", text)
    assert text.count("→") == 2 * len(steps) - 1
    for origin, to, port in steps:
        assert (int(origin), int(to)) in edges
        assert int(port) == int(origin) + 1
    assert [to for _, to, _ in steps] == [origin for origin, _, _ in [*steps[1:], steps[0]]]


@pytest.mark.parametrize("running", [False, True])
def test_every_loop_is_rejected_and_each_suggested_break_gives_an_order(
    client: rtcf.Client, running: bool
) -> None:
    if running:
        client.start()
    for nodes, edges in samples():
        specs = gather(nodes, edges)
        generation = client.get_status("rt_runner").runners[0].generation
        with pytest.raises(rtcf.RefusedError) as refused:
            client.apply(specs, "rt_runner")
        line = str(refused.value)
        check_loop(line, edges)
        assert client.get_order() == []
        assert client.get_status("rt_runner").runners[0].generation == generation
        suggestions = line.partition("read the previous cycle: ")[2].split(", or ")
        if suggestions[-1] == "elsewhere in the loop":
            suggestions.pop()
        for suggested in suggestions:
            keys = re.findall(r"`breaks: \[([^]]+)\]` of n(\d)", suggested)
            assert keys, line
            for ports, node in keys:
                specs[int(node)].breaks.extend(ports.split(", "))
            client.apply(specs, "rt_runner")
            assert sorted(client.get_order()) == [f"/n{node}" for node in range(nodes)]
            client.apply([], "rt_runner")
            for spec in specs:
                del spec.breaks[:]


def test_a_growing_loop_is_rejected_when_it_closes(client: rtcf.Client) -> None:
    client.start()
    ring = gather(MOST, {(node, (node + 1) % MOST) for node in range(MOST)})
    for spec in ring[:-1]:
        client.load(spec)
    order = client.get_order()
    with pytest.raises(rtcf.RefusedError) as refused:
        client.load(ring[-1])
    assert client.get_order() == order == [f"/n{node}" for node in range(MOST - 1)]
    # For a component that is not loaded yet, the break is an option of its load.
    (option,) = re.findall(r"loading n4 with `(--break [^`]+)`", str(refused.value))
    ring[-1].breaks.append(option.split()[1])
    client.load(ring[-1])
    assert sorted(client.get_order()) == [f"/n{node}" for node in range(MOST)]
