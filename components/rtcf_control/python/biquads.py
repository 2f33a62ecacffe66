"""One second-order section, as a chain of one in Biquads of rtcf_control."""

import enum
import math

from rtcf.component import Component, Input, Output, Parameter, State


class Kind(enum.IntEnum):
    """Kinds of sections."""

    lowpass = 0
    highpass = 1
    bandpass = 2
    notch = 3


class Biquad(Component):
    """Second-order section by the pre-warped bilinear transform (Oppenheim & Schafer, Discrete-Time
    Signal Processing, 2010, chapter 7), the trapezoidal rule. Begins settled at its first value.
    """

    u: Input[float]
    y: Output[float] = Output(finite=True)
    kind: Parameter[Kind] = Parameter(Kind.lowpass)
    f: Parameter[float] = Parameter(50.0, min=1e-3, unit="Hz", doc="frequency of the section")
    q: Parameter[float] = Parameter(math.sqrt(0.5), min=1e-6, max=1e6, doc="quality")
    value: State[float] = State(0.0, doc="the input, filtered by the poles")
    rate: State[float] = State(0.0, doc="its derivative, per radian at f")
    acceleration: State[float] = State(0.0, doc="its second derivative")
    step: State[int] = State(0, unit="ns", doc="time from the last value to this one")
    begun: State[bool]

    def start(self):
        self.begun = False

    def damping(self, k, step, highest):
        """Return the damping of the poles. The gain of a bandpass or notch is 1 / sqrt(2) at two
        frequencies that differ by f / q, as in Orfanidis, Introduction to Signal Processing, 1996,
        section 11.3.
        """
        if self.kind is Kind.lowpass or self.kind is Kind.highpass:
            return 1.0 / self.q
        return math.tan(math.pi * min(self.f / self.q, highest) * step) * (1.0 + k * k) / k

    def update(self):
        self.run()

    def safe(self):
        self.run()  # to pass on the safe command of an upstream component

    def run(self):
        if not self.u.valid:
            return
        x = self.u.value
        if not math.isfinite(x):
            self.y.write(x)  # rejected as not finite: readers keep the last output
            return
        if not self.begun:
            self.value = x
            self.rate = 0.0
            self.acceleration = 0.0
            self.step = self.period
            self.begun = True
        elif round(1e9 * self.dt) == self.period:
            self.step = self.period
        step = 1e-9 * self.step
        highest = 0.49 / step
        k = math.tan(math.pi * min(self.f, highest) * step)
        damping = self.damping(k, step, highest)
        value = self.value + k * self.rate
        rate = self.rate + k * self.acceleration
        acceleration = (x - value - (damping + k) * rate) / (1.0 + damping * k + k * k)
        rate += k * acceleration
        value += k * rate
        y = value
        if self.kind is Kind.highpass:
            y = acceleration
        elif self.kind is Kind.bandpass:
            y = damping * rate
        elif self.kind is Kind.notch:
            y = value + acceleration
        self.y.write(y)
        if not math.isfinite(y):
            return
        self.value = value
        self.rate = rate
        self.acceleration = acceleration
        # The last cycle may be a new period ago, or still an old one, as in a running loop.
        self.step = self.period
