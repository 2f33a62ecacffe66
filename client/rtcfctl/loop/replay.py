"""`rtcfctl replay`: replays a bag in a stopped loop."""

import argparse
from pathlib import Path
from typing import Any

import rtcf
from rtcf.replay import LONGEST_GAP_S, Summary, replay

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    replaying = verbs.add_parser(
        "replay", parents=[common], help="replay a bag in a stopped loop, at its recorded times"
    )
    replaying.add_argument("bag", metavar="BAG", type=Path)
    replaying.add_argument(
        "--write", metavar="BAG", type=Path, help="write the mapped outputs to a bag"
    )
    replaying.add_argument(
        "--gap",
        type=amount("s"),
        default=LONGEST_GAP_S,
        metavar="S",
        help=f"permit this time without messages (default: {LONGEST_GAP_S:g} s)",
    )
    replaying.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Replay a bag."""
    if args.write is not None and args.write.suffix in (".mcap", ".csv"):
        raise ValueError(
            f"--write {args.write}: the outputs are a bag: name it {args.write.with_suffix('.bag')}"
        )
    summary = replay(client, args.bag, args.runner, args.write, output.progress, args.gap)
    if not output.for_people:
        output.data(vars(summary))
        return
    print(_sentence(summary))
    if summary.unread:
        output.line(f"read by no component: {', '.join(summary.unread)}")
    if summary.missing:
        output.line(f"not in the bag: {', '.join(summary.missing)}", "yellow")


def _sentence(summary: Summary) -> str:
    seconds = (summary.end_ns - summary.start_ns) / 1e9
    return (
        f"replayed {seconds:.3f} s in {summary.cycles} cycles: "
        f"{summary.injected} messages in, {summary.outputs} out"
    )
