"""A linear-quadratic regulator for a cart with a pendulum. Whenever the weights change, prepare()
computes the gain by iterating the Riccati equation (Anderson and Moore, Optimal Control, 1990,
section 2.4).
"""

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter

GRAVITY, LENGTH, MASS, CART, PERIOD = 9.81, 0.5, 0.2, 1.0, 0.001
A = np.array(
    [
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, -MASS * GRAVITY / CART, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, (CART + MASS) * GRAVITY / (CART * LENGTH), 0.0],
    ]
)
B = np.array([[0.0], [1.0 / CART], [0.0], [-1.0 / (CART * LENGTH)]])


class Lqr(Component):
    """Keeps a pendulum upright and its cart at the reference position."""

    state: Input[np.float64, 4]
    reference: Input[float]
    force: Output[float] = Output(unit="N", finite=True)

    weights: Parameter[np.float64, 4] = Parameter([10.0, 1.0, 100.0, 1.0])
    effort: Parameter[float] = Parameter(0.1, min=1e-6)
    largest: Parameter[float] = Parameter(20.0, min=0.0, unit="N")
    gain: Derived[np.float64, 4]

    def prepare(self):
        a = np.eye(4) + A * PERIOD + A @ A * (PERIOD**2 / 2.0)
        b = (np.eye(4) * PERIOD + A * (PERIOD**2 / 2.0)) @ B
        q = np.diag(self.weights) * PERIOD
        r = np.array([[self.effort * PERIOD]])
        p = q.copy()
        k = np.zeros((1, 4))
        for _ in range(5000):
            k = np.linalg.inv(r + b.T @ p @ b) @ (b.T @ p @ a)
            following = q + a.T @ p @ (a - b @ k)
            if np.max(np.abs(following - p)) < 1e-9:
                break
            p = following
        self.gain = k[0]

    def update(self):
        if not self.state.valid:
            self.force.write(0.0)
            return
        error = self.state.value - np.array([self.reference.value, 0.0, 0.0, 0.0])
        self.force.write(np.clip(-self.gain @ error, -self.largest, self.largest))
