"""What came of the demo: figures for people, and whether all was as it should be."""

from dataclasses import dataclass
from typing import Any

import figure
from rtcf.v1 import runner_pb2

_FIGURES = ("min_ns", "mean_ns", "p50_ns", "p99_ns", "p999_ns", "max_ns")
_COLUMNS = ("min", "mean", "p50", "p99", "p99.9", "max")
_LARGEST = 1e20  # a Mimo's sum never exceeds it


@dataclass(frozen=True)
class Outcome:
    """What the run left; `g1` and `g2` are the nodes' last reports."""

    seconds: float
    frequency_hz: float
    order: list[str]
    status: runner_pb2.RunnerStatus
    statistics: runner_pb2.RunnerStatistics
    answers: int  # values of G2 that R2 has taken
    g1: dict[str, Any]
    g2: dict[str, Any]


def show(outcome: Outcome, problems: list[str]) -> int:
    """Print the outcome; return 1 if anything is wrong with it or `problems` are given."""
    status, g1, g2 = outcome.status, outcome.g1, outcome.g2
    print("\nWhat came of it")
    print(f"  order       {' → '.join(name[1:] for name in outcome.order)}")
    print(
        f"  cycles      {status.iteration}, of which {status.overruns} ended late; "
        f"{status.missed} more were due and dropped for that"
    )
    print(f"\n  µs                   {''.join(f'{column:>10}' for column in _COLUMNS)}")
    for name, figures in (
        ("calculation duration", outcome.statistics.duration),
        ("wake-up latency", outcome.statistics.latency),
    ):
        values = "".join(f"{getattr(figures, each) / 1e3:>10.2f}" for each in _FIGURES)
        print(f"  {name:<21}{values}")
    print(f"\n  G1          received {_of(g1, status)} of /R1_H1R2, the last is {g1['newest']}")
    print(f"  G2          received {_of(g2, status)} of /R3_G2H1, the last is {g2['newest']};")
    print(
        f"              answered {g2['sent']} times on /G2_R2; R2 took {outcome.answers} of these"
    )
    _show_realtime(status)
    problems = _problems(outcome) + problems
    for problem in problems:
        print(f"\n  NOT RIGHT: {problem}")
    if not problems:
        print("\n  All is right: the order, every message, and every process has ended in order.")
    return 1 if problems else 0


def _of(report: dict[str, Any], status: runner_pb2.RunnerStatus) -> str:
    return f"{report['received']} of {status.iteration} values"


def _show_realtime(status: runner_pb2.RunnerStatus) -> None:
    settings = status.settings
    cpu = "the last CPU" if settings.cpu < 0 else f"CPU {settings.cpu}"
    if not status.degraded:
        print(f"\n  real time   yes: SCHED_FIFO {settings.priority} on {cpu}, memory locked")
        return
    print("\n  real time   NO, this machine did not give all of it:")
    for line in status.degraded:
        print(f"              - {line}")


def _problems(outcome: Outcome) -> list[str]:
    status = outcome.status
    found = []
    if outcome.order != figure.ORDER:
        found.append(f"the order should be {' '.join(figure.ORDER)}")
    for name, report in (("G1", outcome.g1), ("G2", outcome.g2)):
        lost = status.iteration - report["received"]
        if lost != 0:
            found.append(f"{name} did not get each value once: {lost} are missing")
        newest = report["newest"]
        if report["not_finite"] or newest is None or not 0 < newest <= _LARGEST:
            found.append(f"{name} got values that no sum can have")
    if status.tap_dropped:
        found.append(f"{status.tap_dropped} values were lost on their way out of the loop")
    if outcome.answers == 0:
        found.append("no answer of G2 has reached R2")
    if status.state != runner_pb2.RUNNER_STATE_STOPPED:
        found.append(f"the loop did not stop in order: {status.status}")
    # A machine that is busy elsewhere makes the loop drop cycles; it must know of each.
    due = outcome.seconds * outcome.frequency_hz
    if status.iteration + status.missed < 0.9 * due:
        found.append(f"{due:g} cycles were due, the loop knows of {status.iteration}")
    return found
