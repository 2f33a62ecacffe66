"""`rtcfctl hz`: measures rate and jitter of cycles, and how often signals change."""

import argparse
import math
import sys
from dataclasses import dataclass
from typing import Any

import rtcf
from rtcf_shared.ports import PortBatch

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted, microseconds

_WINDOW_S = 1.0


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    hz = verbs.add_parser(
        "hz",
        parents=[common],
        help="measure rate and jitter of cycles, and how often signals change",
    )
    hz.add_argument("selection", nargs="*", metavar="NAME", help="as for echo (default: all)")
    hz.add_argument("-n", type=int, metavar="N", help="end after N tables")
    hz.add_argument(
        "--window", type=amount("s"), default=_WINDOW_S, metavar="S",
        help=f"loop time of each table (default: {_WINDOW_S:g})",
    )  # fmt: skip
    hz.set_defaults(run=show)


@dataclass
class _Window:
    """Counts and sums over the cycles of a window."""

    begin_ns: int = 0
    last_ns: int = 0
    intervals: int = 0
    lost: int = 0
    square: float = 0.0  # sum of squared deviations of intervals from the period, ns²
    least_ns: float = math.inf
    most_ns: float = 0.0


class _Meter:
    """Counts changes of each signal, and measures the intervals between starts of cycles."""

    def __init__(self, window_s: float, period_ns: float) -> None:
        self._window_ns = window_s * 1e9
        self._period_ns = period_ns
        self._last: dict[str, Any] = {}
        self._begin()

    def _begin(self) -> None:
        self.changes: dict[str, int] = {}
        self.seen = _Window()

    def take(self, batch: PortBatch) -> bool:
        """Add a batch; return whether the window is complete."""
        import numpy as np

        seen = self.seen
        # Actual start of each cycle: deadline plus wake-up latency.
        woke = batch.stamps_ns + batch.latencies_ns
        if batch.lost or (seen.last_ns and woke[0] < seen.last_ns):
            seen.lost += batch.lost
            seen.last_ns = 0
        if not seen.begin_ns:
            seen.begin_ns = int(woke[0])
        times = np.append(np.int64(seen.last_ns), woke) if seen.last_ns else woke
        gaps = np.diff(times)
        if len(gaps):
            seen.intervals += len(gaps)
            seen.square += float(((gaps - self._period_ns) ** 2).sum())
            seen.least_ns = min(seen.least_ns, float(gaps.min()))
            seen.most_ns = max(seen.most_ns, float(gaps.max()))
        seen.last_ns = int(woke[-1])
        for name in batch.schema.signals:
            values = batch[name].reshape(len(batch), -1)
            before = self._last.get(name)
            if before is not None and before.shape == values[0].shape:
                values = np.concatenate((before[None], values))
            changed = (values[1:] != values[:-1]).any(axis=1)
            self.changes[name] = self.changes.get(name, 0) + int(changed.sum())
            self._last[name] = values[-1].copy()
        return seen.last_ns - seen.begin_ns >= self._window_ns

    def taken(self) -> tuple[_Window, dict[str, int]]:
        """Return the window and the changes in it, and start the next window."""
        found = self.seen, self.changes
        last_ns = self.seen.last_ns
        self._begin()
        self.seen.begin_ns = self.seen.last_ns = last_ns
        return found


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print a table for each window until Ctrl-C, or N tables."""
    if args.n is not None and args.n < 1:
        raise ValueError(f"-n {args.n}: at least 1")
    if not 0 < args.window <= 3600:
        raise ValueError(f"--window {args.window:g}: more than 0, at most 3600 s")
    (runner,) = client.get_status(args.runner or "rt_runner").runners
    meter = _Meter(args.window, 1e9 / runner.settings.frequency_hz)
    left = args.n
    try:
        with client.watch_ports(args.selection, args.runner) as stream:
            for note in stream.schema.notes:
                output.line(f"rtcfctl: note: {note}", to=sys.stderr)
            say_if_idle(client, args.runner, output)
            for batch in stream:
                if len(batch) and meter.take(batch):
                    _print(*meter.taken(), output)
                    left = None if left is None else left - 1
                    if left == 0:
                        return
                    sys.stdout.flush()
                say_if_ended(batch, args.runner, output)
    except KeyboardInterrupt:
        return


def _print(seen: _Window, changes: dict[str, int], output: Output) -> None:
    taken_s = max(seen.last_ns - seen.begin_ns, 1) / 1e9
    rate = seen.intervals / taken_s
    deviation_ns = math.sqrt(seen.square / max(seen.intervals, 1))
    if not output.for_people:
        output.record(
            {"seconds": taken_s, "cycles_hz": rate, "jitter_ns": deviation_ns,
             "shortest_ns": seen.least_ns, "longest_ns": seen.most_ns, "lost": seen.lost,
             "changes_hz": {name: count / taken_s for name, count in changes.items()}}
        )  # fmt: skip
        return
    lost = f", {counted(seen.lost, 'cycle')} lost" if seen.lost else ""
    output.line(
        f"cycles: {rate:.6g} Hz, jitter {microseconds(deviation_ns)} µs, from "
        f"{microseconds(seen.least_ns)} to {microseconds(seen.most_ns)} µs{lost}",
        "bold",
    )
    output.table(
        ("signal", "changes/s"),
        [(name, f"{count / taken_s:.6g}") for name, count in changes.items()],
        right=("changes/s",),
    )
