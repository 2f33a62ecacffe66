"""`rtcfctl apply|save`: graph files, see docs/graph-files.md."""

import argparse
from typing import Any

import rtcf
from rtcf.v1 import control_pb2
from rtcf_shared import whole_files

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import enumerator

_STYLES = {
    control_pb2.Difference.KIND_LOAD: "green",
    control_pb2.Difference.KIND_UNLOAD: "red",
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    applying = verbs.add_parser(
        "apply", parents=[common], help="change the graph to match a graph file, at one cycle"
    )
    applying.add_argument("file", metavar="FILE", help="graph file; - is standard input")
    applying.add_argument("--dry-run", action="store_true", help="only show the changes")
    applying.add_argument(
        "--rebuilt",
        action="store_true",
        help="also replace components whose library has changed since they were loaded",
    )
    applying.set_defaults(run=apply)

    saving = verbs.add_parser("save", parents=[common], help="write the graph as a graph file")
    saving.add_argument("file", metavar="FILE", nargs="?", default="-")
    saving.add_argument("--all", action="store_true", help="save the graphs of all runners")
    saving.set_defaults(run=save)


def apply(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Apply a graph file.  With several runners, change none if one of their graphs is invalid."""
    graphs = _chosen(rtcf.read_graphs(*read(args.file)), args)
    if args.dry_run or len(graphs) > 1:
        dry = [_apply(client, graph, True, args.rebuilt, output) for graph in graphs]
    if args.dry_run:
        _print(graphs, dry, output, "would change nothing", "nothing was changed")
        return
    done = [_apply(client, graph, False, args.rebuilt, output) for graph in graphs]
    _print(graphs, done, output, "nothing to change", "applied")


def save(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Write graphs with the present values of parameters."""
    runners = client.get_status("" if args.all else args.runner or "rt_runner").runners
    text = rtcf.write_graphs(
        rtcf.Graph(
            runner.runner,
            runner.chosen,
            [rtcf.live_spec(each) for each in client.list_components(runner.runner)],
        )
        for runner in runners
    )
    if output.in_json:
        import yaml

        text = output.json(yaml.safe_load(text)) + "\n"  # a graph file, too: JSON is YAML
    if args.file == "-":
        print(text, end="")
        return
    _write(args.file, text)
    if output.for_people:
        print(f"saved {', '.join(runner.runner for runner in runners)} to {args.file}")


def _apply(
    client: rtcf.Client, graph: rtcf.Graph, dry_run: bool, rebuilt: bool, output: Output
) -> control_pb2.ChangeResult:
    return client.apply(
        graph.components, graph.runner, graph.settings, dry_run, output.progress, rebuilt=rebuilt
    )


def _chosen(graphs: list[rtcf.Graph], args: argparse.Namespace) -> list[rtcf.Graph]:
    """Return the graph of the runner given by --runner, or all graphs."""
    if len(graphs) == 1 and (args.runner or not graphs[0].runner):
        graphs[0].runner = args.runner
    if not args.runner:
        return graphs
    found = [graph for graph in graphs if graph.runner == args.runner]
    if not found:
        names = ", ".join(graph.runner for graph in graphs)
        raise rtcf.GraphFileError(
            f"{args.file}: no runner {args.runner} (runners: {names or 'none'})"
        )
    return found


def _print(
    graphs: list[rtcf.Graph],
    results: list[control_pb2.ChangeResult],
    output: Output,
    nothing: str,
    sentence: str,
) -> None:
    if not output.for_people:
        names = [graph.runner or "rt_runner" for graph in graphs]
        output.data(dict(zip(names, results, strict=True)))
        return
    rows = [
        (graph.runner or "rt_runner", each) for graph, result in zip(graphs, results, strict=True)
        for each in result.differences
    ]  # fmt: skip
    if rows:
        output.table(
            ("runner", "change", "component", "detail"),
            (
                (runner, (enumerator(each, "kind"), _STYLES.get(each.kind, "")), each.component,
                 each.detail)
                for runner, each in rows
            ),
        )  # fmt: skip
    print(sentence if rows else nothing)
    for result in results:
        output.notes(result.notes)


def read(file: str) -> tuple[str, str]:
    """Return the text of a file and its name for messages.  Raises GraphFileError."""
    name = "standard input" if file == "-" else file
    try:
        return whole_files.read(file).decode(), name
    except OSError as error:
        raise rtcf.GraphFileError(f"{name}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise rtcf.GraphFileError(f"{name}: not UTF-8 text") from None


def _write(file: str, text: str) -> None:
    """Replace a file atomically: a partial file would be a different valid graph."""
    try:
        whole_files.write_named(file, text.encode())
    except OSError as error:
        raise rtcf.RtcfError(f"{file}: {error.strerror}") from None
