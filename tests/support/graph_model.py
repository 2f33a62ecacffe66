"""A reference model of a runner's graph of Mixers: the expected result of a change, or its
rejection, and the values that the components compute.

Written from the documentation of graphs, without the executor's algorithms: it finds the
order by trial, and loops by following connections.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import rtcf
from rtcf.v1 import graph_pb2

INPUTS = {"in1": "int32", "in2": "int32", "level": "double"}
OUTPUTS = {"out": "int32", "half": "double", "updates": "int32"}
TYPES = INPUTS | OUTPUTS
MODULUS = 100_003
UNLUCKY = 13  # an offset that prepare() rejects
RANGES = {"offset": range(-100, 101), "gain": range(0, 10)}
DEFAULTS = {"offset": 1, "gain": 1}


class Refused(Exception):
    """The change must be rejected."""


@dataclass(frozen=True)
class Mixer:
    """A component: its specification and its present parameters."""

    name: str  # full name
    wires: Mapping[str, str] = field(default_factory=dict)  # remaps, port -> absolute name
    parameters: Mapping[str, int] = field(default_factory=dict)
    unwilling: str = ""  # the hook that fails
    first: bool = False
    breaks: frozenset[str] = frozenset()
    every: int = 1
    phase: int = 0

    def mapped(self, port: str) -> str:
        """Return the name of a port after remapping."""
        return self.wires.get(port, f"{self.name}/{port}")

    def broken(self, port: str) -> bool:
        """Return whether an input reads the previous cycle."""
        return self.first or port in self.breaks

    def value(self, parameter: str) -> int:
        """Return the value of a parameter."""
        return self.parameters.get(parameter, DEFAULTS[parameter])

    def spec(self) -> graph_pb2.ComponentSpec:
        """Return the component specification that a client sends."""
        ns, _, name = self.name.rpartition("/")
        parameters = [f"{each}:={value}" for each, value in self.parameters.items()]
        if self.unwilling:
            parameters.append(f"unwilling:={self.unwilling}")
        remaps = {port: f"~{port}" for port in TYPES} | dict(self.wires)
        return rtcf.component(
            "rtcf_test",
            "Mixer",
            name=name,
            ns=ns or "/",
            remaps=[f"{port}:={to}" for port, to in remaps.items()],
            parameters=parameters,
            first=self.first,
            breaks=sorted(self.breaks),
            every=self.every,
            phase=self.phase,
        )


Graph = Mapping[str, Mixer]


def load(graph: Graph, mixer: Mixer) -> Graph:
    """Return the graph with an additional component."""
    if mixer.name in graph:
        raise Refused(f"{mixer.name} is there")
    _check_hooks(mixer)
    return _checked({**graph, mixer.name: mixer})


def unload(graph: Graph, names: Iterable[str]) -> Graph:
    """Return the graph without some components."""
    left = dict(graph)
    for name in names:
        if left.pop(name, None) is None:
            raise Refused(f"no {name}")
    return _checked(left)


def replaced(graph: Graph, old: str, mixer: Mixer) -> Graph:
    """Return the graph with a component replaced. The new one takes over the flags, breaks
    and parameters that it does not set itself."""
    if old not in graph:
        raise Refused(f"no {old}")
    if mixer.name != old and mixer.name in graph:
        raise Refused(f"{mixer.name} is there")
    mixer = replace(
        mixer,
        first=mixer.first or graph[old].first,
        breaks=mixer.breaks or graph[old].breaks,
        parameters={**graph[old].parameters, **mixer.parameters},
    )
    _check_hooks(mixer)
    left = {name: each for name, each in graph.items() if name != old}
    return _checked({**left, mixer.name: mixer})


def set_breaks(graph: Graph, ports: Iterable[tuple[str, str]], broken: bool) -> Graph:
    """Return the graph with loop breaks set or removed."""
    changed = dict(graph)
    for name, port in ports:
        if name not in changed or port not in INPUTS:
            raise Refused(f"no {name}.{port}")
        mixer = changed[name]
        if broken:
            changed[name] = replace(mixer, breaks=mixer.breaks | {port})
        else:
            breaks = frozenset(each for each in INPUTS if mixer.broken(each)) - {port}
            changed[name] = replace(mixer, breaks=breaks, first=False)
    return _checked(changed)


def set_parameters(graph: Graph, name: str, batch: Mapping[str, int]) -> Graph:
    """Return the graph with new values of a component's parameters."""
    if name not in graph:
        raise Refused(f"no {name}")
    mixer = replace(graph[name], parameters={**graph[name].parameters, **batch})
    _check_parameters(mixer)
    return {**graph, name: mixer}


