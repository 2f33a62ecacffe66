"""`rtcfctl echo`: values of outputs and declared state, cycle by cycle."""

import argparse
import math
import sys
import time
from typing import Any

import rtcf
from rtcf_shared.ports import PortBatch

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted, figure

_TOLD_HZ = 10.0  # default rate for people
_MOST_EVERY = 2**32 - 1


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    echo = verbs.add_parser(
        "echo", parents=[common], help="print values of outputs and state, cycle by cycle"
    )
    echo.add_argument(
        "selection",
        nargs="*",
        metavar="NAME",
        help="component, or one of its outputs or states, with *, ** and ?, e.g. /arm/*.effort "
        "(default: all)",
    )
    echo.add_argument("-n", type=int, metavar="N", help="end after N printed cycles")
    echo.add_argument(
        "--rate",
        type=amount("Hz"),
        metavar="HZ",
        help=f"print HZ cycles per second, 0: every cycle (default: {_TOLD_HZ:g} for people, every "
        "cycle for programs)",
    )
    echo.add_argument(
        "--min-max",
        action="store_true",
        help="print minima and maxima over all cycles since the previous ones",
    )
    echo.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print values until Ctrl-C, or for some cycles."""
    if args.n is not None and args.n < 1:
        raise ValueError(f"-n {args.n}: at least 1")
    rate_hz = args.rate if args.rate is not None else _TOLD_HZ if output.for_people else 0.0
    if not 0 <= rate_hz < math.inf:
        raise ValueError(f"--rate {rate_hz:g}: 0 Hz or more")
    every = 1
    if rate_hz > 0:
        (runner,) = client.get_status(args.runner or "rt_runner").runners
        every = max(1, round(min(runner.settings.frequency_hz / rate_hz, _MOST_EVERY)))
    left = args.n
    try:
        with client.watch_ports(args.selection, args.runner, every, min_max=args.min_max) as stream:
            for note in stream.schema.notes:
                output.line(f"rtcfctl: note: {note}", to=sys.stderr)
            say_if_idle(client, args.runner, output)
            for batch in stream:
                if batch.lost:
                    _say_lost(batch.lost, output)
                for index in range(len(batch)):
                    (_print_extremes if batch.is_min_max else _print)(batch, index, output)
                    left = None if left is None else left - 1
                    if left == 0:
                        return
                sys.stdout.flush()
                say_if_ended(batch, args.runner, output)
    except KeyboardInterrupt:
        return


def _print(batch: PortBatch, index: int, output: Output) -> None:
    values = {name: batch[name][index].tolist() for name in batch.schema.signals}
    cycle = batch.first_cycle + index * batch.every
    stamp_ns = batch.message.stamps_ns[index]
    if not output.for_people:
        output.record({"cycle": cycle, "stamp_ns": stamp_ns, "values": values})
        return
    seconds, rest = divmod(stamp_ns, 1_000_000_000)
    clock = time.strftime("%H:%M:%S", time.localtime(seconds))
    output.line(f"cycle {cycle} at {clock}.{rest // 1000:06}", "bold")
    for name, signal in batch.schema.signals.items():
        unit = f" {signal.unit}" if signal.unit else ""
        output.line(f"  {name}: {_text(values[name])}{unit}")


def _print_extremes(batch: PortBatch, index: int, output: Output) -> None:
    found = {
        name: tuple(
            method(name)[index].tolist()
            for method in (batch.minima, batch.minima_at, batch.maxima, batch.maxima_at)
        )
        for name in batch.schema.signals
    }
    first, last = int(batch.window_begins[index]), int(batch.window_ends[index])
    count = batch.message.counts[index]
    if not output.for_people:
        values = {
            name: {"min": least, "min_cycle": least_at, "max": most, "max_cycle": most_at}
            for name, (least, least_at, most, most_at) in found.items()
        }
        stamp_ns = batch.message.stamps_ns[index]
        output.record(
            {"cycle": first, "last_cycle": last, "cycles": count, "stamp_ns": stamp_ns,
             "values": values}
        )  # fmt: skip
        return
    lacking = last - first + 1 - count
    output.line(f"cycles {first} to {last}{f', {lacking} of them lost' if lacking else ''}", "bold")
    for name, (least, least_at, most, most_at) in found.items():
        unit = batch.schema.signals[name].unit
        where = f" (cycle {least_at}, {most_at})" if not isinstance(least, list) else ""
        extremes = f"{_text(least)} to {_text(most)}"
        if isinstance(most, float) and math.isnan(most):  # counts as the largest value
            extremes = "nan" if math.isnan(least) else f"{_text(least)} or more, and nan"
        output.line(f"  {name}: {extremes}{f' {unit}' if unit else ''}{where}")


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_text(each) for each in value)}]"
    return figure(value) if isinstance(value, float) else str(value).lower()


def _say_lost(count: int, output: Output) -> None:
    if output.for_people:
        output.line(f"{counted(count, 'cycle')} lost: the reader is too slow", "red")
    else:
        output.record({"lost": count})
