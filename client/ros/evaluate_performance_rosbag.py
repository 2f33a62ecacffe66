#!/usr/bin/python3 -I
"""Evaluates the recorded cycles of a loop, as in Fig. 2 of the paper: histograms and statistics.

rosbag record -e '.*/rt_runner/cycles'
rosrun rtcf evaluate_performance_rosbag BAG FREQUENCY
"""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# The types of rtcf and of RTCF 2021; the latter has no cycle number.
_TYPES = ("rtcf_msgs/Cycle", "rtcf_msgs/IterationInfo")
_OF = " or ".join(_TYPES)
_QUANTILES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
_US = 1e-3  # of a ns


class Unusable(Exception):
    """The bag cannot be evaluated; the text says why."""


@dataclass
class Cycles:
    """The recorded times, one entry a cycle, in ns; in the order of the cycles."""

    begins: list[int]  # when the cycle began
    durations: list[int]
    lost: int  # cycles that the loop ran and the bag does not have
    runs: list[int]  # index of the first cycle of each start of the loop


def read(bag: Path, topic: str) -> tuple[str, Cycles]:
    """Return the topic and its cycles; an empty `topic` selects that of the only loop."""
    try:
        import rosbag  # takes a while
    except ImportError:
        raise Unusable("reading bags needs the package python3-rosbag: install it") from None
    try:
        with rosbag.Bag(str(bag)) as opened:
            found = {
                name: info.msg_type
                for name, info in opened.get_type_and_topic_info().topics.items()
                if info.msg_type.endswith(("/Cycle", "/IterationInfo"))
            }
            chosen = _choose(bag, topic, found)
            return chosen, _cycles(message for _, message, _ in opened.read_messages([chosen]))
    except OSError as error:
        raise Unusable(f"cannot read {bag}: {error.strerror}") from None
    except rosbag.ROSBagException as error:
        raise Unusable(f"{bag}: {error}; `rosbag reindex` may repair it") from None


def _choose(bag: Path, topic: str, found: dict[str, str]) -> str:
    if topic:
        if topic not in found:
            raise Unusable(
                f"{bag} has no {topic} of type {_OF}; it has: {', '.join(found) or 'none'}"
            )
        return topic
    if not found:
        raise Unusable(
            f"{bag} has no topic of type {_OF}: record it with `rosbag record -e "
            "'.*/rt_runner/cycles'`"
        )
    # If both topics of a loop were recorded, use Cycle, which has more fields.
    better = {name.rpartition("/")[0] for name, kind in found.items() if kind.endswith("/Cycle")}
    loops = [
        name
        for name, kind in found.items()
        if kind.endswith("/Cycle") or name.rpartition("/")[0] not in better
    ]
    if len(loops) > 1:
        raise Unusable(f"{bag} has several loops: choose one by --topic: {', '.join(loops)}")
    return loops[0]


def _cycles(messages: Iterable[Any]) -> Cycles:
    cycles = Cycles([], [], 0, [0])
    last = -1
    for message in messages:
        if hasattr(message, "header"):
            begin = message.header.stamp.to_nsec() + message.latency_ns
            iteration = message.iteration
        else:
            begin = message.stamp.to_nsec()
            iteration = last + 1
        if iteration <= last:
            cycles.runs.append(len(cycles.begins))
        elif last >= 0:
            cycles.lost += iteration - last - 1
        last = iteration
        cycles.begins.append(begin)
        cycles.durations.append(int(message.duration_ns))
    return cycles


def jitter(cycles: Cycles, period_ns: float) -> list[float]:
    """Return the deviation of each interval between cycles from a multiple of the period, in ns."""
    runs = set(cycles.runs)
    found = []
    for index in range(1, len(cycles.begins)):
        if index in runs:
            continue
        between = cycles.begins[index] - cycles.begins[index - 1]
        # After a lost message or a missed cycle several periods have passed.
        periods = max(1, round(between / period_ns))
        found.append(between - periods * period_ns)
    return found


