#!/usr/bin/env python3
"""Compares the planner of rtcf_control with ruckig (PyPI) on random targets and re-plans.

usage: compare_with_ruckig.py PLAN_CASES [--cases N] [--seed N]

PLAN_CASES is the program built from plan_cases.cpp. The second half of the cases begins in the
middle of the motions of the first half. Requires the PyPI package ruckig 0.19. The exit status is 1
if a duration is longer by more than 1 %, a limit is exceeded, or a motion jumps.
"""

import argparse
import dataclasses
import random
import subprocess
import sys
from collections.abc import Iterator

import ruckig

DURATION_TOLERANCE = 0.01  # relative
LIMIT_TOLERANCE = 1e-9  # relative to the limit
GAP_TOLERANCE = 1e-9  # relative to sizes of the motion


@dataclasses.dataclass
class Axis:
    """Begin, target and limits of an axis."""

    position: float
    velocity: float
    acceleration: float
    target: float
    target_velocity: float
    largest_velocity: float
    largest_acceleration: float
    largest_jerk: float

    def line(self, scale: float) -> str:
        """Input of plan_cases, in other units."""
        return " ".join(repr(value * scale) for value in dataclasses.astuple(self))


@dataclasses.dataclass
class Plan:
    """Output of plan_cases for a case."""

    error: int
    duration: float
    excess: float
    gap: float
    rounding: float
    axes: list[list[float]]  # shortest duration, position, velocity, acceleration


def draw_target(axis: Axis, draw: random.Random) -> None:
    """Draws a target near or far, at rest or moving."""
    reach = axis.largest_velocity * (
        axis.largest_velocity / axis.largest_acceleration
        + axis.largest_acceleration / axis.largest_jerk
    )
    axis.target = axis.position + reach * draw.choice([-1, 1]) * 10 ** draw.uniform(-3, 1)
    axis.target_velocity = 0.0
    if draw.random() < 0.5:
        axis.target_velocity = axis.largest_velocity * draw.uniform(-1, 1)


def draw_round_axis(draw: random.Random) -> Axis:
    """Draws an axis with round numbers: limits that meet, and states at the limits."""
    limits = [draw.choice([0.5, 1.0, 2.0]) for _ in range(3)]
    parts = [-1.0, -0.5, 0.0, 0.5, 1.0]
    return Axis(
        0.0,
        limits[0] * draw.choice(parts),
        limits[1] * draw.choice(parts),
        draw.choice([-4.0, -1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0, 4.0]),
        limits[0] * draw.choice(parts),
        *limits,
    )


def draw_axis(draw: random.Random) -> Axis:
    """Draws an axis: at rest, moving within its limits, beyond them, or with round numbers."""
    if draw.random() < 0.2:
        return draw_round_axis(draw)
    limits = [10 ** draw.uniform(-1, 1) for _ in range(3)]
    axis = Axis(draw.uniform(-3, 3), 0.0, 0.0, 0.0, 0.0, *limits)
    kind = draw.random()
    if kind > 0.3:
        size = 1.0 if kind < 0.8 else 2.0
        axis.velocity = size * limits[0] * draw.uniform(-1, 1)
        axis.acceleration = size * limits[1] * draw.uniform(-1, 1)
    draw_target(axis, draw)
    return axis


def plan(program: str, cases: list[list[Axis]], scales: list[float], fraction: float) -> list[Plan]:
    """Plans all cases with rtcf_control."""
    lines = [
        " ".join([str(len(case)), repr(fraction), *(axis.line(scale) for axis in case)])
        for case, scale in zip(cases, scales, strict=True)
    ]
    output = subprocess.run(
        [program], input="\n".join(lines) + "\n", capture_output=True, text=True, check=True
    ).stdout
    plans = []
    for line in output.splitlines():
        error, *numbers = line.split()
        duration, excess, gap, rounding, *rest = (float(number) for number in numbers)
        axes = [rest[i : i + 4] for i in range(0, len(rest), 4)]
        plans.append(Plan(int(error), duration, excess, gap, rounding, axes))
    return plans


def duration_of_ruckig(case: list[Axis]) -> float | None:
    """The duration of ruckig's motion, or None if it fails."""
    planner = ruckig.Ruckig(len(case))
    task = ruckig.InputParameter(len(case))
    task.current_position = [axis.position for axis in case]
    task.current_velocity = [axis.velocity for axis in case]
    task.current_acceleration = [axis.acceleration for axis in case]
    task.target_position = [axis.target for axis in case]
    task.target_velocity = [axis.target_velocity for axis in case]
    task.max_velocity = [axis.largest_velocity for axis in case]
    task.max_acceleration = [axis.largest_acceleration for axis in case]
    task.max_jerk = [axis.largest_jerk for axis in case]
    trajectory = ruckig.Trajectory(len(case))
    try:
        result = planner.calculate(task, trajectory)
    except (ruckig.RuckigError, ValueError):
        return None
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        return None
    return float(trajectory.duration)


