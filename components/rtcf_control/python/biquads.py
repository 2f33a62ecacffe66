"""One second-order section, as a chain of one in Biquads of rtcf_control."""

import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Kind(enum.IntEnum):
    """Kinds of sections."""

    lowpass = 0
    highpass = 1
    bandpass = 2
    notch = 3


class Biquad(Component):
    """Second-order section by the pre-warped bilinear transform (Oppenheim & Schafer, Discrete-Time
    Signal Processing, 2010, chapter 7). Begins settled at its first value.
    """

    u: Input[float]
    y: Output[float] = Output(finite=True)
    kind: Parameter[Kind] = Parameter(Kind.lowpass)
    f: Parameter[float] = Parameter(50.0, min=1e-3, unit="Hz", doc="frequency of the section")
    q: Parameter[float] = Parameter(math.sqrt(0.5), min=1e-6, max=1e6, doc="quality")
    inputs: State[np.float64, 2]
    outputs: State[np.float64, 2]
    begun: State[bool]

    def start(self):
        self.begun = False

    def analog(self):
        """Return the numerator of the section, in powers of s / (2 pi f)."""
        if self.kind is Kind.lowpass:
            return 1.0, 0.0, 0.0
        if self.kind is Kind.highpass:
            return 0.0, 0.0, 1.0
        if self.kind is Kind.bandpass:
            return 0.0, 1.0 / self.q, 0.0
        return 1.0, 0.0, 1.0

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
        b0, b1, b2 = self.analog()
        k = math.tan(math.pi * min(self.f, 0.49 * self.frequency) / self.frequency)
        scale = 1.0 + k / self.q + k * k
        if not self.begun:
            self.inputs[:] = x
            self.outputs[:] = x * b0
            self.begun = True
        y = (
            (b2 + b1 * k + b0 * k * k) / scale * x
            + 2.0 * (b0 * k * k - b2) / scale * self.inputs[0]
            + (b2 - b1 * k + b0 * k * k) / scale * self.inputs[1]
            - 2.0 * (k * k - 1.0) / scale * self.outputs[0]
            - (1.0 - k / self.q + k * k) / scale * self.outputs[1]
        )
        self.y.write(y)
        if math.isfinite(y):
            self.inputs[1] = self.inputs[0]
            self.inputs[0] = x
            self.outputs[1] = self.outputs[0]
            self.outputs[0] = y
