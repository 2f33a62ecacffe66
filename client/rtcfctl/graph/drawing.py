"""`rtcfctl graph`: the graph of a loop as text, or as a drawing.

A drawing is text in the DOT language; values flow from left to right.
"""

import argparse
import itertools
import math
import subprocess
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import graph_pb2
from rtcf_shared import whole_files

from rtcfctl.graph.folding import Cell, Link, Point, Sizes, place, route, shape
from rtcfctl.graph.loop_graph import Line, LoopGraph, topic, type_of
from rtcfctl.terminal import image_file
from rtcfctl.terminal.output import Output

_FORMATS = (".svg", ".png", ".dot")
_MOST_WORDS = 60  # components; larger graphs are drawn without types and connection names
# Largest graph that Graphviz lays out: components in series and in parallel.
_MOST_LAYERS, _MOST_BESIDE = 12, 30
_MOST_COLUMNS = 48
_ASPECT = 1.6  # approximate width / height of a folded drawing
_LONGEST_NAME = 32
_LETTER, _LINE = 0.6, 1.25  # width of a letter and height of a line, as multiples of font size
_POINTS = 72.0  # per inch
_ARROW = 0.7  # scale of Graphviz's arrow head, which is 10 points long
_ROUND = 5.0  # radius of a line's corners, in points
_SHORTEST_MARKED = 16.0  # shortest segment of a line that has the mark 1/z, in points
# By share of the duration, from least to most.  They differ in lightness, not in hue.
_FILLS = ("#ffffff", "#e3eef7", "#c3dcef", "#94c2e2", "#5ba3d0", "#2b7bba")
_DARK = 5  # index of the first fill with white text
_BREAK = 'color="#b04a00", fontcolor="#b04a00"'
_TOPIC = 'shape=ellipse, fillcolor="#fff4de", color="#b04a00"'


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    graph = verbs.add_parser(
        "graph",
        parents=[common],
        help="show components and their connections, as text or as a drawing",
        # -o is the file for this verb; --output remains.
        conflict_handler="resolve",
    )
    graph.add_argument(
        "-o", dest="file", metavar="FILE", type=Path, help="write a drawing: .svg, .png or .dot"
    )
    graph.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the graph, or write a drawing of it."""
    if args.file is not None:
        image_file.require_format(args.file, _FORMATS)
    graph = LoopGraph(client, args.runner or "rt_runner")
    if args.file is None:
        if output.for_people:
            print("\n".join(graph.text()) or "no components")
        else:
            output.data({"components": graph.components, "connections": graph.connections})
        return
    drawing, kind = dot(graph), args.file.suffix.removeprefix(".")
    content = drawing.encode() if kind == "dot" else _drawn(drawing, kind)
    try:
        whole_files.write_named(str(args.file), content)
    except OSError as error:
        raise rtcf.RtcfError(f"{args.file}: {error.strerror}") from None
    if output.for_people:
        print(f"{args.file}: {len(graph.components)} components")
    else:
        output.data({"file": str(args.file), "components": len(graph.components)})


def _drawn(drawing: str, kind: str) -> bytes:
    """Return the drawing, rendered by Graphviz."""
    try:
        done = subprocess.run(["dot", f"-T{kind}"], input=drawing.encode(), capture_output=True)
    except FileNotFoundError:
        raise rtcf.RtcfError(
            "Graphviz not found: sudo apt install graphviz, or write a .dot file"
        ) from None
    if done.returncode != 0:
        why = done.stderr.decode(errors="replace").strip().splitlines() or ["no error message"]
        raise rtcf.RtcfError(f"Graphviz failed: {why[-1]}")
    return done.stdout


def dot(graph: LoopGraph) -> str:
    """Return the drawing as DOT text.

    A graph that would be too long or too high is folded into rows of alternating direction;
    then this module computes all positions instead of Graphviz.
    """
    sources, sinks = graph.topics(subscribed=True), graph.topics(subscribed=False)
    names = [
        *map(topic, sources), *(each.full_name for each in graph.components), *map(topic, sinks)
    ]  # fmt: skip
    known = set(names)
    lines = [each for each in graph.lines() if {each.writer, each.reader} <= known]
    links = [Link(f"{each.name} {each.writer}", each.writer, each.reader, each.broken)
             for each in lines]  # fmt: skip
    drawing = _Drawing(graph, lines, [*sources, *sinks])
    layers, beside = shape(names, links)
    if layers > _MOST_LAYERS or beside > _MOST_BESIDE:
        return drawing.folded(names, links)
    return drawing.laid_out_by_graphviz()


class _Drawing:
    def __init__(self, graph: LoopGraph, lines: Sequence[Line], topics: Sequence[str]) -> None:
        self._graph = graph
        self._lines = lines
        self._topics = topics
        self._is_large = len(graph.components) > _MOST_WORDS

    def laid_out_by_graphviz(self) -> str:
        ranksep, size, margin = (0.3, 9, "0.05,0.02") if self._is_large else (0.6, 11, "0.12,0.06")
        said = [
            "digraph loop {",
            '  rankdir=LR; bgcolor="white"; fontname="Helvetica"; nodesep=0.25;',
            f"  ranksep={ranksep}; label={_quoted(self._title())}; labelloc=t; fontsize=14;",
            f'  node [shape=box, style="filled,rounded", fontname="Helvetica", fontsize={size}, '
            f'color="#5a6872", margin="{margin}", height=0.2, width=0.3];',
            '  edge [fontname="Helvetica", fontsize=9, color="#5a6872", fontcolor="#5a6872", '
            f"arrowsize={_ARROW}];",
        ]
        rooms: dict[str, list[graph_pb2.ComponentInfo]] = defaultdict(list)
        for component in self._graph.components:
            rooms[component.full_name.rpartition("/")[0]].append(component)
        for number, (namespace, inside) in enumerate(sorted(rooms.items())):
            if namespace:
                said.append(f"  subgraph cluster_{number} {{ label={_quoted(namespace)};")
                said.append('    style=rounded; color="#cfd5da"; fontsize=12;')
            for each in inside:
                said.append(self._node(each, self._label(each, each.full_name.rpartition("/")[2])))
            if namespace:
                said.append("  }")
        for name in self._topics:
            said.append(f"  {_quoted(topic(name))} [label={_quoted(name)}, {_TOPIC}];")
        for line in self._lines:
            words = [f"tooltip={_quoted(line.tip)}"]
            named = not self._is_large and topic(line.name) not in (line.writer, line.reader)
            label = [*([line.name] if named else []), *(["1/z"] if line.broken else [])]
            if label:
                words.append(f"label={_quoted('  '.join(label))}")
            if line.broken:
                words.append(f"constraint=false, style=dashed, {_BREAK}")
            said.append(_edge(line, words))
        return "\n".join([*said, "}"]) + "\n"

    def folded(self, names: Sequence[str], links: Sequence[Link]) -> str:
        labels = {topic(name): [_tail(name)] for name in self._topics}
        for component in self._graph.components:
            labels[component.full_name] = self._label(component, _tail(component.full_name))
        size = 9 if self._is_large else 11
        longest = max(len(row) for rows in labels.values() for row in rows)
        sizes = Sizes(
            wide=round(longest * size * _LETTER) + 14,
            high=round(max(map(len, labels.values())) * size * _LINE) + 8,
            gap_x=46, gap_y=24, lane_x=5, lane_y=4, port=6,
        )  # fmt: skip
        cells = _well_shaped(names, links, sizes)
        high = sizes.top(1 + max(each.row for each in cells.values()))
        title = self._title()
        said = [
            "digraph loop {",
            '  layout=nop2; outputorder=edgesfirst; bgcolor="white";',
            f'  node [shape=box, style="filled,rounded", fontname="Helvetica", fontsize={size}, '
            f'color="#5a6872", fixedsize=true, width={sizes.wide / _POINTS:.3f}, '
            f"height={sizes.high / _POINTS:.3f}];",
            f'  edge [fontname="Helvetica", fontsize=9, color="#5a6872", arrowsize={_ARROW}];',
            f'  "" [shape=plaintext, style="", fontsize=14, label={_quoted(title)}, '
            f'pos="{sizes.left(0) + len(title) * 14 * _LETTER / 2:.1f},{high:.1f}"];',
        ]

        def at(name: str) -> str:
            cell = cells[name]
            across = sizes.left(cell.column) + sizes.wide / 2
            return f'pos="{across:.1f},{high - sizes.top(cell.row) - sizes.high / 2:.1f}"'

        for component in self._graph.components:
            name = component.full_name
            said.append(self._node(component, labels[name], at(name)))
        for name in self._topics:
            label = _quoted(labels[topic(name)][0])
            said.append(f"  {_quoted(topic(name))} [label={label}, {_TOPIC}, {at(topic(name))}];")
        for line, way in zip(self._lines, route(cells, links, sizes), strict=True):
            upwards = [(x, high - y) for x, y in way]
            words = [f"tooltip={_quoted(line.tip)}", f'pos="{_spline(upwards)}"']
            if line.broken:
                words.append(f"style=dashed, {_BREAK}")
                mark = _quoted(f"1/z {line.tip}")
                said.append(
                    f'  {mark} [label="1/z", fontsize=8, fillcolor=white, {_BREAK}, width=0.28, '
                    f'height=0.2, pos="{_pair(_mark(upwards))}"];'
                )
            said.append(_edge(line, words))
        return "\n".join([*said, "}"]) + "\n"

    def _title(self) -> str:
        status = self._graph.status
        title = f"{status.runner}, {status.settings.frequency_hz:g} Hz"
        if any(each.broken for each in self._lines):
            title += "; dashed, 1/z: loop break (value of the previous cycle)"
        return title

    def _label(self, component: graph_pb2.ComponentInfo, name: str) -> list[str]:
        label = [f"{component.position + 1}  {name}"]
        if not self._is_large:
            label += [type_of(component), *self._graph.notes(component)]
        return label

    def _node(self, component: graph_pb2.ComponentInfo, label: Sequence[str], *words: str) -> str:
        name = component.full_name
        shade = min(round(self._graph.share(name) * len(_FILLS)), len(_FILLS) - 1)
        colours = f'fillcolor="{_FILLS[shade]}"'
        if shade >= _DARK:
            colours += ', fontcolor="white"'
        if component.state == graph_pb2.COMPONENT_STATE_FAULTED:
            colours = 'fillcolor="#c02020", fontcolor="white"'
        if self._graph.is_device(name):
            colours += ", peripheries=2"
        text = _quoted("\n".join(label))
        return f"    {_quoted(name)} [{', '.join((f'label={text}', colours, *words))}];"


def _well_shaped(names: Sequence[str], links: Sequence[Link], sizes: Sizes) -> dict[str, Cell]:
    """Return the cells of the layout whose aspect ratio is nearest to _ASPECT."""

    def badness(cells: dict[str, Cell]) -> float:
        wide = sizes.left(1 + max(each.column for each in cells.values()))
        high = sizes.top(1 + max(each.row for each in cells.values()))
        return abs(math.log(wide / high / _ASPECT))

    tried = (
        place(names, links, columns) for columns in range(2, min(_MOST_COLUMNS, len(names)) + 1)
    )
    return min(tried, key=badness)


def _edge(line: Line, words: Sequence[str]) -> str:
    return f"  {_quoted(line.writer)} -> {_quoted(line.reader)} [{', '.join(words)}];"


def _spline(way: Sequence[Point]) -> str:
    """Return a line with rounded corners as a Graphviz spline; the arrow's tip is first."""
    tip = way[-1]
    ends = [*way[:-1], _towards(tip, way[-2], 10 * _ARROW)]
    points = [ends[0]]
    for before, here, after in zip(ends, ends[1:], ends[2:], strict=False):
        begin, end = _towards(here, before, _ROUND), _towards(here, after, _ROUND)
        points += [points[-1], begin, begin, here, here, end]
    points += [points[-1], ends[-1], ends[-1]]
    return " ".join([f"e,{_pair(tip)}", *map(_pair, points)])


def _towards(start: Point, end: Point, distance: float) -> Point:
    length = math.dist(start, end)
    share = min(distance / length, 0.5) if length else 0.0
    return start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share


def _mark(way: Sequence[Point]) -> Point:
    """Return the middle of the segment before the reader's, or of the longest if that is short."""
    stretches = list(itertools.pairwise(way))
    last = stretches[-2:][0]
    is_long = len(stretches) > 1 and math.dist(*last) >= _SHORTEST_MARKED
    a, b = last if is_long else max(stretches, key=lambda each: math.dist(*each))
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


def _pair(point: Point) -> str:
    return f"{point[0]:.1f},{point[1]:.1f}"


def _tail(name: str) -> str:
    return name if len(name) <= _LONGEST_NAME else f"…{name[1 - _LONGEST_NAME :]}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'
