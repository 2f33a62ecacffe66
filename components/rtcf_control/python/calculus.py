"""Integrator, Derivative and MovingAverage of rtcf_control."""

import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

LONGEST = 1000  # cycles
HELD = 2.0  # intervals for which a rate is held


class Method(enum.IntEnum):
    """Rules of integration."""

    euler = 0
    trapezoid = 1


class _Block(Component):
    """Runs in the last cycle, too, to pass on the safe command of an upstream component."""

    def update(self):
        self.run()

    def safe(self):
        self.run()


class Integrator(_Block):
    """Integral over time within limits, with a reset."""

    u: Input[float]
    reset: Input[bool]
    y: Output[float] = Output(finite=True)
    gain: Parameter[float] = Parameter(1.0, unit="1/s", doc="factor of the input")
    initial: Parameter[float] = Parameter(0.0, doc="output at the start and while reset is true")
    lower: Parameter[float] = Parameter(-math.inf, doc="lower limit")
    upper: Parameter[float] = Parameter(math.inf, doc="upper limit")
    method: Parameter[Method] = Parameter(
        Method.trapezoid, doc="backward Euler or trapezoidal rule"
    )
    sum: State[float]
    last: State[float | None]

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")

    def start(self):
        self.sum = self.initial
        self.last = None

    def run(self):
        rate = self.gain * self.u.value if self.u.valid else 0.0
        is_reset = self.reset.valid and self.reset.value
        if not is_reset and not math.isfinite(rate):
            self.y.write(rate)  # rejected as not finite: readers keep the last output
            return
        if is_reset or self.last is None:
            self.sum = self.initial
        else:
            mean = rate if self.method is Method.euler else self.last / 2.0 + rate / 2.0
            self.sum += self.dt * mean
        self.sum = np.clip(self.sum, self.lower, self.upper)
        self.last = rate if self.u.valid and math.isfinite(rate) else None
        self.y.write(self.sum)


class Derivative(_Block):
    """Rate of change with a first-order filter, by backward differences (Åström & Hägglund,
    Advanced PID Control, 2006, chapter 13).
    """

    u: Input[float]
    y: Output[float] = Output(finite=True)
    gain: Parameter[float] = Parameter(1.0, unit="s", doc="factor of the rate of change")
    filter_time: Parameter[float] = Parameter(
        0.0, min=0.0, unit="s", doc="time constant of the filter; 0 = no filter"
    )
    rate: State[float] = State(0.0, unit="1/s")
    last: State[float | None]
    gap: State[float] = State(0.0, unit="s", doc="time without a new finite input")
    interval: State[float] = State(0.0, unit="s", doc="time between the last two new inputs")

    def start(self):
        self.rate = 0.0
        self.gap = 0.0
        self.last = None

    def run(self):
        if not self.u.valid:
            return
        value = self.u.value
        if not math.isfinite(value):
            self.gap += self.dt
            self.y.write(value)  # rejected as not finite: readers keep the last output
            return
        if self.last is not None and not self.u.new:
            self.hold()
            return
        if self.last is not None:
            self.rate = (self.filter_time * self.rate + value - self.last) / (
                self.filter_time + self.gap + self.dt
            )
            self.interval = self.gap + self.dt
        self.y.write(self.gain * self.rate)
        self.gap = 0.0
        if math.isfinite(self.rate):
            self.last = value
        else:
            self.last = None  # overflow, which the filter would keep
            self.rate = 0.0

    def hold(self):
        """Keep the rate for as long as a slow source may take, also if one of its values is lost.
        Then the rate falls as 1 / time: a later value would not have changed by more.
        """
        before = self.gap
        self.gap += self.dt
        if self.gap > HELD * self.interval:
            self.rate *= max(before, HELD * self.interval) / self.gap
        self.y.write(self.gain * self.rate)


class MovingAverage(_Block):
    """Mean of the last values; while the window is not full, of all values.

    Unlike the component in C++, it begins again after a change of its length.
    """

    u: Input[float]
    y: Output[float] = Output(finite=True)
    length: Parameter[int] = Parameter(10, min=1, max=LONGEST, unit="cycles", doc="of the window")
    # Before next: values of this round; from there on: sums of the last round's values from each
    # place to the end. Values are added only: a large one would leave rounding errors behind when
    # it is subtracted.
    window: State[np.float64, LONGEST]
    count: State[int] = State(0, doc="values in the window")
    next: State[int] = State(0, doc="place of the next value")
    ring: State[int] = State(0, doc="number of places in use")
    round: State[float] = State(0.0, doc="sum of this round's values")

    def start(self):
        self.ring = 0

    def run(self):
        if not self.u.valid:
            return
        value = self.u.value
        if not math.isfinite(value):
            self.y.write(value)  # rejected as not finite: readers keep the last output
            return
        if self.ring != self.length:
            self.ring = self.length
            self.count = 0
            self.next = 0
            self.round = 0.0
        self.window[self.next] = value
        self.round += value
        self.next += 1
        self.count = min(self.count + 1, self.ring)
        total = self.round
        if self.next == self.ring:
            for i in range(self.ring - 1, 0, -1):
                self.window[i - 1] += self.window[i]
            self.round = 0.0
            self.next = 0
        elif self.count == self.ring:
            total += self.window[self.next]
        self.y.write(total / self.count)
