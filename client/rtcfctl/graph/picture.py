"""`rtcfctl graph`: what runs after what and who feeds whom, as text or as a picture."""

import argparse
import subprocess
from collections import defaultdict
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared import durable

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import microseconds

_FORMATS = ("svg", "png", "dot")
_MOST_WORDS = 60  # components, of which each can have its type and its connections' names
# From the cheapest to what takes most: light to dark blue, told apart without colours, too.
_FILLS = ("#ffffff", "#e3eef7", "#c3dcef", "#94c2e2", "#5ba3d0", "#2b7bba")
_DARK = 5  # from this one on the text is white


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    graph = verbs.add_parser(
        "graph",
        parents=[common],
        help="what runs after what and who feeds whom, as text or as a picture",
        # -o is the file here; --output stays.
        conflict_handler="resolve",
    )
    graph.add_argument(
        "-o", dest="file", metavar="FILE", type=Path, help="a picture: .svg, .png, or .dot"
    )
    graph.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the graph, or write its picture."""
    kind = args.file.suffix.removeprefix(".") if args.file is not None else ""
    if args.file is not None and kind not in _FORMATS:
        raise ValueError(f"{args.file}: a picture is {', '.join(f'.{each}' for each in _FORMATS)}")
    graph = _Graph(client, args.runner or "rt_runner")
    if args.file is None:
        if output.for_people:
            print("\n".join(graph.text()) or "no components")
        else:
            output.data({"components": graph.components, "connections": graph.connections})
        return
    dot = graph.dot()
    content = dot.encode() if kind == "dot" else _drawn(dot, kind)
    try:
        durable.write_named(str(args.file), content)
    except OSError as error:
        raise rtcf.RtcfError(f"{args.file}: {error.strerror}") from None
    if output.for_people:
        print(f"{args.file}: {len(graph.components)} components")
    else:
        output.data({"file": str(args.file), "components": len(graph.components)})


def _drawn(dot: str, kind: str) -> bytes:
    """Have Graphviz draw it."""
    try:
        done = subprocess.run(["dot", f"-T{kind}"], input=dot.encode(), capture_output=True)
    except FileNotFoundError:
        raise rtcf.RtcfError(
            "no Graphviz to draw it: sudo apt install graphviz, or write a .dot file"
        ) from None
    if done.returncode != 0:
        why = done.stderr.decode(errors="replace").strip().splitlines() or ["it says nothing"]
        raise rtcf.RtcfError(f"Graphviz does not draw it: {why[-1]}")
    return done.stdout


class _Graph:
    """The components and connections of a runner, with what they cost."""

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
            notes = [f"({_type(component)})", *self._notes(component)]
            lines.append(f"{component.position + 1:>{width}}  {name}  {'  '.join(notes)}")
            lines += [f"{'':{width}}    {each}" for each in comes[name]]
            for port in component.ports:
                if to := goes.get((name, port.name)):
                    lines.append(f"{'':{width}}    {port.name} → {', '.join(to)}")
        return lines

    def dot(self) -> str:
        """Return the picture in Graphviz's language."""
        ranksep, size, margin = (0.3, 9, "0.05,0.02") if self._is_large else (0.6, 11, "0.12,0.06")
        lines = [
            "digraph loop {",
            '  rankdir=LR; bgcolor="white"; fontname="Helvetica"; nodesep=0.25;',
            f"  ranksep={ranksep}; label={_quoted(self._title())}; labelloc=t; fontsize=14;",
            f'  node [shape=box, style="filled,rounded", fontname="Helvetica", fontsize={size}, '
            f'color="#5a6872", margin="{margin}", height=0.2, width=0.3];',
            '  edge [fontname="Helvetica", fontsize=9, color="#5a6872", fontcolor="#5a6872", '
            "arrowsize=0.7];",
        ]
        rooms: dict[str, list[graph_pb2.ComponentInfo]] = defaultdict(list)
        for component in self.components:
            rooms[component.full_name.rpartition("/")[0]].append(component)
        for number, (namespace, inside) in enumerate(sorted(rooms.items())):
            if namespace:
                lines.append(f"  subgraph cluster_{number} {{ label={_quoted(namespace)};")
                lines.append('    style=rounded; color="#cfd5da"; fontsize=12;')
            lines += [self._node(each) for each in inside]
            if namespace:
                lines.append("  }")
        lines += self._edges()
        return "\n".join([*lines, "}"]) + "\n"

    @property
    def _is_large(self) -> bool:
        return len(self.components) > _MOST_WORDS

    def _title(self) -> str:
        return f"{self.status.runner}, {self.status.settings.frequency_hz:g} Hz"

    def _node(self, component: graph_pb2.ComponentInfo) -> str:
        name = component.full_name
        label = [f"{component.position + 1}  {name.rpartition('/')[2]}"]
        if not self._is_large:
            label += [_type(component), *self._notes(component)]
        shade = self._shade(name)
        colours = f'fillcolor="{_FILLS[shade]}"'
        if shade >= _DARK:
            colours += ', fontcolor="white"'
        if component.state == graph_pb2.COMPONENT_STATE_FAULTED:
            colours = 'fillcolor="#c02020", fontcolor="white"'
        if self._is_device(name):
            colours += ", peripheries=2"
        return f"    {_quoted(name)} [label={_quoted(chr(10).join(label))}, {colours}];"

    def _edges(self) -> list[str]:
        lines = []
        for each in self.connections:
            label = "" if self._is_large else f"label={_quoted(each.name)}, "
            if each.published or each.subscribed:
                topic = f"topic {each.name}"
                lines.append(
                    f"  {_quoted(topic)} [label={_quoted(each.name)}, shape=ellipse, "
                    'fillcolor="#fff4de", color="#b04a00"];'
                )
            for writer in _writers(each):
                for reader in each.readers:
                    ends = f"{_quoted(writer.component)} -> {_quoted(reader.component)}"
                    style = 'style=dashed, constraint=false, color="#b04a00"' * reader.broken
                    tip = f"tooltip={_quoted(f'{_end(writer)} → {_end(reader)}')}"
                    lines.append(f"  {ends} [{label}{tip}{', ' if style else ''}{style}];")
                if each.published:
                    lines.append(f"  {_quoted(writer.component)} -> {_quoted(topic)};")
            if each.subscribed:
                lines += [
                    f"  {_quoted(topic)} -> {_quoted(reader.component)};" for reader in each.readers
                ]
        return lines

    def _notes(self, component: graph_pb2.ComponentInfo) -> list[str]:
        notes = []
        if component.spec.every > 1:
            notes.append(f"every {component.spec.every}")
        if self._is_device(component.full_name):
            notes.append("device")
        cost = self._costs.get(component.full_name)
        if cost is not None and cost.duration.count:
            notes.append(f"{microseconds(cost.duration.mean_ns)} µs")
        if component.state == graph_pb2.COMPONENT_STATE_FAULTED:
            notes.append("taken out by a fault")
        return notes

    def _is_device(self, name: str) -> bool:
        cost = self._costs.get(name)
        return cost is not None and cost.device_calls > 0

    def _shade(self, name: str) -> int:
        """Return a fill by the share that a component has of all cost."""
        total = sum(each.duration.mean_ns for each in self._costs.values())
        cost = self._costs.get(name)
        if cost is None or total <= 0.0:
            return 0
        share = cost.duration.mean_ns / total
        return min(round(share * len(_FILLS)), len(_FILLS) - 1)


def _is_loaded(component: graph_pb2.ComponentInfo) -> bool:
    return bool(component.state != graph_pb2.COMPONENT_STATE_LEFT_OUT)


def _type(component: graph_pb2.ComponentInfo) -> str:
    return f"{component.spec.package}/{component.spec.type}"


def _writers(connection: graph_pb2.Connection) -> list[graph_pb2.Endpoint]:
    first = [connection.writer] if connection.HasField("writer") else []
    return [*first, *connection.other_writers]


def _end(endpoint: graph_pb2.Endpoint) -> str:
    return f"{endpoint.component}.{endpoint.port}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
