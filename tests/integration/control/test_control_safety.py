"""EStop, CommandTimeout, Heartbeat and JointLimiter of rtcf_control.

Tolerances: latches, selections and clamps are exact. Sums of up to 2000 steps of size 1 differ from
their references by less than ROUNDING.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import Blocks, Stepped, rejection
from daemon_process import wait_for
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.testing import Bench
from rtcf_shared.value_text import parse

DT = 0.001
ROUNDING = 1e-9
RUNNING, STOPPED, RESETTABLE, WAITING = range(4)
MASKED: Any = np.ma
TYPES = ("CommandTimeout", "EStop", "Heartbeat", "JointLimiter")


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("safety"), TYPES) as blocks:
        yield blocks


def levels(length: int, *spans: tuple[int, int]) -> Any:
    """Return an array that is true from the first to before the second cycle of each span."""
    cycles = np.arange(length)
    return np.any([(first <= cycles) & (cycles < end) for first, end in spans], axis=0)


def at(length: int, *cycles: int, value: float = 1.0) -> Any:
    """Return a column that is sent in these cycles only."""
    return MASKED.array(np.full(length, value), mask=~np.isin(np.arange(length), cycles))


# EStop.


def test_a_stop_is_latched_until_a_reset(blocks: Blocks) -> None:
    stop = levels(100, (20, 30), (70, 71))
    reset = levels(100, (25, 28), (50, 51))  # the first one comes during the stop
    values = blocks.run("EStop", {"in": 5.0, "stop1": stop, "reset": reset}, steps=100,
                        start_stopped=False, safe_value=-1.0)  # fmt: skip
    expected = levels(100, (20, 50), (70, 100))
    assert values["stopped"].astype(bool).tolist() == expected.tolist()
    assert values["out"].tolist() == np.where(expected, -1.0, 5.0).tolist()
    state = np.select([levels(100, (20, 30), (70, 71)), expected], [STOPPED, RESETTABLE], RUNNING)
    assert values["state"].tolist() == state.tolist()


def test_a_reset_needs_a_command_newer_than_the_stop(blocks: Blocks) -> None:
    reset = levels(100, (50, 51), (60, 62), (80, 81))
    values = blocks.run(
        "EStop",
        {"in": at(100, 0, 29, 70), "stop1": levels(100, (20, 30)), "reset": reset},
        start_stopped=False,
    )
    assert values["stopped"].astype(bool).tolist() == levels(100, (20, 80)).tolist()
    assert values["state"][[19, 30, 69, 70, 79, 80]].tolist() == [
        RUNNING, STOPPED, STOPPED, RESETTABLE, RESETTABLE, RUNNING,
    ]  # fmt: skip


def test_a_reset_button_that_is_stuck_resets_nothing(blocks: Blocks) -> None:
    values = blocks.run("EStop", {"in": 1.0, "stop1": False, "reset": True}, steps=50)
    assert values["stopped"].all()
    stop = levels(50, (20, 22))
    values = blocks.run("EStop", {"in": 1.0, "stop1": stop, "reset": levels(50, (5, 50))})
    assert values["stopped"].astype(bool).tolist() == levels(50, (0, 5), (20, 50)).tolist()


def test_a_required_input_without_a_value_stops(blocks: Blocks) -> None:
    stop1 = MASKED.array(np.zeros(50, bool), mask=np.arange(50) < 10)
    inputs = {"in": 1.0, "stop1": stop1, "reset": levels(50, (5, 6), (20, 21))}
    values = blocks.run("EStop", inputs, start_stopped=False)
    assert values["stopped"].astype(bool).tolist() == levels(50, (0, 20)).tolist()
    values = blocks.run("EStop", inputs, start_stopped=False, required=2)
    assert values["stopped"].all(), "stop2 has no value"
    values = blocks.run("EStop", inputs, start_stopped=False, required=0)
    assert not values["stopped"].any()


@pytest.mark.parametrize("name", ["stop1", "stop2", "stop3", "stop4"])
def test_each_input_stops(blocks: Blocks, name: str) -> None:
    values = blocks.run("EStop", {"in": 1.0, name: levels(20, (10, 11))}, start_stopped=False,
                        required=0)  # fmt: skip
    assert values["stopped"].astype(bool).tolist() == levels(20, (10, 20)).tolist()


def test_stops_and_resumptions_have_their_rates(blocks: Blocks) -> None:
    stop = levels(1000, (100, 101))
    values = blocks.run(
        "EStop",
        {"in": 2.0, "stop1": stop, "reset": levels(1000, (500, 501))},
        start_stopped=False, stop_rate=10.0, resume_rate=5.0,
    )  # fmt: skip
    time = np.arange(1000)
    expected = np.interp(time, [-1, 399, 400], [0.0, 2.0, 2.0])
    expected = np.where(time >= 100, np.interp(time, [99, 149], [0.5, 0.0]), expected)
    expected = np.where(time >= 500, np.interp(time, [499, 899], [0.0, 2.0]), expected)
    assert np.allclose(values["out"], expected, rtol=0, atol=ROUNDING)


def test_a_command_that_is_not_finite_is_no_command(blocks: Blocks) -> None:
    command = np.where(levels(60, (0, 10), (40, 60)), 3.0, np.nan)
    values = blocks.run(
        "EStop",
        {"in": command, "stop1": levels(60, (20, 21)), "reset": levels(60, (30, 31), (50, 51))},
        start_stopped=False,
    )
    assert np.isfinite(values["out"]).all()
    assert values["out"].tolist() == np.where(levels(60, (20, 50)), 0.0, 3.0).tolist()


def test_a_stop_by_parameter_works_without_a_command(stepped: Bench) -> None:
    block = Stepped(stepped, "EStop", required=0, start_stopped=False)
    try:
        assert not block.step()["latch"]["stopped"]
        block.set(engaged=True)
        assert block.step()["latch"]["stopped"]
        block.set(engaged=False)
        block.step(reset=False)
        assert block.step(reset=True)["latch"]["stopped"], "no command since the stop"
        block.step(**{"in": 4.0, "reset": False})
        assert not block.step(reset=True)["latch"]["stopped"]
        assert block.step()["last"] == 4.0
    finally:
        block.unload()


def test_a_latch_survives_replacement_and_snapshot(stepped: Bench) -> None:
    block = Stepped(stepped, "EStop", start_stopped=False)
    try:
        block.step(**{"in": 4.0, "stop1": True})
        block.step(stop1=False)
        taken = stepped.client.take_snapshot().snapshot
        assert not stepped.client.replace("/stepped/block", block.spec(start_stopped=False)).notes
        assert block.step(5)["latch"]["stopped"]
        stepped.client.restore_snapshot(taken)
        assert block.step(5)["latch"]["stopped"]
    finally:
        block.unload()


def test_a_stop_of_a_position_comes_to_a_standstill(blocks: Blocks) -> None:
    time = DT * np.arange(2000)
    wanted = 0.5 + np.clip(time, 0.0, 1.0) * 2.0  # 2 per second
    stop, reset = levels(2000, (500, 510)), levels(2000, (1500, 1501))
    inputs = {"in": wanted, "stop1": stop, "reset": reset}
    values = blocks.run("EStop", inputs, start_stopped=False, mode="standstill",
                        deceleration=10.0, resume_rate=4.0)  # fmt: skip
    out = values["out"]
    assert np.allclose(out[:500], wanted[:500], rtol=0, atol=ROUNDING)
    # 2 / 10 s, 200 cycles, and half of the velocity on average.
    slower = -np.diff(np.diff(out[498:720])) / DT**2
    assert slower.max() <= 10.0 + 1e-6
    assert out[499] + 0.2 - 0.002 <= out[700] <= out[499] + 0.2
    assert (out[700:1500] == out[700]).all()
    off = values["torque_off"].astype(bool)
    assert not off[:698].any()
    assert off[700:1500].all()
    assert not off[1500:].any()
    assert np.diff(out[1499:]).max() == pytest.approx(0.004, abs=ROUNDING)
    assert out[-1] == wanted[-1]
    at_once = blocks.out("EStop", inputs, start_stopped=False, mode="standstill", resume_rate=4.0)
    assert (at_once[500:1500] == at_once[499]).all()


@pytest.mark.parametrize("held", [False, True], ids=["sent at 50 Hz", "held between steps"])
def test_a_stop_of_a_slow_command_brakes_from_its_velocity(blocks: Blocks, held: bool) -> None:
    cycle = np.arange(1000)
    steps = 0.02 * (cycle // 20)  # 1 per second
    wanted = steps if held else MASKED.array(steps, mask=cycle % 20 != 0)
    for late in range(20):
        inputs = {"in": wanted, "stop1": levels(1000, (300 + late, 1000))}
        out = blocks.out("EStop", inputs, start_stopped=False, mode="standstill",
                         deceleration=4.0, resume_rate=4.0)  # fmt: skip
        way = out[-1] - out[299 + late]
        assert 0.0 < way <= 1.0 / 8.0 + 0.001, late
        assert (out[600:] == out[600]).all()


def test_a_jump_of_a_command_is_no_velocity(blocks: Blocks) -> None:
    wanted = np.where(np.arange(1000) < 300, 0.0, 0.5)
    inputs = {"in": wanted, "stop1": levels(1000, (301, 1000))}
    out = blocks.out("EStop", inputs, start_stopped=False, mode="standstill",
                     deceleration=4.0, resume_rate=4.0)  # fmt: skip
    assert (out[300:] == 0.5).all()


def test_a_standstill_needs_a_resume_rate(stepped: Bench) -> None:
    with pytest.raises(rtcf.RefusedError, match="mode = standstill needs a resume_rate"):
        Stepped(stepped, "EStop", mode="standstill")


def test_a_running_loop_keeps_its_stops(stepped: Bench) -> None:
    client = stepped.client
    block = Stepped(stepped, "EStop", start_stopped=False)
    try:
        block.step(**{"in": 1.0, "stop1": False, "reset": False})
        taken = client.take_snapshot().snapshot
        client.start()
        client.write("/stepped/block.stop1", True)
        wait_for(lambda: block.state["latch"]["stopped"], "the stop")
        client.restore_snapshot(taken)
        client.write("/stepped/block.stop1", False)
        with pytest.raises(rtcf.RefusedError, match=r"all state of /stepped/block is live"):
            client.reset_state("/stepped/block")
        time.sleep(0.05)
        assert block.state["latch"]["stopped"]
        client.stop()
        client.reset_state("/stepped/block")
        assert not block.state["latch"]["stopped"]
    finally:
        client.stop()
        block.unload()


def test_a_required_stop_input_needs_its_writer(stepped: Bench) -> None:
    client = stepped.client
    block = Stepped(stepped, "EStop", start_stopped=False)
    client.load(rtcf.component("rtcf_examples", "Mimo", name="writer", ns="/button",
                               remaps=["out1:=/value", "out2:=/other"]))  # fmt: skip
    client.load(rtcf.component("rtcf_control", "Comparator", name="button", ns="/button",
                               remaps=["in:=/value", "out:=/stepped/stop1"],
                               parameters=["threshold:=1e9"]))  # fmt: skip
    try:
        for _ in range(3):
            state = block.step(**{"in": 1.0})
        assert not state["latch"]["stopped"]
        client.unload(["/button/button"])
        assert block.step()["latch"]["stopped"], "its writer has gone"
    finally:
        client.unload(["/button/writer"])
        block.unload()


def test_a_standstill_begins_with_the_first_command(blocks: Blocks) -> None:
    wanted = MASKED.array(np.linspace(0.8, 1.8, 100), mask=np.arange(100) < 20)
    values = blocks.run("EStop", {"in": wanted, "stop1": False, "reset": levels(100, (60, 61))},
                        mode="standstill", resume_rate=1e9)  # fmt: skip
    assert np.isnan(values["out"][:20]).all()
    assert (values["out"][20:60] == wanted[20]).all()
    assert values["out"][60:].tolist() == wanted[60:].tolist()


@pytest.mark.parametrize("stopped", [False, True], ids=["in motion", "on the way to a standstill"])
def test_the_last_cycle_holds_a_position_where_it_is(stepped: Bench, stopped: bool) -> None:
    client = stepped.client
    block = Stepped(stepped, "EStop", start_stopped=False, mode="standstill", deceleration=5.0,
                    resume_rate=1.0)  # fmt: skip
    client.load(rtcf.component("rtcf_examples", "Identity", name="reader", ns="/reader",
                               remaps=["in:=/stepped/out"]))  # fmt: skip
    try:
        for cycle in range(100):
            block.step(**{"in": 0.8 + 0.002 * cycle, "stop1": stopped and cycle > 90})
        last = client.get_component("/reader/reader")
        client.stop()
        found = client.get_component("/reader/reader")
        before, after = (next(str(each.value) for each in info.ports if each.name == "out")
                         for info in (last, found))  # fmt: skip
        assert after == before
        position = float(before.removeprefix("data: "))
        assert position == pytest.approx(0.8 + 0.002 * 99, abs=0.01 if stopped else ROUNDING)
        states = {each.name: parse(each.value) for each in
                  client.get_component("/stepped/block").states}  # fmt: skip
        assert states["speed"] == 0.0
    finally:
        client.unload(["/reader/reader"])
        block.unload()


def test_torque_stays_on_in_stop_category_2(blocks: Blocks) -> None:
    inputs = {"in": 3.0, "stop1": levels(100, (20, 30))}
    values = blocks.run("EStop", inputs, start_stopped=False, stop_rate=100.0, keep_torque=True)
    assert not values["torque_off"].any()
    values = blocks.run("EStop", inputs, start_stopped=False, stop_rate=100.0)
    assert values["torque_off"].astype(bool).tolist() == levels(100, (49, 100)).tolist()


# CommandTimeout.


def test_a_command_that_is_late_is_stopped_until_a_reset(blocks: Blocks) -> None:
    # Commands every 10 cycles until 100, one at 200, then every 10 cycles from 300.
    sent = [*range(20, 101, 10), 200, *range(300, 500, 10)]
    reset = levels(500, (150, 151), (260, 261), (330, 331))
    values = blocks.run(
        "CommandTimeout",
        {"in": at(500, *sent, value=3.0), "reset": reset}, timeout=0.05, safe_value=-1.0,
    )  # fmt: skip
    # 50 cycles after the one at 100 are in time. The one at 200 is late itself before its reset.
    stopped = levels(500, (151, 330))
    assert values["stopped"].astype(bool).tolist() == stopped.tolist()
    moves = ~stopped & (np.arange(500) >= 20)
    assert values["out"].tolist() == np.where(moves, 3.0, -1.0).tolist()
    state = np.full(500, RUNNING)
    state[:20] = WAITING
    state[151:330] = STOPPED
    state[200:251] = RESETTABLE
    state[300:330] = RESETTABLE
    assert values["state"].tolist() == state.tolist()
    assert values["age"][[100, 110, 150]] == pytest.approx([0.0, 0.01, 0.05], abs=ROUNDING)


def test_a_reset_with_a_command_newer_than_the_stop_resumes(blocks: Blocks) -> None:
    values = blocks.run(
        "CommandTimeout",
        {"in": at(300, 0, 200), "reset": levels(300, (150, 151), (210, 211))}, timeout=0.05,
    )  # fmt: skip
    assert values["stopped"].astype(bool)[:261].tolist() == levels(261, (51, 210), (251, 261)
                                                                    ).tolist()  # fmt: skip


def test_without_latching_the_next_command_ends_a_timeout(blocks: Blocks) -> None:
    values = blocks.run("CommandTimeout", {"in": at(300, 0, 100, 130)}, timeout=0.05,
                        latching=False)  # fmt: skip
    expected = levels(300, (51, 100), (181, 300))
    assert values["stopped"].astype(bool).tolist() == expected.tolist()
    assert values["out"].tolist() == np.where(expected, 0.0, 1.0).tolist()


def test_a_timeout_of_0_needs_a_command_in_each_cycle(blocks: Blocks) -> None:
    values = blocks.run("CommandTimeout", {"in": at(20, *range(10), 11)}, timeout=0.0)
    assert values["stopped"].astype(bool).tolist() == levels(20, (10, 20)).tolist()


def test_values_that_are_not_finite_are_no_commands_in_time(blocks: Blocks) -> None:
    command = np.where(np.arange(100) < 10, 2.0, np.nan)
    values = blocks.run("CommandTimeout", {"in": command}, timeout=0.05)
    assert values["out"].tolist() == np.where(np.arange(100) < 60, 2.0, 0.0).tolist()


# Heartbeat.


def test_a_counter_that_stands_still_stops_until_a_reset_and_a_new_beat(blocks: Blocks) -> None:
    beat = np.arange(300, dtype=np.uint32)
    beat[100:200] = 99  # sent again, but it stands still
    values = blocks.run(
        "Heartbeat",
        {"beat": beat, "reset": levels(300, (180, 181), (250, 251))}, timeout=0.02,
    )  # fmt: skip
    assert values["stopped"].astype(bool).tolist() == levels(300, (120, 250)).tolist()
    expected = np.full(300, RUNNING)
    expected[120:200] = STOPPED
    expected[200:250] = RESETTABLE
    assert values["state"].tolist() == expected.tolist()
    assert values["count"].tolist() == list(range(1, 301))


def test_it_is_stopped_before_the_first_beat(blocks: Blocks) -> None:
    beat = MASKED.array(np.arange(100, dtype=np.uint32), mask=np.arange(100) < 50)
    values = blocks.run("Heartbeat", {"beat": beat}, timeout=0.02)
    assert values["stopped"].astype(bool).tolist() == levels(100, (0, 50)).tolist()
    assert values["state"][[0, 49, 50]].tolist() == [WAITING, WAITING, RUNNING]


def test_own_beats_have_their_interval(blocks: Blocks) -> None:
    values = blocks.run("Heartbeat", steps=100, interval=0.01)
    assert np.nan_to_num(values["count"]).tolist() == ((np.arange(100) + 1) // 10).tolist()


def test_a_counter_that_begins_again_is_a_beat(blocks: Blocks) -> None:
    beat = np.concatenate([np.arange(4294967290, 4294967296), np.arange(10), np.arange(10)])
    values = blocks.run("Heartbeat", {"beat": beat.astype(np.uint32)}, timeout=0.0)
    assert not values["stopped"].any()


# JointLimiter.


@pytest.mark.parametrize(
    ("component", "parameters", "said"),
    [
        ("JointLimiter", {"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        ("JointLimiter", {"soft_lower": 2.0, "soft_upper": 1.0},
         "soft_lower = 2 is above soft_upper = 1"),
        ("JointLimiter", {"soft_upper": 1.0, "k_position": 0.0},
         "soft limits need a k_position above 0"),
        ("JointLimiter", {"max_velocity": -1.0}, "max_velocity"),
        ("JointLimiter", {"deceleration": 0.0}, "deceleration"),
        ("JointLimiter", {"command": "effort", "upper": 1.0, "k_velocity": 9.0},
         "needs a deceleration (rad/s^2)"),
        ("JointLimiter", {"command": "effort", "upper": 1.0, "deceleration": 9.0},
         "needs a k_velocity (N m s/rad) above 0"),
        ("JointLimiter", {"command": "effort", "soft_lower": 1.0},
         "needs a k_velocity (N m s/rad) above 0"),
        ("JointLimiter", {"command": "effort", "max_velocity": 1.0},
         "needs a k_velocity (N m s/rad) above 0"),
        ("EStop", {"stop_rate": 0.0}, "stop_rate"),
        ("CommandTimeout", {"stop_rate": 0.0}, "stop_rate"),
    ],
)  # fmt: skip
def test_limits_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, component: str, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set(component, **parameters)


@pytest.mark.parametrize("command", ["position", "velocity", "effort"])
def test_without_limits_commands_pass(blocks: Blocks, command: str) -> None:
    wanted = np.random.default_rng(3).normal(size=200)
    values = blocks.run("JointLimiter", {"in": wanted, "position": 1.0, "velocity": -2.0},
                        command=command)  # fmt: skip
    # A position begins at the measured one, but has no velocity limit.
    assert values["out"].tolist() == wanted.tolist()
    assert not values["limited"].any()


def test_positions_stay_within_the_limits_and_the_velocity(blocks: Blocks) -> None:
    wanted = np.repeat([2.0, -3.0, 0.5], 1000)
    out = blocks.out("JointLimiter", {"in": wanted, "position": 0.0}, lower=-1.0, upper=1.5,
                     max_velocity=4.0)  # fmt: skip
    expected, at_ = [], 0.0
    for target in np.clip(wanted, -1.0, 1.5):
        at_ += np.clip(target - at_, -0.004, 0.004)
        expected.append(at_)
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)
    assert out.max() == 1.5
    assert out.min() == -1.0


@seed(29)
@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6),
    st.floats(1.0, 20.0),
    st.floats(0.1, 10.0),
)
def test_a_position_brakes_before_its_limits(
    blocks: Blocks, targets: list[float], deceleration: float, velocity: float
) -> None:
    wanted = np.repeat(targets, 300)
    out = blocks.out("JointLimiter", {"in": wanted, "position": 0.0}, lower=-1.0, upper=1.0,
                     max_velocity=velocity, deceleration=deceleration)  # fmt: skip
    assert (np.abs(out) <= 1.0).all()
    speed = np.diff(np.concatenate([[0.0], out])) / DT
    assert np.abs(speed).max() <= velocity + ROUNDING
    assert np.abs(np.diff(speed, prepend=0.0)).max() <= deceleration * DT + 1e-8


def test_a_position_slows_down_before_its_target(blocks: Blocks) -> None:
    out = blocks.out("JointLimiter", {"in": np.full(2000, 1.0), "position": 0.0},
                     deceleration=4.0, max_velocity=10.0)  # fmt: skip
    # Half of the way faster, half of it slower: 2 sqrt(1 / 4) s, up to one cycle on either side.
    arrived = np.flatnonzero(out == 1.0)[0]
    assert 999 <= arrived <= 1001
    assert (np.diff(out) >= -1e-15).all()
    assert (out[arrived:] == 1.0).all()


@seed(31)
@settings(max_examples=20, deadline=None)
@given(st.floats(0.2, 1.5), st.floats(1.0, 8.0))
def test_a_command_within_the_limits_passes_unchanged(
    blocks: Blocks, size: float, rate: float
) -> None:
    time = DT * np.arange(1500)
    wanted = size * (1.0 - np.cos(rate * time))
    out = blocks.out("JointLimiter", {"in": wanted, "position": 0.0}, lower=-0.1, upper=3.5,
                     max_velocity=1.01 * size * rate,
                     deceleration=1.01 * size * rate**2)  # fmt: skip
    # A limit of the velocity or position that is close may only brake a little earlier.
    assert np.abs(out - wanted).max() <= 1e-9


def test_velocities_have_a_limited_acceleration(blocks: Blocks) -> None:
    wanted = np.repeat([2.0, -2.0, 0.5], 600)
    out = blocks.out("JointLimiter", {"in": wanted}, command="velocity",
                     deceleration=8.0)  # fmt: skip
    steps = np.diff(out, prepend=0.0)
    assert np.abs(steps).max() <= 0.008 + ROUNDING
    for end in (599, 1199, 1799):
        assert out[end] == wanted[end]


def test_a_velocity_follows_the_braking_distance(blocks: Blocks) -> None:
    # Against the continuous law v^2 = 2 a d, from which discrete steps differ by at most a h. The
    # joint moves more slowly than commanded, so the limit of the acceleration does not matter.
    position = np.linspace(-0.5, 1.5, 4000)
    out = blocks.out("JointLimiter", {"in": 9.0, "position": position}, command="velocity",
                     upper=1.0, deceleration=5.0, max_velocity=3.0)  # fmt: skip
    law = np.minimum(3.0, np.sqrt(10.0 * np.maximum(1.0 - position, 0.0)))
    begun = 5.0 * DT * np.arange(1, 4001) >= law
    begun &= position < 0.97  # then the joint moves faster than commanded
    assert np.allclose(out[begun], law[begun], rtol=0, atol=5.0 * DT)
    assert (out[begun] <= law[begun]).all()
    assert (np.diff(out[position >= 1.0]) <= 0.0).all()
    assert (out[position >= 1.05] == 0.0).all()


def test_soft_limits_bound_the_velocity_by_the_distance(blocks: Blocks) -> None:
    position = np.linspace(-2.0, 2.0, 801)
    parameters: dict[str, Any] = {"command": "velocity", "soft_lower": -1.0, "soft_upper": 1.0,
                  "k_position": 4.0, "max_velocity": 2.0}  # fmt: skip
    up = blocks.out("JointLimiter", {"in": 9.0, "position": position}, **parameters)
    assert np.allclose(up, np.clip(4.0 * (1.0 - position), -2.0, 2.0), rtol=0, atol=ROUNDING)
    down = blocks.out("JointLimiter", {"in": -9.0, "position": position}, **parameters)
    assert np.allclose(down, np.clip(4.0 * (-1.0 - position), -2.0, 2.0), rtol=0, atol=ROUNDING)


def test_efforts_drive_an_excess_velocity_back(blocks: Blocks) -> None:
    velocity = np.linspace(-6.0, 6.0, 601)
    parameters: dict[str, Any] = {"command": "effort", "max_velocity": 3.0, "max_effort": 8.0}
    inputs = {"position": 0.0, "velocity": velocity}
    out = blocks.out("JointLimiter", {"in": 9.0, **inputs}, k_velocity=5.0, **parameters)
    assert np.allclose(out, np.clip(5.0 * (3.0 - velocity), -8.0, 8.0), rtol=0, atol=ROUNDING)
    out = blocks.out("JointLimiter", {"in": -9.0, **inputs}, k_velocity=5.0, **parameters)
    assert np.allclose(out, np.clip(5.0 * (-3.0 - velocity), -8.0, 8.0), rtol=0, atol=ROUNDING)
    # Near a limit of the position, the braking velocity takes the place of max_velocity.
    position = np.linspace(0.0, 1.2, 601)
    inputs = {"position": position, "velocity": 1.0}
    out = blocks.out("JointLimiter", {"in": 9.0, **inputs}, k_velocity=5.0, upper=1.0,
                     deceleration=2.0, **parameters)  # fmt: skip
    law = np.minimum(3.0, np.sqrt(4.0 * np.maximum(1.0 - position, 0.0)))
    expected = np.clip(5.0 * (law - 1.0), -8.0, 8.0)
    assert np.allclose(out, expected, rtol=0, atol=5.0 * 2.0 * DT)


@pytest.mark.parametrize("command", ["position", "velocity", "effort"])
@pytest.mark.parametrize("broken", ["in", "position", "velocity"])
def test_values_that_are_not_finite_leave_the_limited_output_as_it_is(
    blocks: Blocks, command: str, broken: str
) -> None:
    inputs: dict[str, Any] = {"in": 0.5, "position": 0.25, "velocity": 0.1}
    inputs[broken] = np.array([inputs[broken]] * 5 + [np.nan, np.inf] + [inputs[broken]] * 3)
    values = blocks.run("JointLimiter", inputs, command=command, lower=-1.0, upper=1.0,
                        deceleration=1e6, k_velocity=1e6)  # fmt: skip
    assert np.isfinite(values["out"]).all()
    assert (values["out"] == 0.5).all()


@pytest.mark.parametrize("command", ["velocity", "effort"])
def test_nothing_is_written_before_a_measurement_that_a_limit_needs(
    blocks: Blocks, command: str
) -> None:
    position = MASKED.array(np.zeros(10), mask=np.arange(10) < 5)
    values = blocks.run("JointLimiter", {"in": 0.5, "position": position, "velocity": 0.0},
                        command=command, upper=1.0, deceleration=1e6,
                        k_velocity=1e6)  # fmt: skip
    assert np.isnan(values["out"][:5]).all()
    assert (values["out"][5:] == 0.5).all()


def test_narrower_limits_move_the_position_at_its_velocity(stepped: Bench) -> None:
    block = Stepped(stepped, "JointLimiter", upper=2.0, max_velocity=10.0)
    try:
        assert block.step(500, **{"in": 5.0, "position": 0.0})["last"] == 2.0
        block.set(upper=1.0)
        assert block.step()["last"] == pytest.approx(1.99, abs=ROUNDING)
        assert block.step(200)["last"] == pytest.approx(1.0, abs=ROUNDING)
    finally:
        block.unload()
