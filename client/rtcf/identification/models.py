"""Models of a plant: a transfer function with a delay, and a state space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import linalg, signal

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Transfer:
    """K exp(-delay s) / (d0 s^n + ... + d(n-1) s + 1), of order n = 1 or 2.

    gain         K, in output units per input unit
    denominator  d0 ... d(n-1), 1
    delay        in s
    """

    gain: float
    denominator: tuple[float, ...]
    delay: float

    @property
    def order(self) -> int:
        """The number of poles."""
        return len(self.denominator) - 1

    @property
    def time_constants(self) -> tuple[float, ...]:
        """The time constants of real poles in s, largest first; empty if the poles are complex."""
        poles = np.roots(self.denominator)
        if np.any(np.abs(poles.imag) > 1e-9 * np.abs(poles)):
            return ()
        return tuple(sorted((float(-1.0 / each.real) for each in poles), reverse=True))

    @property
    def natural_frequency(self) -> float:
        """The natural frequency of a second-order model, rad/s."""
        return float(1.0 / np.sqrt(self.denominator[0]))

    @property
    def damping(self) -> float:
        """The damping ratio of a second-order model."""
        return self.denominator[1] * self.natural_frequency / 2.0

    def response(self, omega: npt.ArrayLike) -> Any:
        """Return the frequency response at angular frequencies in rad/s."""
        s = 1j * np.asarray(omega, float)
        return self.gain * np.exp(-s * self.delay) / np.polyval(self.denominator, s)

    def simulate(self, inputs: npt.ArrayLike, period: float) -> Array:
        """Return the output at the beginning of each cycle, from rest.

        inputs  an input per cycle, constant from the beginning of the cycle to its end
        period  the period of the cycles, in s
        """
        numerator, denominator, cycles = self._discrete(period)
        delayed = np.asarray(inputs, float)
        delayed = np.concatenate([np.zeros(cycles), delayed])[: len(delayed)]
        found: Array = self.gain * signal.lfilter(numerator, denominator, delayed)
        return found

    def step(self, times: npt.ArrayLike) -> Array:
        """Return the response to a step of 1 at time 0; times in s."""
        since = np.asarray(times, float) - self.delay
        poles = np.roots(self.denominator)
        if self.order == 1:
            free = np.exp(since * poles[0].real)
        elif abs(poles[0] - poles[1]) < 1e-6 * abs(poles[0]):
            pole = poles.mean().real
            free = np.exp(pole * since) * (1.0 - pole * since)
        else:
            p, q = poles.astype(complex)
            free = ((p * np.exp(q * since) - q * np.exp(p * since)) / (p - q)).real
        found: Array = np.where(since > 0, self.gain * (1.0 - free), 0.0)
        return found

    def _discrete(self, period: float) -> tuple[Array, Array, int]:
        """Return numerator and denominator by z^-1 for a gain of 1, and whole cycles of delay.

        The zero-order hold is exact, also for the rest of the delay (Åström & Wittenmark,
        Computer-Controlled Systems, 1997, chapter 2).
        """
        cycles = int(self.delay / period)
        rest = self.delay - cycles * period
        n = self.order
        lead = self.denominator[0]
        a = np.zeros((n, n))
        a[:-1, 1:] = np.eye(n - 1)
        a[-1] = -np.array(self.denominator[:0:-1]) / lead
        b = np.zeros(n)
        b[-1] = 1.0 / lead
        whole, _ = _held(a, b, period)
        late, newest = _held(a, b, period - rest)
        previous = late @ _held(a, b, rest)[1]
        adjugates = [np.eye(n)]
        coefficients = np.asarray(np.poly(whole), dtype=np.float64)
        for k in range(1, n):  # Leverrier's algorithm
            adjugates.append(whole @ adjugates[-1] + coefficients[k] * np.eye(n))
        # C (zI - A)^-1 (newest + previous z^-1) with C = (1, 0)
        first = np.array([0.0, *((each @ newest)[0] for each in adjugates)])
        second = np.array([0.0, 0.0, *((each @ previous)[0] for each in adjugates)])
        first = np.append(first, 0.0)
        return first + second, coefficients, cycles


@dataclass(frozen=True)
class StateSpace:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k], of cycles with a period in s."""

    a: Array
    b: Array
    c: Array
    period: float

    @property
    def order(self) -> int:
        """The number of states."""
        return len(self.a)

    @property
    def poles(self) -> Any:
        """The poles in 1/s; the slowest first."""
        discrete = np.linalg.eigvals(self.a).astype(complex)
        found = np.log(np.where(discrete == 0, 1e-300, discrete)) / self.period
        return found[np.lexsort((found.imag, np.abs(found)))]

    def response(self, omega: npt.ArrayLike) -> Any:
        """Return the frequency response at angular frequencies in rad/s, below pi / period."""
        z = np.exp(1j * np.asarray(omega, float) * self.period)
        systems = z[..., None, None] * np.eye(self.order) - self.a
        inputs = np.broadcast_to(self.b[:, None], (*z.shape, self.order, 1))
        return (np.linalg.solve(systems, inputs)[..., 0] * self.c).sum(axis=-1)

    def simulate(self, inputs: npt.ArrayLike, period: float | None = None) -> Array:
        """Return the output at the beginning of each cycle, from rest."""
        del period  # that of the model
        u = np.asarray(inputs, float)
        state = np.zeros(self.order)
        found = np.empty(len(u))
        for k, each in enumerate(u):
            found[k] = self.c @ state
            state = self.a @ state + self.b * each
        return found


Model = Transfer | StateSpace


def _held(a: Array, b: Array, time: float) -> tuple[Array, Array]:
    """Return exp(A t), and the integral of exp(A s) B over s from 0 to t."""
    n = len(a)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a, b
    found = linalg.expm(block * time)
    return found[:n, :n], found[:n, n]
