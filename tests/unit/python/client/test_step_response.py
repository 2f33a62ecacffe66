"""rtcf.testing.step_response against systems with closed-form responses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from rtcf.testing import step_response

TIME = np.linspace(0, 20, 20001)


def test_first_order_lag_has_its_textbook_times() -> None:
    measured = step_response(TIME, 3 * (1 - np.exp(-TIME)), target=3.0)
    assert measured.rise_time == pytest.approx(math.log(9), abs=1e-3)
    assert measured.settling_time == pytest.approx(math.log(50), abs=2e-3)
    assert measured.overshoot == 0


@pytest.mark.parametrize(("initial", "target"), [(0.0, 1.0), (2.0, -1.0)])
def test_second_order_system_overshoots_by_its_damping(initial: float, target: float) -> None:
    damping = 0.5
    root = math.sqrt(1 - damping**2)
    share = 1 - np.exp(-damping * TIME) * (
        np.cos(root * TIME) + damping / root * np.sin(root * TIME)
    )
    measured = step_response(TIME, initial + (target - initial) * share, target, initial)
    assert measured.overshoot == pytest.approx(math.exp(-math.pi * damping / root), abs=1e-5)


def test_a_response_that_never_settles_has_no_times() -> None:
    measured = step_response(TIME, 0.5 * (1 - np.exp(-TIME)), target=1.0)
    assert measured.rise_time == measured.settling_time == math.inf
    assert measured.final_error == pytest.approx(0.5)


@pytest.mark.parametrize("amplitude", [0.5, 0.1, 0.03, 0.0201])
@pytest.mark.parametrize("end", [18.85, 19.5, 19.99, 20.0])
def test_a_limit_cycle_has_no_settling_time(amplitude: float, end: float) -> None:
    time = TIME[end >= TIME]
    value = 1 - np.exp(-5 * time) + amplitude * np.sin(2 * time)
    measured = step_response(time, value, target=1.0)
    assert measured.settling_time == math.inf
    assert measured.unsettled


def test_a_record_that_ends_in_a_crossing_has_no_settling_time() -> None:
    time = TIME[TIME <= 1.0]
    measured = step_response(time, time, target=1.0)
    assert measured.settling_time == math.inf
    assert measured.unsettled == (
        "the value is within the tolerance for the last 0.019 s only: measure for longer"
    )


def test_an_oscillation_that_decays_has_its_settling_time() -> None:
    value = 1 - np.exp(-TIME) * np.cos(10 * TIME)
    outside = np.abs(value - 1) > 0.02
    measured = step_response(TIME, value, target=1.0)
    assert measured.settling_time == TIME[np.flatnonzero(outside)[-1] + 1]
    assert measured.unsettled == ""


def test_a_response_that_begins_within_the_tolerance_settles_at_once() -> None:
    assert step_response(TIME, np.ones_like(TIME), target=1.0).settling_time == 0.0


@pytest.mark.parametrize(
    ("time", "value", "target", "tolerance", "words"),
    [
        ([0, 1], [0], 1.0, 0.02, "same length"),
        ([0, 1], [0, math.nan], 1.0, 0.02, "finite in all samples"),
        ([0, 0], [0, 1], 1.0, 0.02, "increase"),
        ([0, 1], [0, 1], 0.0, 0.02, "other than its initial value"),
        ([0, 1], [0, 1], 1.0, 0.0, "between 0 and 1"),
    ],
)
def test_impossible_measurements_are_one_line(
    time: list[float], value: list[float], target: float, tolerance: float, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        step_response(time, value, target, tolerance=tolerance)
