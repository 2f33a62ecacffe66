"""The components and connections of a runner, with the durations of the components."""

from collections import defaultdict
from dataclasses import dataclass

import rtcf
from rtcf.v1 import graph_pb2, runner_pb2

from rtcfctl.terminal.words import microseconds


@dataclass(frozen=True)
class Line:
    """A line of a drawing, from one writer to one reader of a connection.

    Each end is a component or a ROS topic.
    """

    name: str  # mapped name of the connection
    writer: str  # node: full name of a component, or topic()
    reader: str
    tip: str  # text of the tooltip: both ports
    broken: bool = False  # a loop break


def topic(name: str) -> str:
    """Return the name of a topic's node in a drawing."""
    return f"topic {name}"


class LoopGraph:
    """Queried once, by the constructor; `components` are in the order in which they run."""

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
        """Return the components in their order, each with the readers of its outputs."""
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
        """Return a line for each pair of writer and reader, ROS topics included."""
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
        """Return the topics that the loop subscribes to, or those that it only publishes."""
        return [
            each.name
            for each in self.connections
            if each.subscribed == subscribed and (each.subscribed or each.published)
        ]

    def notes(self, component: graph_pb2.ComponentInfo) -> list[str]:
        """Return the notes on a component: rate, device I/O, mean duration, fault."""
        notes = []
        if component.spec.every > 1:
            notes.append(f"every {component.spec.every}")
        if self.is_device(component.full_name):
            notes.append("device")
        cost = self._costs.get(component.full_name)
        if cost is not None and cost.duration.count:
            notes.append(f"{microseconds(cost.duration.mean_ns)} µs")
        if component.state == graph_pb2.COMPONENT_STATE_FAULTED:
            notes.append("taken out after a fault")
        return notes

    def is_device(self, name: str) -> bool:
        """Return whether a component does device I/O."""
        cost = self._costs.get(name)
        return cost is not None and cost.device_calls > 0

    def share(self, name: str) -> float:
        """Return the share, 0 to 1, of a component in the sum of the mean durations."""
        total = sum(each.duration.mean_ns for each in self._costs.values())
        cost = self._costs.get(name)
        return cost.duration.mean_ns / total if cost is not None and total > 0.0 else 0.0


def type_of(component: graph_pb2.ComponentInfo) -> str:
    """Return PACKAGE/TYPE of a component."""
    return f"{component.spec.package}/{component.spec.type}"


def _is_loaded(component: graph_pb2.ComponentInfo) -> bool:
    return bool(component.state != graph_pb2.COMPONENT_STATE_LEFT_OUT)


def _writers(connection: graph_pb2.Connection) -> list[graph_pb2.Endpoint]:
    first = [connection.writer] if connection.HasField("writer") else []
    return [*first, *connection.other_writers]


def _end(endpoint: graph_pb2.Endpoint) -> str:
    return f"{endpoint.component}.{endpoint.port}"
