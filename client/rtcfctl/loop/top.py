"""`rtcfctl top`: live statistics of a loop and its components."""

import argparse
import math
import sys
import textwrap
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcfctl.loop.status import STYLES
from rtcfctl.terminal.drawings import spark
from rtcfctl.terminal.output import Output, coloured, is_screen, styled
from rtcfctl.terminal.plain import enumerator
from rtcfctl.terminal.screen import Screen
from rtcfctl.terminal.words import amount, counted, microseconds

_SHORTEST_S, _LONGEST_S = 0.1, 3600.0
_KEPT = 200  # values per spark line
_SPARK, _SHORTEST_SPARK = 16, 6  # largest and smallest width of a component's spark line
_TITLE = "COMPONENT µs"
_NARROWEST_NAME, _READABLE_NAME = len(_TITLE), 18
_ELSEWHERE = 80  # columns if standard output is not a terminal
# The first line that fits the terminal is shown.
_HELPS = (
    "q end  ↑ ↓ PgUp PgDn Home End scroll  s sort: m mean p p99 w worst v overruns n name o order"
    "  r reset  TAB next runner",
    "q end  ↑ ↓ PgUp PgDn scroll  s sort  o order  r reset  TAB next runner",
    "q end  ↑ ↓ scroll  s sort  o order  r reset  TAB runner",
    "q end  ↑ ↓  s sort",
)

