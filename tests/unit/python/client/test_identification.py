"""rtcf.identification: models of known plants, gains by published rules, margins by SciPy.

Tolerances: without noise, a fit finds the parameters of its own kind of plant within EXACT. With
noise of 2 % of the output's deviation, 4000 cycles determine gain and time constants within NOISY.
The simulation of a model is SciPy's within ROUNDING, and a gain margin is exact within MARGIN.
"""

from __future__ import annotations

import builtins
from typing import Any

import numpy as np
import pytest
from hypothesis import given, seed, settings
from hypothesis import strategies as st
from rtcf.identification import fitting, require_scipy, tuning
from rtcf.identification.experiment import (
    COMPLETED,
    LEFT_LIMITS,
    NOT_BEGUN,
    READY,
    RUNNING,
    Collector,
    Recorded,
)
from rtcf.identification.margins import Margins, SampledPlant
from rtcf.identification.models import Array, Model, StateSpace, Transfer
from rtcf.identification.result import estimated_response, fitted_response, identify
from rtcf.identification.tuning import Gains, RelayPoint
from rtcf.v1 import ports_pb2
from rtcf_shared.errors import RtcfError
from rtcf_shared.ports import PortBatch, PortSchema, Signal
from scipy import signal

EXACT, NOISY, ROUNDING, MARGIN = 1e-3, 0.05, 1e-9, 1e-6
PERIOD = 0.01
RNG = np.random.default_rng(11)
BITS = np.repeat(RNG.choice([-1.0, 1.0], 400), 10)
BITS[0] = 0.0

FIRST = Transfer(2.0, (0.5, 1.0), 0.137)
SECOND = Transfer(-3.0, (0.05, 0.6, 1.0), 0.08)
SWINGING = Transfer(1.5, (0.04, 0.08, 1.0), 0.05)


def response(part: Model | Gains, omega: Array, period: float = PERIOD) -> Any:
    above, below = part.fraction(omega, period)
    return above / below


def margins(gains: Gains, model: Model, period: float) -> Margins:
    return SampledPlant(model, period).margins(gains)


def noisy(y: Any) -> Any:
    return y + 0.02 * np.std(y) * np.random.default_rng(12).normal(size=len(y))


# Models.


def fine(model: Transfer, inputs: Any, factor: int = 100) -> Array:
    """Return the response by the trapezoid of a fine grid, without the sampling of the model."""
    system = signal.lti([model.gain], model.denominator)
    step = PERIOD / factor
    delayed = np.concatenate([np.zeros(round(model.delay / step)), np.repeat(inputs, factor)])
    a, b, c, d, _ = signal.cont2discrete(_matrices(system), step, "zoh")
    b, a = signal.ss2tf(a, b, c, d)
    found: Array = signal.lfilter(b[0], a, delayed)[: len(inputs) * factor : factor]
    return found


