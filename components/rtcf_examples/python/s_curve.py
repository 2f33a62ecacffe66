"""An S-curve: moves one axis within limits of velocity, acceleration and jerk. It is a closed loop
around its own state, so that the target may change at any time (after Gerelli and Guarino Lo
Bianco, 2010).
"""

import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Phase(enum.IntEnum):
    REST = 0
    MOVING = 1
    SETTLING = 2


class SCurve(Component):
    """Follows a target without exceeding its limits."""

    target: Input[float]
    position: Output[float]
    velocity: Output[float]
    acceleration: Output[float]
    phase: Output[int]

    max_velocity: Parameter[float] = Parameter(1.0, min=1e-3)
    max_acceleration: Parameter[float] = Parameter(5.0, min=1e-3)
    max_jerk: Parameter[float] = Parameter(50.0, min=1e-3)

    x: State[float]
    v: State[float]
    a: State[float]
    mode: State[Phase]

    @property
    def moving(self):
        return abs(self.v) > 1e-6 or abs(self.a) > 1e-4

    def wanted_velocity(self, distance):
        """Return the highest velocity from which the axis can stop at the target."""
        far = abs(distance)
        ramp = self.max_acceleration**2 / self.max_jerk
        v = math.sqrt(ramp**2 / 4.0 + 2.0 * self.max_acceleration * far) - ramp / 2.0
        return math.copysign(min(max(v, 0.0), self.max_velocity), distance)

    def update(self):
        if not self.target.valid:
            return
        distance = self.target.value - self.x
        match self.mode:
            case Phase.REST:
                if abs(distance) > 1e-6:
                    self.mode = Phase.MOVING
            case Phase.MOVING:
                if abs(distance) < 1e-4:
                    self.mode = Phase.SETTLING
            case Phase.SETTLING:
                if not self.moving:
                    self.mode = Phase.REST
                elif abs(distance) > 1e-3:
                    self.mode = Phase.MOVING

        if self.mode is Phase.REST:
            self.v = self.a = 0.0
        else:
            error = self.wanted_velocity(distance) - self.v
            wanted = np.sign(error) * math.sqrt(2.0 * self.max_jerk * abs(error)) / 1.5
            wanted = np.clip(wanted, -self.max_acceleration, self.max_acceleration)
            step = self.max_jerk * self.dt
            self.a += np.clip(wanted - self.a, -step, step)
            self.v += self.a * self.dt
            self.x += self.v * self.dt
        self.position.write(self.x)
        self.velocity.write(self.v)
        self.acceleration.write(self.a)
        self.phase.write(self.mode.value)
