"""Python components for the tests: their functions, and each kind of failure."""

import enum
from dataclasses import dataclass

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, Queue, State
from rtcf.linear import c2d

A = np.array([[1.0, 0.001], [0.0, 0.98]])
B = np.array([0.0, 0.02])


@dataclass(frozen=True)
class Plant:
    """Constants of a motor."""

    gain: float
    offset: float


MOTOR = Plant(gain=0.5, offset=0.0)


class Mode(enum.IntEnum):
    """Activity of a controller."""

    IDLE = 0
    RUN = 1
    LIMITED = 2


def clamp(value, low, high):
    """Return the value within bounds."""
    return min(max(value, low), high)


class Ramp(Component):
    """Counts cycles, in all types of a port."""

    count: Output[int]
    seconds: Output[float] = Output(unit="s")
    even: Output[bool]
    pair: Output[np.float64, 2] = Output(unit="m, m/s")
    step: Parameter[int] = Parameter(1, min=1, max=1000, doc="by which it counts")
    total: State[int]
    passed: State[float] = State(0.0, unit="s", doc="since it was loaded")

    def update(self):
        """Count."""
        self.total += self.step
        self.passed += self.dt
        self.count.write(self.total)
        self.seconds.write(self.passed)
        self.even.write(self.total % 2 == 0)
        self.pair.write(np.array((self.passed, 1.0)))

    def safe(self):
        """Go to zero."""
        self.count.write(0)


class Observer(Component):
    """Luenberger observer of a motor."""

    seconds: Input[float]
    pair: Input[np.float64, 2]
    x: Output[np.float64, 2] = Output(unit="rad, rad/s")
    low: Parameter[float] = Parameter(0.4, doc="gain of the angle")
    high: Parameter[float] = Parameter(12.0, doc="gain of the speed")
    estimate: State[np.float64, 2]
    mode: State[Mode] = State(Mode.IDLE)
    seen: State[int]

    def start(self):
        """Begin at rest."""
        self.seen = 0

    def update(self):
        """Predict and correct."""
        if not self.seconds.new:
            return
        self.seen += 1
        if self.seen == 3:
            self.info("third value {} after {} ms", self.seconds.value, self.seen)
        error = self.pair.value[0] - self.estimate[0]
        self.estimate[:] = A @ self.estimate + B * MOTOR.gain + self.dt * self.gains() * error
        self.mode = Mode.RUN
        self.limit(1e6)
        self.x.write(self.estimate)

    def gains(self):
        """Return both gains."""
        return np.array((self.low, self.high))

    def limit(self, bound):
        """Keep the estimate within bounds."""
        for i in range(2):
            if abs(self.estimate[i]) > bound:
                self.mode = Mode.LIMITED
            self.estimate[i] = clamp(self.estimate[i], -bound, bound)


class Seldom(Component):
    """Counts cycles, and writes some of the counts."""

    count: Output[int]
    every: Parameter[int] = Parameter(1, min=1, fixed=True)
    total: State[int]

    def update(self):
        """Count."""
        self.total += 1
        if self.total % self.every == 0:
            self.count.write(self.total)


class Watcher(Component):
    """Records all properties of an input."""

    count: Input[int]
    last: State[int]
    fresh: State[int] = State(0, doc="cycles with a new value")
    valid: State[bool]
    age: State[int] = State(0, unit="ns")
    connected: State[bool]

    def update(self):
        """Record them."""
        self.last = self.count.value
        if self.count.new:
            self.fresh += 1
        self.valid = self.count.valid
        self.age = self.count.age
        self.connected = self.count.connected


class Gatherer(Component):
    """Reads each message of a ramp, even if it does not run in every cycle."""

    count: Queue[int] = Queue(size=8)
    pair: Queue[np.float64, 2] = Queue(size=8)
    messages: State[int]
    in_order: State[bool] = State(True)
    last: State[int]
    seconds: State[float]
    oldest: State[int] = State(0, doc="ns; of a message that it took")

    def update(self):
        """Read all queued messages."""
        while self.count.size > 0:
            self.in_order = self.in_order and self.count.front == self.last + 1
            self.last = self.count.front
            self.oldest = max(self.oldest, self.count.age)
            self.messages += 1
            self.count.pop()
        while self.pair.size > 0:
            self.seconds += self.pair.front[0]
            self.pair.pop()


class Pendulum(Component):
    """State feedback on a model that is discretised when parameters change."""

    angle: Input[float]
    torque: Output[float] = Output(unit="N m")
    length: Parameter[float] = Parameter(0.5, min=0.1, max=2.0, unit="m")
    damping: Parameter[float] = Parameter(0.1, min=0.0, max=5.0)
    step: Parameter[float] = Parameter(0.001, min=0.0001, max=0.1, unit="s")
    gains: Parameter[np.float64, 2] = Parameter([20.0, 2.0], min=0.0, max=100.0)
    ad: Derived[np.float64, 2, 2]
    bd: Derived[np.float64, 2, 1]
    slow: Derived[bool]
    x: State[np.float64, 2]

    def prepare(self):
        """Discretise."""
        if self.gains[0] > 99.0:
            raise ValueError("stiffer than the drive")
        ad, bd = c2d(self.model(), np.array(((0.0,), (1.0,))), self.step)
        self.ad = ad
        self.bd = bd
        self.slow = self.length > 1.0

    def model(self):
        """Return the matrix of the continuous system."""
        return np.array(((0.0, 1.0), (-9.81 / self.length, -self.damping)))

    def update(self):
        """Estimate, and feed back."""
        gain = 0.1 if self.slow else 0.3
        torque = min(max(-self.gains @ self.x, -10.0), 10.0)
        self.x[:] = self.ad @ self.x + self.bd[:, 0] * torque
        if self.angle.new and np.isfinite(self.angle.value):
            self.x[0] += gain * (min(max(self.angle.value, -3.0), 3.0) - self.x[0])
        self.torque.write(torque)


