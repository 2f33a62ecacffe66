"""Moves joints through goal points: one quintic polynomial per joint meets position, velocity and
acceleration at both ends (Craig, Introduction to Robotics, 2005, section 7.3).
"""

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

JOINTS = 6


class Interpolator(Component):
    """Interpolates joint positions and velocities between goal points."""

    goal: Input[np.float64, JOINTS]
    position: Output[np.float64, JOINTS]
    velocity: Output[np.float64, JOINTS]
    duration: Parameter[float] = Parameter(0.5, min=0.01, unit="s")

    coefficients: State[np.float64, (6, JOINTS)]
    passed: State[float]
    q: State[np.float64, JOINTS]
    qd: State[np.float64, JOINTS]
    qdd: State[np.float64, JOINTS]

    def plan(self, goal, t):
        d = goal - self.q
        rows = [
            self.q,
            self.qd,
            self.qdd / 2.0,
            (20.0 * d - 12.0 * self.qd * t - 3.0 * self.qdd * t**2) / (2.0 * t**3),
            (-30.0 * d + 16.0 * self.qd * t + 3.0 * self.qdd * t**2) / (2.0 * t**4),
            (12.0 * d - 6.0 * self.qd * t - self.qdd * t**2) / (2.0 * t**5),
        ]
        self.coefficients = np.vstack(rows)
        self.passed = 0.0

    def update(self):
        if self.goal.new:
            self.plan(self.goal.value, self.duration)
        self.passed = min(self.passed + self.dt, self.duration)
        t = self.passed
        powers = np.array([1.0, t, t**2, t**3, t**4, t**5])
        self.q = powers @ self.coefficients
        slopes = np.array([0.0, 1.0, 2.0 * t, 3.0 * t**2, 4.0 * t**3, 5.0 * t**4])
        self.qd = slopes @ self.coefficients
        self.qdd = np.array([0.0, 0.0, 2.0, 6.0 * t, 12.0 * t**2, 20.0 * t**3]) @ self.coefficients
        self.position.write(self.q)
        self.velocity.write(self.qd)
