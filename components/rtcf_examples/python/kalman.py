"""An extended Kalman filter for a mobile robot: position, heading, speed, turn rate and the bias of
its gyroscope, from odometry, gyroscope and GPS (Thrun, Burgard and Fox, Probabilistic Robotics,
2005, section 3.3; Joseph form after Bucy and Joseph, 1968).
"""

import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


def wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


class Kalman(Component):
    """Estimates x, y, heading, speed, turn rate and gyroscope bias."""

    gps: Input[np.float64, 2]
    odometry: Input[float]
    gyro: Input[float]
    estimate: Output[np.float64, 6]
    deviation: Output[np.float64, 6]

    gps_noise: Parameter[float] = Parameter(0.5, min=1e-3, unit="m")
    odometry_noise: Parameter[float] = Parameter(0.05, min=1e-3, unit="m/s")
    gyro_noise: Parameter[float] = Parameter(0.01, min=1e-4, unit="rad/s")

    x: State[np.float64, 6]
    p: State[np.float64, (6, 6)]

    def start(self):
        self.x = np.zeros(6)
        self.p = np.diag([1.0, 1.0, 0.1, 0.1, 0.01, 0.001])

    def predict(self):
        _, _, heading, speed, rate, _ = self.x
        dt = self.dt
        c, s = math.cos(heading), math.sin(heading)
        f = np.array(
            [
                [1.0, 0.0, -speed * s * dt, c * dt, 0.0, 0.0],
                [0.0, 1.0, speed * c * dt, s * dt, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0, dt, 0.0],
                [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            ]
        )
        q = np.diag([1e-4, 1e-4, 1e-4, 1e-2, 1e-2, 1e-6]) * dt
        self.x += np.array([speed * c, speed * s, rate, 0.0, 0.0, 0.0]) * dt
        self.x[2] = wrap(self.x[2])
        self.p = f @ self.p @ f.T + q

    def correct(self, h, residual, variance):
        """Correct the estimate by one scalar measurement, without inverting a matrix."""
        ph = self.p @ h
        gain = ph / (h @ ph + variance)
        self.x += gain * residual
        self.x[2] = wrap(self.x[2])
        a = np.eye(6) - np.outer(gain, h)
        self.p = a @ self.p @ a.T + variance * np.outer(gain, gain)

    def update(self):
        self.predict()
        if self.odometry.new:
            h = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
            self.correct(h, self.odometry.value - self.x[3], self.odometry_noise**2)
        if self.gyro.new:
            h = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])
            self.correct(h, self.gyro.value - self.x[4] - self.x[5], self.gyro_noise**2)
        if self.gps.new:
            for axis in range(2):
                h = np.zeros(6)
                h[axis] = 1.0
                self.correct(h, self.gps.value[axis] - self.x[axis], self.gps_noise**2)
        self.estimate.write(self.x)
        self.deviation.write(np.sqrt(np.diag(self.p)))
