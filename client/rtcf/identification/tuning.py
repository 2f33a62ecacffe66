"""Gains of a PID controller from a model or a relay experiment, by published rules.

SIMC    S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, Journal
        of Process Control 13, 2003
lambda  E. B. Dahlin, Designing and tuning digital controllers, Instruments and Control Systems 41,
        1968; K. J. Åström & T. Hägglund, Advanced PID Control, 2006, chapter 6
relay   K. J. Åström & T. Hägglund, Automatic tuning of simple regulators with specifications on
        phase and amplitude margins, Automatica 20, 1984
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from rtcf_shared.errors import RtcfError

if TYPE_CHECKING:
    from rtcf.identification.models import Transfer

_FILTER = 10.0  # derivative time by the filter's time constant
_LEAST_TURNS = 3  # oscillations of a relay experiment
_SPREAD = 0.2  # largest relative difference of their periods
_PHASE_MARGIN = np.radians(45.0)
_TI_BY_TD = 4.0


@dataclass(frozen=True)
class Gains:
    """Parameters of rtcf_control/Pid: kp + ki / s + kd s / (filter_time s + 1)."""

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    filter_time: float = 0.0

    def response(self, omega: npt.ArrayLike) -> Any:
        """Return the frequency response at angular frequencies in rad/s."""
        s = 1j * np.asarray(omega, float)
        return self.kp + self.ki / s + self.kd * s / (self.filter_time * s + 1.0)


@dataclass(frozen=True)
class RelayPoint:
    """The gain and period at which a proportional controller makes the loop oscillate."""

    ultimate_gain: float
    ultimate_period: float


def simc(
    model: Transfer, closed_loop_time: float | None = None, *, extra_delay: float = 0
) -> Gains:
    """Return gains by SIMC.

    model             of first order: PI; of second order with real poles: PID
    closed_loop_time  time constant of the closed loop in s; by default the delay
    extra_delay       of the controller in s, e.g. half a period

    Raises RtcfError for complex poles.
    """
    times = model.time_constants
    if not times:
        raise RtcfError("simc needs real poles: the plant oscillates; use a first-order model")
    delay = model.delay + extra_delay
    wanted = _positive(delay if closed_loop_time is None else closed_loop_time, delay)
    kc = times[0] / (model.gain * (wanted + delay))
    ti = min(times[0], 4.0 * (wanted + delay))
    td = times[1] if len(times) > 1 else 0.0
    # From the series form Kc (1 + 1 / (Ti s)) (1 + Td s), equation 17 there.
    return Gains(kc * (1.0 + td / ti), kc / ti, kc * td, td / _FILTER)


def lambda_tuning(
    model: Transfer, closed_loop_time: float | None = None, *, extra_delay: float = 0
) -> Gains:
    """Return the gains of a PI controller by lambda tuning, which cancels the time constant.

    model             of first order
    closed_loop_time  time constant of the closed loop in s; by default that of the model, times 3
    extra_delay       of the controller in s, e.g. half a period
    """
    if model.order != 1:
        raise ValueError("lambda tuning needs a first-order model")
    (time,) = model.time_constants
    delay = model.delay + extra_delay
    wanted = _positive(3.0 * time if closed_loop_time is None else closed_loop_time, delay)
    kp = time / (model.gain * (wanted + delay))
    return Gains(kp, kp / time)


def relay_tuning(point: RelayPoint) -> Gains:
    """Return gains of a PID controller for a phase margin of 45 degrees, with Ti = 4 Td."""
    omega = 2.0 * np.pi / point.ultimate_period
    tangent = np.tan(_PHASE_MARGIN)
    td = (tangent + np.sqrt(4.0 / _TI_BY_TD + tangent**2)) / (2.0 * omega)
    kp = point.ultimate_gain * np.cos(_PHASE_MARGIN)
    return Gains(float(kp), float(kp / (_TI_BY_TD * td)), float(kp * td), float(td / _FILTER))


def relay_point(
    relay: npt.ArrayLike, outputs: npt.ArrayLike, period: float, hysteresis: float = 0.0
) -> RelayPoint:
    """Return the oscillation that a relay has caused, by its describing function.

    relay       the signal of the relay per cycle
    outputs     the measured value per cycle
    period      in s
    hysteresis  of the relay, in the unit of the output

    Raises RtcfError without a steady oscillation.
    """
    signal, y = np.asarray(relay, float), np.asarray(outputs, float)
    ups = np.flatnonzero((signal[1:] > 0) & (signal[:-1] < 0)) + 1
    if len(ups) < _LEAST_TURNS + 1:
        raise RtcfError(
            f"the relay has caused {max(len(ups) - 1, 0)} oscillations, {_LEAST_TURNS} are needed: "
            "set a longer duration, or a smaller hysteresis"
        )
    last = ups[-(_LEAST_TURNS + 1) :]
    turns = np.diff(last)
    if np.ptp(turns) > max(_SPREAD * turns.mean(), 2.0):
        raise RtcfError("the oscillation of the relay is not steady: set a longer duration")
    steady = slice(int(last[0]), int(last[-1]))
    height = float(np.ptp(signal[steady])) / 2.0
    swing = float(np.ptp(y[steady])) / 2.0
    if swing <= hysteresis:
        raise RtcfError("the oscillation is within the hysteresis: set a smaller hysteresis")
    gain = 4.0 * height / (np.pi * np.sqrt(swing**2 - hysteresis**2))
    return RelayPoint(float(gain), float(turns.mean() * period))


def _positive(time: float, delay: float) -> float:
    if time < 0 or time + delay <= 0:
        raise RtcfError("the model has no delay: set the closed-loop time constant, above 0 s")
    return time
