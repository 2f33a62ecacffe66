"""`rtcfctl snapshot|restore`: the state, parameters and values of a runner in a file."""

import argparse
from pathlib import Path
from typing import Any

import rtcf
from rtcf_shared import whole_files

from rtcfctl.terminal.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    taking = verbs.add_parser(
        "snapshot",
        parents=[common],
        help="write state, parameters and values of all components at one cycle to a file",
    )
    taking.add_argument("file", metavar="FILE", type=Path)
    taking.set_defaults(run=take)
    restoring = verbs.add_parser(
        "restore", parents=[common], help="continue from a snapshot, from one cycle to the next"
    )
    restoring.add_argument("file", metavar="FILE", type=Path)
    restoring.set_defaults(run=restore)


def take(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Write a snapshot."""
    taken = client.take_snapshot(args.runner)
    _write(args.file, taken.snapshot)
    if not output.for_people:
        output.data(
            {
                "file": str(args.file),
                "bytes": len(taken.snapshot),
                "iteration": taken.iteration,
                "notes": list(taken.notes),
            }
        )
        return
    print(f"cycle {taken.iteration} of {args.runner or 'rt_runner'} in {args.file}")
    output.notes(taken.notes)


def restore(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Restore a snapshot."""
    try:
        snapshot = whole_files.read(args.file)
    except OSError as error:
        raise rtcf.RtcfError(f"{args.file}: {error.strerror}") from None
    result = client.restore_snapshot(snapshot, args.runner, output.progress)
    output.changed(f"restored {args.file}", result)


def _write(file: Path, snapshot: bytes) -> None:
    """Replace a file atomically, so that it always has a complete snapshot."""
    try:
        whole_files.write_named(file, snapshot)
    except OSError as error:
        raise rtcf.RtcfError(f"{file}: {error.strerror}") from None
