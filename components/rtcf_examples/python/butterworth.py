"""A Butterworth low-pass filter of fourth order: two biquads, from the bilinear transform with a
pre-warped frequency (Oppenheim and Schafer, Discrete-Time Signal Processing, 2010, section 7.2).
"""

import math

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

PERIOD = 0.001  # s, of the loop
ORDER = 4
SECTIONS = ORDER // 2


class Butterworth(Component):
    """Low-pass filter of fourth order."""

    u: Input[float]
    y: Output[float]
    cutoff: Parameter[float] = Parameter(50.0, min=0.1, max=450.0, unit="Hz")
    b: Derived[np.float64, (SECTIONS, 3)]
    a: Derived[np.float64, (SECTIONS, 2)]
    past: State[np.float64, (SECTIONS, 2)]

    def prepare(self):
        w = math.tan(math.pi * self.cutoff * PERIOD)
        for i in range(SECTIONS):
            damping = 2.0 * math.cos(math.pi * (2 * i + 1) / (2 * ORDER))
            norm = 1.0 + damping * w + w * w
            self.b[i] = np.array([w * w, 2.0 * w * w, w * w]) / norm
            self.a[i] = np.array([2.0 * (w * w - 1.0), 1.0 - damping * w + w * w]) / norm

    def update(self):
        x = self.u.value
        for i in range(SECTIONS):
            b, a, past = self.b[i], self.a[i], self.past[i]
            y = b[0] * x + past[0]
            past[0], past[1] = b[1] * x - a[0] * y + past[1], b[2] * x - a[1] * y
            x = y
        self.y.write(x)
