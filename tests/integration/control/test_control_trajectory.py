"""rtcf_control/TrajectoryGenerator against analytic motions and ruckig.

Tolerances: positions, velocities and accelerations of size 1 differ from analytic ones by less than
ROUNDING; velocity and acceleration exceed no limit by more than ROUNDING, and change between cycles
by no more than the jerk allows. Durations differ from ruckig's by less than 1 %. The C++ tests in
tests/unit/cpp/control cover nested messages, which a bench cannot send.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from block_bench import PATH, Stepped, rejection
from daemon_process import BUILD_TREE
from pages import TREE
from rtcf.testing import Bench

DT = 0.001
ROUNDING = 1e-8
VELOCITY, ACCELERATION, JERK = 2.0, 4.0, 16.0
LIMITS: dict[str, Any] = {"velocity": "2", "acceleration": "4", "jerk": "16"}
QUOTED = {name: f'"{value}"' for name, value in LIMITS.items()}  # a text, not a number
MASKED: Any = np.ma
_RUCKIG = "ruckig==0.19.4"


@pytest.fixture(scope="module")
def arm() -> Iterator[Bench]:
    with Bench(
        "rtcf_control/TrajectoryGenerator", path=PATH, joints="a b c", initial="0 0.5 -1", **LIMITS
    ) as bench:
        yield bench


def rows_at(cycles: dict[int, Any], steps: int) -> Any:
    """Return a column of messages that are sent in some cycles only."""
    width = len(next(iter(cycles.values())))
    values = np.zeros((steps, width))
    sent = np.zeros(steps, dtype=bool)
    for cycle, row in cycles.items():
        values[cycle], sent[cycle] = row, True
    return MASKED.array(values, mask=np.repeat(~sent[:, None], width, axis=1))


def motion_of(arm: Bench, inputs: dict[str, Any], steps: int) -> tuple[Any, Any, Any, Any]:
    """Return positions, velocities, accelerations and the response of two equal runs."""
    names = ("point.positions", "point.velocities", "point.accelerations")
    first = arm.run(inputs, steps)
    again = arm.run(inputs, steps)
    for name in names:
        assert again[name].tobytes() == first[name].tobytes(), "the same inputs gave other outputs"
    position, velocity, acceleration = (first[name] for name in names)
    return position, velocity, acceleration, first


def assert_smooth(position: Any, velocity: Any, acceleration: Any) -> None:
    assert np.max(np.abs(velocity)) <= VELOCITY + ROUNDING
    assert np.max(np.abs(acceleration)) <= ACCELERATION + ROUNDING
    assert np.max(np.abs(np.diff(acceleration, axis=0))) <= JERK * DT + ROUNDING
    left = np.diff(velocity, axis=0) - DT * acceleration[:-1]
    assert np.max(np.abs(left)) <= JERK * DT**2 / 2 + ROUNDING
    left = np.diff(position, axis=0) - DT * (velocity[:-1] + DT / 2 * acceleration[:-1])
    assert np.max(np.abs(left)) <= JERK * DT**3 / 6 + ROUNDING


def test_joints_arrive_together_in_the_analytic_time(arm: Bench) -> None:
    target = [3.0, 1.0, -1.5]
    position, velocity, acceleration, response = motion_of(
        arm, {"target.position": rows_at({1: target}, 3000)}, 3000
    )
    assert_smooth(position, velocity, acceleration)
    assert position[0].tolist() == [0.0, 0.5, -1.0]
    duration = 3.0 / VELOCITY + VELOCITY / ACCELERATION + ACCELERATION / JERK
    arrival = math.ceil(duration / DT - 1e-6)
    done = response["done"].astype(bool)
    assert done[0] and not done[1:arrival].any() and done[arrival:].all()
    assert position[arrival].tolist() == target
    assert (velocity[arrival - 10] != 0.0).all()
    assert response["command.position"].tobytes() == position.tobytes()
    assert response["command.velocity"].tobytes() == velocity.tobytes()


@pytest.mark.parametrize("moving", [False, True], ids=["at rest", "moving"])
def test_targets_that_change_while_moving_exceed_no_limit(arm: Bench, moving: bool) -> None:
    steps = 20_000
    draw = np.random.default_rng(29)
    times = np.cumsum(draw.integers(1, 300, size=steps))
    cycles = [int(each) for each in times if each < steps]
    inputs = {"target.position": rows_at({c: draw.uniform(-3, 3, 3) for c in cycles}, steps)}
    if moving:
        inputs["target.velocity"] = rows_at({c: draw.uniform(-2, 2, 3) for c in cycles}, steps)
    position, velocity, acceleration, response = motion_of(arm, inputs, steps)
    assert_smooth(position, velocity, acceleration)
    assert response["rejected"][-1] == 0


def test_values_that_are_not_finite_are_rejected(arm: Bench) -> None:
    good = {1: [1.0, 1.0, 1.0]}
    expected = motion_of(arm, {"target.position": rows_at(good, 500)}, 500)[0]
    bad = good | {100: [math.nan, 0.0, 0.0], 200: [0.0, 0.0, math.inf]}
    position, _, _, response = motion_of(arm, {"target.position": rows_at(bad, 500)}, 500)
    assert position.tobytes() == expected.tobytes()
    assert response["rejected"][-1] == 2


def test_nothing_is_written_before_a_measurement() -> None:
    with Bench("rtcf_control/TrajectoryGenerator", path=PATH, joints="a b") as bench:
        measured = rows_at({10: [0.5, -0.5]}, 20)
        response = bench.run({"measured.position": measured}, 20)
        assert response.written["command"].tolist() == [i >= 10 for i in range(20)]
        assert response["command.position"][-1].tolist() == [0.5, -0.5]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"joints": ""}, "joints has 0 names; write 1 to 16"),
        ({"joints": " ".join(f"j{i}" for i in range(17))}, "joints has 17 names; write 1 to 16"),
        ({"velocity": "1 2"}, "velocity has 2 numbers; write one for all joints, or 1"),
        ({"jerk": "-1"}, "jerk: -1 is not finite and above 0"),
        ({"lower": "1", "upper": "0"}, "joint joint1: lower = 1 is above upper = 0"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    stepped: Bench, parameters: dict[str, str], said: str
) -> None:
    with rejection(said):
        Stepped(
            stepped,
            "TrajectoryGenerator",
            **{name: f'"{text}"' for name, text in parameters.items()},
        )


def test_a_trajectory_is_followed_and_its_tail_replaced(stepped: Bench) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a b", initial="0 0", **QUOTED)
    try:
        block.step()
        block.write(
            trajectory="{joint_names: [b, a], points: ["
            "{positions: [0.5, 1.0], velocities: [0, 0], time_from_start: {secs: 1, nsecs: 0}}]}"
        )
        block.step(501)
        assert block.state["position"][:2] == pytest.approx([0.5, 0.25], abs=ROUNDING)
        block.write(
            trajectory="{joint_names: [a, b], points: ["
            "{positions: [0.5, 0.5], velocities: [0, 0], time_from_start: {secs: 1, nsecs: 0}}]}"
        )
        assert block.step(1001)["position"][:2] == [0.5, 0.5]
        assert block.state["rejections"] == 0
    finally:
        block.unload()


def table_of_stops() -> tuple[dict[str, str], float]:
    """Return the table of docs/control/trajectory.md by limit, and the longest stop in s."""
    text = (TREE / "docs" / "control" / "trajectory.md").read_text(encoding="utf-8")
    section = text.partition("\n## Stops\n")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (\w+) \| (\w+)[:;]", section, re.MULTILINE)
    formula = re.search(r"at most (\d) V/A \+ (\d) A/J \+ (\d) √\(V/J\) after", section)
    assert formula is not None
    of_v, of_a, of_both = map(int, formula.groups())
    longest = of_v * VELOCITY / ACCELERATION + of_a * ACCELERATION / JERK
    return dict(rows), longest + of_both * math.sqrt(VELOCITY / JERK)


def test_stops_keep_the_limits_of_the_table_in_the_docs(stepped: Bench) -> None:
    gives_way, longest = table_of_stops()
    assert gives_way == {
        "jerk": "first", "acceleration": "next", "velocity": "never", "position": "never"
    }  # fmt: skip
    draw = np.random.default_rng(41)
    block = Stepped(stepped, "TrajectoryGenerator", joints="a", initial='"0"', lower='"-1"',
                    upper='"1"', **QUOTED)  # fmt: skip
    try:
        block.step()
        for _ in range(8):
            start = block.state["position"][0]
            # A short polynomial, whose accelerations may exceed their limit by far.
            end = float(np.clip(start + draw.uniform(-0.3, 0.3), -0.99, 0.99))
            duration = max(0.05, 2.0 * abs(end - start) / VELOCITY)
            nsecs = round(1e9 * duration)
            block.write(
                trajectory="{joint_names: [a], points: [{"
                f"positions: [{end}], velocities: [0], "
                f"time_from_start: {{secs: {nsecs // 10**9}, nsecs: {nsecs % 10**9}}}}}]}}"
            )
            block.step(int(draw.integers(1, round(duration / DT))))
            block.write(halt=True)
            for _ in range(math.ceil(longest / DT / 100)):
                state = block.step(100)
                assert abs(state["commanded_velocity"][0]) <= VELOCITY + ROUNDING
                assert abs(state["position"][0]) <= 1.0 + ROUNDING
            assert state["commanded_velocity"][0] == 0.0
            block.step(halt=False)
        assert block.state["rejections"] == 0
    finally:
        block.unload()


def test_new_limits_and_a_replacement_do_not_jump(stepped: Bench) -> None:
    given: dict[str, Any] = {"joints": "a", "initial": '"0"', **QUOTED}
    block = Stepped(stepped, "TrajectoryGenerator", **given)
    try:
        block.step()
        before = block.step(800, target="{position: [9.0]}")
        assert before["commanded_velocity"][0] == pytest.approx(VELOCITY)
        block.set(velocity='"1"')
        after = block.step()
        assert after["commanded_velocity"][0] == pytest.approx(VELOCITY, abs=JERK * DT**2)
        slow = block.step(1000)["commanded_velocity"][0]
        assert slow == pytest.approx(1.0)
        block.client.replace("/stepped/block", block.spec(**{**given, "velocity": '"1"'}))
        assert block.step()["commanded_velocity"][0] == pytest.approx(1.0)
        assert block.step(20_000)["position"][0] == 9.0
    finally:
        block.unload()


def linear(position: float, seconds: int) -> str:
    """Return a trajectory of one joint with one linear segment."""
    return (
        f"{{joint_names: [a], points: [{{positions: [{position}], "
        f"time_from_start: {{secs: {seconds}, nsecs: 0}}}}]}}"
    )


@pytest.mark.parametrize("change", [{"velocity": '"0.05"'}, {"upper": '"0.3"'}, {"lower": '"0.2"'}])
def test_the_rest_of_a_trajectory_keeps_new_limits(stepped: Bench, change: dict[str, str]) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a", initial='"0"', **QUOTED)
    try:
        block.step()
        goal = -1.0 if "lower" in change else 1.0
        before = block.step(300, trajectory=linear(goal, 2))
        assert abs(before["commanded_velocity"][0]) == pytest.approx(0.5)
        block.set(**change)
        after = block.step(1000)
        assert after["rejections"] == 1
        assert after["commanded_velocity"][0] == 0.0
        assert abs(after["position"][0]) < 0.35
    finally:
        block.unload()


def test_a_stop_under_way_keeps_a_new_limit_of_position(stepped: Bench) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a", initial='"0"', **QUOTED)
    try:
        block.step()
        state = block.step(800, target="{position: [9.0]}")
        assert state["commanded_velocity"][0] == pytest.approx(VELOCITY)
        block.step(halt=True)
        brakes_in = VELOCITY**2 / (2.0 * ACCELERATION)
        limit = state["position"][0] + brakes_in + 0.02  # without a jerk limit, it stands before
        block.set(upper=f'"{limit}"')
        farthest = max(block.step(10)["position"][0] for _ in range(200))
        assert farthest <= limit + ROUNDING
        assert block.state["commanded_velocity"][0] == 0.0
    finally:
        block.unload()


def test_a_lost_trajectory_stops_the_joints(stepped: Bench) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a", initial='"0"', **QUOTED)
    try:
        block.step()
        assert block.step(300, trajectory=linear(1.0, 2))["rejections"] == 0
        for number in range(12):
            block.write(trajectory=linear(1.0 + number, 20))
        block.write(trajectory="{points: []}")
        after = block.step(1000)
        assert after["commanded_velocity"][0] == 0.0
        assert after["position"][0] < 0.4
        assert after["rejections"] == 8
        block.step(100, trajectory=linear(1.0, 2))
        assert block.state["commanded_velocity"][0] > 0.0, "the next one is followed"
    finally:
        block.unload()


def test_an_old_measured_position_begins_no_motion(stepped: Bench) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a", **QUOTED)
    try:
        block.step(300, measured="{name: [a], position: [0.5]}", idle=True)
        after = block.step(300, idle=False, target="{position: [1.0]}")
        assert after["rejections"] >= 1
        assert not after["begun"]
        after = block.step(measured="{name: [a], position: [0.3]}")
        assert after["position"][0] == 0.3
        assert block.step(300)["position"][0] == 0.3, "no target from before"
    finally:
        block.unload()


def test_a_snapshot_continues_a_motion_to_a_target_bit_by_bit(stepped: Bench) -> None:
    block = Stepped(stepped, "TrajectoryGenerator", joints="a b", initial="0 1", **QUOTED)
    try:
        block.step(300, target="{position: [2.0, 0.5], velocity: [0.5, 0.0]}")
        taken = stepped.client.take_snapshot().snapshot
        first = block.step(900)
        block.step(10, target="{position: [0.0, 0.0]}")
        stepped.client.restore_snapshot(taken)
        assert block.step(900) == first
    finally:
        block.unload()


@pytest.fixture(scope="session")
def ruckig_python() -> Path:
    """A Python that has ruckig."""
    folder = BUILD_TREE / "venv-ruckig"
    python = folder / "bin" / "python"
    asked = [str(python), "-c", "import importlib.metadata as m; print(m.version('ruckig'))"]
    if (
        not python.exists()
        or subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
        != _RUCKIG.partition("==")[2]
    ):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, _RUCKIG], check=True)
    return python


def test_motions_last_no_longer_than_those_of_ruckig(ruckig_python: Path) -> None:
    compared = subprocess.run(
        [ruckig_python, TREE / "tests" / "control" / "trajectory" / "compare_with_ruckig.py",
         BUILD_TREE / "tests" / "control" / "rtcf_plan_cases", "--cases", "4000", "--seed", "29"],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert compared.returncode == 0, compared.stdout + compared.stderr
