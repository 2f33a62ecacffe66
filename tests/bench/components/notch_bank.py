"""Banks of notch filters (biquads in transposed direct form II), in the ways to write them with
arrays: a row per coefficient, a column per coefficient, and a column per section.
"""

import math

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

PERIOD = 0.001  # s, of the loop
JOINTS = 8
SECTIONS = 4


def notch(frequency, q):
    """Return the coefficients b0, b1, b2, a1, a2 of a notch filter."""
    w = 2.0 * math.pi * frequency * PERIOD
    alpha = math.sin(w) / (2.0 * q)
    a = np.array([1.0, -2.0 * math.cos(w), 1.0, -2.0 * math.cos(w), 1.0 - alpha])
    return a / (1.0 + alpha)


class NotchRows(Component):
    """One notch per joint; a row per coefficient."""

    u: Input[np.float64, JOINTS]
    y: Output[np.float64, JOINTS]
    q: Parameter[float] = Parameter(5.0, min=0.1, doc="quality factor")
    b: Derived[np.float64, 3, JOINTS]
    a: Derived[np.float64, 2, JOINTS]
    z: State[np.float64, 2, JOINTS]

    def prepare(self):
        for k in range(JOINTS):
            c = notch(20.0 + 10.0 * k, self.q)
            self.b[:, k] = c[:3]
            self.a[:, k] = c[3:]

    def update(self):
        x = self.u.value
        y = self.b[0] * x + self.z[0]
        self.z[0] = self.b[1] * x - self.a[0] * y + self.z[1]
        self.z[1] = self.b[2] * x - self.a[1] * y
        self.y.write(y)


class NotchColumns(Component):
    """One notch per joint; a column per coefficient."""

    u: Input[np.float64, JOINTS]
    y: Output[np.float64, JOINTS]
    q: Parameter[float] = Parameter(5.0, min=0.1, doc="quality factor")
    c: Derived[np.float64, JOINTS, 5]
    z: State[np.float64, JOINTS, 2]

    def prepare(self):
        for k in range(JOINTS):
            self.c[k] = notch(20.0 + 10.0 * k, self.q)

    def update(self):
        x = self.u.value
        y = self.c[:, 0] * x + self.z[:, 0]
        self.z[:, 0] = self.c[:, 1] * x - self.c[:, 3] * y + self.z[:, 1]
        self.z[:, 1] = self.c[:, 2] * x - self.c[:, 4] * y
        self.y.write(y)


class NotchSections(Component):
    """Four notches in series for all joints; a column per section."""

    u: Input[np.float64, JOINTS]
    y: Output[np.float64, JOINTS]
    q: Parameter[float] = Parameter(5.0, min=0.1, doc="quality factor")
    c: Derived[np.float64, 5, SECTIONS]
    z1: State[np.float64, JOINTS, SECTIONS]
    z2: State[np.float64, JOINTS, SECTIONS]

    def prepare(self):
        for k in range(SECTIONS):
            self.c[:, k] = notch(20.0 + 10.0 * k, self.q)

    def update(self):
        x = self.u.value
        for k in range(SECTIONS):
            c = self.c[:, k]
            y = c[0] * x + self.z1[:, k]
            self.z1[:, k] = c[1] * x - c[3] * y + self.z2[:, k]
            self.z2[:, k] = c[2] * x - c[4] * y
            x = y
        self.y.write(x)


class NotchCascade(Component):
    """Eight notches in series for one signal; a column per section."""

    u: Input[float]
    y: Output[float]
    q: Parameter[float] = Parameter(5.0, min=0.1, doc="quality factor")
    b: Derived[np.float64, 3, JOINTS]
    a: Derived[np.float64, 2, JOINTS]
    z: State[np.float64, 2, JOINTS]

    def prepare(self):
        for k in range(JOINTS):
            c = notch(20.0 + 10.0 * k, self.q)
            self.b[:, k] = c[:3]
            self.a[:, k] = c[3:]

    def update(self):
        x = self.u.value
        for k in range(JOINTS):
            b, a, z = self.b[:, k], self.a[:, k], self.z[:, k]
            y = b[0] * x + z[0]
            z[0] = b[1] * x - a[0] * y + z[1]
            z[1] = b[2] * x - a[1] * y
            x = y
        self.y.write(x)