def applied(graph: Graph, wanted: Iterable[Mixer]) -> Graph:
    """Return the result of applying a whole graph, in which each name occurs once."""
    result: dict[str, Mixer] = {}
    for mixer in wanted:
        if mixer.name in result:
            raise Refused(f"{mixer.name} stands twice")
        result[mixer.name] = mixer
        _check_hooks(mixer)
    return _checked(result)


def _check_hooks(mixer: Mixer) -> None:
    _check_parameters(mixer)
    if mixer.unwilling or mixer.phase >= mixer.every or mixer.breaks - INPUTS.keys():
        raise Refused(f"{mixer.name} does not configure or start")


def _check_parameters(mixer: Mixer) -> None:
    for name, value in mixer.parameters.items():
        if name not in RANGES or value not in RANGES[name]:
            raise Refused(f"{mixer.name}: {name} = {value}")
    if mixer.value("offset") == UNLUCKY:
        raise Refused(f"{mixer.name} does not prepare")


def _checked(graph: Graph) -> Graph:
    types: dict[str, str] = {}
    writers: set[str] = set()
    shared: set[str] = set()
    for mixer in graph.values():
        for port, kind in TYPES.items():
            name = mixer.mapped(port)
            if types.setdefault(name, kind) != kind:
                raise Refused(f"types differ on {name}")
            if port in OUTPUTS:
                if name in writers:
                    shared.add(name)
                writers.add(name)
    for mixer in graph.values():
        for port in TYPES:
            if port not in OUTPUTS and mixer.mapped(port) in shared:
                raise Refused(f"{mixer.mapped(port)} has two writers and a reader")
    rates = {mixer.every for mixer in graph.values()}
    if any(one % other and other % one for one in rates for other in rates):
        raise Refused(f"{rates} do not go together")
    order(graph)
    return graph


def writers(graph: Graph, name: str) -> set[tuple[str, str]]:
    """Return the components and ports that write a connection; at most one if an input
    reads it."""
    return {
        (mixer.name, port)
        for mixer in graph.values()
        for port in OUTPUTS
        if mixer.mapped(port) == name
    }


def sources(graph: Graph, mixer: Mixer) -> set[str]:
    """Return the components that must run before `mixer`."""
    found = set()
    for port in INPUTS:
        if not mixer.broken(port):
            found |= {peer for peer, _ in writers(graph, mixer.mapped(port))}
    return found


def order(graph: Graph) -> list[str]:
    """Return the order of execution; raises Refused if there is none."""
    waiting = {name: sources(graph, mixer) for name, mixer in graph.items()}
    done: list[str] = []
    while waiting:
        ready = [name for name, before in waiting.items() if before.issubset(done)]
        if not ready:
            raise Refused(f"a loop among {sorted(waiting)}")
        # One at a time: a component that becomes ready may precede others by its name.
        done.append(min(ready, key=lambda name: (not graph[name].first, name)))
        del waiting[done[-1]]
    return done


@dataclass(frozen=True)
class Connection:
    """A mapped name and its ends; several writers have no order among each other."""

    writers: frozenset[tuple[str, str]]
    readers: frozenset[tuple[str, str, bool]]


def connections(graph: Graph) -> dict[str, Connection]:
    """Return all connections by name."""
    names = {mixer.mapped(port) for mixer in graph.values() for port in TYPES}
    return {
        name: Connection(
            frozenset(writers(graph, name)),
            frozenset(
                (mixer.name, port, mixer.broken(port))
                for mixer in graph.values()
                for port in INPUTS
                if mixer.mapped(port) == name
            ),
        )
        for name in names
    }


Values = dict[tuple[str, str], float]  # by component and port; 0 without a value


def run_cycle(graph: Graph, iteration: int, values: Values) -> Values:
    """Return the values of outputs, and of inputs without a writer, after one more cycle."""
    before, now = values, dict(values)
    for name in order(graph):
        mixer = graph[name]
        if iteration % mixer.every != mixer.phase:
            continue
        read: dict[str, float] = {}
        for port in INPUTS:
            peers = writers(graph, mixer.mapped(port))
            if peers:
                read[port] = (before if mixer.broken(port) else now)[peers.pop()]
            else:
                read[port] = now[name, port]
        mixed = mixer.value("offset") * mixer.value("gain")
        mixed += int(3 * read["in1"] + 5 * read["in2"]) + int(read["level"])
        now[name, "out"] = mixed % MODULUS
        now[name, "half"] = mixed % MODULUS / 2
        now[name, "updates"] += 1
    return now