def summary(values_ns: Sequence[float]) -> dict[str, float]:
    """Return mean, quantiles and extremes of the values, in µs."""
    ordered = sorted(values_ns)
    result = {"min": ordered[0], "mean": sum(ordered) / len(ordered)}
    for name, quantile in _QUANTILES.items():
        # At least this share of the values is no larger.
        result[name] = ordered[min(len(ordered) - 1, int(quantile * len(ordered)))]
    result["max"] = ordered[-1]
    return {name: round(value * _US, 3) for name, value in result.items()}


def evaluate(cycles: Cycles, frequency: float) -> dict[str, Any]:
    """Return the results, by name."""
    period_ns = 1e9 / frequency
    deviations = jitter(cycles, period_ns)
    if not deviations:
        raise Unusable(f"{len(cycles.begins)} cycles are too few to evaluate: record at least 2")
    return {
        "cycles": len(cycles.begins),
        "lost": cycles.lost,
        "overruns": sum(duration >= period_ns for duration in cycles.durations),
        "duration_us": summary(cycles.durations),
        # Absolute values: early and late cycles count alike.
        "jitter_us": summary([abs(each) for each in deviations]),
    }


def plot(cycles: Cycles, frequency: float, title: str, file: Path) -> None:
    """Write two histograms with logarithmic counts."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        raise Unusable("plotting needs the package python3-matplotlib: install it") from None

    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
    figure.suptitle(title)
    panels: tuple[tuple[Sequence[float], str], ...] = (
        (cycles.durations, "(a) calculation duration [µs]"),
        (jitter(cycles, 1e9 / frequency), "(b) scheduling jitter [µs]"),
    )
    for axis, (values, label) in zip(axes, panels, strict=True):
        axis.hist([value * _US for value in values], bins=100, log=True)
        limit = summary([abs(value) for value in values])["p999"]
        axis.axvline(limit, color="black", linestyle="--", label=f"99.9 %: {limit:.1f} µs")
        axis.set_xlabel(label)
        axis.set_ylabel("cycles")
        axis.legend()
    figure.savefig(file, dpi=150)


def table(topic: str, numbers: dict[str, Any]) -> str:
    """Return the results as text."""
    rows = (("calculation duration", "duration_us"), ("scheduling jitter", "jitter_us"))
    names = list(numbers["duration_us"])
    lines = [
        f"{topic}: {_counted(numbers['cycles'], 'cycle')}, "
        f"{_counted(numbers['lost'], 'message')} lost, {_counted(numbers['overruns'], 'overrun')}",
        "µs".ljust(22) + "".join(f"{name:>10}" for name in names),
    ]
    lines += [
        f"{label:22}" + "".join(f"{numbers[key][name]:10.3f}" for name in names)
        for label, key in rows
    ]
    return "\n".join(lines)


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _frequency(text: str) -> float:
    value = float(text)
    if not 0.0 < value < float("inf"):
        raise ValueError
    return value


def main(arguments: Sequence[str] | None = None) -> int:
    """Evaluate a bag; return the exit status: 0 success, 1 the bag cannot be evaluated, 2 usage."""
    parser = argparse.ArgumentParser(
        prog="evaluate_performance_rosbag",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "bag", type=Path, metavar="BAG", help="a bag with a loop's topic cycles or iteration_info"
    )
    parser.add_argument(
        "frequency", type=_frequency, metavar="FREQUENCY", help="nominal frequency of the loop, Hz"
    )
    parser.add_argument("--topic", default="", help="loop topic, if the bag has several")
    parser.add_argument("--png", type=Path, help="file of the plot (default: BAG.evaluation.png)")
    parser.add_argument("--json", action="store_true", help="print the numbers as JSON")
    given = parser.parse_args(arguments)
    try:
        topic, cycles = read(given.bag, given.topic)
        numbers = evaluate(cycles, given.frequency)
        file = given.png or given.bag.with_name(f"{given.bag.name}.evaluation.png")
        try:
            plot(cycles, given.frequency, f"{topic} at {given.frequency:g} Hz", file)
        except OSError as error:
            raise Unusable(f"cannot write {file}: {error.strerror}") from None
    except Unusable as problem:
        print(f"evaluate_performance_rosbag: {problem}", file=sys.stderr)
        return 1
    print(json.dumps(numbers, indent=2) if given.json else f"{table(topic, numbers)}\n{file}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
