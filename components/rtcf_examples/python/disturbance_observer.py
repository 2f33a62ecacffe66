"""A disturbance observer for a drive: estimates the disturbance torque from the commanded torque
and the velocity (Ohnishi, Shibata and Murakami, Motion control for advanced mechatronics, 1996).
"""

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Observer(Component):
    """Base class of observers that apply a first-order filter to the drive's model."""

    inertia: Parameter[float] = Parameter(0.02, min=1e-6, unit="kg m^2")
    bandwidth: Parameter[float] = Parameter(200.0, min=1.0, max=2000.0, unit="rad/s")

    def filtered(self, value, target):
        """Return the next value of a first-order filter towards the target."""
        share = 1.0 - np.exp(-self.bandwidth * self.dt)
        return value + share * (target - value)


class DisturbanceObserver(Observer):
    """Estimates the disturbance torque on a drive and compensates for it."""

    command: Input[float]
    velocity: Input[float]
    disturbance: Output[float] = Output(unit="N m")
    compensated: Output[float] = Output(unit="N m")
    contact: Output[bool]

    threshold: Parameter[float] = Parameter(0.5, min=0.0, unit="N m")
    limit: Parameter[float] = Parameter(5.0, min=0.0, unit="N m")

    z: State[float]
    estimate: State[float]
    beyond: State[int]

    def update(self):
        momentum = self.bandwidth * self.inertia * self.velocity.value
        self.z = self.filtered(self.z, self.estimate_input() + momentum)
        self.estimate = np.clip(self.z - momentum, -self.limit, self.limit)
        self.beyond = self.beyond + 1 if np.abs(self.estimate) > self.threshold else 0
        self.disturbance.write(self.estimate)
        self.compensated.write(self.command.value + self.estimate)
        self.contact.write(self.beyond >= 5)

    def estimate_input(self):
        return self.command.value if self.command.valid else 0.0
