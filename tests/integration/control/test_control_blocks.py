"""The blocks of rtcf_control without Pid and SignalGenerator, against independent references.

Tolerances: comparisons, selections and single operations are exact. Sums of up to 2000 terms of
size 1 differ from their references by less than ROUNDING, as each addition rounds by 1e-16.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import rtcf
from block_bench import Blocks, Stepped, rejection
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2
from scipy import integrate, interpolate, signal
from values import port_value

DT = 0.001
ROUNDING = 1e-11
MASKED: Any = np.ma
TYPES = (
    "Backlash", "Comparator", "Counter", "DeadBand", "Delay", "Demux2", "Demux3", "Demux6",
    "Demux7", "Derivative", "Gain", "Hysteresis", "Integrator", "LookupTable", "LookupTable2D",
    "MovingAverage", "Mux2", "Mux3", "Mux6", "Mux7", "RateLimiter", "Saturation", "Sum", "Switch",
)  # fmt: skip
# Tested in modules of their own.
OTHERS = (
    "Biquads", "CommandTimeout", "EStop", "Excitation", "FrictionCompensation",
    "GravityCompensation", "Heartbeat", "JointCommandSubscriber", "JointLimiter",
    "JointStatePublisher", "KalmanFilter", "Motor", "Pid", "SignalGenerator", "StateSpace",
    "TrajectoryGenerator",
)  # fmt: skip
STATEFUL = (
    "Backlash", "Delay", "Derivative", "Hysteresis", "Integrator", "MovingAverage", "RateLimiter",
)  # fmt: skip
WALK = np.cumsum(np.random.default_rng(29).normal(size=1000))
WAVE = np.sin(np.linspace(0.0, 20.0, 1000)) + 0.3

numbers = st.floats(-1e3, 1e3)
walks = arrays.arrays(float, 60, elements=numbers)


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    with Blocks(tmp_path_factory.mktemp("blocks"), TYPES) as blocks:
        yield blocks


def vectors(response: dict[str, Any]) -> Any:
    """Return the vectors that a Mux has written; three values are a geometry_msgs/Vector3."""
    if "out.x" in response:
        return np.stack([response[f"out.{axis}"] for axis in "xyz"], axis=1)
    return response["out"].reshape(len(response["out"]), -1)


# What all have in common.


def test_the_package_has_the_components_that_are_tested_each_with_one_line(
    blocks: Blocks,
) -> None:
    types = {each.type: each.doc for each in blocks.client.list_types("rtcf_control").types}
    assert sorted(types) == sorted((*TYPES, *OTHERS))
    assert [name for name, doc in types.items() if not doc or "\n" in doc] == []


@pytest.mark.parametrize(
    "type_",
    [
        "Backlash", "DeadBand", "Delay", "Derivative", "Gain", "Integrator", "LookupTable",
        "MovingAverage", "RateLimiter", "Saturation",
    ],
)  # fmt: skip
def test_values_that_are_not_finite_leave_the_output_as_it_is(blocks: Blocks, type_: str) -> None:
    values = np.array([0.25, 0.5, np.nan, np.inf, -np.inf, 0.75, 0.75])
    out = blocks.out(type_, {"in": values})
    assert np.isfinite(out).all()
    assert (out[2:5] == out[1]).all()


@pytest.mark.parametrize("type_", ["Backlash", "Gain", "MovingAverage", "RateLimiter", "Switch"])
def test_nothing_is_written_before_the_first_value(blocks: Blocks, type_: str) -> None:
    name = "in0" if type_ == "Switch" else "in"
    values = MASKED.array([9.0, 9.0, 5.0, 5.0], mask=[True, True, False, False])
    out = blocks.out(type_, {name: values})
    assert np.isnan(out[:2]).all()
    assert out[2:].tolist() == [5.0, 5.0]


@pytest.mark.parametrize(
    ("type_", "parameters", "said"),
    [
        ("Saturation", {"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        ("DeadBand", {"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        ("Integrator", {"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        ("Hysteresis", {"low": 2.0, "high": 1.0}, "low = 2 is above high = 1"),
        ("RateLimiter", {"rising": -1.0}, "rising"),
        ("Backlash", {"width": -1.0}, "width"),
        ("Derivative", {"filter_time": -1.0}, "filter_time"),
        ("MovingAverage", {"length": 0}, "length"),
        ("MovingAverage", {"length": 1001}, "length"),
        ("Switch", {"selected": 4}, "selected"),
        ("Delay", {"delay": 1.1}, "delay = 1.1 s is above 1000 cycles, which are 1 s at 1000 Hz"),
        ("LookupTable", {"x": "0 one"}, 'x: one is not a number; write a list as in "0 1 2"'),
        ("LookupTable", {"y": "0 1;2"}, 'y: 1;2 is not a number; write a list as in "0 1 4"'),
        ("LookupTable", {"y": "0 inf"}, "y: inf is not a number"),
        ("LookupTable", {"x": "0 1 2"}, "x has 3 numbers and y has 2: each point needs one of"),
        ("LookupTable", {"x": "", "y": ""}, "x has 0 numbers"),
        ("LookupTable", {"x": "1 1"}, "x: each number must be above the previous one"),
        ("LookupTable2D", {"columns": "0"}, "columns and rows need at least two numbers each"),
        ("LookupTable2D", {"rows": "1 0"}, "rows: each number must be above the previous one"),
        ("LookupTable2D", {"values": "1 2 3"}, "values has 3 numbers; 2 rows of 2 columns need 4"),
        ("LookupTable2D", {"values": "1 2 x 4"}, "values: x is not a number"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, type_: str, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set(type_, **parameters)


# Gain, Sum, limits.


@pytest.mark.parametrize("gain", [2.5, -2.5, 0.0])
def test_gain_multiplies_and_adds(blocks: Blocks, gain: float) -> None:
    out = blocks.out("Gain", {"in": WALK}, gain=gain, offset=-1.0)
    assert out.tolist() == (gain * WALK - 1.0).tolist()


def test_sum_weights_its_inputs_and_takes_0_for_those_without_a_value(blocks: Blocks) -> None:
    inputs = np.random.default_rng(1).normal(size=(4, 100))
    gains: dict[str, Any] = {"gain1": 1.0, "gain2": -1.0, "gain3": 0.5, "gain4": 0.0}
    names = ("in1", "in2", "in3", "in4")
    out = blocks.out("Sum", dict(zip(names, inputs, strict=True)), bias=3.0, **gains)
    assert np.allclose(out, np.array(list(gains.values())) @ inputs + 3.0, rtol=0, atol=ROUNDING)
    only = blocks.out("Sum", {"in2": inputs[1]}, gain2=-1.0)
    assert only.tolist() == (-inputs[1]).tolist()
    late = MASKED.array(inputs[0], mask=np.arange(100) < 50)
    out = blocks.out("Sum", {"in1": late, "in2": inputs[1]})
    assert out[:50].tolist() == inputs[1][:50].tolist()
    assert out[50:].tolist() == (inputs[0] + inputs[1])[50:].tolist()
    assert "out" not in blocks.run("Sum", steps=3)


@pytest.mark.parametrize(
    ("lower", "upper"), [(-1.0, 0.5), (0.25, 0.25), (-np.inf, 0.5), (0.5, np.inf)]
)
def test_saturation_limits_to_a_range(blocks: Blocks, lower: float, upper: float) -> None:
    limits: dict[str, Any] = {
        name: value for name, value in (("lower", lower), ("upper", upper)) if np.isfinite(value)
    }
    response = blocks.run("Saturation", {"in": WAVE}, **limits)
    expected = np.minimum(np.maximum(WAVE, lower), upper)
    assert response["out"].tolist() == expected.tolist()
    assert response["saturated"].astype(bool).tolist() == (expected != WAVE).tolist()


@pytest.mark.parametrize(("lower", "upper"), [(-0.5, 0.25), (0.0, 0.0), (0.5, 1.0)])
def test_dead_band_removes_the_band(blocks: Blocks, lower: float, upper: float) -> None:
    out = blocks.out("DeadBand", {"in": WAVE}, lower=lower, upper=upper)
    expected = np.maximum(WAVE - upper, 0.0) + np.minimum(WAVE - lower, 0.0)
    assert out.tolist() == expected.tolist()


@seed(29)
@settings(max_examples=15)
@given(walk=walks, rising=st.floats(0.0, 1e6), falling=st.floats(0.0, 1e6))
def test_rate_limiter_follows_within_its_rates(
    blocks: Blocks, walk: Any, rising: float, falling: float
) -> None:
    out = blocks.out("RateLimiter", {"in": walk}, rising=rising, falling=falling)
    expected = [walk[0]]
    for value in walk[1:]:
        change = min(max(value - expected[-1], -falling * DT), rising * DT)
        expected.append(expected[-1] + change)
    assert np.allclose(out, expected, rtol=0, atol=1e3 * ROUNDING)


def test_rate_limiter_reports_that_it_limits_and_holds_at_rate_0(blocks: Blocks) -> None:
    step = np.where(np.arange(20) < 5, 0.0, 1.0)
    response = blocks.run("RateLimiter", {"in": step}, rising=125.0)  # 8 cycles of 0.125
    assert response["limited"].astype(bool).tolist() == [5 <= each < 12 for each in range(20)]
    assert blocks.out("RateLimiter", {"in": step}, rising=0.0).tolist() == [0.0] * 20
    # Without a limit downwards.
    assert blocks.out("RateLimiter", {"in": -step}, rising=0.0).tolist() == (-step).tolist()


@seed(29)
@settings(max_examples=15)
@given(walk=walks, width=st.floats(0.0, 500.0))
def test_backlash_is_the_play_operator(blocks: Blocks, walk: Any, width: float) -> None:
    out = blocks.out("Backlash", {"in": walk}, width=width)
    expected = [walk[0]]
    for drive in walk[1:]:
        gap = drive - expected[-1]
        moved = max(abs(gap) - width / 2.0, 0.0)  # the part that the flank pushes
        expected.append(expected[-1] + np.sign(gap) * moved)
    assert np.allclose(out, expected, rtol=0, atol=1e3 * ROUNDING)


# Logic.


@pytest.mark.parametrize("initial", [False, True])
@pytest.mark.parametrize(("low", "high"), [(-0.2, 0.7), (0.25, 0.25)])
def test_hysteresis_changes_at_its_ends_only(
    blocks: Blocks, low: float, high: float, initial: bool
) -> None:
    values = np.round(WAVE, 2)
    values[[3, 400]] = np.nan
    out = blocks.out("Hysteresis", {"in": values}, low=low, high=high, initial=initial)
    decided = np.where(values > high, 1, np.where(values < low, 0, -1))
    decided = np.concatenate([[int(initial)], decided])
    last = np.maximum.accumulate(np.where(decided >= 0, np.arange(len(decided)), 0))
    assert out.astype(int).tolist() == decided[last][1:].tolist()


@pytest.mark.parametrize(
    ("relation", "expected"),
    [
        ("above", lambda x, y: x > y),
        ("below", lambda x, y: x < y),
        ("within", lambda x, y: np.abs(x - y) <= 0.25),
    ],
)
def test_comparator_compares_with_its_reference(
    blocks: Blocks, relation: str, expected: Any
) -> None:
    values = np.array([0.0, 1.0, 1.25, 1.5, np.nan, 1.0, 1.0])
    reference = MASKED.array([9.0, 1.0, 1.0, 1.0, 1.0, np.nan, 2.0], mask=[1, 0, 0, 0, 0, 0, 0])
    out = blocks.out("Comparator", {"in": values, "reference": reference},
                     relation=relation, threshold=0.0, tolerance=0.25)  # fmt: skip
    against = np.array([0.0, 1.0, 1.0, 1.0, 1.0, np.nan, 2.0])
    assert out.astype(bool).tolist() == expected(values, against).tolist()


@seed(29)
@settings(max_examples=15)
@given(
    levels=arrays.arrays(bool, (3, 60), elements=st.booleans()),
    initial=st.integers(-20, 20),
    modulus=st.integers(0, 7),
)
def test_counter_counts_rising_edges(
    blocks: Blocks, levels: Any, initial: int, modulus: int
) -> None:
    up, down, reset = levels
    reset = reset & (np.arange(60) % 7 == 0)
    out = blocks.out("Counter", {"up": up, "down": down, "reset": reset},
                     initial=initial, modulus=modulus, output="count")  # fmt: skip
    levels_before = np.concatenate([np.ones((2, 1), bool), levels[:2, :-1]], axis=1)
    ups, downs = (levels[:2] & ~levels_before).astype(int)
    count = initial
    expected = []
    for cycle in range(60):
        count = initial if reset[cycle] else count + int(ups[cycle] - downs[cycle])
        expected.append(count % modulus if modulus else count)
    assert out.tolist() == expected


# Dynamics.


@pytest.mark.parametrize("gain", [2.0, -2.0, 0.0])
def test_integrator_is_the_trapezoidal_rule_or_the_sum(blocks: Blocks, gain: float) -> None:
    out = blocks.out("Integrator", {"in": WAVE}, gain=gain, initial=3.0)
    expected = 3.0 + gain * integrate.cumulative_trapezoid(WAVE, dx=DT, initial=0.0)
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)
    out = blocks.out("Integrator", {"in": WAVE}, gain=gain, method="euler")
    expected = gain * DT * (np.cumsum(WAVE) - WAVE[0])
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)


def test_integrator_of_a_ramp_is_a_parabola(blocks: Blocks) -> None:
    time = np.arange(1000) * DT
    out = blocks.out("Integrator", {"in": time})
    assert np.allclose(out, time**2 / 2.0, rtol=0, atol=ROUNDING)


def test_integrator_stops_at_its_limits_and_leaves_them_at_once(blocks: Blocks) -> None:
    values = np.where(np.arange(1000) < 600, 1.0, -1.0)
    out = blocks.out("Integrator", {"in": values}, upper=0.25, lower=-0.125, method="euler")
    expected = [0.0]
    for value in values[1:]:
        expected.append(min(max(expected[-1] + value * DT, -0.125), 0.25))
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)
    assert (blocks.out("Integrator", {"in": WAVE}, lower=0.5, upper=0.5) == 0.5).all()


def test_integrator_writes_its_initial_value_without_an_input_and_at_a_reset(
    blocks: Blocks,
) -> None:
    assert blocks.out("Integrator", steps=3, initial=2.0).tolist() == [2.0] * 3
    reset = np.arange(40) % 10 == 5
    out = blocks.out("Integrator", {"in": 1.0, "reset": reset}, initial=2.0)
    since = np.where(np.arange(40) < 5, np.arange(40), (np.arange(40) - 5) % 10)
    assert np.allclose(out, 2.0 + DT * since, rtol=0, atol=ROUNDING)
    # A reset also works with a broken sensor.
    values = np.where(np.arange(40) < 4, 1.0, np.nan)
    out = blocks.out("Integrator", {"in": values, "reset": reset}, initial=2.0)
    assert out[4] == pytest.approx(2.003, abs=ROUNDING)
    assert out[5] == 2.0


@pytest.mark.parametrize("filter_time", [0.0, 0.01, 1.0])
def test_derivative_is_the_backward_difference_of_its_transfer_function(
    blocks: Blocks, filter_time: float
) -> None:
    out = blocks.out("Derivative", {"in": WAVE}, gain=-2.0, filter_time=filter_time)
    if filter_time == 0.0:
        expected = -2.0 * np.diff(WAVE, prepend=WAVE[0]) / DT
    else:
        b, a, _ = signal.cont2discrete(
            ([-2.0, 0.0], [filter_time, 1.0]), DT, method="backward_diff"
        )
        expected = signal.lfilter(b.ravel(), a, WAVE - WAVE[0])
    assert np.allclose(out, expected, rtol=0, atol=1e3 * ROUNDING)


def test_derivative_of_a_ramp_is_its_slope_also_after_a_gap(blocks: Blocks) -> None:
    ramp = 3.0 * DT * np.arange(200)
    filtered = blocks.out("Derivative", {"in": ramp}, filter_time=0.02)
    analytic = 3.0 * (1.0 - (0.02 / 0.021) ** np.arange(200))
    assert np.allclose(filtered, analytic, rtol=0, atol=ROUNDING)
    ramp[50:90] = np.nan
    out = blocks.out("Derivative", {"in": ramp})
    assert np.allclose(out[1:], 3.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("filter_time", [0.0, 0.01])
def test_derivative_continues_after_a_value_that_overflows(
    blocks: Blocks, filter_time: float
) -> None:
    ramp = 3.0 * DT * np.arange(200)
    ramp[50] = 1e307
    out = blocks.out("Derivative", {"in": ramp}, filter_time=filter_time)
    assert out[50] == out[49]
    assert out[-1] == pytest.approx(3.0, abs=1e-4)


@seed(29)
@settings(max_examples=15)
@given(walk=arrays.arrays(float, 60, elements=numbers), length=st.integers(1, 70))
def test_moving_average_is_the_mean_of_the_window(blocks: Blocks, walk: Any, length: int) -> None:
    out = blocks.out("MovingAverage", {"in": walk}, length=length)
    expected = [np.mean(walk[max(0, end - length) : end]) for end in range(1, 61)]
    assert np.allclose(out, expected, rtol=0, atol=1e3 * ROUNDING)


def test_moving_average_forgets_the_rounding_of_a_large_value(blocks: Blocks) -> None:
    values = np.full(100, 0.1)
    values[5] = 1e15
    out = blocks.out("MovingAverage", {"in": values}, length=10)
    assert np.allclose(out[15:], 0.1, rtol=0, atol=1e-15)


@pytest.mark.parametrize("place", [0, 5, 57, 99])
def test_moving_average_forgets_a_large_value_that_has_left(blocks: Blocks, place: int) -> None:
    values = np.full(400, 0.1)
    values[place] = 1e16
    out = blocks.out("MovingAverage", {"in": values}, length=100)
    assert np.allclose(out[place + 100 :], 0.1, rtol=0, atol=1e-14)


def test_moving_average_of_the_longest_window_is_a_filter(blocks: Blocks) -> None:
    values = np.concatenate([np.zeros(999), WAVE])
    out = blocks.out("MovingAverage", {"in": values}, length=1000)
    expected = signal.lfilter(np.full(1000, 1e-3), 1.0, values)
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("cycles", [0, 1, 7, 999, 1000])
def test_delay_by_whole_cycles_is_a_shift(blocks: Blocks, cycles: int) -> None:
    values = np.arange(1200.0) + 0.1
    out = blocks.out("Delay", {"in": values}, delay=cycles * DT, initial=-1.0)
    assert list(out) == [-1.0] * cycles + list(values[: 1200 - cycles])


def test_delay_between_cycles_is_linear_and_bridges_gaps(blocks: Blocks) -> None:
    time = np.arange(1000) * DT
    out = blocks.out("Delay", {"in": WAVE}, delay=0.0123)
    expected = np.interp(time - 0.0123, time, WAVE, left=0.0)
    assert np.allclose(out, expected, rtol=0, atol=ROUNDING)
    gaps = WAVE.copy()
    gaps[100:110] = np.nan
    there = np.isfinite(gaps)
    out = blocks.out("Delay", {"in": gaps}, delay=0.0123)
    expected = np.interp(time - 0.0123, time[there], WAVE[there], left=0.0)
    assert np.allclose(out[there], expected[there], rtol=0, atol=ROUNDING)


def test_delay_writes_its_initial_value_without_an_input(blocks: Blocks) -> None:
    assert blocks.out("Delay", steps=3, initial=2.0).tolist() == [2.0] * 3


# Vectors, selection, tables.


@pytest.mark.parametrize("size", [2, 3, 6, 7])
def test_mux_and_demux_are_inverse(blocks: Blocks, size: int) -> None:
    values = np.random.default_rng(size).normal(size=(50, size))
    inputs = {f"in{i + 1}": values[:, i] for i in range(size)}
    assert vectors(blocks.run(f"Mux{size}", inputs)).tolist() == values.tolist()
    fields = {"in": values}
    if size == 3:
        fields = {f"in.{axis}": values[:, i] for i, axis in enumerate("xyz")}
    response = blocks.run(f"Demux{size}", fields)
    for i in range(size):
        assert response[f"out{i + 1}"].tolist() == values[:, i].tolist()


def test_mux_waits_for_all_inputs_and_rejects_what_is_not_finite(blocks: Blocks) -> None:
    late = MASKED.array([1.0, 2.0, 3.0, 4.0], mask=[True, False, False, False])
    found = vectors(blocks.run("Mux2", {"in1": [5.0, 6.0, np.nan, 8.0], "in2": late}))
    assert np.isnan(found[0]).all()
    assert found[1:].tolist() == [[6.0, 2.0], [6.0, 2.0], [8.0, 4.0]]


def test_switch_selects_and_ignores_numbers_without_a_value(blocks: Blocks) -> None:
    inputs = {"in0": 10.0, "in1": 11.0, "in3": 13.0}
    select = np.array([0, 1, 2, 3, 4, -1, 1, 2_000_000_000])
    out = blocks.out("Switch", {**inputs, "select": select})
    assert out.tolist() == [10.0, 11.0, 11.0, 13.0, 13.0, 13.0, 11.0, 11.0]
    assert blocks.out("Switch", inputs, steps=2, selected=3).tolist() == [13.0] * 2


@seed(29)
@settings(max_examples=10)
@given(
    inputs=arrays.arrays(float, (2, 60), elements=numbers),
    select=arrays.arrays(np.int32, 60, elements=st.integers(0, 1)),
    cycles=st.integers(0, 9),
)
def test_switch_moves_to_another_input_in_the_time_of_the_transition(
    blocks: Blocks, inputs: Any, select: Any, cycles: int
) -> None:
    out = blocks.out("Switch", {"in0": inputs[0], "in1": inputs[1], "select": select},
                     fade=cycles * DT)  # fmt: skip
    expected: list[float] = []
    origin, since = 0.0, cycles
    for cycle in range(60):
        if cycle and select[cycle] != select[cycle - 1]:
            origin, since = expected[-1], 0
        since = min(since + 1, cycles)
        share = since / cycles if cycles else 1.0
        expected.append(origin + share * (inputs[select[cycle]][cycle] - origin))
    assert np.allclose(out, expected, rtol=0, atol=1e3 * ROUNDING)


X = [-2.0, -0.5, 0.25, 3.0]
Y = [1.0, 4.0, -2.0, 0.5]


def text(values: Any) -> str:
    return " ".join(repr(float(each)) for each in np.ravel(values))


def test_lookup_table_is_linear_between_its_points(blocks: Blocks) -> None:
    values = np.concatenate([np.linspace(-5.0, 5.0, 300), X])
    out = blocks.out("LookupTable", {"in": values}, x=text(X), y=text(Y))
    assert np.allclose(out, np.interp(values, X, Y), rtol=0, atol=ROUNDING)
    assert out[-4:].tolist() == Y
    out = blocks.out("LookupTable", {"in": values}, x=text(X), y=text(Y), outside="extend")
    line = interpolate.interp1d(X, Y, fill_value="extrapolate")
    assert np.allclose(out, line(values), rtol=0, atol=ROUNDING)
    # Commas, line breaks, and one point.
    assert blocks.out("LookupTable", {"in": [0.5]}, x="0,\n1", y="2, 4").tolist() == [3.0]
    for outside in ("clamp", "extend"):
        out = blocks.out("LookupTable", {"in": values}, x="1", y="7", outside=outside)
        assert (out == 7.0).all()


def test_lookup_table_2d_is_bilinear_between_its_points(blocks: Blocks) -> None:
    rows = [-1.0, 0.5, 2.0]
    table = np.random.default_rng(2).normal(size=(3, 4))
    across, down = np.random.default_rng(3).uniform(-4.0, 4.0, (2, 300))
    parameters: dict[str, Any] = {"columns": text(X), "rows": text(rows), "values": text(table)}
    grid = interpolate.RegularGridInterpolator(
        (rows, X), table, bounds_error=False, fill_value=None
    )
    out = blocks.out("LookupTable2D", {"x": across, "y": down}, **parameters)
    inside = np.stack([np.clip(down, -1.0, 2.0), np.clip(across, -2.0, 3.0)], axis=1)
    assert np.allclose(out, grid(inside), rtol=0, atol=ROUNDING)
    out = blocks.out("LookupTable2D", {"x": across, "y": down}, outside="extend", **parameters)
    assert np.allclose(out, grid(np.stack([down, across], axis=1)), rtol=0, atol=ROUNDING)


# Between cycles: parameters, resets, replacements, snapshots, other periods.


def test_stateful_blocks_go_on_after_a_replacement_and_begin_again_after_a_reset(
    stepped: Bench,
) -> None:
    for type_ in STATEFUL:
        block = Stepped(stepped, type_)
        try:
            for value in (0.5, 2.0, -1.0):
                before = block.step(2, **{"in": value})
            assert not stepped.client.replace("/stepped/block", block.spec()).notes
            assert block.state == before, type_
            stepped.client.reset_state("/stepped/block")
            initial = block.state
            assert initial != before, type_
        finally:
            block.unload()


def test_stateful_blocks_continue_bit_by_bit_from_a_snapshot(stepped: Bench) -> None:
    client = stepped.client
    source = rtcf.component("rtcf_control", "SignalGenerator", name="source", ns="/snap",
                            parameters=["shape:=triangle", "frequency:=3.3"])  # fmt: skip
    client.load(source)
    for type_ in STATEFUL:
        client.load(rtcf.component("rtcf_control", type_, name=type_, ns=f"/snap/{type_}",
                                   remaps=["in:=/snap/out"]))  # fmt: skip

    def states() -> list[tuple[str, str, str]]:
        return [
            (type_, each.name, each.value)
            for type_ in STATEFUL
            for each in client.get_component(f"/snap/{type_}/{type_}").states
        ]

    try:
        client.step(137)
        taken = client.take_snapshot().snapshot
        client.step(411)
        first = states()
        client.restore_snapshot(taken)
        client.step(411)
        assert states() == first
    finally:
        names = [f"/snap/{type_}/{type_}" for type_ in STATEFUL]
        client.unload([*names, "/snap/source"])


def test_a_gain_of_an_integrator_changes_without_a_jump(stepped: Bench) -> None:
    block = Stepped(stepped, "Integrator")
    try:
        before = block.step(101, **{"in": 1.0})["sum"]
        assert before == pytest.approx(0.1, abs=ROUNDING)
        block.set(gain=50.0)
        # One interval between both gains, as the trapezoidal rule has it.
        assert block.step()["sum"] == pytest.approx(before + DT * 25.5, abs=ROUNDING)
        assert block.step()["sum"] == pytest.approx(before + DT * 75.5, abs=ROUNDING)
    finally:
        block.unload()


@pytest.mark.parametrize("length", [3, 40])
def test_a_window_changes_its_length_without_a_jump(stepped: Bench, length: int) -> None:
    block = Stepped(stepped, "MovingAverage", length=10)

    def mean() -> float:
        return port_value(stepped.client, "/stepped/block", "out")

    try:
        for value in range(12):
            block.step(**{"in": float(value)})
        assert mean() == pytest.approx(6.5, abs=ROUNDING)
        block.set(length=length)
        block.step(**{"in": 6.5})
        assert mean() == pytest.approx(6.5, abs=ROUNDING)
        state = block.step(length, **{"in": 7.0})
        assert state["count"] == length
        assert mean() == pytest.approx(7.0, abs=ROUNDING)
    finally:
        block.unload()


def test_state_that_does_not_fit_is_dropped(stepped: Bench) -> None:
    block = Stepped(stepped, "MovingAverage", length=10)
    try:
        block.step(5, **{"in": 1.0})
        wrong = rtcf.parse_parameter("next:=999999")
        stepped.client.set_state("/stepped/block", [wrong])
        state = block.step()
        assert (state["count"], state["next"], state["round"]) == (1, 1, 1.0)
    finally:
        block.unload()
    block = Stepped(stepped, "Switch")
    try:
        block.step(5, in0=1.0)
        stepped.client.set_state("/stepped/block", [rtcf.parse_parameter("active:=-70000")])
        assert block.step()["active"] == 0
    finally:
        block.unload()


def test_integral_and_rate_follow_the_period(stepped: Bench) -> None:
    block = Stepped(stepped, "Integrator")
    try:
        before = block.step(100, **{"in": 1.0})["sum"]
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250))
        after = block.step(11)["sum"]
        assert after - before == pytest.approx(11 * 0.004, abs=ROUNDING)
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_delay_that_a_faster_loop_makes_too_long_is_reported(stepped: Bench) -> None:
    block = Stepped(stepped, "Delay", delay=0.9)
    try:
        block.step(2, **{"in": 1.0})
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=2000))
        block.step(2)
        assert "/stepped/block: delay is only 0.5 s: at most 1000 cycles at 2000 Hz" in stepped.logs
    finally:
        block.unload()
        stepped.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1000))


def test_a_derivative_of_a_slow_source_has_no_spikes(stepped: Bench) -> None:
    block = Stepped(stepped, "Derivative")
    try:
        found = []
        for k in range(10):  # a ramp of 1/s at 100 Hz in a loop of 1 kHz
            found.append(block.step(**{"in": 0.01 * k})["rate"])
            found += [block.step()["rate"] for _ in range(9)]
        assert found[11:] == pytest.approx([1.0] * 89)
        # The source stops: the rate is held for two of its intervals, then falls.
        assert block.step(11)["rate"] == pytest.approx(1.0)
        assert block.step(20)["rate"] == pytest.approx(0.5)
    finally:
        block.unload()
