"""Components in the style of engineers: lists, NumPy functions, bases, properties, None."""

import enum
import math
from typing import ClassVar

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

POINTS = [0.0, 1, 2.5, 4.0, 7.0]
VALUES = [0.5, -1.0, 2.0, 8.0, 1.0]
ROWS = [2, 0]
MATRIX = np.arange(30.0).reshape(10, 3) ** 1.5


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1
    HOLD = 4


def over(values, limit):
    """Return the number of values above a limit, and the largest value."""
    return np.count_nonzero(values > limit), values.max() if len(values) else 0.0


class Bounded:
    """A mixin, not a component itself."""

    bound: Parameter[float] = Parameter(2.0, min=0.0, max=9.0)
    hits: State[int]

    @property
    def wide(self):
        return self.bound > 3.0

    def bounded(self, value):
        self.hits += 1 if abs(value) > self.bound else 0
        return np.clip(value, -self.bound, self.bound)


class Filter(Component):
    """A base without update."""

    u: Input[float]
    y: Output[float]
    share: Derived[float]
    z: State[float]

    def prepare(self):
        self.share = 0.25

    def start(self):
        self.z = 1.0

    def step(self, value):
        self.z += self.share * (value - self.z)
        return self.z

    @property
    def far(self):
        return abs(self.z) > 1.0


class Inherited(Bounded, Filter):
    """Calls its bases."""

    SIGNS = [1.0, -1.0]  # noqa: RUF012
    SCALES: ClassVar[tuple[float, ...]] = (1.0, 0.5)
    turns: State[int]

    def start(self):
        super().start()
        self.turns = 3

    @staticmethod
    def twice(value):
        return 2.0 * value

    @property
    def far(self):
        return super().far and self.turns > 5

    def step(self, value):
        return self.twice(super().step(value)) + Filter.step(self, value)

    def update(self):
        self.turns += 1
        result = self.bounded(self.step(self.u.value)) * self.SIGNS[self.turns % 2]
        result *= self.SCALES[self.turns % 2]
        self.y.write(result if self.far or self.wide else -result)


class InheritedAgain(Inherited):
    """Calls an update of a base."""

    count: Output[int]

    def update(self):
        super().update()
        self.count.write(self.hits)

    def safe(self):
        super().safe()
        self.y.write(0.0)


class Selecting(Component):
    """Uses masks and arrays as indices."""

    u: Input[np.float64, 6]
    m: Input[np.float64, (3, 3)]
    i: Input[int]
    a: State[np.float64, 6]
    b: State[np.float64, (3, 3)]
    n: State[int]
    x: State[float]

    def update(self):
        u, i = self.u.value, self.i.value % 3
        self.a[:] = u
        self.b = self.m.value
        self.a[self.a > 1.0] = 1.0
        self.a[u < -1.0] *= 0.5
        order = np.argsort(u, kind="stable")
        self.a[order[:3]] += u[order[3:]]
        self.b[i] = self.a[:3]
        self.b[ROWS, i] = u[[0, -1]]
        self.b[:, ROWS] += self.a[3:5]
        self.b[np.array(ROWS)] -= self.b[[0, 1]]
        self.b[[0, 1, 2], [2, 1, 0]] = u[3:]
        self.b[self.b > 3.0] = self.x
        self.n, self.x = over(self.b[self.b != 0.0], 0.5) if self.n < 9 else (0, 0.0)


