"""The base class rtcf::ExtendedKalmanFilter, by the example of docs/control/kalman_filter.md.

Tolerance: estimates of size 1 in 500 cycles differ from those of plain NumPy by less than ROUNDING.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from block_bench import PATH, Stepped
from pages import TREE
from rtcf.testing import Bench
from rtcf.v1 import runner_pb2

DT = 0.001
GRAVITY = 9.81
ROUNDING = 1e-9
CYCLES = 500
MASKED: Any = np.ma
PARAMETERS = {"angle_initial": 0.4, "angle_deviation": 0.2, "rate_deviation": 0.5,
              "angle_noise": 0.01, "rate_noise": 0.3, "acceleration_noise": 0.05}  # fmt: skip


@pytest.fixture(scope="module")
def pendulum() -> Iterator[Bench]:
    with Bench("rtcf_test/PendulumFilter", path=PATH, parameters=PARAMETERS) as bench:
        yield bench


def motion() -> tuple[Any, Any]:
    """Return torques, and noisy accelerations that a pendulum shows."""
    draw = np.random.default_rng(29)
    torques = np.sin(0.02 * np.arange(CYCLES))
    angle, rate, seen = 0.5, 0.0, []
    for k in range(CYCLES):
        seen.append(GRAVITY * np.sin(angle) + 0.05 * draw.normal())
        after = torques[min(k + 1, CYCLES - 1)]  # it has acted when the next cycle reads it
        angle, rate = angle + rate * DT, rate + (after - GRAVITY * np.sin(angle)) * DT
    return torques, np.array(seen)


def filtered(torques: Any, seen: Any, dt: Any) -> tuple[Any, Any]:
    """Return estimates and deviations; NaN is a missing measurement."""
    x, p = np.array([0.4, 0.0]), np.diag([0.2**2, 0.5**2])
    estimates, deviations = [], []
    for k, (torque, value) in enumerate(zip(torques, seen, strict=True)):
        if k > 0:
            f = np.array([[1.0, dt[k]], [-GRAVITY * np.cos(x[0]) * dt[k], 1.0]])
            x = np.array([x[0] + x[1] * dt[k], x[1] + (torque - GRAVITY * np.sin(x[0])) * dt[k]])
            p = f @ p @ f.T + np.diag([0.01**2, 0.3**2]) * dt[k]
        if np.isfinite(value):
            h = np.array([[GRAVITY * np.cos(x[0]), 0.0]])
            gain = p @ h.T / (h @ p @ h.T + 0.05**2)
            x = x + gain[:, 0] * (value - GRAVITY * np.sin(x[0]))
            p = (np.eye(2) - gain @ h) @ p
        estimates.append(x)
        deviations.append(np.sqrt(np.diag(p)))
    return np.array(estimates), np.array(deviations)


def test_the_estimates_are_those_of_the_textbook(pendulum: Bench) -> None:
    torques, seen = motion()
    seen[100:180] = np.nan
    seen[::3] = np.nan
    seen[0] = 5.0
    first = pendulum.run({"torque": torques, "acceleration": seen})
    again = pendulum.run({"torque": torques, "acceleration": seen})
    estimates, deviations = filtered(torques, seen, np.full(CYCLES, DT))
    for column, name in enumerate(("angle", "rate")):
        assert again[name].tobytes() == first[name].tobytes(), "the same inputs gave other outputs"
        assert np.allclose(first[name], estimates[:, column], rtol=0.0, atol=ROUNDING)
        deviation = first[f"{name}_deviation"]
        assert np.allclose(deviation, deviations[:, column], rtol=0.0, atol=ROUNDING)
    assert first["used"].tolist() == np.isfinite(seen).astype(int).tolist()
    assert first["age"][179] == pytest.approx(81 * DT)


def test_the_estimate_finds_the_angle(pendulum: Bench) -> None:
    torques, seen = motion()
    found = pendulum.run({"torque": torques, "acceleration": seen})
    angle, rate = 0.5, 0.0
    for k in range(1, CYCLES):
        angle, rate = angle + rate * DT, rate + (torques[k] - GRAVITY * np.sin(angle)) * DT
    # Within four standard deviations, which are below 0.01 rad.
    assert found["angle_deviation"][-1] < 0.01
    assert abs(found["angle"][-1] - angle) < 4.0 * found["angle_deviation"][-1]
    assert abs(found["rate"][-1] - rate) < 4.0 * found["rate_deviation"][-1]


def test_it_begins_at_the_first_measurement(pendulum: Bench) -> None:
    seen = MASKED.array(np.ones(5), mask=[True, True, False, True, True])
    found = pendulum.run({"torque": np.zeros(5), "acceleration": seen})
    assert np.isfinite(found["angle"]).tolist() == [False, False, True, True, True]


def test_an_input_that_is_not_finite_is_a_fault(pendulum: Bench) -> None:
    torques, seen = np.ones(60), np.ones(60)
    expected = pendulum.run({"torque": torques, "acceleration": seen})["angle"]
    torques[20:25] = np.nan
    found = pendulum.run({"torque": torques, "acceleration": seen})["angle"]
    assert (found[20:25] == found[19]).all()
    assert found[25:].tolist() == expected[25:].tolist()


def test_a_new_period_is_taken_as_it_is() -> None:
    with Bench("rtcf_examples/Identity", path=PATH) as bench:
        block = Stepped(bench, "PendulumFilter", package="rtcf_test", **PARAMETERS)
        periods = np.repeat([0.001, 0.004], 20)
        expected = filtered(np.zeros(40), np.ones(40), periods)[0]
        for k in range(40):
            frequency = round(1.0 / periods[k])
            bench.client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))
            found = block.step(acceleration=1.0)["estimate"]
            assert found == pytest.approx(expected[k].tolist(), abs=ROUNDING)


def test_the_page_shows_the_component() -> None:
    page = (TREE / "docs/control/kalman_filter.md").read_text()
    source = (TREE / "tests/components/pendulum_filter.cpp").read_text()
    shown = re.search(r"```cpp\n.*?(class .*?)RTCF_COMPONENT", page, re.DOTALL)
    assert shown and shown[1].strip() in source
