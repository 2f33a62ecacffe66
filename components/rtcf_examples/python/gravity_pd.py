"""A PD controller with gravity compensation for an arm of three joints in a plane (Siciliano and
others, Robotics, 2009, section 8.5.1).
"""

from dataclasses import dataclass

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

JOINTS = 3


@dataclass(frozen=True)
class Link:
    """One link of the arm."""

    mass: float
    length: float
    centre: float


LINKS = (Link(3.0, 0.4, 0.2), Link(2.0, 0.35, 0.17), Link(1.0, 0.2, 0.08))
MASS = np.array([each.mass for each in LINKS])
LENGTH = np.array([each.length for each in LINKS])
CENTRE = np.array([each.centre for each in LINKS])
GRAVITY = 9.81


class GravityPd(Component):
    """Holds an arm at its set point against gravity."""

    setpoint: Input[np.float64, JOINTS]
    position: Input[np.float64, JOINTS]
    velocity: Input[np.float64, JOINTS]
    torque: Output[np.float64, JOINTS] = Output(unit="N m", finite=True)

    kp: Parameter[np.float64, JOINTS] = Parameter([80.0, 50.0, 20.0])
    kd: Parameter[np.float64, JOINTS] = Parameter([8.0, 5.0, 1.0])
    limit: Parameter[np.float64, JOINTS] = Parameter([60.0, 40.0, 15.0])
    last: State[np.float64, JOINTS]

    def gravity(self, q):
        angles = np.cumsum(q)
        along = np.cos(angles)
        torque = np.zeros(JOINTS)
        for i in range(JOINTS):
            for k in range(i, JOINTS):
                arm = CENTRE[k] * along[k] + np.sum(LENGTH[i:k] * along[i:k])
                torque[i] += MASS[k] * GRAVITY * arm
        return torque

    def update(self):
        q = self.position.value
        wanted = self.gravity(q)
        if self.setpoint.valid:
            wanted += self.kp * (self.setpoint.value - q) - self.kd * self.velocity.value
        self.last = np.clip(wanted, -self.limit, self.limit)
        self.torque.write(self.last)

    def safe(self):
        self.torque.write(self.gravity(self.position.value) - self.kd * self.velocity.value)
