"""`rtcfctl convert`: converts a recording to CSV or to a bag, or repairs it."""

import argparse
from pathlib import Path
from typing import Any

import rtcf
from rtcf.recording.convert import convert, repair

from rtcfctl.terminal.interruption import interrupted_by_termination
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import counted


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    converting = verbs.add_parser(
        "convert", parents=[common], help="convert a recording or incident to CSV or a bag"
    )
    converting.add_argument("recording", metavar="FILE", type=Path, help="recording or incident")
    converting.add_argument(
        "to", metavar="TO", type=Path, help="output file: .csv or .bag; with --repair .mcap"
    )
    converting.add_argument(
        "--repair",
        action="store_true",
        help="write a complete recording from one whose recorder was killed",
    )
    converting.add_argument("--force", action="store_true", help="overwrite an existing file")
    converting.set_defaults(run=run)


def run(_: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Convert one file."""
    damaged = 0
    with interrupted_by_termination(), rtcf.read_recording(args.recording) as recording:
        if args.repair:
            written, damaged = repair(recording, args.to, force=args.force)
        else:
            written = convert(recording, args.to, force=args.force, on_progress=output.progress)
        size = args.to.stat().st_size
        whole = recording.whole
    if not output.for_people:
        output.data(
            {"file": str(args.to), "written": written, "bytes": size, "whole": whole}
            | ({"damaged": damaged} if args.repair else {})
        )
        return
    what = counted(written, "message" if args.to.suffix == ".bag" else "cycle")
    end = "" if whole else "; the recording is incomplete: its last second may be missing"
    if damaged:
        end += f"; {counted(damaged, 'damaged chunk')} left out"
    output.line(f"{args.to}: {what}, {size / 1e6:.1f} MB{end}")
