"""Histograms of `rtcfctl stats --plot`, as bars in a terminal or as an image file.

All axes are logarithmic, so that one slow cycle in a million is visible beside the others.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rtcf
from rtcf.v1 import runner_pb2

from rtcfctl.terminal import image_file
from rtcfctl.terminal.drawings import bar

_FORMATS = (".svg", ".png", ".pdf")
_LEAST_NS = 10.0  # shorter and negative times count as this
# Bins per decade, finest first.  All are wider than the buckets of rtcfd, which are 3.2 % wide.
_BINS_OF_DECADE = (40, 20, 10, 5, 2, 1)
_MOST_BINS, _MOST_LINES = 120, 24
_FEWEST_FOLDED = 3  # fewest successive empty lines that are replaced by …
_LONGEST_BAR, _SHORTEST_BAR = 60, 10
_LOWEST, _SHARE_OF_BARS = 0.7, 0.7  # image: lower limit in cycles, largest height of bars
_MARKS = (("50 %", "p50_ns"), ("99 %", "p99_ns"), ("99.9 %", "p999_ns"), ("max", "max_ns"))
_DASHES = (":", "--", "-.", "-")  # line styles of the marks


@dataclass(frozen=True)
class Bin:
    """The number of cycles that took more than `low_ns` and at most `high_ns`."""

    low_ns: float
    high_ns: float
    count: int


def bins(buckets: Sequence[runner_pb2.Bucket], most: int, most_lines: int) -> list[Bin]:
    """Return adjacent bins of equal width on a logarithmic axis: at most `most`, which take at most
    `most_lines` in a terminal, where long gaps are folded."""
    uppers = [max(each.upper_ns, _LEAST_NS) for each in buckets]
    for of_decade in _BINS_OF_DECADE:
        numbers = [math.ceil(of_decade * math.log10(each) - 1e-6) for each in uppers]
        if numbers[-1] - numbers[0] < most and _number_of_lines(numbers) <= most_lines:
            break
    counts = dict.fromkeys(range(numbers[0], numbers[-1] + 1), 0)
    for number, bucket in zip(numbers, buckets, strict=True):
        counts[number] += bucket.count
    return [
        Bin(10 ** ((number - 1) / of_decade), 10 ** (number / of_decade), count)
        for number, count in counts.items()
    ]


def _number_of_lines(numbers: Sequence[int]) -> int:
    """Return how many lines the bins of these numbers take, with the gaps between them."""
    filled = sorted(set(numbers))
    gaps = (after - before - 1 for before, after in itertools.pairwise(filled))
    return len(filled) + sum(1 if gap >= _FEWEST_FOLDED else gap for gap in gaps)


def require_cycles(found: runner_pb2.RunnerStatistics) -> None:
    """Raise RtcfError if the loop has run no cycle."""
    if not found.duration.count:
        raise rtcf.RtcfError(f"{found.runner} has run no cycles: nothing to draw")


def lines(found: runner_pb2.RunnerStatistics, width: int) -> Iterator[str]:
    """Yield histograms for a terminal; lengths of bars are logarithmic."""
    for title, buckets, distribution in _panels(found):
        if buckets:
            yield f"{title} (µs), {_grouped(distribution.count)} cycles, logarithmic bars"
            yield from _bars(bins(buckets, _MOST_BINS, _MOST_LINES), distribution, width)
            yield ""


def draw(found: runner_pb2.RunnerStatistics, file: Path) -> None:
    """Write an image file.  Raises ValueError for an unknown suffix, and RtcfError."""
    image_file.require_format(file, _FORMATS)
    require_cycles(found)
    pyplot = image_file.pyplot_module()
    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    figure.suptitle(f"{found.runner}, {_grouped(found.iterations)} cycles")
    for axis, letter, (title, buckets, distribution) in zip(
        axes, "ab", _panels(found), strict=True
    ):
        axis.set_xlabel(f"({letter}) {title} [µs]")
        axis.set_ylabel("cycles")
        if buckets:
            _draw(axis, title, bins(buckets, _MOST_BINS, _MOST_BINS), distribution)
    image_file.write(figure, file)


_Panel = tuple[str, Sequence[runner_pb2.Bucket], runner_pb2.Distribution]


def _panels(found: runner_pb2.RunnerStatistics) -> tuple[_Panel, _Panel]:
    return (
        ("calculation duration", found.duration_buckets, found.duration),
        ("wake-up latency", found.latency_buckets, found.latency),
    )


def _draw(
    axis: Any, title: str, found: Sequence[Bin], distribution: runner_pb2.Distribution
) -> None:
    from matplotlib import ticker

    axis.set_xscale("log")
    axis.set_yscale("log")
    bars = axis.bar(
        [each.low_ns / 1e3 for each in found],
        [each.count for each in found],
        [(each.high_ns - each.low_ns) / 1e3 for each in found],
        align="edge", color="#8fbbdb", edgecolor="#2b7bba", linewidth=0.4,
    )  # fmt: skip
    for each, rectangle in zip(found, bars, strict=True):
        if each.count:
            rectangle.set_gid(f"{title.split()[0]} bar {each.count}")
    for (name, field), dashes in zip(_MARKS, _DASHES, strict=True):
        value_us = max(getattr(distribution, field), _LEAST_NS) / 1e3
        line = axis.axvline(
            value_us, color="black", linewidth=1, linestyle=dashes,
            label=f"{name}: {_edge(getattr(distribution, field))} µs",
        )  # fmt: skip
        line.set_gid(f"{title.split()[0]} mark {name}")
    low, high = found[0].low_ns / 1e3, found[-1].high_ns / 1e3
    # Show at least a decade, so that a narrow distribution looks narrow.
    room = max(math.sqrt(10 * low / high), 1.1)
    axis.set_xlim(low / room, high * room)
    # Leave room for the legend above the bars.
    most = max(each.count for each in found)
    axis.set_ylim(_LOWEST, _LOWEST * (most / _LOWEST) ** (1 / _SHARE_OF_BARS))
    plain = ticker.FuncFormatter(
        lambda value, _: f"{value:g}" if value < 1e4 else _grouped(round(value))
    )
    few = math.log10(high * room / (low / room)) < 2
    axis.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5) if few else (1,), numticks=12))
    axis.xaxis.set_major_formatter(plain)
    axis.xaxis.set_minor_formatter(ticker.NullFormatter())
    axis.yaxis.set_major_locator(ticker.LogLocator(numticks=12))
    axis.yaxis.set_major_formatter(ticker.FuncFormatter(lambda value, _: _grouped(round(value))))
    axis.yaxis.set_minor_formatter(ticker.NullFormatter())
    axis.grid(axis="y", color="#d8dde1", linewidth=0.6)
    axis.set_axisbelow(True)
    axis.legend(loc="upper right")


def _bars(found: Sequence[Bin], distribution: runner_pb2.Distribution, width: int) -> Iterator[str]:
    most = max(each.count for each in found)
    digits = len(_grouped(most))
    marks = _marks(found, distribution)
    edges = max(len(_edge(each.high_ns)) for each in found)
    edges = max(edges, len(_edge(found[0].low_ns)))
    room = width - (2 * edges + 5) - digits - 2 - max(map(len, marks)) - 2
    room = min(max(room, _SHORTEST_BAR), _LONGEST_BAR)
    for is_gap, group in itertools.groupby(
        zip(found, marks, strict=True), lambda each: not each[0].count
    ):
        together = list(group)
        if is_gap and len(together) >= _FEWEST_FOLDED:
            yield f"{'…':>{2 * edges + 4}}"
            continue
        for each, mark in together:
            share = (1 + math.log10(each.count)) / (1 + math.log10(most)) if each.count else 0.0
            yield (
                f"{_edge(each.low_ns):>{edges}} to {_edge(each.high_ns):>{edges}} "
                f"{bar(share, room):<{room}} {_grouped(each.count):>{digits}}  {mark}"
            ).rstrip()


def _marks(found: Sequence[Bin], distribution: runner_pb2.Distribution) -> list[str]:
    """Return the marks beside each bin; percentiles are accurate to the width of a bucket."""
    names: list[list[str]] = [[] for _ in found]
    filled = [number for number, each in enumerate(found) if each.count]
    for name, field in _MARKS:
        value_ns = getattr(distribution, field)
        at = next((each for each in filled if found[each].high_ns >= value_ns), filled[-1])
        names[at].append(name)
    return [", ".join(each) for each in names]


def _edge(nanoseconds: float) -> str:
    microseconds = nanoseconds / 1e3
    return f"{microseconds:.{2 if microseconds < 10 else 1 if microseconds < 100 else 0}f}"


def _grouped(count: int) -> str:
    return f"{count:,}".replace(",", " ")
