"""`rtcfctl stats`."""

import argparse
import sys
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted, losses, microseconds

_FIELDS = ("min_ns", "mean_ns", "p50_ns", "p99_ns", "p999_ns", "max_ns")
_SHORTEST_WATCH_S, _LONGEST_WATCH_S = 0.1, 86400.0
_HERE = Path()  # --plot without a file: draw in the terminal
_WIDTH = 80  # columns if standard output is not a terminal
_COLUMNS = ("count", "min", "mean", "p50", "p99", "p99.9", "max")


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    stats = verbs.add_parser("stats", parents=[common], help="show durations, latencies, overruns")
    stats.add_argument("--reset", action="store_true", help="reset the statistics afterwards")
    stats.add_argument(
        "--watch",
        type=amount("s"),
        nargs="?",
        const=1.0,
        metavar="S",
        help="update each second, or each S seconds (or 500ms), until Ctrl-C",
    )
    stats.add_argument(
        "--plot",
        metavar="FILE",
        type=Path,
        nargs="?",
        const=_HERE,
        help="also draw histograms, in the terminal or to FILE",
    )
    stats.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the statistics of a loop and of its components."""
    if args.watch is not None:
        if args.plot is not None:
            raise ValueError("--plot cannot be used with --watch")
        _watch(client, args, output)
        return
    found = client.get_statistics(args.runner, buckets=args.plot is not None)
    if args.plot is None:
        _print(found, output)
    else:
        from rtcfctl.loop import histograms

        if args.plot is _HERE:
            histograms.require_cycles(found)
        else:
            histograms.draw(found, args.plot)
        _print(found, output)
        if args.plot is _HERE and output.for_people:
            output.line("")
            for line in histograms.lines(found, output.width or _WIDTH):
                output.line(line)
    if args.reset:
        client.reset_statistics(args.runner)


def _watch(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the statistics until Ctrl-C; a terminal is cleared before each update."""
    if not _SHORTEST_WATCH_S <= args.watch <= _LONGEST_WATCH_S:
        raise ValueError(
            f"--watch {args.watch:g}: at least {_SHORTEST_WATCH_S} s, at most {_LONGEST_WATCH_S:g}"
        )
    if args.reset:
        client.reset_statistics(args.runner)
    try:
        for found in client.watch_statistics(args.runner, args.watch):
            output.restart()
            _print(found, output)
            sys.stdout.flush()
    except KeyboardInterrupt:
        return


def _print(found: runner_pb2.RunnerStatistics, output: Output) -> None:
    if not output.for_people:
        output.data(found)
        return
    rows = [
        _row("calculation duration", found.duration),
        _row("wake-up latency", found.latency),
    ]
    if found.adoption.count:
        rows.append(_row("adoption of a change", found.adoption))
    output.table((f"{found.runner} (µs)", *_COLUMNS), rows, right=_COLUMNS)
    output.line(
        f"{counted(found.iterations, 'cycle')}, {counted(found.overruns, 'overrun')}, "
        f"{found.missed} missed",
        "bold red" if found.overruns or found.missed else "",
    )
    output.line(
        f"{found.minor_faults} minor, {found.major_faults} major page faults, "
        f"{found.involuntary_switches} involuntary context switches",
        "bold red" if found.major_faults else "",
    )
    causes = (
        (found.late_wake_ups, "began late because the machine woke the loop late"),
        (found.exchange_overruns, "were caused by adopting changes or exchanging values"),
        (found.frame_overruns, "were caused by copying values into frames; lower frame_kb"),
        (found.catching_up, "were caused by a previous overrun (catch_up)"),
    )
    for count, cause in causes:
        if count:
            output.line(f"{count} of {counted(found.overruns, 'overrun')} {cause}", "yellow")
    for line in losses(found.log_dropped, found.tap_dropped):
        output.line(line, "yellow")
    if found.uncounted:
        output.line(
            f"{counted(found.uncounted, 'cycle')} missing in the durations: overwritten before "
            "they were counted; lower frame_kb",
            "yellow",
        )
    output.line("")
    output.table(
        ("component (µs)", *_COLUMNS, "overruns"),
        ((*_row(each.component, each.duration), each.overruns) for each in found.components),
        right=(*_COLUMNS, "overruns"),
    )
    for each in found.components:
        if each.faults:
            output.line(f"{each.component}: {counted(each.faults, 'fault')}", "bold red")
    devices = [each for each in found.components if each.device_calls]
    if devices:
        columns = ("calls", "mean")
        output.line("")
        output.table(
            ("device I/O in (µs)", *columns),
            (
                (each.component, each.device_calls, microseconds(each.device_mean_ns))
                for each in devices
            ),
            right=columns,
        )


def _row(name: str, distribution: runner_pb2.Distribution) -> tuple[Any, ...]:
    values = (microseconds(getattr(distribution, field)) for field in _FIELDS)
    return (name, distribution.count, *(values if distribution.count else ("-" for _ in _FIELDS)))
