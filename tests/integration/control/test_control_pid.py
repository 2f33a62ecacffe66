"""rtcf_control/Pid against scipy, the continuous closed loop, and an own difference equation.

Tolerances: effort of size 1 to 1000 after some hundred cycles differs from its references by less
than ROUNDING relative to the largest effort. The continuous loop differs by the sampling: less than
1 % of the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import PATH, Blocks, Stepped, rejection
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import signal

DT = 0.001
ROUNDING = 1e-10
MASKED: Any = np.ma
NOISE = np.random.default_rng(29).normal(size=(2, 500))
SETPOINT = np.where(np.arange(500) < 100, 0.5, 1.0)
MEASURED = 0.2 * np.sin(np.arange(500) / 30.0) + 0.01 * NOISE[0]


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("pid"), ["Pid"]) as blocks:
        yield blocks


@dataclass
class Settings:
    """Parameters of Pid, by their names."""

    kp: float = 1.0
    ki: float = 0.0
    kd: float = 0.0
    setpoint_weight: float = 1.0
    derivative_weight: float = 0.0
    filter_time: float = 0.0
    dead_band: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    rate: float = math.inf
    setpoint_rate: float = math.inf
    anti_windup: str = "back_calculation"
    tracking_time: float = 0.0
    safe_effort: float = 0.0

    def given(self) -> dict[str, Any]:
        """Return the parameters to set, without infinity, which is only valid as a default."""
        return {name: value for name, value in vars(self).items() if value not in
                (math.inf, -math.inf)}  # fmt: skip


def shrunk(error: float, band: float) -> float:
    return math.copysign(max(abs(error) - band, 0.0), error)


def limited(value: float, low: float, high: float) -> float:
    return max(low, min(high, value))


def reference(p: Settings, r: Any, y: Any, ff: Any, gain: Any, actual: Any = None) -> Any:
    """Return effort, by the equations of docs/control/pid.md, with the terms kept apart."""
    efforts: list[float] = []
    total = 0.0  # of the integral of the error and of what anti-windup took
    shift = 0.0  # of changes of the schedule
    followed, before_y, before_gain = float(r[0]), float(y[0]), float(gain[0])
    slope_r = slope_y = 0.0
    applied = limited(p.safe_effort, p.lower, p.upper)
    for k in range(len(r)):
        step_r = limited(r[k] - followed, -p.setpoint_rate * DT, p.setpoint_rate * DT)
        pole = p.filter_time / (p.filter_time + DT)
        if k:
            slope_r = pole * slope_r + (1.0 - pole) * step_r / DT
            slope_y = pole * slope_y + (1.0 - pole) * (y[k] - before_y) / DT
        followed += step_r
        before_y = y[k]
        error = followed - y[k]
        taken = error - shrunk(error, p.dead_band)
        proportional = p.kp * (p.setpoint_weight * followed - y[k] - taken)
        derivative = p.kd * (p.derivative_weight * slope_r - slope_y)
        if p.ki:
            shift -= (gain[k] - before_gain) * (proportional + derivative)
        before_gain = gain[k]
        wanted = gain[k] * (proportional + derivative) + ff[k] + total + shift
        change = limited(wanted - applied, -p.rate * DT, p.rate * DT)
        effort = wanted if change == wanted - applied else applied + change
        effort = limited(effort, p.lower, p.upper)
        lost = 0.0 if actual is None else applied - actual[k]
        applied = effort
        efforts.append(effort)
        growth = gain[k] * p.ki * shrunk(error, p.dead_band) * DT
        if p.anti_windup == "back_calculation" and p.ki:
            tracking = p.tracking_time or abs(p.kp / p.ki)
            total += growth - min(1.0, DT / max(tracking, DT)) * (wanted - effort + lost)
        elif p.anti_windup != "clamping" or (wanted - effort) * growth <= 0.0:
            total += growth
    return np.array(efforts)


def effort_of(blocks: Blocks, p: Settings, r: Any, y: Any, **inputs: Any) -> Any:
    """Return effort of two runs, which are the same bit by bit."""
    runs = [
        blocks.run("Pid", {"setpoint": r, "measured": y, **inputs}, **p.given())["effort"]
        for _ in range(2)
    ]
    assert runs[0].tobytes() == runs[1].tobytes()
    return runs[0]


def close(found: Any, expected: Any) -> bool:
    scale = max(1.0, float(np.max(np.abs(expected))))
    return bool(np.allclose(found, expected, rtol=0, atol=ROUNDING * scale))


# The linear controller.


@pytest.mark.parametrize(
    "p",
    [
        Settings(kp=2.5),
        Settings(kp=-2.5, ki=-3.0),
        Settings(kp=0.0, ki=3.0),
        Settings(kp=0.0),
        Settings(kp=2.0, ki=5.0, kd=0.02, filter_time=0.01),
        Settings(kp=2.0, ki=5.0, kd=0.02, filter_time=0.01, setpoint_weight=0.3,
                 derivative_weight=0.7),
        Settings(kp=2.0, kd=0.02, setpoint_weight=0.0),
    ],
)  # fmt: skip
def test_effort_is_that_of_the_transfer_functions(blocks: Blocks, p: Settings) -> None:
    found = effort_of(blocks, p, SETPOINT, MEASURED)
    integral = signal.lfilter([0.0, p.ki * DT], [1.0, -1.0], SETPOINT - MEASURED)
    weighted = p.derivative_weight * SETPOINT - MEASURED
    derivative = signal.lfilter(
        [p.kd, -p.kd], [p.filter_time + DT, -p.filter_time], weighted - weighted[0]
    )
    proportional = p.kp * (p.setpoint_weight * SETPOINT - MEASURED)
    assert close(found, proportional + integral + derivative)


def test_a_closed_loop_responds_as_the_continuous_one(tmp_path: Path) -> None:
    file = tmp_path / "loop.yaml"
    file.write_text(
        "components:\n"
        "  - {name: pid, package: rtcf_control, type: Pid, breaks: [measured],\n"
        "     remaps: {measured: /position, effort: /speed},\n"
        "     parameters: {kp: 4.0, ki: 8.0, setpoint_weight: 0.5}}\n"
        "  - {name: plant, package: rtcf_control, type: Integrator,\n"
        "     remaps: {in: /speed, out: /position}}\n"
    )
    with Bench(str(file), path=PATH) as bench:
        response = bench.run({"/pid.setpoint": 1.0}, steps=3000)
    _, expected = signal.step(([2.0, 8.0], [1.0, 4.0, 8.0]), T=response.time)
    assert np.max(np.abs(response["/plant.out"] - expected)) < 0.01


# All of it, against the difference equation.

gains = st.floats(-5.0, 5.0)
times = st.sampled_from([0.0, 0.0005, 0.01, 0.3])


@st.composite
def all_settings(draw: st.DrawFn) -> Settings:
    low, high = sorted(draw(st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))))
    return Settings(
        kp=draw(gains), ki=draw(st.one_of(st.just(0.0), st.floats(-100.0, 100.0))),
        kd=draw(st.floats(-0.02, 0.02)), setpoint_weight=draw(st.floats(0.0, 1.0)),
        derivative_weight=draw(st.floats(0.0, 1.0)), filter_time=draw(times),
        dead_band=draw(st.sampled_from([0.0, 0.3])),
        lower=draw(st.sampled_from([low, -math.inf])),
        upper=draw(st.sampled_from([high, math.inf])),
        rate=draw(st.sampled_from([0.0, 100.0, 3000.0, math.inf])),
        setpoint_rate=draw(st.sampled_from([0.0, 300.0, math.inf])),
        anti_windup=draw(st.sampled_from(["back_calculation", "clamping", "off"])),
        tracking_time=draw(times), safe_effort=draw(st.floats(-30.0, 30.0)),
    )  # fmt: skip


@seed(29)
@settings(max_examples=40)
@given(
    p=all_settings(),
    walk=arrays.arrays(float, (5, 80), elements=st.floats(-3.0, 3.0)),
    has_actual=st.booleans(),
)
def test_effort_is_that_of_the_difference_equation(
    blocks: Blocks, p: Settings, walk: Any, has_actual: bool
) -> None:
    r, y, ff, gain, actual = walk
    inputs = {"feedforward": ff, "gain": gain} | ({"actual": actual} if has_actual else {})
    found = effort_of(blocks, p, r, y, **inputs)
    expected = reference(p, r, y, ff, gain, actual if has_actual else None)
    assert close(found, expected)
    assert (found >= p.lower).all()
    assert (found <= p.upper).all()
    # Limits that hold at once are met at the start, as safe_effort is within them.
    assert (np.abs(np.diff(found)) <= p.rate * DT * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("anti_windup", ["back_calculation", "clamping", "off"])
@pytest.mark.parametrize("rate", [math.inf, 20.0])
def test_the_integral_is_limited_with_effort(blocks: Blocks, anti_windup: str, rate: float) -> None:
    p = Settings(kp=1.0, ki=50.0, upper=2.0, lower=-2.0, rate=rate, anti_windup=anti_windup)
    error = np.where(np.arange(1000) < 500, 3.0, -0.5)
    found = effort_of(blocks, p, error, np.zeros(1000))
    ones = np.ones(1000)
    assert close(found, reference(p, error, 0 * ones, 0 * ones, ones))
    # Without windup, effort leaves its limit within 100 cycles of the change of the error.
    left = int(np.argmax(found[500:] < 1.9))
    assert (left > 100) == (anti_windup == "off") or found[-1] == 2.0
    assert (found[-1] == 2.0) == (anti_windup == "off")


def test_equal_limits_hold_effort(blocks: Blocks) -> None:
    p = Settings(kp=3.0, ki=4.0, lower=0.25, upper=0.25)
    assert (effort_of(blocks, p, SETPOINT, MEASURED) == 0.25).all()


def test_errors_within_the_dead_band_do_not_move_effort(blocks: Blocks) -> None:
    p = Settings(kp=3.0, ki=40.0, dead_band=0.1)
    assert not effort_of(blocks, p, 0.1 * np.sign(NOISE[0]), np.zeros(500)).any()
    assert effort_of(blocks, p, [0.35], [0.0])[0] == pytest.approx(0.75, abs=ROUNDING)


def test_the_other_outputs_tell_error_and_limits(blocks: Blocks) -> None:
    response = blocks.run(
        "Pid", {"setpoint": SETPOINT, "measured": MEASURED}, kp=2.0, upper=1.0, setpoint_rate=2.0
    )
    followed = np.minimum(0.5 + 2.0 * DT * np.maximum(np.arange(500) - 99, 0), 1.0)
    assert np.allclose(response["error"], followed - MEASURED, rtol=0, atol=ROUNDING)
    beyond = 2.0 * (followed - MEASURED) > 1.0
    assert response["saturated"].astype(bool).tolist() == beyond.tolist()


def test_the_rate_also_limits_the_first_cycles(blocks: Blocks) -> None:
    p = Settings(kp=100.0, rate=1000.0, safe_effort=5.0)
    assert np.allclose(effort_of(blocks, p, [1.0] * 4, [0.0] * 4), [6.0, 7.0, 8.0, 9.0])


def test_a_perfect_actuator_changes_nothing(blocks: Blocks) -> None:
    p = Settings(kp=2.0, ki=40.0, upper=2.0)
    alone = effort_of(blocks, p, SETPOINT, MEASURED)
    late = MASKED.array(np.roll(alone, 1), mask=np.arange(500) == 0)
    assert effort_of(blocks, p, SETPOINT, MEASURED, actual=late).tolist() == alone.tolist()


# Faults.


def test_a_value_that_is_not_finite_holds_effort_and_state(blocks: Blocks) -> None:
    p = Settings(kp=2.0, ki=5.0, kd=0.1)
    ramp = DT * np.arange(60.0)
    broken = ramp.copy()
    broken[20:40] = np.nan
    found = effort_of(blocks, p, np.ones(60), broken)
    assert (found[20:40] == found[19]).all()
    # The slope over the gap is that of the ramp: no spike.
    whole = effort_of(blocks, p, np.ones(60), ramp)
    lost = p.ki * DT * np.sum(1.0 - ramp[20:40])
    assert found[40] == pytest.approx(whole[40] - lost, abs=ROUNDING)
    for name in ("feedforward", "gain"):
        bad = MASKED.array(np.full(60, np.nan), mask=np.arange(60) != 30)
        held = effort_of(blocks, p, np.ones(60), ramp, **{name: bad})
        assert (held[30:] == held[29]).all(), "the value stays until another one comes"


def test_effort_continues_after_a_value_that_overflows(blocks: Blocks) -> None:
    p = Settings(kp=2.0, ki=5.0, kd=0.1, filter_time=0.01)
    measured = np.full(60, 0.5)
    measured[20] = 1.5e308
    found = effort_of(blocks, p, np.ones(60), measured)
    assert found[20] == found[19]
    assert found[21] == pytest.approx(found[19], abs=ROUNDING)
    assert np.allclose(np.diff(found[21:]), 5.0 * 0.5 * DT, rtol=0, atol=ROUNDING)
    # Also where only the slope overflows, which this controller does not use.
    measured[20] = 1e306
    found = effort_of(blocks, Settings(kp=2.0), np.ones(60), measured)
    assert found[21:].tolist() == [1.0] * 39


def test_nothing_is_written_before_both_inputs_have_a_value(blocks: Blocks) -> None:
    late = MASKED.array([0.0, 0.0, 1.0], mask=[True, True, False])
    found = effort_of(blocks, Settings(), np.ones(3) * 3.0, late)
    assert np.isnan(found[:2]).all()
    assert found[2] == 2.0


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        ({"setpoint_tracking": True}, "setpoint_tracking needs a finite setpoint_rate"),
        ({"setpoint_weight": 1.5}, "setpoint_weight"),
        ({"filter_time": -1.0}, "filter_time"),
        ({"rate": -1.0}, "rate"),
        ({"anti_windup": "none"}, "anti_windup"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set("Pid", **parameters)


# Manual and automatic mode.


def test_manual_mode_writes_the_manual_effort_within_limits_and_rate(blocks: Blocks) -> None:
    inputs = {"setpoint": 1.0, "measured": 0.0, "manual": True}
    response = blocks.run("Pid", {**inputs, "manual_effort": [1.0, 9.0, 9.0, -9.0]},
                          upper=4.0, lower=-4.0, rate=3000.0)  # fmt: skip
    assert response["effort"].tolist() == [1.0, 4.0, 4.0, 1.0]
    assert response["saturated"].astype(bool).tolist() == [False, True, True, True]
    response = blocks.run("Pid", inputs, steps=2, manual_value=-1.5)
    assert response["effort"].tolist() == [-1.5, -1.5]
    response = blocks.run("Pid", {"manual_effort": [1.0, np.nan, 2.0]}, in_manual=True)
    assert response["effort"].tolist() == [1.0, 1.0, 2.0], "without setpoint and measured value"


@pytest.mark.parametrize("kd", [0.0, 0.05])
def test_automatic_mode_begins_with_the_manual_effort(blocks: Blocks, kd: float) -> None:
    manual = np.arange(200) < 100
    response = blocks.run(
        "Pid",
        {"setpoint": 3.0, "measured": 0.5, "manual": manual, "manual_effort": 7.0,
         "feedforward": 0.25},
        kp=2.0, ki=10.0, kd=kd, filter_time=0.01,
    )  # fmt: skip
    after = 7.0 + 10.0 * 2.5 * DT * np.arange(100)
    assert (response["effort"][:100] == 7.0).all()
    assert np.allclose(response["effort"][100:], after, rtol=0, atol=ROUNDING)


def test_the_tracked_setpoint_returns_to_its_input_at_its_rate(blocks: Blocks) -> None:
    manual = np.arange(200) < 100
    response = blocks.run(
        "Pid", {"setpoint": 3.0, "measured": 0.5, "manual": manual, "manual_effort": 7.0},
        kp=2.0, ki=0.001, setpoint_tracking=True, setpoint_rate=10.0,
    )  # fmt: skip
    error = np.maximum(np.arange(200) - 99, 0) * 10.0 * DT
    assert np.allclose(response["error"], error, rtol=0, atol=ROUNDING)
    assert np.allclose(np.diff(response["effort"]), 2.0 * np.diff(error), rtol=0, atol=1e-5)


def test_manual_mode_works_without_a_sensor_and_automatic_mode_resumes(blocks: Blocks) -> None:
    cycle = np.arange(60)
    measured = np.where((cycle >= 20) & (cycle < 40), np.nan, 0.5)
    response = blocks.run(
        "Pid",
        {"setpoint": 1.0, "measured": measured, "manual": (cycle >= 30) & (cycle < 45),
         "manual_effort": 4.0},
        kp=2.0, ki=10.0,
    )  # fmt: skip
    effort = response["effort"]
    assert (effort[20:30] == effort[19]).all()
    assert (effort[30:45] == 4.0).all()
    assert np.allclose(effort[45:], 4.0 + 10.0 * 0.5 * DT * (cycle[45:] - 45), atol=ROUNDING)
    # The sensor returns after automatic mode.
    response = blocks.run(
        "Pid",
        {"setpoint": 1.0, "measured": measured, "manual": (cycle >= 30) & (cycle < 35),
         "manual_effort": 4.0},
        kp=2.0, ki=10.0,
    )  # fmt: skip
    assert response["effort"][40] == pytest.approx(4.0, abs=ROUNDING)


# Between cycles.


@pytest.mark.parametrize(
    "change",
    [
        {"kp": 7.0}, {"kd": 0.5}, {"setpoint_weight": 0.1}, {"derivative_weight": 0.9},
        {"dead_band": 0.25}, {"filter_time": 0.5}, {"ki": 11.0}, {"kp": -1.0, "kd": 0.0},
    ],
    ids=str,
)  # fmt: skip
def test_gains_change_without_a_jump(stepped: Bench, change: dict[str, float]) -> None:
    block = Stepped(stepped, "Pid", kp=2.0, ki=10.0, kd=0.05, setpoint_weight=0.7)
    try:
        block.write(setpoint=1.0, measured=0.5)
        before = block.step(50)["last_effort"]
        block.set(**change)
        after = block.step()
        assert after["last_effort"] == pytest.approx(before + 10.0 * 0.5 * DT, abs=ROUNDING)
        # The next step follows the new integral gain and band.
        growth = change.get("ki", 10.0) * (0.5 - change.get("dead_band", 0.0)) * DT
        assert block.step()["last_effort"] - after["last_effort"] == pytest.approx(
            growth, abs=ROUNDING
        )
    finally:
        block.unload()


def test_a_proportional_gain_without_integral_changes_effort_at_once(stepped: Bench) -> None:
    block = Stepped(stepped, "Pid", kp=2.0)
    try:
        block.write(setpoint=1.0, measured=0.5)
        assert block.step(3)["last_effort"] == 1.0
        block.set(kp=4.0)
        assert block.step()["last_effort"] == 2.0
    finally:
        block.unload()


def test_a_replacement_continues_a_reset_begins_again(stepped: Bench) -> None:
    given_parameters = {"kp": 2.0, "ki": 10.0}
    block = Stepped(stepped, "Pid", **given_parameters)
    try:
        block.write(setpoint=1.0, measured=0.5)
        before = block.step(100)
        stepped.client.replace("/stepped/block", block.spec(kp=5.0, ki=10.0))
        assert block.state["integral"] == before["integral"]
        after = block.step()
        assert after["last_effort"] == pytest.approx(before["last_effort"] + 0.005, abs=ROUNDING)
        stepped.client.reset_state("/stepped/block")
        assert block.step()["last_effort"] == 2.5
    finally:
        block.unload()


def test_a_snapshot_continues_bit_by_bit(stepped: Bench) -> None:
    block = Stepped(stepped, "Pid", kp=2.0, ki=10.0, kd=0.05, filter_time=0.01, upper=1.5)
    try:
        block.write(setpoint=1.0, measured=0.5)
        block.step(10)
        block.step(measured=0.25)
        taken = stepped.client.take_snapshot().snapshot
        first = block.step(70)
        stepped.client.restore_snapshot(taken)
        assert block.step(70) == first
    finally:
        block.unload()


def test_integral_and_rate_follow_the_period(stepped: Bench) -> None:
    block = Stepped(stepped, "Pid", kp=0.0, ki=1.0, tracking_time=0.1)
    try:
        block.write(setpoint=1.0, measured=0.0)
        before = block.step(100)["integral"]
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250))
        after = block.step(11)["integral"]
        assert after - before == pytest.approx(11 * 0.004, abs=ROUNDING)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_controller_in_place_of_another_type_continues_its_effort(stepped: Bench) -> None:
    block = Stepped(stepped, "Pid", kp=2.0, ki=10.0)
    client = stepped.client
    try:
        client.replace("/stepped/block", block.spec("Effort", package="rtcf_test", effort=6.5))
        client.step(3)
        client.replace("/stepped/block", block.spec(kp=2.0, ki=10.0), reset_parameters=True)
        block.write(setpoint=1.0, measured=0.5)
        assert block.step()["last_effort"] == 6.5
        assert block.step()["last_effort"] == pytest.approx(6.505, abs=ROUNDING)
    finally:
        block.unload()


def test_a_stop_passes_the_safe_effort_through_the_blocks_behind(stepped: Bench) -> None:
    client = stepped.client
    for spec in (
        rtcf.component("rtcf_control", "Pid", ns="/safe", name="pid",
                       parameters=["safe_effort:=-3.0", "in_manual:=true", "manual_value:=5.0"]),
        rtcf.component("rtcf_control", "Gain", ns="/safe", name="gain", parameters=["gain:=2.0"],
                       remaps=["in:=/safe/effort", "out:=/safe/doubled"]),
        rtcf.component("rtcf_control", "RateLimiter", ns="/safe", name="limiter",
                       remaps=["in:=/safe/doubled", "out:=/safe/torque"]),
    ):  # fmt: skip
        client.load(spec)
    try:
        client.start()
        client.stop()
        (last,) = (each for each in client.get_component("/safe/limiter").states
                   if each.name == "last")  # fmt: skip
        assert float(last.value) == -6.0
    finally:
        client.unload(["/safe/pid", "/safe/gain", "/safe/limiter"])


def _two_controllers(file: Path, *, with_actual: bool) -> Path:
    """Write a graph in which a Switch selects one of two controllers of a plant with a lag."""
    own = "setpoint: /setpoint, measured: /position"
    breaks = "measured"
    if with_actual:
        own += ", actual: /speed"
        breaks += ", actual"
    lines = [
        f"  - {{name: {name}, ns: /{name}, package: rtcf_control, type: Pid, breaks: [{breaks}],\n"
        f"     remaps: {{effort: /effort_{name}, {own}}},\n"
        f"     parameters: {{kp: {kp}, ki: {ki}, tracking_time: 0.2}}}}\n"
        for name, kp, ki in (("a", 4.0, 8.0), ("b", 2.0, 1.0))
    ]
    file.write_text(
        "components:\n" + "".join(lines) + "  - {name: switch, package: rtcf_control, type: Switch,"
        " remaps: {in0: /effort_a, in1: /effort_b, out: /speed}}\n"
        "  - {name: lag, package: rtcf_control, type: Sum, parameters: {gain2: -1.0},\n"
        "     remaps: {in1: /speed, in2: /position, out: /slope}, breaks: [in2]}\n"
        "  - {name: plant, package: rtcf_control, type: Integrator,\n"
        "     remaps: {in: /slope, out: /position}}\n"
    )
    return file


@pytest.mark.parametrize("with_actual", [False, True])
def test_a_controller_that_is_not_selected_follows_the_actual_effort(
    tmp_path: Path, with_actual: bool
) -> None:
    file = _two_controllers(tmp_path / "two.yaml", with_actual=with_actual)
    select = (np.arange(8000) >= 6000).astype(np.int32)
    with Bench(str(file), path=PATH) as bench:
        response = bench.run({"/a/a.setpoint": 1.0, "/switch.select": select})
    effort = response["/switch.out"]
    assert effort[5999] == pytest.approx(1.0, abs=0.01), "the effort that holds the plant"
    jump = abs(effort[6000] - effort[5999])
    assert (jump < 0.01) if with_actual else (jump > 0.1)
