"""`rtcfctl graph`: what runs after what and who feeds whom, as text or as a picture."""

import argparse
import subprocess
from pathlib import Path
from typing import Any

import rtcf
from rtcf_shared import durable

from rtcfctl.graph.drawing import dot
from rtcfctl.graph.loop_graph import LoopGraph
from rtcfctl.terminal.output import Output

_FORMATS = ("svg", "png", "dot")


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
    graph = LoopGraph(client, args.runner or "rt_runner")
    if args.file is None:
        if output.for_people:
            print("\n".join(graph.text()) or "no components")
        else:
            output.data({"components": graph.components, "connections": graph.connections})
        return
    drawing = dot(graph)
    content = drawing.encode() if kind == "dot" else _drawn(drawing, kind)
    try:
        durable.write_named(str(args.file), content)
    except OSError as error:
        raise rtcf.RtcfError(f"{args.file}: {error.strerror}") from None
    if output.for_people:
        print(f"{args.file}: {len(graph.components)} components")
    else:
        output.data({"file": str(args.file), "components": len(graph.components)})


def _drawn(drawing: str, kind: str) -> bytes:
    """Have Graphviz draw it."""
    try:
        done = subprocess.run(["dot", f"-T{kind}"], input=drawing.encode(), capture_output=True)
    except FileNotFoundError:
        raise rtcf.RtcfError(
            "no Graphviz to draw it: sudo apt install graphviz, or write a .dot file"
        ) from None
    if done.returncode != 0:
        why = done.stderr.decode(errors="replace").strip().splitlines() or ["it says nothing"]
        raise rtcf.RtcfError(f"Graphviz does not draw it: {why[-1]}")
    return done.stdout
