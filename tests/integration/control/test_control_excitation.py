"""rtcf_control/Excitation: its signals are those of SignalGenerator, bit by bit; all ends are safe.

All comparisons are exact: the excitation is one addition and one limit.
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
from rtcf.testing import Bench

STEPS = 400
WAYS: dict[str, Any] = {"lower": -10.0, "upper": 10.0, "duration": 0.3}
READY, RUNNING, COMPLETED, STOPPED, LEFT_LIMITS, LEASE_ENDED, NOT_BEGUN = range(7)
ON = np.arange(STEPS) >= 10  # run: false, then true in each cycle
IN = 0.3 * np.sin(0.01 * np.arange(STEPS)) + 0.5
MASKED: Any = np.ma


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Blocks]:
    types = ["Excitation", "SignalGenerator"]
    with Blocks(tmp_path_factory.mktemp("excitation"), types) as blocks:
        yield blocks


def excite(blocks: Blocks, inputs: dict[str, Any], **parameters: Any) -> Any:
    """Run an excitation from cycle 10 on."""
    return blocks.run("Excitation", {"run": ON, **inputs}, **{**WAYS, **parameters})


def only(column: Any, cycles: Any) -> Any:
    """Return values that are sent only in some cycles."""
    return MASKED.array(column, mask=~np.isin(np.arange(STEPS), cycles))


@pytest.mark.parametrize(
    ("shape", "more"),
    [
        ("step", {}),
        ("prbs", {"frequency": 200.0}),
        ("linear_chirp", {"frequency": 2.0, "end_frequency": 50.0}),
        ("log_chirp", {"frequency": 2.0, "end_frequency": 50.0}),
        ("multisine", {"frequency": 5.0, "lines": 7}),
    ],
)
def test_signals_are_those_of_the_signal_generator(
    blocks: Blocks, shape: str, more: dict[str, Any]
) -> None:
    found = excite(blocks, {"in": IN}, shape=shape, amplitude=2.0, **more)
    time: dict[str, Any] = {} if shape == "step" else {"duration": 0.3}
    wave = blocks.out("SignalGenerator", steps=300, shape=shape, amplitude=2.0, **time, **more)
    assert found["out"][10:310].tolist() == (IN[10:310] + wave).tolist()
    assert found["out"][:10].tolist() == IN[:10].tolist()
    assert found["out"][310:].tolist() == IN[310:].tolist()
    assert found["state"].tolist() == 10 * [READY] + 300 * [RUNNING] + 90 * [COMPLETED]
    assert found["running"].tolist() == (found["state"] == RUNNING).tolist()
    assert (found["signal"][found["state"] != RUNNING] == 0.0).all()


def test_replace_keeps_the_value_of_the_begin(blocks: Blocks) -> None:
    found = excite(blocks, {"in": IN}, mode="replace", amplitude=2.0)
    assert (found["out"][10:310] == IN[10] + 2.0).all()
    assert found["out"][310:].tolist() == IN[310:].tolist()


def test_the_signal_begins_after_its_delay(blocks: Blocks) -> None:
    found = excite(blocks, {"in": IN}, delay=0.05, duration=0.1)
    assert (found["signal"][10:60] == 0.0).all()
    assert (found["out"][60:160] == IN[60:160] + 1.0).all()
    assert found["state"].tolist().count(RUNNING) == 150


def test_the_relay_switches_at_its_hysteresis(blocks: Blocks) -> None:
    measured = 4.0 + np.sin(0.05 * np.arange(STEPS))
    found = excite(blocks, {"measured": measured}, shape="relay", hysteresis=0.3, amplitude=2.0)
    error = measured[10] - measured
    high, expected = True, []
    for each in error[10:310]:
        high = True if each > 0.3 else False if each < -0.3 else high
        expected.append(2.0 if high else -2.0)
    assert found["out"][10:310].tolist() == expected
    assert len(set(expected)) == 2


@seed(37)
@settings(max_examples=20, deadline=None)
@given(
    shape=st.sampled_from(["step", "prbs", "log_chirp", "multisine"]),
    amplitude=st.floats(-50.0, 50.0),
    limits=st.tuples(st.floats(-5.0, 0.0), st.floats(1.0, 5.0)),
)
def test_the_command_stays_within_its_limits(
    blocks: Blocks, shape: str, amplitude: float, limits: tuple[float, float]
) -> None:
    lower, upper = limits
    found = excite(blocks, {"in": IN}, shape=shape, amplitude=amplitude, lower=lower, upper=upper)
    assert found["out"].min() >= lower
    assert found["out"].max() <= upper
    running = found["state"] == RUNNING
    assert running.sum() == 300
    assert (found["out"][~running] == IN[~running]).all()


# Ends.


@pytest.mark.parametrize("bad", [2.0, -2.0, np.nan, np.inf])
def test_a_measured_value_outside_its_limits_stops_at_once(blocks: Blocks, bad: float) -> None:
    measured = np.zeros(STEPS)
    measured[100] = bad
    found = excite(
        blocks, {"in": IN, "measured": measured}, measured_lower=-1.0, measured_upper=1.5
    )
    assert (found["out"][10:100] == IN[10:100] + 1.0).all()
    assert found["out"][100:].tolist() == IN[100:].tolist()
    assert (found["state"][100:] == LEFT_LIMITS).all()


@pytest.mark.parametrize("kind", ["late", "NaN", "frozen"])
@pytest.mark.parametrize("needed", [{"measured_upper": 1.5}, {"shape": "relay"}])
def test_a_lost_measured_value_ends_it(blocks: Blocks, kind: str, needed: dict[str, Any]) -> None:
    measured = only(IN, range(100)) if kind == "late" else IN.copy()
    if kind == "frozen":
        measured[100:] = measured[99]
    elif kind == "NaN":
        measured[100] = np.nan
    limit = {"frozen_timeout": 0.15} if kind == "frozen" else {"measurement_timeout": 0.15}
    found = excite(blocks, {"in": IN, "measured": measured}, **needed, **limit)
    ended = 100 if kind == "NaN" else 250
    assert (found["state"][10:ended] == RUNNING).all()
    assert (found["state"][ended:] == LEFT_LIMITS).all()
    assert found["out"][ended:].tolist() == IN[ended:].tolist()
    # Without limits, it is not needed.
    found = excite(blocks, {"in": IN, "measured": measured}, **limit)
    assert (found["state"][310:] == COMPLETED).all()


def test_a_lost_measured_value_is_named(stepped: Bench) -> None:
    excitation = Stepped(stepped, "Excitation", **WAYS, measured_upper=1.0)
    try:
        excitation.step(2, run=False, measured=0.0)
        excitation.step(1, run=True)
        excitation.step(250)
        fault = stepped.client.get_component("/stepped/block").fault
        said = "measured has no new value within measurement_timeout: the excitation ends"
        assert fault == f"iteration 201: {said}"
        # It does not begin again.
        excitation.step(2, run=False)
        assert excitation.step(2, run=True)["progress"] == NOT_BEGUN
    finally:
        excitation.unload()
        stepped.client.stop()


def test_run_false_and_stop_end_it(blocks: Blocks) -> None:
    run = ON & (np.arange(STEPS) < 50)
    found = blocks.run("Excitation", {"run": run, "in": IN}, **WAYS)
    assert found["state"][49:].tolist() == [RUNNING] + 350 * [STOPPED]
    assert found["out"][50:].tolist() == IN[50:].tolist()
    stop = np.arange(STEPS) >= 70
    found = excite(blocks, {"in": IN, "stop": stop})
    assert found["state"][69:].tolist() == [RUNNING] + 330 * [STOPPED]
    assert found["out"][70:].tolist() == IN[70:].tolist()


def test_it_ends_when_its_caller_is_silent(blocks: Blocks) -> None:
    run = only(ON, [5, 10, 40, 60])
    found = blocks.run("Excitation", {"run": run, "in": IN}, **WAYS, lease=0.1)
    # The last true comes in cycle 60; 100 cycles later it is 0.1 s old.
    assert (found["state"][10:161] == RUNNING).all()
    assert (found["state"][161:] == LEASE_ENDED).all()
    assert found["out"][161:].tolist() == IN[161:].tolist()
    found = blocks.run("Excitation", {"run": run, "in": IN}, **WAYS, lease=0.0)
    assert (found["state"][310:] == COMPLETED).all()


def test_it_begins_again_only_after_run_was_false(blocks: Blocks) -> None:
    found = excite(blocks, {"in": IN}, duration=0.05)
    assert found["state"].tolist().count(RUNNING) == 50
    run = ON.copy()
    run[200] = False
    brief: dict[str, Any] = WAYS | {"duration": 0.05}
    found = blocks.run("Excitation", {"run": run, "in": IN}, **brief)
    assert found["state"].tolist().count(RUNNING) == 100


def test_a_run_that_was_true_before_the_loop_begins_nothing(stepped: Bench) -> None:
    excitation = Stepped(stepped, "Excitation", **WAYS)
    excitation.step(2, run=False)
    assert excitation.step(5, run=True)["progress"] == RUNNING
    stepped.client.stop()
    assert excitation.step(5)["progress"] == READY
    excitation.step(2, run=False)
    assert excitation.step(5, run=True)["progress"] == RUNNING
    stepped.client.stop()
    excitation.unload()


def test_the_last_cycle_passes_the_command_before(stepped: Bench) -> None:
    client = stepped.client
    excitation = Stepped(stepped, "Excitation", **WAYS, idle=0.25)
    client.load(rtcf.component("rtcf_examples", "Identity", name="reader", ns="/reader",
                               remaps=["in:=/stepped/out"]))  # fmt: skip
    excitation.step(2, run=False)
    excitation.step(3, run=True)

    def value() -> str:
        ports = client.get_component("/reader/reader").ports
        return next(str(each.value) for each in ports if each.name == "out")

    assert value() == "data: 1.25"
    excitation.unload()
    client.step(1)
    assert value() == "data: 0.25"
    client.unload(["/reader/reader"])
    client.stop()


@pytest.mark.parametrize(
    ("parameters", "inputs", "said"),
    [
        ({"upper": -10.0}, {}, "not begun: set lower and upper, the limits of out"),
        ({"upper": 0.4}, {"in": IN}, "is outside lower = -10 to upper = 0.4"),
        ({"measured_upper": 1.0}, {}, "not begun: measured has no value or is lost, or is outside"),
        ({"measured_upper": 1.0}, {"measured": np.full(STEPS, 2.0)}, "not begun: measured has no"),
        ({"shape": "relay"}, {}, "not begun: measured has no value"),
    ],
)
def test_it_does_not_begin_outside_its_limits(
    blocks: Blocks, parameters: dict[str, Any], inputs: dict[str, Any], said: str
) -> None:
    found = excite(blocks, inputs, **parameters)
    assert found["state"].tolist() == 10 * [READY] + 390 * [NOT_BEGUN]
    assert (found["signal"] == 0.0).all()
    assert any(said in each for each in blocks.logs)


def test_a_command_that_is_not_finite_ends_it_at_the_last_command(blocks: Blocks) -> None:
    command = IN.copy()
    command[[50, 350]] = np.nan
    found = excite(blocks, {"in": command})
    assert found["out"][50] == IN[49]
    assert (found["state"][50:] == LEFT_LIMITS).all()
    assert found["out"][350] == IN[349]


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"lower": 2.0, "upper": 1.0}, "lower = 2 is above upper = 1"),
        (
            {"measured_lower": 2.0, "measured_upper": 1.0},
            "measured_lower = 2 is above measured_upper = 1",
        ),
        (
            {"shape": "log_chirp", "frequency": 0.0},
            "log_chirp: frequency and end_frequency must be above 0 Hz",
        ),
        ({"lines": 0}, "lines"),
        ({"lease": -1.0}, "lease"),
        ({"duration": 0.0}, "duration"),
        ({"shape": "sine"}, "shape"),
    ],
)
def test_parameters_that_do_not_fit_are_rejected_with_one_line(
    blocks: Blocks, parameters: dict[str, Any], said: str
) -> None:
    with rejection(said):
        blocks.set("Excitation", **parameters)
