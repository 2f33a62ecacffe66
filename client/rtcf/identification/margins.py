"""Margins of stability of a loop of a PID controller and a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import optimize

from rtcf.identification.models import Model, StateSpace
from rtcf.identification.tuning import Gains

_POINTS = 4000
_DECADES = 6.0  # below the Nyquist frequency


@dataclass(frozen=True)
class Margins:
    """Margins of a loop; infinite if the loop has no such crossing.

    gain            factor of the gain at which the loop becomes unstable
    phase           in degrees
    delay           delay in s that makes the loop unstable
    sensitivity     largest |1 / (1 + L)|: 1.2 to 2 is usual
    crossover       angular frequency of the phase margin, rad/s
    """

    gain: float
    phase: float
    delay: float
    sensitivity: float
    crossover: float

    @property
    def stable(self) -> bool:
        """Whether all margins are positive, as those of a stable loop are."""
        return self.gain > 1.0 and self.phase > 0.0


def loop_response(gains: Gains, model: Model, period: float) -> Callable[[npt.ArrayLike], Any]:
    """Return the frequency response of the opened loop, with the zero-order hold of a cycle.

    A StateSpace includes the hold; for a Transfer, a delay of half a period stands for it.
    """

    def response(omega: npt.ArrayLike) -> Any:
        w = np.asarray(omega, float)
        hold = 1.0 if isinstance(model, StateSpace) else np.exp(-0.5j * w * period)
        return gains.response(w) * model.response(w) * hold

    return response


def margins(gains: Gains, model: Model, period: float) -> Margins:
    """Return the margins of a loop at frequencies up to the Nyquist frequency of its cycles.

    gains   the controller, with the sign of feedback of setpoint - measured
    model   the plant
    period  of the cycles, in s
    """
    response = loop_response(gains, model, period)
    nyquist = np.pi / period
    omega = np.geomspace(nyquist * 10.0**-_DECADES, nyquist * (1.0 - 1e-9), _POINTS)
    loop = response(omega)
    phase = np.unwrap(np.angle(loop))

    def refined(function: Callable[[float], float], values: Any) -> list[float]:
        """Return the zeros between points where `values` changes its sign."""
        at = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
        return [float(optimize.brentq(function, omega[i], omega[i + 1], xtol=1e-12)) for i in at]

    # Crossings of the negative real axis: the imaginary part is 0, and the real part is negative.
    real_axis = refined(lambda w: float(response(w).imag), loop.imag)
    gains_there = [1.0 / abs(response(w)) for w in real_axis if response(w).real < 0]
    crossings = refined(lambda w: float(np.log(abs(response(w)))), np.log(np.abs(loop)))
    smallest, crossover, delay = float("inf"), float("nan"), float("inf")
    for w in crossings:
        # The distance of the phase to -180 degrees, by the unwrapped phase there.
        near = float(np.interp(w, omega, phase))
        exact = float(np.angle(response(w)))
        exact += 2.0 * np.pi * round((near - exact) / (2.0 * np.pi))
        margin = exact + np.pi + _start(phase)
        if np.degrees(margin) < smallest:
            smallest, crossover = float(np.degrees(margin)), w
        delay = min(delay, float(margin / w))
    above = [each for each in gains_there if each > 1.0]
    below = [each for each in gains_there if each <= 1.0]
    # A crossing at a larger gain makes the loop unstable unless its phase returns.
    gain = min(above, default=float("inf"))
    if below and smallest <= 0.0:
        gain = max(below)
    sensitivity = float(np.max(1.0 / np.abs(1.0 + loop)))
    return Margins(gain, smallest, delay, sensitivity, crossover)


def _start(phase: Any) -> float:
    """Return the turns of 2 pi that bring the first phase to -270 ... 90 degrees."""
    return float(-2.0 * np.pi * np.round((phase[0] + np.pi / 2.0) / (2.0 * np.pi)))
