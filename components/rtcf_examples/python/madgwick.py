"""Orientation from gyroscope and accelerometer (Madgwick, An efficient orientation filter for
inertial and inertial/magnetic sensor arrays, 2010).
"""

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


def product(p, q):
    """Return the product of two quaternions, w first."""
    w, v = p[0] * q[0] - p[1:] @ q[1:], p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.hstack((w, v))


class Madgwick(Component):
    """Estimates the orientation of an inertial measurement unit."""

    gyro: Input[np.float64, 3]
    acceleration: Input[np.float64, 3]
    orientation: Output[np.float64, 4]
    beta: Parameter[float] = Parameter(0.1, min=0.0, max=5.0)
    q: State[np.float64, 4] = State([1.0, 0.0, 0.0, 0.0])

    def update(self):
        rate = 0.5 * product(self.q, np.concatenate(([0.0], self.gyro.value)))
        a = self.acceleration.value
        length = np.linalg.norm(a)
        if self.acceleration.valid and length > 1e-6:
            ax, ay, az = a / length
            w, x, y, z = self.q
            f = np.array(
                [
                    2.0 * (x * z - w * y) - ax,
                    2.0 * (w * x + y * z) - ay,
                    2.0 * (0.5 - x**2 - y**2) - az,
                ]
            )
            jacobian = np.array(
                [
                    [-2.0 * y, 2.0 * z, -2.0 * w, 2.0 * x],
                    [2.0 * x, 2.0 * w, 2.0 * z, 2.0 * y],
                    [0.0, -4.0 * x, -4.0 * y, 0.0],
                ]
            )
            step = jacobian.T @ f
            size = np.linalg.norm(step)
            if size > 0.0:
                rate -= self.beta * step / size
        self.q += rate * self.dt
        self.q /= np.linalg.norm(self.q)
        self.orientation.write(self.q)
