"""The arm of rtcf_arm with its controllers: motion, emergency stops, faults, swaps.

Bounds: while it moves, each joint is within TRACKING of its commanded position. A controller that
is replaced by an equal one moves no joint by more than BUMP beyond that. After an emergency stop
all torques are 0 within two cycles; after a reset, no joint moves by more than STILL without a new
command.
"""

from __future__ import annotations

import random
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment, wait_for
from pages import TREE
from rtcf.testing import Bench
from rtcf_shared.graph_reader import read_graphs

ARM = BUILD_TREE / "devel" / "share" / "rtcf_arm"
PATH = [BUILD_TREE / "lib" / "rtcf"]
JOINTS = [f"joint{i}" for i in range(1, 7)]
TORQUES = [f"/{joint}/stop.out" for joint in JOINTS] + ["/gripper/stop.out"]
TRACKING = 0.03  # rad
BUMP = 0.002  # rad
STILL = 0.005  # rad
CYCLES = 1000  # per second
MASKED: Any = np.ma


@pytest.fixture
def arm(daemon: Daemon, client: rtcf.Client) -> rtcf.Client:
    """Return the client of an rtcfd with the stopped arm."""
    (graph,) = read_graphs((ARM / "arm.yaml").read_text(), "arm.yaml")
    client.apply(graph.components, settings=graph.settings)
    return client


def operate(client: rtcf.Client, **values: Any) -> None:
    """Set parameters of the operator."""
    words = [f"{name}:={str(value).lower()}" for name, value in values.items()]
    client.set_parameters("operator", [rtcf.parse_parameter(word) for word in words])


def values(client: rtcf.Client, *signals: str) -> list[float]:
    """Return present values of outputs, by "/component.port"."""
    found = []
    for component, _, port in (each.rpartition(".") for each in signals):
        (value,) = (
            each.value for each in client.get_component(component).ports if each.name == port
        )
        found.append(float(value.removeprefix("data: ")))
    return found


def positions(client: rtcf.Client) -> Any:
    """Return the measured positions of joints 1 to 6."""
    return np.array(values(client, *(f"/robot.{joint}_position" for joint in JOINTS)))


def velocities(client: rtcf.Client) -> Any:
    """Return the measured velocities of joints 1 to 6."""
    return np.array(values(client, *(f"/robot.{joint}_velocity" for joint in JOINTS)))


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """Yield a bench of the whole arm."""
    with Bench(str(ARM / "arm.yaml"), path=PATH) as bench:
        yield bench


def test_the_arm_follows_its_tour_and_repeats_it_bit_by_bit(bench: Bench) -> None:
    operate(bench.client, mode="tour")
    first = bench.run(steps=12 * CYCLES)
    for i, joint in enumerate(JOINTS, 1):
        measured: Any = first[f"/robot.{joint}_position"]
        wanted: Any = first[f"/setpoints.position{i}"]
        assert np.nanmax(np.abs(measured - wanted)) < TRACKING, joint
        assert np.ptp(wanted[~np.isnan(wanted)]) > 0.3, f"{joint} moves"
    second = bench.run(steps=12 * CYCLES)
    for joint in JOINTS:
        name = f"/robot.{joint}_position"
        assert second[name].tobytes() == first[name].tobytes()
    operate(bench.client, mode="stand")


def test_the_arm_moves_like_in_a_c_program_bit_by_bit(bench: Bench) -> None:
    operate(bench.client, mode="tour")
    found = bench.run(steps=10 * CYCLES)
    operate(bench.client, mode="stand")
    assert found["/robot.contacts"].min() > 0, "the block lies on the table"
    # The simulation is first in a cycle, so it gets the torques of the cycle before.
    torques = np.zeros((10 * CYCLES, len(TORQUES)))  # the gripper gets none
    torques[1:, :6] = np.column_stack([found[each] for each in TORQUES[:6]])[:-1]
    done = subprocess.run(
        [BUILD_TREE / "tests" / "mujoco" / "rtcf_step_model", ARM / "arm.xml", "0", "0.001", "1"],
        input=torques.tobytes(), stdout=subprocess.PIPE, check=True, timeout=300,
    )  # fmt: skip
    # Time, 15 coordinates of which 7 are of the block, 14 velocities of which 6 are.
    states = np.frombuffer(done.stdout).reshape(len(torques), 30)
    assert np.array_equal(found["/robot.time"], states[:, 0])
    for i, joint in enumerate(JOINTS):
        assert np.array_equal(found[f"/robot.{joint}_position"], states[:, 8 + i])
        assert np.array_equal(found[f"/robot.{joint}_velocity"], states[:, 22 + i])
    assert np.array_equal(found["/robot.block_pose.position.x"], states[:, 1])


