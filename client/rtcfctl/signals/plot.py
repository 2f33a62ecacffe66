"""`rtcfctl plot`: plots signals in the terminal."""

import argparse
import math
import sys
import threading
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import rtcf
from rtcf.streams.ports import PortStream
from rtcf_shared.ports import PortBatch

from rtcfctl.signals.idle_loop import say_if_idle
from rtcfctl.terminal.drawings import MARKS, Curves, is_ascii
from rtcfctl.terminal.output import Output, coloured, is_screen, styled
from rtcfctl.terminal.screen import Screen
from rtcfctl.terminal.words import amount, figure

_SPAN_S, _LONGEST_S = 5.0, 3600.0
_MOST = 6  # curves, each with its own colour
_COLOURS = ("cyan", "yellow", "green", "magenta", "blue", "red")
_LOOK_S = 0.1
_LABEL = 10  # width of the labels at the left of the curves
_WIDTH, _HEIGHT = 80, 24  # size if standard output is not a terminal


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    plot = verbs.add_parser("plot", parents=[common], help="plot signals in the terminal")
    plot.add_argument("selection", nargs="+", metavar="NAME", help="as for echo")
    plot.add_argument(
        "--span", type=amount("s"), default=_SPAN_S, metavar="S",
        help=f"loop time of the plot ({_SPAN_S:g})",
    )  # fmt: skip
    plot.add_argument("--once", action="store_true", help="print one plot of the next --span")
    plot.set_defaults(run=show)


@dataclass
class _Window:
    """The minimum and maximum of each signal over some cycles."""

    stamp_ns: int
    ends: dict[str, tuple[float, float]]


