"""Results of the demo: checks them, and prints them with the statistics of the loop."""

from dataclasses import dataclass
from typing import Any

import figure
from rtcf.v1 import graph_pb2, runner_pb2

_STATISTICS = ("min_ns", "mean_ns", "p50_ns", "p99_ns", "p999_ns", "max_ns")
_COLUMNS = ("min", "mean", "p50", "p99", "p99.9", "max")
_LARGEST = 1e20  # a Mimo's sum never exceeds it


@dataclass(frozen=True)
class Outcome:
    """Results of one run; `g1` and `g2` are the last reports of the ROS nodes."""

    seconds: float
    frequency_hz: float
    order: list[str]
    status: runner_pb2.RunnerStatus
    statistics: runner_pb2.RunnerStatistics
    answer: graph_pb2.PortInfo  # the input of R2 that reads G2's values
    g1: dict[str, Any]
    g2: dict[str, Any]


def show(outcome: Outcome, errors: list[str]) -> int:
    """Print the outcome and all errors; return the exit status, 1 if there are errors.

    `errors` are those of ending the processes.
    """
    status, g1, g2 = outcome.status, outcome.g1, outcome.g2
    print("\nResults")
    print(f"  order       {' → '.join(name[1:] for name in outcome.order)}")
    print(
        f"  cycles      {status.iteration} run, {status.overruns} of them late; "
        f"{status.missed} missed"
    )
    print(f"\n  µs                   {''.join(f'{column:>10}' for column in _COLUMNS)}")
    for name, histogram in (
        ("calculation duration", outcome.statistics.duration),
        ("wake-up latency", outcome.statistics.latency),
    ):
        values = "".join(f"{getattr(histogram, each) / 1e3:>10.2f}" for each in _STATISTICS)
        print(f"  {name:<21}{values}")
    print(f"\n  G1          received {_of(g1, status)} of /R1_H1R2, last value {g1['newest']}")
    print(f"  G2          received {_of(g2, status)} of /R3_G2H1, last value {g2['newest']};")
    print(
        f"              published {g2['sent']} values on /G2_R2, last value in R2 "
        f"{outcome.answer.value.removeprefix('data: ')}"
    )
    _show_realtime(status)
    errors = _errors(outcome) + errors
    for error in errors:
        print(f"\n  ERROR: {error}")
    if not errors:
        print("\n  All checks passed: the order, every message, and the exit of every process.")
    return 1 if errors else 0


def _of(report: dict[str, Any], status: runner_pb2.RunnerStatus) -> str:
    return f"{report['received']} of {status.iteration} values"


def _show_realtime(status: runner_pb2.RunnerStatus) -> None:
    settings = status.settings
    cpu = "the last CPU" if settings.cpu < 0 else f"CPU {settings.cpu}"
    if not status.degraded:
        print(f"\n  real time   yes: SCHED_FIFO {settings.priority} on {cpu}, memory locked")
        return
    print("\n  real time   NO:")
    for line in status.degraded:
        print(f"              - {line}")


def _errors(outcome: Outcome) -> list[str]:
    status = outcome.status
    found = []
    if outcome.order != figure.ORDER:
        found.append(f"wrong order, expected {' '.join(figure.ORDER)}")
    for name, report in (("G1", outcome.g1), ("G2", outcome.g2)):
        lost = status.iteration - report["received"]
        if lost != 0:
            found.append(f"{name} did not receive each value exactly once: {lost} missing")
        newest = report["newest"]
        if report["not_finite"] or newest is None or not 0 < newest <= _LARGEST:
            found.append(f"{name} received values outside the range of the sums")
    if status.tap_dropped:
        found.append(f"{status.tap_dropped} values were dropped between the loop and ROS")
    if not outcome.answer.HasField("value"):
        found.append("R2 read no value from G2")
    if status.state != runner_pb2.RUNNER_STATE_STOPPED:
        found.append(f"the loop did not stop in order: {status.status}")
    # On a busy machine the loop misses cycles, but it must count each of them.
    due = outcome.seconds * outcome.frequency_hz
    if status.iteration + status.missed < 0.9 * due:
        found.append(
            f"{due:g} cycles were due, but the loop counted {status.iteration} run "
            f"and {status.missed} missed"
        )
    return found