class Sampling(Component):
    """Uses functions of NumPy and math that the random programs lack."""

    u: Input[np.float64, 20]
    v: Input[float]
    m: Input[np.float64, (4, 3)]
    ints: Input[np.int64, 5]
    a: State[np.float64, 12]
    b: State[np.float64, 6]
    s: State[np.float64, (4, 3)]
    n: State[np.int64, 6]
    on: State[np.bool_, 4]

    def update(self):
        u, v, m = self.u.value, self.v.value, self.m.value
        self.a[0] = np.polyval([1.0, v, -2.0], 0.5) + np.trapz(u, dx=0.1)
        self.a[1] = np.trapz(u[:5], POINTS) + np.interp(v, POINTS, VALUES, left=-1.0)
        self.a[2] = np.ptp(u) + np.prod(m[:, 0]) + np.var(u, ddof=1)
        self.a[3] = u.std() + np.sum(np.concatenate((u, u, u, u, u, u, u, u)))
        self.a[4] = np.round(v, 2) + math.erf(v) + math.hypot(v, 3.0)
        self.a[5] = np.sum(self.ints.value) + np.mean(self.ints.value)
        self.a[6:9] = np.linspace(-1.0, v, 3) + np.roll(m[1], 1) + np.flip(m[2])
        self.a[9:] = np.diff(u)[:3] + np.nan_to_num(m[0], nan=5.0)
        self.b = [np.median(u), np.linalg.det(m[:3]), np.trace(m), v, 1, np.inner(m[0], m[1])]
        self.s = m + np.sum(m, axis=1, keepdims=True) + np.cumsum(m, axis=0)
        self.s += np.round(m) - m.max(axis=0) + MATRIX.sum() + MATRIX.mean(axis=0)
        self.s *= u[:4, None] * u[None, 4:7]
        view = self.s.reshape(6, 2)
        view[1] = 7.0
        self.s.T.ravel()[0] = 3.0
        self.n[:2] = np.searchsorted(POINTS, [v, 2.5], side="right")
        self.n[2] = np.searchsorted(POINTS, v) + np.clip(self.ints.value[0], -2, 5)
        self.n[3:] = np.argmax(m, axis=0) + np.argmin(m, axis=0) + np.array([1, 2, v > 0])
        self.on[0] = np.allclose(u, u * (1.0 + 1e-9)) and np.array_equal(m, m)
        self.on[1] = np.all(np.isclose(m, v, atol=1.0)) or np.any(u > 3.0)
        self.on[2] = v in (0.0, 1.0) or math.isclose(v, 1.0, abs_tol=0.5)
        self.on[3] = np.count_nonzero(m > 0.0) > 5 or (any(u.astype(bool)) and all([v > 0, True]))
        for i in reversed(range(1, 4)):
            self.n[i] += abs(u[:5]).astype(int)[i] % 7 + sum(POINTS[:3]) > 2


class Unknown(Component):
    """Has states that are None at first."""

    u: Input[float]
    vector: Input[np.float64, 3]
    i: Input[int]
    y: Output[float]
    mode: State[Mode]
    last: State[float | None]
    first: State[float | None] = State(2.0)
    row: State[np.float64 | None, 3]
    when: State[int | None]
    way: State[Mode | None]

    def after(self, value):
        return -1.0 if value is None else value

    def update(self):
        slope = 0.0 if self.last is None else self.u.value - self.last
        last = self.last
        if last is not None and last > 0.0:
            slope += np.clip(last, 0.0, 1.0) + self.after(last)
        self.y.write(slope + self.after(None) + (1.0 if last == 0.5 else 0.0))
        self.last = self.u.value if self.i.value % 3 else None
        self.first = self.last
        if self.row is not None:
            self.row += self.vector.value
        self.row = self.vector.value if self.i.value % 2 else self.row
        self.when = None if self.when == 3 else self.i.value % 5
        match self.way:
            case None:
                self.way = Mode.RUN
            case Mode.RUN:
                self.way = Mode.HOLD
            case _:
                self.way = None
        match (self.mode, self.i.value % 2 == 0):
            case (Mode.OFF, True):
                self.mode = Mode(1)
            case (Mode.RUN, even):
                self.mode = Mode.HOLD if even else Mode.OFF
            case _:
                self.mode = Mode.OFF
        self.info("mode {} {}", self.mode, self.mode.value)