class _Plot:
    """The last windows of a stream, about one for each column of dots."""

    def __init__(self, span_s: float) -> None:
        self._span_s = span_s
        self._windows: deque[_Window] = deque()
        self._lock = threading.Lock()
        self.names: list[str] = []
        self.left_out = 0
        self.over = False
        self.error = ""

    def take(self, batch: PortBatch) -> None:
        """Add windows.  Any thread."""
        signals = [name for name, signal in batch.schema.signals.items() if not signal.shape]
        names = signals[:_MOST]
        ends = {
            name: (batch.minima(name).astype(float), batch.maxima(name).astype(float))
            for name in names
        }
        with self._lock:
            self.names, self.left_out = names, len(batch.schema.signals) - len(names)
            for index, stamp_ns in enumerate(batch.message.stamps_ns):
                row = {name: (float(a[index]), float(b[index])) for name, (a, b) in ends.items()}
                self._windows.append(_Window(stamp_ns, row))
            while self._windows and self._seconds() > 2 * self._span_s:
                self._windows.popleft()

    def is_full(self) -> bool:
        """Return whether the windows cover the whole span."""
        with self._lock:
            return self._seconds() >= self._span_s

    def _seconds(self) -> float:
        if not self._windows:
            return 0.0
        return (self._windows[-1].stamp_ns - self._windows[0].stamp_ns) / 1e9

    def lines(self, width: int, height: int) -> list[str]:
        """Return the lines of the plot: names, curves, time axis or error."""
        with self._lock:
            windows, names = list(self._windows), list(self.names)
        if not windows:
            return [self.error or "no cycles yet"]
        end_ns = windows[-1].stamp_ns
        windows = [each for each in windows if end_ns - each.stamp_ns <= self._span_s * 1e9]
        values = [value for each in windows for ends in each.ends.values() for value in ends]
        finite = [value for value in values if math.isfinite(value)]
        low, high = min(finite, default=0.0), max(finite, default=0.0)
        if low == high:
            low, high = low - 1.0, high + 1.0
        head = _legend(names, windows[-1], width)
        if self.left_out:
            head.append(f"{self.left_out} more signals not shown: select fewer by NAME")
        room = max(height - len(head) - 1, 2)
        curves = Curves(width - _LABEL, room, low, high, marked=_is_marked(names))
        dots = curves.columns
        for number, name in enumerate(names):
            last: tuple[float, float] | None = None
            for each in windows:
                ends = each.ends.get(name)
                if ends is None:
                    continue
                ago = (end_ns - each.stamp_ns) / (self._span_s * 1e9)
                x = min(max(dots - 1 - round(ago * (dots - 1)), 0), dots - 1)
                # Extend the window to its predecessor, so that the curve is connected.
                least, most = ends
                if last is not None and least > last[1]:
                    least = last[1]
                elif last is not None and most < last[0]:
                    most = last[0]
                curves.column(x, least, most, number)
                last = ends
        labels = {0: high, room // 2: (low + high) / 2, room - 1: low}
        lines = []
        for row, runs in enumerate(curves.lines()):
            label = figure(labels[row])[: _LABEL - 1] if row in labels else ""
            text = "".join(_coloured(part, owner) for part, owner in runs)
            lines.append(f"{label:>{_LABEL - 1}} {text}")
        below = f"{'':{_LABEL}}{f'-{self._span_s:g} s':<{width - _LABEL - 4}}now"
        return [*head, *lines, self.error[:width] or below]


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Draw until q or Ctrl-C, or print one plot."""
    if not 0 < args.span <= _LONGEST_S:
        raise ValueError(f"--span {args.span:g}: more than 0, at most {_LONGEST_S:g} s")
    if not output.for_people:
        raise ValueError("plot has no output for programs: use `rtcfctl echo -o json`")
    (runner,) = client.get_status(args.runner or "rt_runner").runners
    every = max(1, round(args.span * runner.settings.frequency_hz / (2 * _WIDTH)))
    plot = _Plot(args.span)
    with client.watch_ports(args.selection, args.runner, every, min_max=True) as stream:
        for note in stream.schema.notes:
            output.line(f"rtcfctl: note: {note}", to=sys.stderr)
        if not any(not signal.shape for signal in stream.schema.signals.values()):
            raise rtcf.RtcfError("no scalar signal selected; use e.g. COMPONENT.PORT.FIELD")
        say_if_idle(client, args.runner, output)
        reader = threading.Thread(target=_read, args=(stream, plot), daemon=True)
        reader.start()
        try:
            if args.once or not is_screen():
                while not plot.is_full() and not plot.over:
                    time.sleep(_LOOK_S)
                print("\n".join(plot.lines(_WIDTH, _HEIGHT)))
                return
            with Screen() as screen:
                while True:
                    screen.draw(plot.lines(*screen.size))
                    if screen.key(_LOOK_S) in ("q", "escape"):
                        return
        except KeyboardInterrupt:
            return


def _read(stream: PortStream, plot: _Plot) -> None:
    try:
        for batch in stream:
            plot.take(batch)
        plot.error = "the stream has ended"
    except rtcf.RtcfError as error:
        plot.error = str(error)
    finally:
        plot.over = True


def _legend(names: list[str], newest: _Window, width: int) -> list[str]:
    """Return lines with the names of the signals and their newest values."""
    lines: list[str] = [""]
    used = 0
    for number, name in enumerate(names):
        least, most = newest.ends.get(name, (math.nan, math.nan))
        value = figure(most) if least == most else f"{figure(least)} to {figure(most)}"
        mark = MARKS[number % len(MARKS)] if _is_marked(names) else "⣿"
        text = f"{mark} {name} {value}"
        text = text if len(text) < width else f"{text[: width - 1]}…"
        if used and used + len(text) + 2 > width:
            lines.append("")
            used = 0
        lines[-1] += ("  " if used else "") + _coloured(text, number)
        used += len(text) + 2
    return lines


def _is_marked(names: list[str]) -> bool:
    """Return whether curves differ by their characters, not by their colours."""
    return is_ascii() or (len(names) > 1 and not coloured(sys.stdout))


def _coloured(text: str, owner: int) -> str:
    if owner < 0:
        return text
    return styled(text, _COLOURS[owner % len(_COLOURS)], coloured(sys.stdout))