def replans(
    cases: list[list[Axis]], plans: list[Plan], draw: random.Random
) -> Iterator[list[Axis]]:
    """Cases that begin in the middle of motions, with other targets."""
    for case, made in zip(cases, plans, strict=True):
        again = []
        for axis, (_, *motion) in zip(case, made.axes, strict=True):
            moved = dataclasses.replace(axis)
            moved.position, moved.velocity, moved.acceleration = motion
            draw_target(moved, draw)
            again.append(moved)
        yield again


def report(name: str, cases: list[list[Axis]], plans: list[Plan], shown: int) -> bool:
    """Compares plans and prints the result. Returns True if all is well.

    A shorter motion that ends at its target within its limits is no error: ruckig does not always
    find the shortest one if the start is at a limit.
    """
    shorter = longer = failed = bad = 0
    worst = 0.0
    for case, made in zip(cases, plans, strict=True):
        reference = duration_of_ruckig(case)
        problem = note = ""
        if made.error != 0:
            problem = f"error {made.error}"
        elif made.excess > LIMIT_TOLERANCE:
            problem = f"limit exceeded by {made.excess}"
        elif made.gap > GAP_TOLERANCE or made.rounding > GAP_TOLERANCE:
            problem = f"gap {made.gap}, rounding {made.rounding}"
        elif reference is None:
            failed += 1
        else:
            difference = (made.duration - reference) / max(reference, 1e-9)
            if difference > DURATION_TOLERANCE:
                longer += 1
                problem = f"{made.duration} s, ruckig {reference} s"
            elif difference < -DURATION_TOLERANCE:
                shorter += 1
                note = f"{made.duration} s, ruckig {reference} s (shorter)"
            else:
                worst = max(worst, abs(difference))
        bad += problem != ""
        if (problem or note) and shown > 0:
            shown -= 1
            print(f"  {problem or note}")
            for axis in case:
                print("   ", dataclasses.astuple(axis))
    print(
        f"{name}: {len(cases)} cases, {bad} bad, {longer} longer, {shorter} shorter, "
        f"{failed} without an answer of ruckig; others differ by at most {worst:.2g}; "
        f"excess {max(made.excess for made in plans):.2g}, "
        f"gap {max(made.gap for made in plans):.2g}, "
        f"rounding {max(made.rounding for made in plans):.2g}"
    )
    return bad == 0


def report_scales(cases: list[list[Axis]], plans: list[Plan], scaled: list[Plan]) -> bool:
    """Compares durations in other units, which must be the same."""
    worst = 0.0
    bad = 0
    for case, one, other in zip(cases, plans, scaled, strict=True):
        difference = abs(one.duration - other.duration) / max(one.duration, 1e-9)
        if difference > 1e-6 or other.excess > LIMIT_TOLERANCE or other.gap > GAP_TOLERANCE:
            bad += 1
            if bad < 3:
                print(f"  {one} {other} {case}")
        worst = max(worst, difference)
    print(f"other units: {len(cases)} cases, {bad} bad, durations differ by at most {worst:.2g}")
    return bad == 0


def main() -> int:
    """Runs all comparisons."""
    parser = argparse.ArgumentParser(description="compare the planner of rtcf_control with ruckig")
    parser.add_argument("program", help="program built from plan_cases.cpp")
    parser.add_argument("--cases", type=int, default=100_000, help="number of cases")
    parser.add_argument("--seed", type=int, default=1, help="seed of the cases")
    parser.add_argument("--show", type=int, default=5, help="print at most N cases that differ")
    options = parser.parse_args()
    draw = random.Random(options.seed)
    half = max(options.cases // 2, 1)
    cases = [[draw_axis(draw) for _ in range(draw.choice([1, 1, 1, 2, 3, 7]))] for _ in range(half)]
    units = [1.0] * half
    plans = plan(options.program, cases, units, draw.uniform(0.1, 0.9))
    good = report("targets", cases, plans, options.show)
    again = list(replans(cases, plans, draw))
    good &= report("re-plans", again, plan(options.program, again, units, 0.5), options.show)
    scaled = plan(options.program, cases, [10 ** draw.uniform(-6, 4) for _ in cases], 0.5)
    good &= report_scales(cases, plans, scaled)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