class Axes(Component):
    """Adds the axes that are enabled."""

    u: Input[np.float64, 3]
    y: Output[np.float64, 3]
    enabled: Parameter[bool, 3] = Parameter([True, False, True], doc="axes that move")
    plan: Parameter[bool, 2, 2] = Parameter([[True, False], [False, False]], name="plan/way")
    many: Derived[int]
    total: State[np.float64, 3]

    def prepare(self):
        """Count."""
        self.many = np.count_nonzero(self.enabled) + np.count_nonzero(self.plan)
        if self.many == 0:
            raise ValueError("no axis")

    def update(self):
        """Add."""
        step = np.where(self.enabled, self.u.value, 0.0)
        step[~self.enabled] = 1.0
        for axis in range(3):
            if self.enabled[axis] and self.plan[0, axis % 2]:
                step[axis] += self.many
        self.total += np.clip(step, -1e3, 1e3)
        self.y.write(self.total)


class Window(Component):
    """Weighs the last three matrices."""

    u: Input[np.float64, 2, 2]
    y: Output[np.float64, 2, 2]
    share: Parameter[float] = Parameter(0.5, min=0.0, max=1.0)
    samples: State[np.float64, 3, 2, 2] = State(0.5, unit="m", doc="the latest first")
    counts: State[np.int16, 3, 2, 2]
    weights: Derived[np.float64, 3, 2, 2]

    def prepare(self):
        """Weigh older samples less."""
        self.weights[:] = self.share
        self.weights[0] = 1.0

    def update(self):
        """Shift the samples."""
        self.samples[1:] = self.samples[:-1]
        self.samples[0] = np.clip(self.u.value, -1e6, 1e6)
        self.counts[:, 1, 0] += 1
        self.y.write(np.sum(self.weights * self.samples, axis=0))


class Integrator(Component):
    """Has private members, beside a port of the same name."""

    u: Input[float] = Input(unit="m/s", doc="measured speed")
    goals: Queue[float] = Queue(size=2, unit="m", doc="positions to reach")
    integral: Output[float] = Output(unit="m", doc="position")
    ki: Parameter[float] = Parameter(2.0, min=0.0, max=10.0)
    _integral: State[float] = State(0.5, unit="m", doc="of the input")
    _last: State[float | None]
    _latched: State[bool] = State(False, live=True)
    _sums: State[np.float64, 3]
    _time: State[int]  # the loop's is self.time
    _record: State[int]
    _memory: State[np.float64, 2]
    _gain: Derived[float]
    _LIMIT = 1e6
    __FACTOR = 0.5

    def prepare(self):
        """Compute the gain."""
        self._gain = self.ki * self.__FACTOR

    def _limited(self, value):
        return min(max(value, -self._LIMIT), self._LIMIT)

    def __step(self, __share):
        __sum = self._integral + self._gain * self.u.value * __share
        return self._limited(__sum)

    def update(self):
        """Integrate."""
        old = self._sums
        self._integral = self.__step(self.dt)
        self._sums = 0.5 * self._sums + self._integral
        self._memory[:] = self._sums[:2] - old[:2]
        if self._last is None or self.u.value > self._last:
            self._last = self.u.value
        self._latched = self._latched or self._integral > 1e3
        self._time += self.time
        self._record += self.goals.size
        self.integral.write(self._integral)


def quotient(a, b):
    """Return a / b."""
    return a / b


class Failing(Component):
    """Fails in the way selected by its parameter."""

    out: Output[float]
    way: Parameter[int] = Parameter(0, min=0, max=9)
    after: Parameter[int] = Parameter(20)
    zero: State[float]
    place: State[int] = State(5)
    few: State[np.float64, 3]
    updates: State[int]

    def start(self):
        """Fail at the start if selected."""
        if self.way == 9:
            raise ValueError("does not want to start")

    def update(self):
        """Write, and fail eventually."""
        self.out.write(1.0)
        self.updates += 1
        if self.updates < self.after:
            return
        self.out.write(666.0)
        if self.way == 1:
            raise ValueError("the limit is passed")
        if self.way == 2:
            self.few[self.place] = 1.0
        if self.way == 3:
            self.zero = quotient(1.0, self.zero)
        if self.way == 4:
            self.fault("no reply from the drive")
        if self.way == 5:
            self.few[:] = np.ones(self.place)
        if self.way == 6:
            self.few[0] = np.ones(self.place * 100000)[self.place]
        if self.way == 7:
            self.place = self.place % (self.place - 5)