@pytest.mark.long
def test_a_minute_is_the_same_bit_by_bit_on_a_loaded_machine(bench: Bench) -> None:
    operate(bench.client, mode="tour")
    alone = bench.run(steps=60 * CYCLES)
    with subprocess.Popen(["stress-ng", "--cpu", "2", "--cache", "1", "--timeout", "120"]) as load:
        beside = bench.run(steps=60 * CYCLES)
        load.terminate()
    operate(bench.client, mode="stand")
    assert alone["/robot.contacts"].max() > 0
    for name in alone:
        assert alone[name].tobytes() == beside[name].tobytes(), name


def test_sliders_and_a_goal_move_the_arm(arm: rtcf.Client) -> None:
    operate(arm, mode="sliders", joint1=0.8, joint5=0.5)
    arm.step(3 * CYCLES)
    assert positions(arm) == pytest.approx([0.8, 0.3, 1.6, 0.0, 0.5, 0.0], abs=STILL)
    operate(arm, mode="goal")
    goal = [-0.4, 0.1, 1.4, 0.3, 0.8, 0.2]
    arm.write("operator.goal", {"position": goal})
    arm.step(3 * CYCLES)
    assert positions(arm) == pytest.approx(goal, abs=STILL)


def test_without_a_target_the_arm_stands_in_its_first_pose(arm: rtcf.Client) -> None:
    arm.step(CYCLES)
    before = positions(arm)
    arm.step(2 * CYCLES)
    assert np.abs(positions(arm) - before).max() < STILL


@pytest.mark.parametrize("times", [8, pytest.param(1000, marks=pytest.mark.long)])
def test_an_emergency_stop_at_any_instant_ends_all_torques(arm: rtcf.Client, times: int) -> None:
    draw = random.Random(30)
    for _ in range(times):
        operate(arm, mode="tour")
        arm.step(draw.randrange(200, 1500))
        operate(arm, emergency_stop=True)
        arm.step(2)
        assert values(arm, *TORQUES) == [0.0] * len(TORQUES)
        arm.step(400)
        assert np.abs(velocities(arm)).max() < 1e-3, "the brakes hold it"
        held = positions(arm)
        operate(arm, emergency_stop=False)
        arm.step(10)
        assert values(arm, *TORQUES) == [0.0] * len(TORQUES), "it is latched"
        operate(arm, reset_stop=True)
        arm.step(CYCLES)
        assert np.abs(positions(arm) - held).max() < STILL, "no motion without a new command"
        operate(arm, reset_stop=False, mode="stand")
        arm.step(10)
        operate(arm, mode="tour")
        arm.step(CYCLES)
        assert np.abs(velocities(arm)).max() > 0.0
        assert np.abs(positions(arm) - held).max() > STILL, "it moves again"


def limits_of_the_trajectory() -> dict[str, Any]:
    """Return velocity, lower and upper of the joints."""
    (graph,) = read_graphs((ARM / "arm.yaml").read_text(), "arm.yaml")
    (found,) = (each for each in graph.components if each.name == "trajectory")
    texts = {each.name: each.value.string_value for each in found.parameters}
    return {name: np.array(texts[name].split(), float) for name in ("velocity", "lower", "upper")}


