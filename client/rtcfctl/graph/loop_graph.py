"""The components and connections of a runner, with what they cost."""

from collections import defaultdict
from dataclasses import dataclass

import rtcf
from rtcf.v1 import graph_pb2, runner_pb2

from rtcfctl.terminal.words import microseconds


@dataclass(frozen=True)
class Line:
    """One reader of one writer of a connection; a topic is either end of its values."""

    name: str  # of the connection
    writer: str  # node: a component's full name, or topic()
    reader: str
    tip: str  # both ports
    broken: bool = False  # a loop break


def topic(name: str) -> str:
    """Return the node of a topic."""
    return f"topic {name}"


class LoopGraph:
    """What was asked for once; `components` are in the order of the schedule."""

    def __init__(self, client: rtcf.Client, runner: str) -> None:
        (self.status,) = client.get_status(runner).runners
        self.components = sorted(
            (each for each in client.list_components(runner) if _is_loaded(each)),
            key=lambda each: each.position,
        )
        self.connections = client.list_connections(runner)
        self._costs: dict[str, runner_pb2.ComponentStatistics] = {}
        if self.status.state != runner_pb2.RUNNER_STATE_DOWN:
            statistics = client.get_statistics(runner)
            self._costs = {each.component: each for each in statistics.components}

    def text(self) -> list[str]:
        """Return each component in its order, with where its outputs go."""
        goes: dict[tuple[str, str], list[str]] = defaultdict(list)
        comes: dict[str, list[str]] = defaultdict(list)
        for each in self.connections:
            ends = [
                f"{_end(reader)}{' (loop break)' if reader.broken else ''}"
                for reader in each.readers
            ]
            if each.published:
                ends.append(f"topic {each.name}")
            for writer in _writers(each):
                goes[writer.component, writer.port] += ends
            if each.subscribed:
                for reader in each.readers:
                    comes[reader.component].append(f"topic {each.name} → {reader.port}")
        lines = []
        width = len(str(len(self.components)))
        for component in self.components:
            name = component.full_name
            notes = [f"({type_of(component)})", *self.notes(component)]
            lines.append(f"{component.position + 1:>{width}}  {name}  {'  '.join(notes)}")
            lines += [f"{'':{width}}    {each}" for each in comes[name]]
            for port in component.ports:
                if to := goes.get((name, port.name)):
                    lines.append(f"{'':{width}}    {port.name} → {', '.join(to)}")
        return lines

    def lines(self) -> list[Line]:
        """Return what goes from where to where."""
        found = []
        for each in self.connections:
            for writer in _writers(each):
                for reader in each.readers:
                    tip = f"{_end(writer)} → {_end(reader)}"
                    found.append(
                        Line(each.name, writer.component, reader.component, tip, reader.broken)
                    )
                if each.published:
                    tip = f"{_end(writer)} → topic {each.name}"
                    found.append(Line(each.name, writer.component, topic(each.name), tip))
            if each.subscribed:
                for reader in each.readers:
                    tip = f"topic {each.name} → {_end(reader)}"
                    found.append(Line(each.name, topic(each.name), reader.component, tip))
        return found

    def topics(self, *, subscribed: bool) -> list[str]:
        """Return the topics that are read, or those that are only published."""
        return [
            each.name
            for each in self.connections
            if each.subscribed == subscribed and (each.subscribed or each.published)
        ]

    def notes(self, component: graph_pb2.ComponentInfo) -> list[str]:
        """Return what is to be known of a component beside its type."""
        notes = []
        if component.spec.every > 1:
            notes.append(f"every {component.spec.every}")
        if self.is_device(component.full_name):
            notes.append("device")
        cost = self._costs.get(component.full_name)
        if cost is not None and cost.duration.count:
            notes.append(f"{microseconds(cost.duration.mean_ns)} µs")
        if component.state == graph_pb2.COMPONENT_STATE_FAULTED:
            notes.append("taken out by a fault")
        return notes

    def is_device(self, name: str) -> bool:
        """Tell whether a component talks to a device."""
        cost = self._costs.get(name)
        return cost is not None and cost.device_calls > 0

    def share(self, name: str) -> float:
        """Return a component's share of what all cost, from 0 to 1."""
        total = sum(each.duration.mean_ns for each in self._costs.values())
        cost = self._costs.get(name)
        return cost.duration.mean_ns / total if cost is not None and total > 0.0 else 0.0


def type_of(component: graph_pb2.ComponentInfo) -> str:
    """Return package and type."""
    return f"{component.spec.package}/{component.spec.type}"


def _is_loaded(component: graph_pb2.ComponentInfo) -> bool:
    return bool(component.state != graph_pb2.COMPONENT_STATE_LEFT_OUT)


def _writers(connection: graph_pb2.Connection) -> list[graph_pb2.Endpoint]:
    first = [connection.writer] if connection.HasField("writer") else []
    return [*first, *connection.other_writers]


def _end(endpoint: graph_pb2.Endpoint) -> str:
    return f"{endpoint.component}.{endpoint.port}"
