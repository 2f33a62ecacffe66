"""Models of a plant: a transfer function with a delay, and a state space.

Both are sampled exactly: the input is constant during a cycle, and the output is that at the begin
of a cycle. With q = exp(-i w period), `fraction` returns their frequency response as a numerator
and a denominator, whose zeros in the disc |q| < 1 are the unstable poles.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import signal

Array = npt.NDArray[np.float64]

_LIGHT = 0.3  # damping below which poles are a resonance
_TERMS = 14  # of a Taylor series, of a matrix with a norm of at most 0.5
_HIGHEST = 0.9  # of the Nyquist frequency, for a resonance


@dataclass(frozen=True)
class Resonance:
    """A lightly damped pair of poles: natural frequency in Hz, and damping ratio."""

    frequency: float
    damping: float


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
        if self.order == 1:
            return (self.denominator[0],)
        product, total, _ = self.denominator
        square = total * total - 4.0 * product
        if square < -1e-9 * total * total:
            return ()
        largest = (total + float(np.sqrt(max(square, 0.0)))) / 2.0
        return (largest, product / largest)

    @property
    def natural_frequency(self) -> float:
        """The natural frequency of a second-order model, rad/s."""
        return float(1.0 / np.sqrt(self.denominator[0]))

    @property
    def damping(self) -> float:
        """The damping ratio of a second-order model."""
        return self.denominator[1] * self.natural_frequency / 2.0

    @property
    def poles(self) -> Any:
        """The poles in 1/s."""
        if self.time_constants:
            return -1.0 / np.array(self.time_constants, complex)
        swing = 1j * np.sqrt(1.0 - self.damping**2)
        return self.natural_frequency * np.array([swing - self.damping, -swing - self.damping])

    @property
    def damped(self) -> Transfer:
        """The model with two equal time constants in place of complex poles."""
        return replace(self, denominator=(self.denominator[0], 2.0 / self.natural_frequency, 1.0))

    @property
    def resonances(self) -> list[Resonance]:
        """The lightly damped poles."""
        if self.time_constants or self.damping > _LIGHT:
            return []
        return [Resonance(self.natural_frequency / (2.0 * np.pi), self.damping)]

    def fraction(self, omega: npt.ArrayLike, period: float) -> tuple[Any, Any]:
        """Return numerator and denominator at angular frequencies in rad/s, at most pi / period."""
        w = np.asarray(omega, float)
        numerator, _, cycles = _discrete(self.denominator, self.delay, period)
        q = np.exp(-1j * w * period)
        above = self.gain * q**cycles * np.polyval(numerator[::-1], q)
        # 1 - pole q without cancellation, for slow poles at low frequencies.
        below = -np.expm1((self.poles - 1j * w[..., None]) * period)
        return above, below.prod(axis=-1)

    def simulate(self, inputs: npt.ArrayLike, period: float) -> Array:
        """Return the output at the beginning of each cycle, from rest.

        inputs  an input per cycle, constant from the beginning of the cycle to its end
        period  the period of the cycles, in s
        """
        numerator, denominator, cycles = _discrete(self.denominator, self.delay, period)
        delayed = np.asarray(inputs, float)
        delayed = np.concatenate([np.zeros(cycles), delayed])[: len(delayed)]
        found: Array = self.gain * signal.lfilter(numerator, denominator, delayed)
        return found


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

    @property
    def resonances(self) -> list[Resonance]:
        """The lightly damped poles that dominate the response at their frequency, lowest first."""
        values, vectors = np.linalg.eig(self.a.astype(complex))
        residues = (self.c @ vectors) * np.linalg.solve(vectors, self.b.astype(complex))
        found = []
        for pole, residue in zip(values, residues, strict=True):
            angle = float(np.angle(pole))
            if not 0.0 < angle < _HIGHEST * np.pi:
                continue
            rate = -float(np.log(abs(pole)))
            size = float(np.hypot(rate, angle))
            z = np.exp(1j * angle)
            mode = residue / (z - pole) + np.conj(residue) / (z - np.conj(pole))
            rest = (residues / (z - values)).sum() - mode
            if rate < _LIGHT * size and abs(mode) > abs(rest):
                found.append(Resonance(size / (2.0 * np.pi * self.period), rate / size))
        return sorted(found, key=lambda each: each.frequency)

    def fraction(self, omega: npt.ArrayLike, period: float | None = None) -> tuple[Any, Any]:
        """Return numerator and denominator at angular frequencies in rad/s, at most pi / period."""
        del period  # that of the model
        w = np.asarray(omega, float)
        systems = np.exp(1j * w * self.period)[..., None, None] * np.eye(self.order) - self.a
        inputs = np.broadcast_to(self.b[:, None], (*w.shape, self.order, 1))
        poles = np.linalg.eigvals(self.a)
        below = (1.0 - poles * np.exp(-1j * w * self.period)[..., None]).prod(axis=-1)
        return below * (np.linalg.solve(systems, inputs)[..., 0] * self.c).sum(axis=-1), below

    def simulate(self, inputs: npt.ArrayLike, period: float | None = None) -> Array:
        """Return the output at the beginning of each cycle, from rest."""
        del period  # that of the model
        u = np.asarray(inputs, float)
        states, power = self.b[:, None], self.a
        while states.shape[1] < len(u):  # B, A B, A² B ...: the response to a pulse of 1
            states = np.concatenate([states, power @ states], axis=1)
            power = power @ power
        pulse = np.concatenate([[0.0], self.c @ states])[: len(u)]
        found: Array = signal.fftconvolve(u, pulse)[: len(u)]
        return found


Model = Transfer | StateSpace


@functools.lru_cache(maxsize=64)
def _discrete(
    denominator: tuple[float, ...], delay: float, period: float
) -> tuple[Array, Array, int]:
    """Return numerator and denominator by z^-1 for a gain of 1, and whole cycles of delay.

    The zero-order hold is exact, also for the rest of the delay (Åström & Wittenmark,
    Computer-Controlled Systems, 1997, chapter 2).
    """
    cycles = int(delay / period)
    rest = delay / period - cycles
    n = len(denominator) - 1
    # The unit of time is a cycle, so that the matrix is well scaled.
    scaled = [each / period ** (n - k) for k, each in enumerate(denominator)]
    a = np.zeros((n, n))
    a[:-1, 1:] = np.eye(n - 1)
    a[-1] = -np.array(scaled[:0:-1]) / scaled[0]
    b = np.zeros(n)
    b[-1] = 1.0 / scaled[0]
    before, previous = _held(a, b, rest)
    late, newest = _held(a, b, 1.0 - rest)
    whole, previous = late @ before, late @ previous
    adjugates = [np.eye(n)]
    coefficients = np.array([1.0, -np.trace(whole), np.linalg.det(whole)])[: n + 1]
    for k in range(1, n):  # Leverrier's algorithm
        adjugates.append(whole @ adjugates[-1] + coefficients[k] * np.eye(n))
    # C (zI - A)^-1 (newest + previous z^-1) with C = (1, 0)
    numerator = np.zeros(n + 2)
    numerator[1:-1] = [(each @ newest)[0] for each in adjugates]
    numerator[2:] += [(each @ previous)[0] for each in adjugates]
    return numerator, coefficients, cycles


def _held(a: Array, b: Array, time: float) -> tuple[Array, Array]:
    """Return exp(A t), and the integral of exp(A s) B over s from 0 to t.

    A Taylor series and squarings: ten times faster than linalg.expm for these small matrices.
    """
    n = len(a)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = a * time, b * time
    squarings = max(int(np.ceil(np.log2(np.abs(block[:n, :n]).sum() + 1e-300))) + 1, 0)
    block /= 2.0**squarings
    unit = np.eye(n + 1)
    found = unit
    for k in range(_TERMS, 0, -1):
        found = unit + block @ found / k
    for _ in range(squarings):
        found = found @ found
    return found[:n, :n], found[:n, n]