@pytest.mark.parametrize("model", [FIRST, SECOND, SWINGING])
def test_the_simulation_is_that_of_a_fine_grid(model: Transfer) -> None:
    expected = fine(model, BITS[:800])
    assert np.allclose(model.simulate(BITS[:800], PERIOD), expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("model", [FIRST, SECOND, SWINGING])
def test_the_frequency_response_is_that_of_the_simulation(model: Transfer) -> None:
    omega = np.array([1.0, 5.0, 20.0, 100.0])
    pulse = np.zeros(4000)
    pulse[0] = 1.0
    answer = model.simulate(pulse, PERIOD)
    expected = [answer @ np.exp(-1j * w * PERIOD * np.arange(4000)) for w in omega]
    assert np.allclose(response(model, omega), expected, rtol=0, atol=1e-9)


def test_time_constants_are_those_of_real_poles() -> None:
    assert FIRST.time_constants == pytest.approx((0.5,))
    assert SECOND.time_constants == pytest.approx((0.5, 0.1))
    assert SWINGING.time_constants == ()
    assert SWINGING.natural_frequency == pytest.approx(5.0)
    assert SWINGING.damping == pytest.approx(0.2)


# Fits.


def test_a_first_order_plant_is_found() -> None:
    fit = fitting.fit_first_order(BITS, FIRST.simulate(BITS, PERIOD) + 4.0, PERIOD)
    assert isinstance(fit.model, Transfer)
    assert (fit.model.gain, fit.model.time_constants[0], fit.model.delay, fit.offset) == (
        pytest.approx((2.0, 0.5, 0.137, 4.0), rel=EXACT)
    )
    assert fit.percent > 99.9
    fit = fitting.fit_first_order(BITS, noisy(FIRST.simulate(BITS, PERIOD)), PERIOD)
    assert isinstance(fit.model, Transfer)
    assert (fit.model.gain, fit.model.time_constants[0]) == pytest.approx((2.0, 0.5), rel=NOISY)
    assert fit.model.delay == pytest.approx(0.137, abs=PERIOD)
    assert 97.0 < fit.percent < 99.0


@pytest.mark.parametrize("plant", [SECOND, SWINGING])
def test_a_second_order_plant_is_found(plant: Transfer) -> None:
    fit = fitting.fit_second_order(BITS, plant.simulate(BITS, PERIOD), PERIOD)
    assert isinstance(fit.model, Transfer)
    found = (fit.model.gain, *fit.model.denominator, fit.model.delay)
    assert found == pytest.approx((plant.gain, *plant.denominator, plant.delay), rel=EXACT)
    fit = fitting.fit_second_order(BITS, noisy(plant.simulate(BITS, PERIOD)), PERIOD)
    assert isinstance(fit.model, Transfer)
    assert fit.model.gain == pytest.approx(plant.gain, rel=NOISY)
    assert fit.model.denominator == pytest.approx(plant.denominator, rel=2 * NOISY)


def test_a_state_space_is_found_with_its_order_and_poles() -> None:
    # Two inertias: a lag and a resonance.
    system = signal.lti([40.0], np.polymul([0.5, 1.0], [1.0, 1.2, 40.0]))
    a, b, c, _, _ = signal.cont2discrete(_matrices(system), PERIOD)
    plant = StateSpace(a, b[:, 0], c[0], PERIOD)
    fit = fitting.fit_state_space(BITS, plant.simulate(BITS), PERIOD)
    assert isinstance(fit.model, StateSpace)
    assert fit.model.order == 3
    assert fit.percent > 99.0
    expected = np.roots(system.den)
    for pole in fit.model.poles:
        assert np.min(np.abs(expected - pole)) < 0.02 * abs(pole)
    omega = np.geomspace(0.1, 30.0, 30)
    assert np.allclose(response(fit.model, omega), response(plant, omega), rtol=0.02, atol=1e-3)


def _matrices(system: Any) -> Any:
    space = system.to_ss()
    return space.A, space.B, space.C, space.D


@seed(41)
@settings(max_examples=12, deadline=None)
@given(
    gain=st.floats(0.1, 100.0),
    sign=st.sampled_from([-1.0, 1.0]),
    time=st.floats(0.05, 2.0),
    ratio=st.floats(0.1, 0.9),
    delay=st.floats(0.0, 0.3),
)
def test_random_plants_are_found(
    gain: float, sign: float, time: float, ratio: float, delay: float
) -> None:
    first = Transfer(sign * gain, (time, 1.0), delay)
    fit = fitting.fit_first_order(BITS, first.simulate(BITS, PERIOD), PERIOD)
    assert isinstance(fit.model, Transfer)
    assert fit.model.gain == pytest.approx(sign * gain, rel=EXACT)
    assert fit.model.time_constants[0] == pytest.approx(time, rel=EXACT)
    assert fit.model.delay == pytest.approx(delay, abs=EXACT * PERIOD)
    second = Transfer(sign * gain, (ratio * time**2, (1.0 + ratio) * time, 1.0), delay)
    fit = fitting.fit_second_order(BITS, second.simulate(BITS, PERIOD), PERIOD)
    assert fit.percent > 99.9
    omega = np.geomspace(0.1, 10.0, 20)
    error = np.abs(response(fit.model, omega) - response(second, omega))
    assert np.max(error) < 0.01 * gain


@pytest.mark.parametrize(
    ("inputs", "outputs", "said"),
    [
        (np.zeros(10), np.arange(10.0), "10 cycles are too few for a model: at least 30"),
        (np.ones(50), np.arange(50.0), "the input is constant: no model"),
        (np.arange(50.0), np.ones(50), "the output is constant: no model"),
        (np.arange(50.0), np.full(50, np.nan), "the recorded values are not all finite"),
    ],
)
def test_values_that_determine_no_model_are_rejected(inputs: Any, outputs: Any, said: str) -> None:
    fits: list[Any] = [fitting.fit_first_order, fitting.fit_second_order, fitting.fit_state_space]
    for fit in fits:
        with pytest.raises(RtcfError, match=said):
            fit(inputs, outputs, PERIOD)


def test_wrong_arguments_are_rejected() -> None:
    with pytest.raises(ValueError, match="same length"):
        fitting.fit_first_order(np.zeros(50), np.zeros(51), PERIOD)
    with pytest.raises(ValueError, match="order 9: 0 to 8"):
        fitting.fit_state_space(BITS, BITS, PERIOD, 9)


# Rules.


def test_simc_has_the_published_gains() -> None:
    # Skogestad 2003, table 1: Kc = T1 / (k (tc + delay)), TI = min(T1, 4 (tc + delay)), TD = T2.
    pi = tuning.simc(Transfer(2.0, (5.0, 1.0), 1.0))
    assert (pi.kp, pi.ki, pi.kd) == pytest.approx((5.0 / 4.0, 5.0 / 4.0 / 5.0, 0.0))
    slow = tuning.simc(Transfer(2.0, (50.0, 1.0), 1.0))
    assert (slow.kp, slow.ki) == pytest.approx((12.5, 12.5 / 8.0))
    wanted = tuning.simc(Transfer(2.0, (5.0, 1.0), 1.0), 3.0)
    assert (wanted.kp, wanted.ki) == pytest.approx((5.0 / 8.0, 5.0 / 8.0 / 5.0))
    # Half a period of the hold is a delay.
    assert tuning.simc(Transfer(2.0, (5.0, 1.0), 0.5), period=1.0) == pi


def test_simc_counts_the_filter_of_its_derivative_and_the_cycles_as_delays() -> None:
    # In series form, equation 17 there: Kc = T1 / (k (tc + delay)), TI = 5, TD = 2, and the filter.
    found = tuning.simc(Transfer(2.0, (10.0, 7.0, 1.0), 0.7), period=0.1)
    delay = 0.7 + 0.1 + 0.2
    assert found.filter_time == pytest.approx(0.2)
    s = 1j * np.array([0.1, 1.0, 10.0])
    series = 5.0 / (2.0 * 2.0 * delay) * (1.0 + 1.0 / (5.0 * s)) * (1.0 + 2.0 * s)
    ideal = found.kp + found.ki / s + found.kd * s / (0.2 * s + 1.0)
    assert np.allclose(ideal, series / (0.2 * s + 1.0), rtol=1e-12)


def test_simc_has_the_published_margins_on_a_plant_with_a_large_time_constant() -> None:
    # Skogestad 2003, table 4, for k / (T s + 1) with T <= 8 delay and tc = delay: 3.14, 61.4
    # degrees, a largest sensitivity of 1.59, a delay margin of 2.14 delays.
    model = Transfer(1.0, (1.0, 1.0), 1.0)
    found = margins(tuning.simc(model), model, 1e-3)
    assert found.gain == pytest.approx(3.14, abs=0.01)
    assert found.phase == pytest.approx(61.4, abs=0.1)
    assert found.sensitivity == pytest.approx(1.59, abs=0.01)
    assert found.delay == pytest.approx(2.14, abs=0.01)


def test_lambda_tuning_has_the_published_gains() -> None:
    # Kp = T / (K (lambda + delay)), TI = T.
    model = Transfer(2.0, (5.0, 1.0), 1.0)
    found = tuning.lambda_tuning(model)
    assert (found.kp, found.ki, found.kd) == pytest.approx((5.0 / 32.0, 1.0 / 32.0, 0.0))
    assert tuning.lambda_tuning(model, 4.0).kp == pytest.approx(0.5)


def test_relay_tuning_has_its_phase_margin_at_the_ultimate_frequency() -> None:
    # Åström & Hägglund 1984: the loop passes through exp(i (pi + 45 degrees)) there.
    found = tuning.relay_tuning(RelayPoint(8.0, 0.5))
    omega = 2.0 * np.pi / 0.5
    td = found.kd / found.kp
    assert found.kp == pytest.approx(8.0 * np.cos(np.pi / 4.0))
    assert found.kp / found.ki == pytest.approx(4.0 * td)
    assert omega * td - 1.0 / (omega * 4.0 * td) == pytest.approx(np.tan(np.pi / 4.0))
    ideal = Gains(found.kp, found.ki, found.kd)
    loop = response(ideal, np.array([omega]), 1e-7)[0] * -1.0 / 8.0
    assert loop == pytest.approx(np.exp(1.25j * np.pi), rel=1e-5)


def test_a_relay_finds_the_ultimate_gain_and_period() -> None:
    # K exp(-s) / (s + 1)^2 under a relay: the describing function is exact within 10 %.
    plant = Transfer(1.0, (1.0, 2.0, 1.0), 1.0)
    grid = np.linspace(0.1, 3.0, 3000)
    omega = np.interp(np.pi, -np.unwrap(np.angle(response(plant, grid, 1e-6))), grid)
    relay, outputs = np.full(6000, 1.0), np.zeros(6000)
    state, past = np.zeros(2), 100
    a, b, _, _, _ = signal.cont2discrete(
        (
            np.array([[0.0, 1.0], [-1.0, -2.0]]),
            np.array([[0.0], [1.0]]),
            np.array([[1.0, 0.0]]),
            np.array([[0.0]]),
        ),
        PERIOD,
    )
    for k in range(6000):
        outputs[k] = state[0]
        relay[k] = -1.0 if outputs[k] > 0 else 1.0
        state = a @ state + b[:, 0] * (relay[k - past] if k >= past else 0.0)
    found = tuning.relay_point(relay, outputs, PERIOD)
    assert found.ultimate_period == pytest.approx(2.0 * np.pi / omega, rel=0.1)
    size = abs(response(plant, np.array([omega]), 1e-6)[0])
    assert found.ultimate_gain == pytest.approx(1.0 / size, rel=0.1)


def test_relays_without_an_oscillation_are_rejected() -> None:
    with pytest.raises(RtcfError, match="the relay has caused 0 oscillations, 3 are needed"):
        tuning.relay_point(np.ones(100), np.zeros(100), PERIOD)
    square = np.where(np.arange(400) % 40 < 20, 1.0, -1.0)
    with pytest.raises(RtcfError, match="within the hysteresis"):
        tuning.relay_point(square, 0.1 * square, PERIOD, 0.2)
    uneven = np.where(np.sin(40.0 * np.log1p(np.arange(600) / 60.0)) > 0, 1.0, -1.0)
    with pytest.raises(RtcfError, match="not steady"):
        tuning.relay_point(uneven, uneven, PERIOD)


def test_rules_reject_models_that_they_do_not_cover() -> None:
    with pytest.raises(RtcfError, match="simc needs real poles"):
        tuning.simc(SWINGING)
    with pytest.raises(ValueError, match="first-order"):
        tuning.lambda_tuning(SECOND)
    with pytest.raises(RtcfError, match="no delay: set the closed-loop time"):
        tuning.simc(Transfer(1.0, (1.0, 1.0), 0.0))


# Margins.


def closed_loop(gains: Gains, delay: int, numerator: Any, denominator: Any) -> Array:
    """Return the matrix of the cycles of a Pid and a plant: its law, line by line, on unit states.

    numerator, denominator  of the plant by z^-1, without the delay, in cycles
    """
    b, a = np.trim_zeros(np.asarray(numerator), "b"), np.asarray(denominator)
    longest = max(len(b), len(a)) + delay
    size = 2 * longest + 3

    def cycle(state: Array) -> Array:
        efforts, outputs = state[:longest], state[longest : 2 * longest]
        integral, slope, last = state[2 * longest :]
        y = b[1:] @ efforts[delay : delay + len(b) - 1] - a[1:] @ outputs[: len(a) - 1]
        slope = (gains.filter_time * slope + y - last) / (gains.filter_time + PERIOD)
        effort = -gains.kp * y - gains.kd * slope + integral
        integral = integral - gains.ki * PERIOD * y
        return np.concatenate([[effort], efforts[:-1], [y], outputs[:-1], [integral, slope, y]])

    return np.stack([cycle(each) for each in np.eye(size)], axis=1)


def spectral_radius(gains: Gains, delay: int, numerator: Any, denominator: Any) -> float:
    """Return the largest pole of a loop; an integral that is off is none."""
    poles = np.abs(np.linalg.eigvals(closed_loop(gains, delay, numerator, denominator)))
    poles.sort()
    return float(poles[-1] if gains.ki else poles[-2])


@seed(43)
@settings(max_examples=60, deadline=None)
@given(
    time=st.floats(0.02, 2.0),
    ratio=st.floats(0.05, 0.9),
    delay=st.integers(0, 40),
    gain=st.floats(0.3, 3.0),
    derivative=st.floats(0.0, 1.0),
    filtered=st.floats(0.0, 0.2),
)
def test_a_loop_is_stable_if_the_poles_of_its_cycles_are(
    time: float, ratio: float, delay: int, gain: float, derivative: float, filtered: float
) -> None:
    below = np.polymul([time, 1.0], [ratio * time, 1.0])
    b, a, _ = signal.cont2discrete(([1.0], below), PERIOD, "zoh")
    kp = gain * time / (delay * PERIOD + PERIOD)
    kd = derivative * kp * ratio * time
    gains = Gains(kp, kp / time, kd, filtered * ratio * time)
    radius = spectral_radius(gains, delay, b.ravel(), a)
    model = Transfer(1.0, tuple(below), delay * PERIOD)
    found = margins(gains, model, PERIOD)
    if abs(radius - 1.0) > 1e-6:
        assert found.stable == (radius < 1.0)
    if found.stable:
        # The distance of the Nyquist curve to -1, by a dense search.
        omega = np.linspace(1e-6, np.pi / PERIOD, 200_000)
        z = np.exp(1j * omega * PERIOD)
        plant = np.polyval(b.ravel(), z) / np.polyval(a, z) * z**-delay
        slope = (1.0 - 1.0 / z) / (gains.filter_time * (1.0 - 1.0 / z) + PERIOD)
        law = gains.kp + gains.ki * PERIOD / (z - 1.0) + gains.kd * slope
        expected = np.max(1.0 / np.abs(1.0 + law * plant))
        assert found.sensitivity == pytest.approx(expected, rel=1e-3)
    if found.stable and np.isfinite(found.gain):
        for factor, stable in ((0.999, True), (1.001, False)):
            by = factor * found.gain
            other = Gains(by * gains.kp, by * gains.ki, by * gains.kd, gains.filter_time)
            assert (spectral_radius(other, delay, b.ravel(), a) < 1.0) == stable


def test_a_loop_with_twice_its_gain_margin_is_unstable() -> None:
    model = Transfer(2.0, (0.5, 1.0), 0.1)
    gains = tuning.simc(model)
    margin = margins(gains, model, PERIOD).gain
    assert margins(gains, model, PERIOD).stable
    factor = 2.0 * margin
    faster = Gains(factor * gains.kp, factor * gains.ki)
    found = margins(faster, model, PERIOD)
    assert not found.stable
    assert found.gain == pytest.approx(0.5, rel=MARGIN)


def test_a_negative_plant_has_the_margins_of_a_positive_one() -> None:
    model = Transfer(2.0, (0.5, 1.0), 0.1)
    other = Transfer(-2.0, (0.5, 1.0), 0.1)
    assert margins(tuning.simc(model), model, PERIOD) == margins(tuning.simc(other), other, PERIOD)


# Everything together.


def recorded(model: Transfer, inputs: Any = BITS) -> Recorded:
    time = (np.arange(len(inputs)) * PERIOD).astype(np.float64)
    return Recorded(
        PERIOD, time, inputs, inputs, noisy(model.simulate(inputs, PERIOD)), COMPLETED, 0
    )


def test_the_best_model_is_the_simplest_that_fits() -> None:
    first = identify(recorded(FIRST))
    assert first.best is first.first
    second = identify(recorded(SECOND))
    assert second.best is second.second
    swinging = identify(recorded(SWINGING))
    assert swinging.best is swinging.second


@pytest.mark.parametrize("method", ["simc", "lambda"])
def test_a_proposal_is_stable(method: str) -> None:
    found = identify(recorded(SECOND)).propose(method)
    assert found.margins.stable
    assert found.gains.kp < 0 and found.gains.ki < 0
    assert 1.0 < found.margins.sensitivity < 2.0


def test_proposals_reject_what_does_not_apply() -> None:
    found = identify(recorded(FIRST))
    with pytest.raises(RtcfError, match="the method relay needs an excitation by --shape relay"):
        found.propose("relay")
    with pytest.raises(ValueError, match="method cohen: use one of simc, lambda, relay"):
        found.propose("cohen")


def test_the_measured_response_is_that_of_the_plant() -> None:
    run = recorded(FIRST)
    f, estimate = estimated_response(run)
    fit = identify(run).first
    slow = f < 2.0
    expected = fitted_response(fit, f[slow], PERIOD)
    assert np.allclose(np.abs(estimate[slow]), np.abs(expected), rtol=0.25, atol=0)


def test_a_record_says_why_it_is_not_complete() -> None:
    none = np.zeros(0)
    assert Recorded(PERIOD, none, none, none, none, COMPLETED, 0).why == ""
    assert "limits" in Recorded(PERIOD, none, none, none, none, LEFT_LIMITS, 0).why


def test_without_scipy_one_line_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any, **more: Any) -> Any:
        if name.startswith("scipy"):
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(RtcfError, match="^identification needs SciPy: sudo apt install"):
        require_scipy()


