"""Torque of a motor from two measured tables: drive torque by current, interpolated linearly, and
friction by speed and temperature, interpolated bilinearly (Press and others, Numerical Recipes,
2007, sections 3.1 and 3.6).
"""

import numpy as np
from rtcf.component import Component, Input, Output, Parameter

CURRENTS = [0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0]
TORQUES = [0.0, 0.11, 0.23, 0.45, 0.66, 0.83, 0.95]
SPEEDS = np.linspace(0.0, 300.0, 7)
TEMPERATURES = np.array([0.0, 25.0, 50.0, 80.0])
FRICTION = np.array(
    [
        [0.080, 0.090, 0.105, 0.125, 0.150, 0.180, 0.215],
        [0.050, 0.058, 0.068, 0.082, 0.100, 0.121, 0.146],
        [0.035, 0.041, 0.049, 0.060, 0.073, 0.089, 0.108],
        [0.028, 0.033, 0.040, 0.049, 0.060, 0.073, 0.089],
    ]
)


def interval(points, x):
    """Return the index of the interval around x, and the position of x in it, from 0 to 1."""
    i = min(max(np.searchsorted(points, x) - 1, 0), len(points) - 2)
    return i, np.clip((x - points[i]) / (points[i + 1] - points[i]), 0.0, 1.0)


class Lookup(Component):
    """Torque of a motor at its shaft."""

    current: Input[float]
    speed: Input[float]
    temperature: Input[float]
    torque: Output[float] = Output(unit="N m")
    scale: Parameter[float] = Parameter(1.0, min=0.5, max=1.5)

    def friction(self, speed, temperature):
        i, a = interval(TEMPERATURES, temperature)
        k, b = interval(SPEEDS, abs(speed))
        cold = (1.0 - b) * FRICTION[i, k] + b * FRICTION[i, k + 1]
        warm = (1.0 - b) * FRICTION[i + 1, k] + b * FRICTION[i + 1, k + 1]
        return (1.0 - a) * cold + a * warm

    def update(self):
        current = self.current.value
        driving = np.sign(current) * np.interp(abs(current), CURRENTS, TORQUES)
        braking = np.sign(self.speed.value) * self.friction(
            self.speed.value, self.temperature.value
        )
        self.torque.write(self.scale * driving - braking)
