"""Gains of a PID controller from a model or a relay experiment, by published rules.

SIMC    S. Skogestad, Simple analytic rules for model reduction and PID controller tuning, Journal
        of Process Control 13, 2003
lambda  E. B. Dahlin, Designing and tuning digital controllers, Instruments and Control Systems 41,
        1968; K. J. Åström & T. Hägglund, Advanced PID Control, 2006, chapter 6
relay   K. J. Åström & T. Hägglund, Automatic tuning of simple regulators with specifications on
        phase and amplitude margins, Automatica 20, 1984
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
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

    def fraction(self, omega: npt.ArrayLike, period: float) -> tuple[Any, Any]:
        """Return numerator and denominator of the frequency response of the cycles of a Pid.

        omega   angular frequencies in rad/s
        period  of the cycles, in s

        The integral of a cycle acts from the next cycle on, and the derivative is a backward
        difference:  kp + ki h q / (1 - q) + kd (1 - q) / (Tf + h - Tf q)  with q = exp(-i w h).
        """
        w = np.asarray(omega, float)
        q, difference = np.exp(-1j * w * period), -np.expm1(-1j * w * period)
        slow = difference if self.ki else 1.0
        filtered = self.filter_time * difference + period if self.kd else 1.0
        above = self.kp * slow * filtered + self.ki * period * q * filtered
        return above + self.kd * difference * slow, slow * filtered

    def rounded(self) -> Gains:
        """Return the gains with four digits, as they are printed and set."""
        return Gains(*(float(f"{each:.4g}") for each in astuple(self)))


@dataclass(frozen=True)
class Notch:
    """A notch of rtcf_control/Biquads: frequency in Hz, and Q = frequency / bandwidth."""

    frequency: float
    q: float

    @property
    def sections(self) -> str:
        """The parameter of Biquads."""
        return f"notch {self.frequency:.4g} {self.q:.4g}"

    def fraction(self, omega: npt.ArrayLike, period: float) -> tuple[Any, Any]:
        """Return numerator and denominator of its frequency response; see Gains.fraction().

        (S² + 1) / (S² + S / Q + 1) by the bilinear transform, exact at the notch's frequency.
        """
        q = np.exp(-1j * np.asarray(omega, float) * period)
        up, down = np.tan(np.pi * self.frequency * period) * (1.0 + q), 1.0 - q
        return down**2 + up**2, down**2 + up * down / self.q + up**2


@dataclass(frozen=True)
class RelayPoint:
    """The gain and period at which a proportional controller makes the loop oscillate."""

    ultimate_gain: float
    ultimate_period: float


def simc(
    model: Transfer,
    closed_loop_time: float | None = None,
    *,
    period: float = 0.0,
    slower: float = 1,
) -> Gains:
    """Return gains by SIMC.

    model             of first order: PI; of second order with real poles: PID; with the second time
                      constant above 4 (closed_loop_time + delay): the rule for double integrators
    closed_loop_time  time constant of the closed loop in s; by default the delay
    period            of the cycles of the controller, in s
    slower            factor of closed_loop_time + delay

    The delay is that of the model, with half a period for the hold and, of a PID, half a period for
    the difference and the time constant of the derivative's filter.  Raises RtcfError for complex
    poles, see integral_tuning().
    """
    times = model.time_constants
    if not times:
        raise RtcfError("simc needs real poles: the plant oscillates")
    delay = model.delay + period / 2.0
    if len(times) == 1:
        span = slower * _span(closed_loop_time, delay)
        kc = times[0] / (model.gain * span)
        return Gains(kc, kc / min(times[0], 4.0 * span))
    delay += period / 2.0
    td = min(times[1], 4.0 * slower * _span(closed_loop_time, delay))
    filter_time = td / _FILTER
    span = slower * _span(closed_loop_time, delay + filter_time)
    # Beyond td, the second lag is an integrator: T2 s + 1 = T2 / td (td s + 1) there.
    kc = times[0] / (model.gain * span) * (times[1] / td)
    ti = min(times[0], 4.0 * span)
    # Kc (1 + 1 / (Ti s)) (1 + Td s) / (Tf s + 1) as a sum: equation 17 there, with the filter.
    return Gains(
        kc * (ti + td - filter_time) / ti,
        kc / ti,
        kc * (ti - filter_time) * (td - filter_time) / ti,
        filter_time,
    )


def integral_tuning(
    model: Transfer,
    closed_loop_time: float | None = None,
    *,
    period: float = 0.0,
    slower: float = 1,
) -> Gains:
    """Return an integral controller by SIMC's rule for a plant that is only a delay.

    Well below its poles, a model is its gain and the delay of its lags.
    """
    delay = model.delay + period / 2.0 + model.denominator[-2]
    return Gains(0.0, 1.0 / (model.gain * slower * _span(closed_loop_time, delay)))


def lambda_tuning(
    model: Transfer,
    closed_loop_time: float | None = None,
    *,
    period: float = 0.0,
    slower: float = 1,
) -> Gains:
    """Return the gains of a PI controller by lambda tuning, which cancels the time constant.

    model             of first order
    closed_loop_time  time constant of the closed loop in s; by default that of the model, times 3
    period            of the cycles of the controller in s, half of which is a delay
    slower            factor of closed_loop_time + delay
    """
    if model.order != 1:
        raise ValueError("lambda tuning needs a first-order model")
    (time,) = model.time_constants
    wanted = 3.0 * time if closed_loop_time is None else closed_loop_time
    kp = time / (model.gain * slower * _span(wanted, model.delay + period / 2.0))
    return Gains(kp, kp / time)


def relay_tuning(point: RelayPoint, *, slower: float = 1) -> Gains:
    """Return gains of a PID controller for a phase margin of 45 degrees, with Ti = 4 Td.

    slower  divisor of the gain, and factor of Ti
    """
    omega = 2.0 * np.pi / point.ultimate_period
    tangent = np.tan(_PHASE_MARGIN)
    td = float((tangent + np.sqrt(4.0 / _TI_BY_TD + tangent**2)) / (2.0 * omega))
    kp = float(point.ultimate_gain * np.cos(_PHASE_MARGIN)) / slower
    return Gains(kp, kp / (_TI_BY_TD * td * slower), kp * td, td / _FILTER)


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


def _span(closed_loop_time: float | None, delay: float) -> float:
    """Return closed-loop time constant and delay together; by default, both are the same."""
    if closed_loop_time is None:
        closed_loop_time = delay
    if closed_loop_time < 0 or closed_loop_time + delay <= 0:
        raise RtcfError("the model has no delay: set the closed-loop time constant, above 0 s")
    return closed_loop_time + delay