# The cycles of a stream.

NAMES = ["/e.out", "/e.signal", "/e.state", "/e.armed"]
PERIOD_NS = 10_000_000
SCHEMA = PortSchema(
    tuple(ports_pb2.PortColumn(size=8) for _ in range(5)),
    (),
    {name: Signal(name, "", n, "<f8", (), 0) for n, name in enumerate([*NAMES, "/m.y"])},
)


def batch(first: int, states: list[int], armed: list[int], cycles: list[int] | None = None) -> Any:
    """Return cycles whose input is 10 times, and whose output is 100 times the cycle number."""
    numbers = np.arange(first, first + len(states)) if cycles is None else np.array(cycles)
    columns = [10.0 * numbers, numbers, states, armed, 100.0 * numbers]
    message = ports_pb2.PortBatch(
        stamps_ns=[int(each) * PERIOD_NS for each in numbers],
        values=[np.asarray(each, "<f8").tobytes() for each in columns],
    )
    return PortBatch(SCHEMA, 1, first, 0, False, message)


def collected(*batches: Any) -> Collector:
    collector = Collector(NAMES, "/m.y", PERIOD_NS)
    for each in batches:
        collector.take(each)
    return collector


def test_the_record_begins_one_cycle_before_the_excitation() -> None:
    found = collected(
        batch(0, [READY] * 3, [0, 1, 1]),
        batch(3, [READY, RUNNING, RUNNING], [1, 0, 0]),
        batch(6, [RUNNING, COMPLETED], [0, 0]),
    )
    assert found.over
    run = found.recorded(late=False)
    assert run.inputs.tolist() == [30.0, 40.0, 50.0, 60.0]
    assert run.outputs.tolist() == [300.0, 400.0, 500.0, 600.0]
    assert run.time.tolist() == pytest.approx([-0.01, 0.0, 0.01, 0.02])
    assert (run.outcome, run.filled) == (COMPLETED, 0)
    # Read by a loop break, outputs come one cycle later.
    assert found.recorded(late=True).outputs.tolist() == [200.0, 300.0, 400.0, 500.0]


