"""Drawings made of characters: spark lines, bars, and curves of braille dots."""

import itertools
import math
import sys
from collections.abc import Mapping, Sequence

_BLOCKS = "▁▂▃▄▅▆▇█"
_PARTS = " ▏▎▍▌▋▊▉"  # parts of a block, in eighths of its width
# Bits of a braille character's 2 by 4 dots, by column and row.
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
_BLANK = 0x2800
_ASCII_BLOCKS, _ASCII_BAR = ".:-=+*%#", "#"
# Of curves that have no colour, or in ASCII.
MARKS = "*+xo#@%&=~"


def is_ascii() -> bool:
    """Return whether standard output shows ASCII only."""
    return bool(getattr(sys.stdout, "ascii", False))


def spark(values: Sequence[float], width: int) -> str:
    """Return the last values as blocks, scaled from 0 to the largest; NaN is a space."""
    shown = list(values)[-width:] if width > 0 else []
    most = max((each for each in shown if math.isfinite(each)), default=0.0)
    blocks = _ASCII_BLOCKS if is_ascii() else _BLOCKS

    def block(value: float) -> str:
        if not math.isfinite(value):
            return " "
        return blocks[round(max(value, 0.0) / most * (len(blocks) - 1)) if most > 0 else 0]

    return "".join(block(each) for each in shown)


def bar(share: float, width: int) -> str:
    """Return a bar whose length is a share, 0 to 1, of `width` characters."""
    if is_ascii():
        return _ASCII_BAR * round(min(max(share, 0.0), 1.0) * width)
    eighths = round(min(max(share, 0.0), 1.0) * width * 8)
    return (_BLOCKS[-1] * (eighths // 8) + _PARTS[eighths % 8]).rstrip()


class Curves:
    """A field of braille dots for several curves: each character has 2 by 4 dots.

    marked  whether each curve has a character of its own instead, as where there are no colours
    """

    def __init__(
        self, width: int, height: int, low: float, high: float, *, marked: bool = False
    ) -> None:
        self._marked = marked
        self._width, self._height = width, height
        self._low, self._high = low, high
        self._dots: dict[tuple[int, int], int] = {}
        self._owner: dict[tuple[int, int], int] = {}

    @property
    def columns(self) -> int:
        """Width of the field in dots."""
        return 2 * self._width

    def column(self, x: int, low: float, high: float, owner: int) -> None:
        """Set the dots from `low` to `high` in column `x` of dots, for curve `owner`."""
        if not (math.isfinite(low) and math.isfinite(high)):
            return
        top, bottom = self._row(high), self._row(low)
        for row in range(top, bottom + 1):
            place = x // 2, row // 4
            self._dots[place] = self._dots.get(place, 0) | _DOTS[x % 2][row % 4]
            self._owner[place] = owner

    def lines(self) -> list[list[tuple[str, int]]]:
        """Return the lines as runs of characters, each with its curve; -1: no curve."""
        found = []
        for line in range(self._height):
            runs: list[tuple[str, int]] = []
            for x in range(self._width):
                dots = self._dots.get((x, line), 0)
                owner = self._owner.get((x, line), -1)
                character = chr(_BLANK + dots) if dots else " "
                if dots and self._marked:
                    character = MARKS[owner % len(MARKS)]
                if runs and runs[-1][1] == owner:
                    runs[-1] = (runs[-1][0] + character, owner)
                else:
                    runs.append((character, owner))
            found.append(runs)
        return found

    def _row(self, value: float) -> int:
        rows = 4 * self._height
        # Halves, because the difference of two large numbers may be infinite.
        span = self._high / 2 - self._low / 2
        above = min(max(value, self._low), self._high) / 2 - self._low / 2
        return rows - 1 - round(above / span * (rows - 1) if span > 0 else 0.0)


def drawn(
    title: str,
    curves: Sequence[Sequence[float]],
    marks: Mapping[float, str],
    *,
    width: int = 72,
    height: int = 9,
    label: int = 8,
) -> list[str]:
    """Return the lines of a plot of curves over equal steps, with its lowest and highest value.

    curves  values from left to right; NaN leaves a gap
    marks   texts below the curves, by the share of the width at which they begin; that of 1 ends
            there
    label   width of the numbers at the left
    """
    finite = [float(value) for curve in curves for value in curve if math.isfinite(value)]
    low, high = min(finite, default=0.0), max(finite, default=0.0)
    field = Curves(width, height, low, high, marked=is_ascii())
    for owner, curve in enumerate(curves):
        last: float | None = None
        for x, part in enumerate(_parts(curve, field.columns)):
            values = [float(value) for value in part if math.isfinite(value)]
            if not values:
                last = None
                continue
            # From the last value, so that the curve is connected.
            before = values[0] if last is None else last
            field.column(x, min(*values, before), max(*values, before), owner)
            last = values[-1]
    # 0.0 is added because -0.001 is rounded to -0.0.
    labels = {0: f"{round(high, 2) + 0.0:.2f}", height - 1: f"{round(low, 2) + 0.0:.2f}"}
    lines = [
        f"{labels.get(row, ''):>{label}} {''.join(text for text, _ in runs)}".rstrip()
        for row, runs in enumerate(field.lines())
    ]
    below = ""
    for share, text in marks.items():
        below = below.ljust(round(share * width) - (len(text) if share == 1.0 else 0)) + text
    return [title, *lines, " " * (label + 1) + below]


def _parts(values: Sequence[float], count: int) -> list[Sequence[float]]:
    """Return `count` parts of nearly equal length, the longer ones first."""
    size, longer = divmod(len(values), count)
    ends = [each * size + min(each, longer) for each in range(count + 1)]
    return [values[begin:end] for begin, end in itertools.pairwise(ends)]
