"""Fits models to recorded inputs and outputs of a plant that begins at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from rtcf_shared.errors import RtcfError
from scipy import optimize, signal

from rtcf.identification.models import Array, Model, StateSpace, Transfer

_GRID = 24  # start values of a time constant
_STARTS = 3  # that are refined
_LEAST_SAMPLES = 30
_MOST_STATES = 8
_HISTORY = 60  # cycles of the regression, at most
_DEVIATIONS = 3.0  # standard deviations of the parameters of `others`
_LARGEST_DEVIATION = 1.0  # of a parameter
_MOST_CORRELATED = 0.99
_CLOSE = 1.05  # of the smallest error: a model of lower order is preferred


@dataclass(frozen=True)
class Fit:
    """A model, and how it describes the recorded values.

    percent    100 (1 - |y - model| / |y - mean of y|): 100 is exact, 0 as good as a constant
    residuals  recorded minus simulated outputs
    offset     output of the plant at rest
    others     models that the noise of the values does not distinguish from `model`
    """

    model: Model
    percent: float
    residuals: Array
    offset: float
    others: tuple[Model, ...] = ()

    @property
    def systematic(self) -> float:
        """The part of the output in percent that neither the model nor white noise explains.

        E.g. friction, or an unknown resonance: the part of the residuals that is correlated from
        cycle to cycle, by the same measure as `percent`.
        """
        return (100.0 - self.percent) * float(np.sqrt(_correlation(self.residuals)))


def fit_first_order(inputs: npt.ArrayLike, outputs: npt.ArrayLike, period: float) -> Fit:
    """Fit K exp(-delay s) / (T s + 1).

    inputs   an input per cycle
    outputs  the output at the beginning of each cycle
    period   in s

    Raises RtcfError if the values do not determine a model.
    """
    return _fit(inputs, outputs, period, lambda p: (float(np.exp(p[0])), 1.0), [()])


def fit_second_order(inputs: npt.ArrayLike, outputs: npt.ArrayLike, period: float) -> Fit:
    """Fit K exp(-delay s) / (s² / w² + 2 z s / w + 1), with real or complex poles; see above."""

    def denominator(p: Any) -> tuple[float, ...]:
        time = float(np.exp(p[0]))
        return (time * time, 2.0 * float(np.exp(p[1])) * time, 1.0)

    starts: list[tuple[float, ...]] = [(float(np.log(each)),) for each in (0.1, 0.7, 2.0, 10.0)]
    return _fit(inputs, outputs, period, denominator, starts)


def fit_state_space(
    inputs: npt.ArrayLike, outputs: npt.ArrayLike, period: float, order: int = 0
) -> Fit:
    """Fit a state space of an order, 0 = the smallest one that describes the values.

    The Markov parameters of an observer, by least squares, are those of the plant (OKID: Juang,
    Phan, Horta & Longman, Journal of Guidance, Control, and Dynamics 16, 1993), which the
    eigensystem realization algorithm turns into a state space (ERA: Juang & Pappa, Journal of
    Guidance, Control, and Dynamics 8, 1985).  Raises RtcfError.
    """
    u, y = _checked(inputs, outputs)
    if not 0 <= order <= _MOST_STATES:
        raise ValueError(f"order {order}: 0 to {_MOST_STATES}")
    offset = float(y[0])
    rows = max(2 * _MOST_STATES, min(_HISTORY, len(u) // 10))
    markov = _markov_parameters(u, y - offset, rows, 2 * rows)
    index = np.arange(rows)
    hankel = markov[index[:, None] + index[None, :]]
    shifted = markov[index[:, None] + index[None, :] + 1]
    left, values, right = np.linalg.svd(hankel)
    candidates = range(1, _MOST_STATES + 1) if order == 0 else [order]
    fits = []
    for n in candidates:
        if values[n - 1] <= 1e-12 * values[0]:
            break
        root = np.sqrt(values[:n])
        a = (left[:, :n] / root).T @ shifted @ (right[:n].T / root)
        b, c = root * right[:n, 0], left[0, :n] * root
        if np.max(np.abs(np.linalg.eigvals(a))) > 1.0 + 1e-3:
            continue  # unstable: the output would be infinite
        model = StateSpace(a, b, c, period)
        fits.append(_judged(model, y, model.simulate(u)))
    if not fits:
        raise RtcfError("no stable state space describes the values: excite for longer")
    errors = [float(np.linalg.norm(each.residuals)) for each in fits]
    return next(
        fit for fit, error in zip(fits, errors, strict=True) if error <= _CLOSE * min(errors)
    )


def _checked(inputs: npt.ArrayLike, outputs: npt.ArrayLike) -> tuple[Array, Array]:
    """Return the inputs as differences from the first one, and the outputs."""
    u, y = np.asarray(inputs, float), np.asarray(outputs, float)
    if u.ndim != 1 or u.shape != y.shape:
        raise ValueError("inputs and outputs must be two lists of the same length")
    if len(u) < _LEAST_SAMPLES:
        raise RtcfError(f"{len(u)} cycles are too few for a model: at least {_LEAST_SAMPLES}")
    if not (np.isfinite(u).all() and np.isfinite(y).all()):
        raise RtcfError("the recorded values are not all finite: no model")
    if np.ptp(u) == 0:
        raise RtcfError("the input is constant: no model; set a larger amplitude or wider limits")
    if np.ptp(y) == 0:
        raise RtcfError("the output is constant: no model; set a larger amplitude")
    return u - u[0], y


def _judged(model: Model, y: Array, simulated: Array) -> Fit:
    """Return a fit with the best offset."""
    offset = float(np.mean(y - simulated))
    residuals = y - simulated - offset
    spread = float(np.linalg.norm(y - y.mean()))
    return Fit(model, 100.0 * (1.0 - float(np.linalg.norm(residuals)) / spread), residuals, offset)


def _fit(
    inputs: npt.ArrayLike,
    outputs: npt.ArrayLike,
    period: float,
    denominator: Callable[[Any], tuple[float, ...]],
    more: list[tuple[float, ...]],
) -> Fit:
    """Return the best model: gain and offset by linear least squares within a nonlinear search.

    The parameters are the logarithm of a time constant, `more`, and the delay in cycles.
    """
    u, y = _checked(inputs, outputs)
    longest = 0.5 * len(u) * period
    y0 = y - y.mean()
    scale = float(np.linalg.norm(y0))

    def linear(p: Any) -> tuple[float, Array]:
        unit = Transfer(1.0, denominator(p), max(float(p[-1]), 0.0) * period)
        x = unit.simulate(u, period)
        x0 = x - x.mean()
        power = float(x0 @ x0)
        gain = float(x0 @ y0) / power if power > 0 else 0.0
        residuals: Array = (y0 - gain * x0) / scale
        return gain, residuals

    starts: list[tuple[float, tuple[float, ...]]] = []
    for time in np.geomspace(period, 4.0 * longest, _GRID):
        for rest in more:
            p = (float(np.log(time)), *rest)
            x = Transfer(1.0, denominator((*p, 0.0)), 0.0).simulate(u, period)
            error, cycles = _best_delay(x, y0, len(u) // 2)
            starts.append((error, (*p, float(cycles))))
    starts.sort()
    low = [np.log(period / 20.0), *(np.log(1e-3) for _ in more[0]), 0.0]
    high = [np.log(100.0 * longest), *(np.log(1e3) for _ in more[0]), longest / period]

    def refined(start: Any, tolerance: float) -> Any:
        return optimize.least_squares(
            lambda p: linear(p)[1], np.clip(start, low, high), bounds=(low, high),
            xtol=tolerance, ftol=tolerance, gtol=1e-14, x_scale="jac", max_nfev=100,
        )  # fmt: skip

    rough = [refined(start, 1e-4) for _, start in starts[:_STARTS]]
    costs = [float(each.cost) for each in rough]
    best = refined(rough[int(np.argmin(costs))].x, 1e-10)

    def model_of(p: Any) -> Transfer:
        clipped = np.clip(p, low, high)
        delay = float(clipped[-1]) * period
        return Transfer(linear(clipped)[0], denominator(clipped), delay)

    model = model_of(best.x)
    fit = _judged(model, y, model.simulate(u, period))
    others = [model_of(best.x + each) for each in _deviations(best.jac, best.fun)]

    def refitted(p: Any, delay: float) -> tuple[Any, float]:
        """Return the parameters with this delay that fit best, and the square of their error."""
        found = optimize.least_squares(
            lambda rest: linear((*rest, delay))[1], p[:-1], bounds=(low[:-1], high[:-1]),
            xtol=1e-4, ftol=1e-4, gtol=1e-14, x_scale="jac", max_nfev=30,
        )  # fmt: skip
        return np.append(found.x, delay), 2.0 * float(found.cost)

    # The covariance holds close to the best parameters only.  A longer delay, which a loop may not
    # be stable with, may fit as well with other time constants: the profile of the likelihood.
    most = float(best.fun @ best.fun) + _DEVIATIONS**2 * _variance(best.fun)
    p, longer = np.clip(best.x, low, high), 1.0
    while best.x[-1] + longer < high[-1]:
        p, error = refitted(p, float(best.x[-1]) + longer)
        if error > most:
            break
        others.append(model_of(p))
        longer *= 2.0
    return replace(fit, others=tuple(others))


def _best_delay(x: Array, y: Array, most: int) -> tuple[float, int]:
    """Return the smallest relative error of a delayed response, and its delay in cycles.

    For each delay, the best gain and offset are known from sums over the overlap.
    """
    n = len(x)
    products = signal.correlate(y, x, method="fft")[n - 1 : n - 1 + most]
    counts = np.arange(n, n - most, -1)
    sums, powers = np.cumsum(x)[counts - 1], np.cumsum(x * x)[counts - 1]
    powers = powers - sums * sums / n
    gained = np.where(powers > 0.0, products**2 / np.where(powers > 0.0, powers, 1.0), 0.0)
    cycles = int(np.argmax(gained))
    return 1.0 - float(gained[cycles] / (y @ y)), cycles


def _correlation(residuals: Array) -> float:
    """Return the correlation of neighbours; 0 if it is negative."""
    power = float(residuals @ residuals)
    return max(float(residuals[1:] @ residuals[:-1]) / power, 0.0) if power > 0.0 else 0.0


def _variance(residuals: Array) -> float:
    """Return the variance of residuals.

    They may be correlated: fewer of them count, as of an autoregression of first order.
    """
    correlation = min(_correlation(residuals), _MOST_CORRELATED)
    variance = float(residuals @ residuals) / len(residuals)
    return variance * (1.0 + correlation) / (1.0 - correlation)


def _deviations(jacobian: Array, residuals: Array) -> list[Array]:
    """Return changes of the parameters along the axes of their covariance, both ways."""
    _, values, axes = np.linalg.svd(jacobian, full_matrices=False)
    deviation = np.sqrt(_variance(residuals))
    sizes = _DEVIATIONS * deviation / np.maximum(values, 1e-12 * values[0])
    # A parameter that the values leave open, e.g. the time constant of an integrator, stays close.
    sizes = np.minimum(sizes, _LARGEST_DEVIATION)
    return [sign * size * axis for size, axis in zip(sizes, axes, strict=True) for sign in (1, -1)]


def _markov_parameters(u: Array, y: Array, history: int, count: int) -> Array:
    """Return the first responses to a pulse of 1, from the cycle after it."""
    rows = len(u) - history
    columns = [y[history - i : history - i + rows] for i in range(1, history + 1)]
    columns += [u[history - i : history - i + rows] for i in range(1, history + 1)]
    regression = np.stack([*columns, np.ones(rows)], axis=1)
    found = np.linalg.lstsq(regression, y[history:], rcond=1e-10)[0]
    a, b = found[:history], found[history : 2 * history]
    markov = np.zeros(count)
    for k in range(count):
        markov[k] = b[k] if k < history else 0.0
        most = min(k, history)
        markov[k] += float(a[:most] @ markov[k - most : k][::-1])
    return markov