def test_the_end_of_an_earlier_excitation_does_not_count() -> None:
    found = collected(batch(0, [NOT_BEGUN] * 4, [0, 0, 1, 1]))
    assert found.armed and not found.over
    found = collected(batch(0, [NOT_BEGUN] * 4, [0, 0, 1, 0]))
    assert found.over
    assert "did not begin" in found.recorded(late=False).why


def test_missing_cycles_are_interpolated_and_many_are_rejected() -> None:
    cycles = [n for n in range(3, 203) if n not in (50, 120)]
    found = collected(
        batch(0, [READY] * 3, [0, 1, 1]),
        batch(3, [RUNNING] * 197 + [LEFT_LIMITS], [0] * 198, cycles),
    )
    run = found.recorded(late=False)
    assert (run.filled, run.outcome) == (2, LEFT_LIMITS)
    assert run.outputs.tolist() == [100.0 * n for n in range(2, 202)]
    # The command is constant until the next cycle.
    assert run.inputs[50 - 2] == 490.0
    cycles = list(range(3, 203, 2))
    found = collected(
        batch(0, [READY] * 3, [0, 1, 1]),
        batch(3, [RUNNING] * 99 + [COMPLETED], [0] * 100, cycles),
    )
    with pytest.raises(RtcfError, match="98 of 198 cycles are late or dropped: the values are not"):
        found.recorded(late=False)
