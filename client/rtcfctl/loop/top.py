"""`rtcfctl top`: what a loop costs, while it runs."""

import argparse
import math
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcfctl.loop.status import STYLES
from rtcfctl.terminal.output import Output, coloured, styled
from rtcfctl.terminal.pictures import spark
from rtcfctl.terminal.plain import enumerator
from rtcfctl.terminal.screen import Screen
from rtcfctl.terminal.words import amount, counted, microseconds

_SHORTEST_S, _LONGEST_S = 0.1, 3600.0
_KEPT = 200  # values of a row of blocks
_SPARK = 16  # of them that a component's row shows
_NARROWEST_NAME = 12
_HELP = "q end  s sort  o schedule's order  r reset  TAB next runner"

Key = Callable[[runner_pb2.ComponentStatistics], Any]
_SORTS: dict[str, Key] = {
    "mean": lambda each: -each.duration.mean_ns,
    "p99": lambda each: -each.duration.p99_ns,
    "max": lambda each: -each.duration.max_ns,
    "over": lambda each: -each.overruns,
    "name": lambda each: each.component,
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    top = verbs.add_parser("top", parents=[common], help="what a loop costs, while it runs")
    top.add_argument(
        "--interval", type=amount("s"), default=1.0, metavar="S", help="between looks (1)"
    )
    top.add_argument("-n", type=int, metavar="N", help="end after so many looks")
    top.add_argument(
        "--sort", choices=("order", *_SORTS), default="order", help="of the components (order)"
    )
    top.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Look again and again: in one place of a terminal, else one table after the other."""
    if not _SHORTEST_S <= args.interval <= _LONGEST_S:
        raise ValueError(f"--interval {args.interval:g}: from {_SHORTEST_S:g} to {_LONGEST_S:g} s")
    if args.n is not None and args.n < 1:
        raise ValueError(f"-n {args.n}: at least 1")
    top = _Top(client, args.runner or "rt_runner", args.sort)
    top.look()  # a refusal is told before the screen changes
    try:
        if output.for_people and sys.stdout.isatty():
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
            print("\n".join(top.lines(80, 10**6)[:-1]), end="\n\n", flush=True)
        else:
            output.record({"status": top.status, "statistics": top.found})
            sys.stdout.flush()
        left = None if left is None else left - 1
        if left == 0:
            return
        time.sleep(args.interval)
        top.look()


class _Means:
    """What a distribution that grows took on average since the last look, look by look."""

    def __init__(self) -> None:
        self.kept: deque[float] = deque(maxlen=_KEPT)
        self._count, self._sum = 0, 0.0

    def take(self, found: runner_pb2.Distribution) -> None:
        total = found.count * found.mean_ns
        if found.count < self._count:
            self._count, self._sum = 0, 0.0  # it began anew
        more = found.count - self._count
        self.kept.append((total - self._sum) / more if more else math.nan)
        self._count, self._sum = found.count, total


class _Top:
    """What is shown of one runner, and what was seen before."""

    def __init__(self, client: rtcf.Client, runner: str, sort: str) -> None:
        self._client = client
        self._runner = runner
        self._sort = sort
        self._trouble = ""
        self.status = runner_pb2.RunnerStatus()
        self.found = runner_pb2.RunnerStatistics()
        self._means: dict[str, _Means] = {}

    def look(self) -> None:
        """Ask again; what is wrong is shown, and raised only the first time."""
        try:
            (self.status,) = self._client.get_status(self._runner).runners
            self.found = self._client.get_statistics(self._runner)
        except rtcf.RtcfError as error:
            if not self.status.runner:
                raise
            self._trouble = str(error)
            if self.status.state == runner_pb2.RUNNER_STATE_DOWN:
                self.found = runner_pb2.RunnerStatistics()
            return
        self._trouble = ""
        self._mean("~duration").take(self.found.duration)
        self._mean("~latency").take(self.found.latency)
        for each in self.found.components:
            self._mean(each.component).take(each.duration)

    def press(self, key: str) -> None:
        """Do what a key says."""
        orders = ("order", *_SORTS)
        try:
            if key == "s":
                self._sort = orders[(orders.index(self._sort) + 1) % len(orders)]
            elif key == "o":
                self._sort = "order"
            elif key == "r":
                self._client.reset_statistics(self._runner)
                self.look()
            elif key == "tab":
                self._next_runner()
        except rtcf.RtcfError as error:
            self._trouble = str(error)

    def lines(self, width: int, height: int) -> list[str]:
        """Return what is shown, one line of help last."""
        head = [*self._about(width), *self._cycles(width)]
        rows = self._components(width)
        room = height - len(head) - 3
        if len(rows) > room:
            left = len(rows) - max(room - 1, 0)
            rows = [*rows[: max(room - 1, 0)], f"… {counted(left, 'component')} more"]
        return [*head, "", self._columns(width), *rows, _styled(_HELP[:width], "bold")]

    def _mean(self, name: str) -> _Means:
        return self._means.setdefault(name, _Means())

    def _next_runner(self) -> None:
        names = [each.runner for each in self._client.get_status().runners]
        at = names.index(self._runner) + 1 if self._runner in names else 0
        self._runner = names[at % len(names)]
        self.status, self._means = runner_pb2.RunnerStatus(), {}
        self.look()

    def _about(self, width: int) -> list[str]:
        status = self.status
        state = enumerator(status, "state")
        rate = f"{status.settings.frequency_hz:g} Hz"
        text = f"{self._runner}  {state}  {rate}  cycle {status.iteration}"
        clock = time.strftime("%H:%M:%S")
        lines = [_fit(f"{text:<{width - len(clock) - 1}.{width - len(clock) - 1}} {clock}", width)]
        style = STYLES.get(status.state, "")
        lines[0] = lines[0].replace(state, _styled(state, style), 1)
        troubles = [
            *([f"!! {self._trouble}"] if self._trouble else []),
            *(f"!! NOT REAL TIME: {each}" for each in status.degraded),
            *([f"!! LATE: {status.late}"] if status.late else []),
            *([status.status] if status.status else []),
        ]
        return lines + [_styled(_fit(each, width), "bold red") for each in troubles]

    def _cycles(self, width: int) -> list[str]:
        found = self.found
        lines = []
        for title, figures, name in (
            ("calculation", found.duration, "~duration"),
            ("wake-up", found.latency, "~latency"),
        ):
            if not figures.count:
                lines.append(f"{title:<12} nothing yet")
                continue
            text = (
                f"{title:<12} mean {microseconds(figures.mean_ns):>8}  "
                f"p99 {microseconds(figures.p99_ns):>8}  max {microseconds(figures.max_ns):>9} µs  "
            )
            lines.append(_fit(text + spark(self._mean(name).kept, width - len(text)), width))
        faults = found.minor_faults + found.major_faults
        losses = found.log_dropped + found.tap_dropped
        figures_line = (
            f"{counted(found.overruns, 'overrun')}, {found.missed} missed, "
            f"{counted(faults, 'page fault')}"
        )
        if losses:
            figures_line += f", {losses} records and values lost"
        bad = found.overruns or found.missed or losses
        return [*lines, _styled(_fit(figures_line, width), "bold red" if bad else "")]

    def _columns(self, width: int) -> str:
        name = self._name_width(width)
        sorts = {"mean": "MEAN", "p99": "P99", "max": "MAX", "over": "OVER"}
        head = f"{'COMPONENT µs':<{name}}"
        for key, size in (("mean", 8), ("p50", 8), ("p99", 8), ("max", 9)):
            head += f" {sorts.get(key, key.upper()):>{size}}"
        head += f" {'SHARE':>6} {'OVER':>6} LATELY"
        return _styled(_fit(head, width), "bold")

    def _components(self, width: int) -> list[str]:
        rows = list(self.found.components)
        if self._sort != "order":
            rows.sort(key=_SORTS[self._sort])
        period_ns = 1e9 / self.status.settings.frequency_hz if self.found.runner else math.inf
        name = self._name_width(width)
        return [_fit(self._row(each, name, period_ns, width), width) for each in rows]

    def _row(
        self, each: runner_pb2.ComponentStatistics, name: int, period_ns: float, width: int
    ) -> str:
        figures = each.duration
        text = f"{_short(each.component, name):<{name}}"
        if not figures.count:
            return f"{text} {'-':>8} {'-':>8} {'-':>8} {'-':>9}"
        for value, size in (
            (figures.mean_ns, 8), (figures.p50_ns, 8), (figures.p99_ns, 8), (figures.max_ns, 9),
        ):  # fmt: skip
            text += f" {microseconds(value):>{size}}"
        share = figures.mean_ns * figures.count / max(self.found.iterations, 1) / period_ns
        text += f" {share:>6.1%} {each.overruns:>6} "
        return text + spark(self._mean(each.component).kept, min(_SPARK, width - len(text)))

    @staticmethod
    def _name_width(width: int) -> int:
        return max(_NARROWEST_NAME, width - 4 * 9 - 1 - 2 * 7 - 1 - _SPARK)


def _short(name: str, width: int) -> str:
    return name if len(name) <= width else f"…{name[len(name) - width + 1 :]}"


def _fit(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: width - 1]}…"


def _styled(text: str, style: str) -> str:
    return styled(text, style, coloured(sys.stdout))
