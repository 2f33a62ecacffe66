"""Margins of stability of a loop of a PID controller and a model, in the z domain.

The loop is that which runs: the sampled plant of models.py, and the law of a cycle of the
controller, see Gains.fraction().  With q = 1 / z, the zeros of the characteristic function

    F(q) = D(q) Dc(q) + N(q) Nc(q),   plant N / D, controller Nc / Dc

in the disc |q| <= 1 are the unstable poles of the closed loop.  F has no poles there, so that the
number of its zeros is the number of turns of F(q) around 0 on the unit circle (argument principle).
This is accurate for delays of any length, unlike the roots of a polynomial of that degree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rtcf.identification.models import Array, Model, Transfer
from rtcf.identification.tuning import Gains, Notch

_POINTS = 1500  # of a grid in the logarithm of the frequency
_DECADES = 7.0  # below the Nyquist frequency
_LINEAR = 500  # points of an equidistant grid
_PER_CYCLE = 6  # of the latter by cycle of the delay
_AROUND = np.concatenate([-np.geomspace(30.0, 0.1, 10), [0.0], np.geomspace(0.1, 30.0, 10)])
_LARGEST_TURN = 1.0  # rad between neighbours
_HALVINGS = 20
_BISECTIONS = 50
_PEAK = 0.7  # of the largest sensitivity on the grid: peaks that are refined


@dataclass(frozen=True)
class Margins:
    """Margins of a loop; infinite if the loop has no such crossing.

    stable          all poles of the closed loop are inside the unit circle
    gain            smallest factor above 1 of the gain at which the loop becomes unstable; of an
                    unstable loop, the largest one up to 1 at which it has a pole on the unit circle
    phase           in degrees; negative of an unstable loop
    delay           delay in s that makes the loop unstable; 0 of an unstable loop
    sensitivity     largest |1 / (1 + L)|: 1.2 to 2 is usual
    crossover       angular frequency of the phase margin, rad/s; infinite if the loop has none
    """

    stable: bool
    gain: float
    phase: float
    delay: float
    sensitivity: float
    crossover: float


class SampledPlant:
    """A model with the period of its cycles, and optionally a notch filter in front of it."""

    def __init__(self, model: Model, period: float, notch: Notch | None = None) -> None:
        self._model, self._period, self._notch = model, period, notch
        nyquist = np.pi / period
        poles = model.poles
        cycles = getattr(model, "delay", 0.0) / period
        near = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * _AROUND
        omega = np.concatenate(
            [
                [0.0],
                np.geomspace(nyquist * 10.0**-_DECADES, nyquist, _POINTS),
                np.linspace(0.0, nyquist, int(_LINEAR + _PER_CYCLE * cycles)),
                near.ravel(),
            ]
        )
        # An identified integrator is a pole near 1: at 0, a state space is only rounding errors.
        lowest = 0.0 if isinstance(model, Transfer) else nyquist * 10.0**-_DECADES
        self._omega = np.unique(omega[(omega >= lowest) & (omega <= nyquist)])
        self._grid = self._fraction(self._omega)

    def sensitivity(self, gains: Gains, most: float = float("inf")) -> float:
        """Return the largest sensitivity of a loop; infinite if it is unstable, or if it is above
        `most`."""
        above, below = self._on_grid(gains)
        function = above + below
        if np.any(np.abs(below) > most * np.abs(function)) or not self._is_stable(gains, function):
            return float("inf")
        return self._sensitivity(gains, np.abs(below / function))

    def margins(self, gains: Gains) -> Margins:
        """Return the margins of a loop, with feedback of setpoint - measured."""
        above, below = self._on_grid(gains)
        function = above + below
        stable = self._is_stable(gains, function)
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = self._sensitivity(gains, np.abs(below / function))
            loop = (above / below)[1:]  # an integral is infinite at 0
            decibels = np.log(np.abs(loop))
        omega = self._omega[1:]
        at = self._crossings(lambda w: self._loop(gains, w).imag, omega, loop.imag)
        reals = self._loop(gains, np.append(at, np.pi / self._period)).real
        factors = -1.0 / reals[reals < 0.0]
        if stable:
            gain = np.min(factors[factors > 1.0], initial=np.inf)
        else:
            gain = np.max(factors[factors <= 1.0], initial=0.0)
        crossings = self._crossings(lambda w: np.log(np.abs(self._loop(gains, w))), omega, decibels)
        phase = delay = crossover = float("inf")
        if len(crossings):
            angles = np.angle(-self._loop(gains, crossings))  # distances to -180 degrees
            closest = int(np.argmin(np.abs(angles)))
            phase = float(np.degrees(np.abs(angles[closest])))
            delay = float(np.min((angles % (2.0 * np.pi)) / crossings))
            crossover = float(crossings[closest])
        if not stable:
            phase, delay = -phase, 0.0
        return Margins(stable, float(gain), phase, delay, largest, crossover)

    def _fraction(self, omega: Array) -> tuple[Any, Any]:
        above, below = self._model.fraction(omega, self._period)
        if self._notch is not None:
            filtered = self._notch.fraction(omega, self._period)
            return above * filtered[0], below * filtered[1]
        return above, below

    def _on_grid(self, gains: Gains) -> tuple[Any, Any]:
        """Return N Nc and D Dc: their ratio is the opened loop L, their sum is F."""
        controller = gains.fraction(self._omega, self._period)
        return self._grid[0] * controller[0], self._grid[1] * controller[1]

    def _at(self, gains: Gains, omega: Array) -> tuple[Any, Any]:
        """Return N Nc and D Dc at other frequencies."""
        plant, controller = self._fraction(omega), gains.fraction(omega, self._period)
        return plant[0] * controller[0], plant[1] * controller[1]

    def _loop(self, gains: Gains, omega: Array) -> Any:
        """Return the frequency response of the opened loop."""
        above, below = self._at(gains, omega)
        return above / below

    def _is_stable(self, gains: Gains, function: Any) -> bool:
        """Count the turns of F; false if it is 0, or changes faster than can be followed."""
        omega = self._omega
        for _ in range(_HALVINGS):
            if not np.all(np.abs(function) > 0.0):
                return False
            turns = np.angle(function[1:] / function[:-1])
            fast = np.flatnonzero(np.abs(turns) > _LARGEST_TURN)
            if not len(fast):
                # The half circle; the other one is its mirror image.
                return bool(abs(turns.sum()) < np.pi / 2.0)
            between = (omega[fast] + omega[fast + 1]) / 2.0
            omega = np.insert(omega, fast + 1, between)
            function = np.insert(function, fast + 1, sum(self._at(gains, between)))
        return False

    def _sensitivity(self, gains: Gains, on_grid: Array) -> float:
        """Return the largest sensitivity, also between the points of the grid."""
        inner, omega = on_grid[1:-1], self._omega
        largest = float(np.max(on_grid))
        peaks = np.flatnonzero(
            (inner >= on_grid[:-2]) & (inner >= on_grid[2:]) & (inner > _PEAK * largest)
        )
        low, high = omega[peaks], omega[peaks + 2]
        columns = np.arange(len(peaks))
        for _ in range(3):
            points = np.linspace(low, high, 9)
            above, below = self._at(gains, points)
            values = np.abs(below / (above + below))
            largest = max(largest, float(np.max(values, initial=0.0)))
            best = np.clip(values.argmax(axis=0), 1, 7)
            low, high = points[best - 1, columns], points[best + 1, columns]
        return largest

    def _crossings(self, function: Callable[[Array], Any], omega: Array, values: Any) -> Array:
        """Return the zeros between points where `values` changes its sign, by bisection."""
        at = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
        low, high, sign = omega[at], omega[at + 1], np.sign(values[at])
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2.0
            same = np.sign(function(middle)) == sign
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        found: Array = (low + high) / 2.0
        return found