@pytest.mark.parametrize("stops", [6, pytest.param(1000, marks=pytest.mark.long)])
def test_a_halt_at_any_instant_keeps_all_limits(bench: Bench, stops: int) -> None:
    # Goals of the whole range: in some, the arm meets the table and the block. Then the commanded
    # motion still ends within its limits, but the arm is pushed away from it, and slides.
    limits = limits_of_the_trajectory()
    draw = np.random.default_rng(49)
    operate(bench.client, mode="goal")
    free = 0
    for _ in range(-(-stops // 20)):
        count = min(stops, 20)
        steps = 1500 * count
        goals, halt = MASKED.masked_all((steps, 6)), MASKED.masked_all(steps, dtype=bool)
        for begin in range(0, steps, 1500):
            goals[begin + 5] = draw.uniform(limits["lower"], limits["upper"])
            at = begin + int(draw.integers(10, 700))
            halt[at], halt[begin + 1495] = True, False
        found = bench.run({"/operator.goal.position": goals, "/trajectory.halt": halt}, steps)
        contacts = found["/robot.contacts"].reshape(count, 1500)
        alone = (contacts == contacts[0, 0]).all(axis=1)  # only the block touches the table
        free += int(alone.sum())
        for i, joint in enumerate(JOINTS):
            wanted, angle, measured, speed = (
                np.asarray(found[name]).reshape(count, 1500)
                for name in (
                    f"/setpoints.velocity{i + 1}",
                    f"/setpoints.position{i + 1}",
                    f"/robot.{joint}_position",
                    f"/robot.{joint}_velocity",
                )
            )
            assert np.nanmax(np.abs(wanted)) <= limits["velocity"][i] + 1e-9, joint
            assert (wanted[:, 1490] == 0.0).all(), joint
            for each, most in ((angle, 1e-9), (measured[alone], TRACKING)):
                assert np.nanmax(each) <= limits["upper"][i] + most, joint
                assert np.nanmin(each) >= limits["lower"][i] - most, joint
            assert np.abs(speed[alone, 1490]).max() < 0.05, joint
    operate(bench.client, mode="stand")
    assert stops * 0.7 < free and (stops < 100 or free < stops)


def test_a_fault_of_any_component_stops_the_arm_and_names_it(arm: rtcf.Client) -> None:
    (graph,) = read_graphs((ARM / "arm.yaml").read_text(), "arm.yaml")
    names = [each.full_name for each in arm.list_components() if each.full_name != "/robot"]
    assert len(names) > 30
    for place, spec in enumerate(graph.components):
        if spec.name == "robot":
            continue
        operate(arm, mode="tour")
        arm.step(CYCLES)
        faulty = rtcf.component("rtcf_faults", "Throws", parameters=["after:=100"])
        faulty.ns, faulty.name, faulty.every = spec.ns, spec.name, spec.every
        changed = [*graph.components[:place], faulty, *graph.components[place + 1 :]]
        arm.apply(changed, settings=graph.settings)
        assert arm.step(CYCLES).cycles < CYCLES
        name = names.pop(names.index(f"{spec.ns.rstrip('/')}/{spec.name}"))
        assert arm.get_component(name).fault.endswith("update() threw: the encoder jumped")
        (status,) = arm.get_status().runners
        assert name in status.status
        torques = [each for each in TORQUES if not each.startswith(f"{name}.")]
        assert values(arm, *torques) == [0.0] * len(torques), name
        arm.apply(graph.components, settings=graph.settings)
    assert names == []


def test_a_controller_is_replaced_while_the_arm_moves(arm: rtcf.Client) -> None:
    def error() -> float:
        wanted = values(arm, *(f"/setpoints.position{i}" for i in range(1, 7)))
        return float(np.abs(positions(arm) - np.array(wanted)).max())

    operate(arm, mode="tour")
    arm.step(1200)
    (before,) = (
        each.spec for each in arm.list_components() if each.full_name == "/joint2/velocity"
    )
    largest = 0.0
    for _ in range(50):
        arm.step(20)
        largest = max(largest, error())
    arm.replace("/joint2/velocity", before)
    for _ in range(50):
        arm.step(20)
        assert error() < max(largest, TRACKING / 2) + BUMP


def test_the_arm_is_shown_until_its_time_is_over() -> None:
    done = subprocess.run(
        [TREE / "components" / "rtcf_arm" / "show", "--seconds", "4", "--no-browser"],
        env=clean_environment(), capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.match(r"http://127\.0\.0\.1:\d+/\?token=\S+\n", done.stdout)
    rows = re.findall(r"^ +\d+ s +(\d+) +\d+ +.* ([\d.]+)°$", done.stdout, re.MULTILINE)
    assert len(rows) >= 2
    assert int(rows[-1][0]) > int(rows[0][0])
    assert all(float(error) < np.degrees(TRACKING) for _, error in rows)


def test_the_arm_is_shown_after_a_fault_with_its_incident() -> None:
    with subprocess.Popen(
        [TREE / "components" / "rtcf_arm" / "show", "--no-browser"],
        env=clean_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        lines = process.stdout

        def read_to(pattern: str) -> re.Match[str]:
            for line in lines:
                if found := re.search(pattern, line):
                    return found
            raise AssertionError(f"no line like {pattern}")

        with rtcf.Client(read_to(r"--socket (\S+)")[1]) as client:
            read_to(r"^ +\d+ s ")
            client.write("robot.push", "[1e9, 1e9, 1e9, 0, 0, 0]")
            read_to("^the loop has ended: .*the simulation diverged")
            (incident,) = wait_for(client.list_incidents, "the incident")
            assert "the simulation diverged" in incident.reason
            client.write("robot.push", "[0, 0, 0, 0, 0, 0]")
            client.restart_runner("rt_runner")
            client.start()
            read_to(r"^ +\d+ s ")
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130


def test_ctrl_c_ends_everything() -> None:
    with subprocess.Popen(
        [TREE / "components" / "rtcf_arm" / "show", "--no-browser"],
        env=clean_environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        lines: list[str] = []
        while " s  " not in (lines[-1] if lines else ""):
            lines.append(process.stdout.readline())
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "interrupted; all processes have ended" in rest
    socket = re.search(r"--socket (\S+)", "".join(lines))
    assert socket is not None
    assert not Path(socket[1]).exists()
