"""`rtcfctl record`: writes the values of every cycle to an MCAP file."""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import rtcf
from rtcf.recording.files import LEAST_FREE_MIB, Files
from rtcf.recording.moment import Moment
from rtcf.streams.condition import Condition
from rtcf.streams.ports import PortStream
from rtcf_shared.ports import PortBatch

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.signals.termination import ended_by_signals
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.safe_streams import control
from rtcfctl.terminal.words import amount, counted

_PRINT_PERIOD_S = 1.0
_LONGEST = 1e9  # largest --duration in s, and --size in MiB
_AROUND_S = 1.0  # default time before and after a trigger
_KEPT_S = 1.0  # interval of flushes: the most that is lost if the recorder is killed


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    record = verbs.add_parser(
        "record",
        parents=[common],
        help="write the values of every cycle to a file",
        # -o is the file for this verb; --output remains.
        conflict_handler="resolve",
    )
    record.add_argument(
        "-o", dest="file", metavar="FILE", type=Path, required=True, help="MCAP file"
    )
    record.add_argument(
        "selection",
        nargs="*",
        metavar="NAME",
        help="component, or one of its outputs or states, as for rtcfctl echo (default: all)",
    )
    record.add_argument(
        "--duration", type=amount("s"), metavar="S", help="end after this loop time"
    )
    record.add_argument(
        "--size", type=amount("MiB"), metavar="MIB", help="end when the file has this size"
    )
    record.add_argument(
        "--split",
        action="store_true",
        help="continue in another file (FILE-1, FILE-2, …) after each --duration or --size",
    )
    record.add_argument(
        "--trigger",
        metavar="CONDITION",
        help="record only around the first cycle in which it is true, e.g. 'wave.phase > 0.9'",
    )
    record.add_argument(
        "--pre", type=amount("s"), metavar="S", help=f"time before --trigger ({_AROUND_S:g})"
    )
    record.add_argument(
        "--post", type=amount("s"), metavar="S", help=f"time after --trigger ({_AROUND_S:g})"
    )
    record.add_argument(
        "--min-free",
        type=amount("MiB"),
        default=float(LEAST_FREE_MIB),
        metavar="MIB",
        help=f"end when less is free on the disk of the file ({LEAST_FREE_MIB}; 0: never)",
    )
    record.add_argument("--force", action="store_true", help="overwrite an existing file")
    record.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Record until Ctrl-C, for a time, to a size, or around a trigger."""
    moment = _checked(args)
    if args.file.suffix in (".bag", ".csv"):
        mcap = args.file.with_suffix(".mcap")
        raise ValueError(
            f"{args.file}: recordings are MCAP files: rtcfctl record -o {mcap}, then "
            f"rtcfctl convert {mcap} {args.file}"
        )
    selection = list(args.selection)
    if moment is not None and selection:
        selection += moment.condition.columns
    # Report errors before a file is created.
    with client.watch_ports(selection, args.runner) as stream:
        for note in stream.schema.notes:
            _note(output, note)
        if moment is not None:
            moment.condition.check(stream.schema)
        say_if_idle(client, args.runner, output)
        runner = args.runner or "rt_runner"
        with (
            ended_by_signals(stream),
            Files(args.file, runner, force=args.force, least_free_mib=args.min_free) as files,
        ):
            _follow(stream, files, moment, args, output)
    _tell(files, moment, output)


def _checked(args: argparse.Namespace) -> Moment | None:
    """Check the options; return the trigger, if there is one.  Raises ValueError."""
    _require("--duration", args.duration, "s")
    _require("--size", args.size, "MiB")
    _require("--min-free", args.min_free, "MiB", or_none=True)
    if args.split and args.duration is None and args.size is None:
        raise ValueError("--split requires --duration or --size")
    if args.trigger is None:
        if args.pre is not None or args.post is not None:
            raise ValueError("--pre and --post require --trigger")
        return None
    if args.split or args.duration is not None:
        raise ValueError("--trigger: use --pre and --post instead of --duration or --split")
    _require("--pre", args.pre, "s", or_none=True)
    _require("--post", args.post, "s", or_none=True)
    pre_s, post_s = (_AROUND_S if each is None else each for each in (args.pre, args.post))
    return Moment(Condition(args.trigger), pre_s, post_s)


def _require(option: str, value: float | None, unit: str, *, or_none: bool = False) -> None:
    if value is None or 0 < value <= _LONGEST or (or_none and value == 0):
        return
    least = "0 or more" if or_none else f"more than 0 {unit}"
    raise ValueError(f"{option} {value:g}: {least}, and {_LONGEST:g} at most")


def _tell(files: Files, moment: Moment | None, output: Output) -> None:
    lost = f"{counted(files.lost, 'cycle')} lost" if files.lost else "none lost"
    if moment is not None and moment.cut:
        _note(output, "pre-trigger data truncated: memory limit reached")
    if not output.for_people:
        output.data(
            {"file": str(files.paths[0]), "files": [str(path) for path in files.paths],
             "cycles": files.cycles, "lost": files.lost, "bytes": files.bytes}
            | ({} if moment is None else {"cycle": moment.cycle})
        )  # fmt: skip
        return
    more = f" to {files.paths[-1].name}" if len(files.paths) > 1 else ""
    about = ""
    if moment is not None:
        cycle = moment.cycle
        about = ", the condition was never true" if cycle is None else f", true in cycle {cycle}"
    output.line(
        f"{files.paths[0]}{more}: {counted(files.cycles, 'cycle')}, {files.bytes / 1e6:.1f} MB, "
        f"{lost}{about}",
        "bold red" if files.lost else "",
    )


def _follow(
    stream: PortStream,
    files: Files,
    moment: Moment | None,
    args: argparse.Namespace,
    output: Output,
) -> None:
    printed = flushed = time.monotonic()
    try:
        for batch in stream:
            for part in [batch] if moment is None else moment.take(batch):
                for note in files.add(part):
                    _note(output, note)
            now = time.monotonic()
            say_if_ended(batch, args.runner, output)
            if now - flushed >= _KEPT_S or batch.last_of_loop:
                files.flush()
                flushed = now
            if now - printed >= _PRINT_PERIOD_S and sys.stderr.isatty():
                printed = now
                waits = moment is not None and moment.cycle is None
                print(
                    control("\r"),
                    f"{counted(files.cycles, 'cycle')}, {files.size / 1e6:.1f} MB, "
                    f"{files.lost} lost{', waiting for the condition' if waits else ''} ",
                    sep="",
                    end="",
                    file=sys.stderr,
                    flush=True,
                )
            if moment is not None and moment.over:
                return
            if not _is_full(files, batch, args):
                continue
            if not args.split:
                return
            files.next()
    finally:
        if sys.stderr.isatty():
            print(control("\r\x1b[K"), end="", file=sys.stderr, flush=True)


def _is_full(files: Files, batch: PortBatch, args: argparse.Namespace) -> bool:
    """Return whether a file has reached --size or --duration."""
    full = args.size is not None and files.size >= args.size * 1024 * 1024
    return full or (args.duration is not None and files.taken_ns(batch) >= args.duration * 1e9)


def _note(output: Output, text: str) -> None:
    output.line(f"rtcfctl: note: {text}", to=sys.stderr)
