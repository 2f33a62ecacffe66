"""`rtcfctl graph`: components in their order and their connections, as text or as a drawing."""

import argparse
import subprocess
from pathlib import Path
from typing import Any

import rtcf
from rtcf_shared import whole_files

from rtcfctl.graph.drawing import dot
from rtcfctl.graph.loop_graph import LoopGraph
from rtcfctl.terminal.output import Output

_FORMATS = ("svg", "png", "dot")


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
    kind = args.file.suffix.removeprefix(".") if args.file is not None else ""
    if args.file is not None and kind not in _FORMATS:
        raise ValueError(f"{args.file}: use one of {', '.join(f'.{each}' for each in _FORMATS)}")
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
