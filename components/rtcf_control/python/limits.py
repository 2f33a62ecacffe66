"""Limits of a value: Saturation, RateLimiter, DeadBand, Backlash and Hysteresis of rtcf_control."""

import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class _Block(Component):
    """Runs in the last cycle, too, to pass on the safe command of an upstream component."""

    def update(self):
        self.run()

    def safe(self):
        self.run()


class Saturation(_Block):
    """Limits a value to a range."""

    u: Input[float]
    y: Output[float] = Output(finite=True)
    saturated: Output[bool]
    lower: Parameter[float] = Parameter(-math.inf, doc="lower limit")
    upper: Parameter[float] = Parameter(math.inf, doc="upper limit")

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")

    def run(self):
        if not self.u.valid:
            return
        value = self.u.value
        if not math.isfinite(value):
            self.y.write(value)  # rejected as not finite: readers keep the last output
            return
        limited = np.clip(value, self.lower, self.upper)
        self.y.write(limited)
        self.saturated.write(limited != value)


class RateLimiter(_Block):
    """Limits the rate of change; the first value passes unlimited."""

    u: Input[float]
    y: Output[float] = Output(finite=True)
    limited: Output[bool]
    rising: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="1/s", doc="largest rate upwards; 0 holds"
    )
    falling: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="1/s", doc="largest rate downwards; 0 holds"
    )
    last: State[float | None] = State(live=True)

    def start(self):
        self.last = None

    def run(self):
        if not self.u.valid:
            return
        value = self.u.value
        if not math.isfinite(value):
            self.y.write(value)  # rejected as not finite: readers keep the last output
            return
        before = value if self.last is None else self.last
        step = min(self.dt, 1e-8 * self.period)  # of a late cycle: ten periods at most
        self.last = np.clip(value, before - self.falling * step, before + self.rising * step)
        self.y.write(self.last)
        self.limited.write(self.last != value)


class DeadBand(_Block):
    """0 within a band, else the distance to the nearer end of the band."""

    u: Input[float]
    y: Output[float] = Output(finite=True)
    lower: Parameter[float] = Parameter(0.0, doc="lower end of the band")
    upper: Parameter[float] = Parameter(0.0, doc="upper end of the band")

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")

    def run(self):
        if self.u.valid:
            value = self.u.value
            self.y.write(
                value - np.clip(value, self.lower, self.upper) if math.isfinite(value) else value
            )


class Backlash(_Block):
    """Mechanical play: the play operator (Brokate & Sprekels, Hysteresis and Phase Transitions)."""

    u: Input[float]
    y: Output[float] = Output(finite=True)
    width: Parameter[float] = Parameter(0.0, min=0.0, doc="play from flank to flank")
    position: State[float | None]

    def start(self):
        self.position = None

    def run(self):
        if not self.u.valid:
            return
        drive = self.u.value
        if not math.isfinite(drive):
            self.y.write(drive)  # rejected as not finite: readers keep the last output
            return
        before = drive if self.position is None else self.position
        self.position = np.clip(before, drive - self.width / 2.0, drive + self.width / 2.0)
        self.y.write(self.position)


class Hysteresis(_Block):
    """Schmitt trigger: true above high, false below low, else unchanged."""

    u: Input[float]
    y: Output[bool]
    low: Parameter[float] = Parameter(0.0, doc="false below this value")
    high: Parameter[float] = Parameter(0.0, doc="true above this value")
    initial: Parameter[bool] = Parameter(False, doc="output until the input leaves the band")
    on: State[bool]
    begun: State[bool]

    def prepare(self):
        if self.low > self.high:
            raise ValueError("low is above high")

    def start(self):
        self.begun = False

    def run(self):
        if not self.u.valid:
            return
        if not self.begun:
            self.on = self.initial
            self.begun = True
        if self.u.value > self.high:
            self.on = True
        elif self.u.value < self.low:
            self.on = False
        self.y.write(self.on)