Key = Callable[[runner_pb2.ComponentStatistics], Any]
_SORTS: dict[str, Key] = {
    "mean": lambda each: -each.duration.mean_ns,
    "p99": lambda each: -each.duration.p99_ns,
    "max": lambda each: -each.duration.max_ns,
    "over": lambda each: -each.overruns,
    "name": lambda each: each.component,
}
_ORDERS = ("order", *_SORTS)
_SORT_WORDS = {
    "order": "in the order in which they run",
    "mean": "by mean",
    "p99": "by the 99 % percentile",
    "max": "by maximum",
    "over": "by overruns",
    "name": "by name",
}
_SORT_KEYS = {"m": "mean", "p": "p99", "w": "max", "v": "over", "n": "name", "o": "order"}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    top = verbs.add_parser("top", parents=[common], help="show live statistics of a loop")
    top.add_argument(
        "--interval", type=amount("s"), default=1.0, metavar="S", help="update each S seconds (1)"
    )
    top.add_argument("-n", type=int, metavar="N", help="end after N updates")
    top.add_argument("--sort", choices=_ORDERS, default="order", help="sort the components (order)")
    top.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Show live statistics on a terminal, else print one table after the other."""
    if not _SHORTEST_S <= args.interval <= _LONGEST_S:
        raise ValueError(f"--interval {args.interval:g}: from {_SHORTEST_S:g} to {_LONGEST_S:g} s")
    if args.n is not None and args.n < 1:
        raise ValueError(f"-n {args.n}: at least 1")
    top = _Top(client, args.runner or "rt_runner", args.sort)
    top.look()  # report an error before the screen changes
    try:
        if output.for_people and is_screen():
            with Screen() as screen:
                _run(top, screen, args)
        else:
            _print(top, args, output)
    except KeyboardInterrupt:
        return


def _run(top: "_Top", screen: Screen, args: argparse.Namespace) -> None:
    left = args.n
    due = time.monotonic()
    while True:
        screen.draw(top.lines(*screen.size))
        left = None if left is None else left - 1
        if left == 0:
            return
        due += args.interval
        while (wait_s := due - time.monotonic()) > 0:
            key = screen.key(wait_s)
            if key in ("q", "escape"):
                return
            if key:
                top.press(key)
                screen.draw(top.lines(*screen.size))
        due = max(due, time.monotonic() - args.interval)
        top.look()


def _print(top: "_Top", args: argparse.Namespace, output: Output) -> None:
    left = args.n
    while True:
        if output.for_people:
            print("\n".join(top.table(_ELSEWHERE)), end="\n\n", flush=True)
        else:
            output.record({"status": top.status, "statistics": top.found})
            sys.stdout.flush()
        left = None if left is None else left - 1
        if left == 0:
            return
        time.sleep(args.interval)
        top.look()


@dataclass(frozen=True)
class _Column:
    """A column of the table of components."""

    title: str
    width: int
    sort: str  # key in _SORTS; empty: not sortable
    text: Callable[[runner_pb2.ComponentStatistics, float], str]  # statistics, share


_COLUMNS = (
    _Column("MEAN", 8, "mean", lambda each, _: microseconds(each.duration.mean_ns)),
    _Column("P50", 8, "", lambda each, _: microseconds(each.duration.p50_ns)),
    _Column("P99", 8, "p99", lambda each, _: microseconds(each.duration.p99_ns)),
    _Column("MAX", 9, "max", lambda each, _: microseconds(each.duration.max_ns)),
    _Column("SHARE", 6, "", lambda _, share: f"{share:.1%}"),
    _Column("OVER", 6, "over", lambda each, _: str(each.overruns)),
)
# Columns to leave out, the first set that fits the terminal.
_LEFT_OUT = ((), ("P50",), ("P50", "P99"), ("P50", "P99", "SHARE"))


@dataclass(frozen=True)
class _Layout:
    """The width of the name, the columns and the spark line that fit a terminal."""

    name: int
    columns: Sequence[_Column]
    spark: int  # width; 0: none

    @classmethod
    def of(cls, width: int, longest_name: int) -> "_Layout":
        for titles in _LEFT_OUT:
            columns = [each for each in _COLUMNS if each.title not in titles]
            left = width - sum(each.width + 1 for each in columns)
            if left >= _NARROWEST_NAME:
                break
        most = left - _SHORTEST_SPARK - 1
        name = min(longest_name, most if most >= _READABLE_NAME else left)
        name = max(name, _NARROWEST_NAME)
        lately = min(left - name - 1, _SPARK)
        return cls(name, columns, lately if lately >= _SHORTEST_SPARK else 0)


class _Means:
    """The mean of a distribution between successive updates."""

    def __init__(self) -> None:
        self.kept: deque[float] = deque(maxlen=_KEPT)
        self._count, self._sum = 0, 0.0

    def take(self, found: runner_pb2.Distribution) -> None:
        total = found.count * found.mean_ns
        if found.count < self._count:
            self._count, self._sum = 0, 0.0  # it was reset
        more = found.count - self._count
        self.kept.append((total - self._sum) / more if more else math.nan)
        self._count, self._sum = found.count, total


class _Top:
    """The newest status and statistics of a runner, its history, and the scroll position."""

    def __init__(self, client: rtcf.Client, runner: str, sort: str) -> None:
        self._client = client
        self._runner = runner
        self._sort = sort
        self._error = ""
        self._above = 0  # components above the visible ones
        self._room = 1  # components that fit the screen
        self.status = runner_pb2.RunnerStatus()
        self.found = runner_pb2.RunnerStatistics()
        self._means: dict[str, _Means] = {}

    def look(self) -> None:
        """Query status and statistics.  Raise an error the first time; later, show it."""
        try:
            (self.status,) = self._client.get_status(self._runner).runners
            self.found = self._client.get_statistics(self._runner)
        except rtcf.RtcfError as error:
            if not self.status.runner:
                raise
            self._error = str(error)
            if self.status.state == runner_pb2.RUNNER_STATE_DOWN:
                self.found = runner_pb2.RunnerStatistics()
            return
        self._error = ""
        self._mean("~duration").take(self.found.duration)
        self._mean("~latency").take(self.found.latency)
        for each in self.found.components:
            self._mean(each.component).take(each.duration)

    def press(self, key: str) -> None:
        """Handle a key."""
        page = max(self._room - 1, 1)
        steps = {
            "up": -1, "k": -1, "down": 1, "j": 1, "page up": -page, "page down": page, " ": page,
            "home": -self._above, "end": len(self.found.components),
        }  # fmt: skip
        try:
            if key in steps:
                self._above = max(self._above + steps[key], 0)
            elif key == "s":
                self._order(_ORDERS[(_ORDERS.index(self._sort) + 1) % len(_ORDERS)])
            elif key in _SORT_KEYS:
                self._order(_SORT_KEYS[key])
            elif key == "r":
                self._client.reset_statistics(self._runner)
                self.look()
            elif key == "tab":
                self._next_runner()
        except rtcf.RtcfError as error:
            self._error = str(error)

    def lines(self, width: int, height: int) -> list[str]:
        """Return the lines of the screen: head, visible components, their position, and keys."""
        head = self._head(width)
        # If the terminal is too low, cut the head, so that some components are visible.
        head = head[: max(height - 6, 1)]
        if height - len(head) > 6:
            head.append("")
        rows = self._components(width)
        self._room = max(height - len(head) - 3, 1)
        self._above = min(self._above, max(len(rows) - self._room, 0))
        shown = rows[self._above : self._above + self._room]
        which = f"{self._above + 1} to {self._above + len(shown)} of " * (len(shown) < len(rows))
        place = f"{which}{counted(len(rows), 'component')}, {_SORT_WORDS[self._sort]}"
        keys = next((each for each in _HELPS if len(each) <= width), _HELPS[-1])
        return [
            *head, self._columns(width), *shown, _fit(place, width),
            _styled(_fit(keys, width), "bold"),
        ]  # fmt: skip

    def table(self, width: int) -> list[str]:
        """Return the whole table, for output without scrolling."""
        return [*self._head(width), "", self._columns(width), *self._components(width)]

    def _order(self, sort: str) -> None:
        self._sort, self._above = sort, 0

    def _mean(self, name: str) -> _Means:
        return self._means.setdefault(name, _Means())

    def _next_runner(self) -> None:
        names = [each.runner for each in self._client.get_status().runners]
        at = names.index(self._runner) + 1 if self._runner in names else 0
        self._runner = names[at % len(names)]
        self.status, self._means, self._above = runner_pb2.RunnerStatus(), {}, 0
        self.look()

    def _head(self, width: int) -> list[str]:
        return [*self._about(width), *self._cycles(width), *self._counts(width)]

    def _about(self, width: int) -> list[str]:
        status = self.status
        state = enumerator(status, "state")
        rate, cycle = f"{status.settings.frequency_hz:g} Hz", f"cycle {status.iteration}"
        clock = time.strftime("%H:%M:%S")
        room = width - len(clock) - 1
        shortest = min(len(self._runner), _NARROWEST_NAME)
        for words in ((state, rate, cycle), (state, cycle), (state,)):
            rest = "".join(f"  {word}" for word in words)
            if shortest + len(rest) <= room:
                break
        text = _fit(f"{_short(self._runner, max(room - len(rest), 1))}{rest}", room)
        in_style = _styled(state, STYLES.get(status.state, ""))
        first = f"{text:<{room}} {clock}".replace(f"  {state} ", f"  {in_style} ", 1)
        warnings = [
            *([f"!! {self._error}"] if self._error else []),
            *(f"!! NOT REAL TIME: {each}" for each in status.degraded),
            *([f"!! LATE: {status.late}"] if status.late else []),
            *(each for each in (status.status, status.clock_silence) if each),
        ]
        return [first, *(line for each in warnings for line in _folded(each, width, "bold red"))]

    def _cycles(self, width: int) -> list[str]:
        lines = []
        for title, times, name in (
            ("calculation", self.found.duration, "~duration"),
            ("wake-up", self.found.latency, "~latency"),
        ):
            if not times.count:
                lines.append(f"{title:<12} no cycles yet")
                continue
            text = (
                f"{title:<12} mean {microseconds(times.mean_ns):>8}  "
                f"p99 {microseconds(times.p99_ns):>8}  max {microseconds(times.max_ns):>9} µs  "
            )
            lately = spark(self._mean(name).kept, max(width - len(text), 0))
            lines.append(_fit((text + lately).rstrip(), width))
        return lines

    def _counts(self, width: int) -> list[str]:
        found = self.found
        faults = found.minor_faults + found.major_faults
        losses = found.log_dropped + found.tap_dropped
        text = (
            f"{counted(found.overruns, 'overrun')}, {found.missed} missed, "
            f"{counted(faults, 'page fault')}"
        )
        if losses:
            text += f", {losses} records and values dropped"
        bad = found.overruns or found.missed or losses
        return _folded(text, width, "bold red" if bad else "")

    def _layout(self, width: int) -> _Layout:
        longest = max((len(each.component) for each in self.found.components), default=0)
        return _Layout.of(width, longest)

    def _columns(self, width: int) -> str:
        layout = self._layout(width)
        head = f"{'▼' * (self._sort == 'name')}{_TITLE}"[: layout.name].ljust(layout.name)
        for each in layout.columns:
            title = f"{'▼' * (each.sort == self._sort)}{each.title}"
            head += f" {title:>{each.width}}"
        if layout.spark:
            head += " LATELY"
        return _styled(_fit(head, width), "bold")

    def _components(self, width: int) -> list[str]:
        rows = list(self.found.components)
        if self._sort != "order":
            rows.sort(key=_SORTS[self._sort])
        period_ns = 1e9 / self.status.settings.frequency_hz if self.found.runner else math.inf
        layout = self._layout(width)
        return [_fit(self._row(each, layout, period_ns), width) for each in rows]

    def _row(self, each: runner_pb2.ComponentStatistics, layout: _Layout, period_ns: float) -> str:
        times = each.duration
        share = times.mean_ns * times.count / max(self.found.iterations, 1) / period_ns
        text = f"{_short(each.component, layout.name):<{layout.name}}"
        for column in layout.columns:
            said = column.text(each, share) if times.count else "-"
            text += f" {said:>{column.width}}"
        if layout.spark and times.count:
            text += " " + spark(self._mean(each.component).kept, layout.spark)
        return text


def _short(name: str, width: int) -> str:
    return name if len(name) <= width else f"…{name[len(name) - width + 1 :]}"


def _fit(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 1]}…"


def _folded(text: str, width: int, style: str) -> list[str]:
    lines = textwrap.wrap(text, width, subsequent_indent="   ") or [""]
    return [_styled(each, style) for each in lines]


def _styled(text: str, style: str) -> str:
    return styled(text, style, coloured(sys.stdout))
