"""A PID controller with a filtered derivative and back-calculation (Åström and Hägglund, PID
Controllers, 1995, sections 3.4 and 3.5).
"""

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Pid(Component):
    """Drives a measured value to a set point."""

    setpoint: Input[float]
    measured: Input[float]
    effort: Output[float] = Output(finite=True)

    kp: Parameter[float] = Parameter(2.0, min=0.0)
    ti: Parameter[float] = Parameter(0.5, min=1e-3, unit="s")
    td: Parameter[float] = Parameter(0.05, min=0.0, unit="s")
    n: Parameter[float] = Parameter(10.0, min=1.0, max=100.0)
    limit: Parameter[float] = Parameter(10.0, min=0.0)

    integral: State[float]
    derivative: State[float]
    last: State[float | None]

    def update(self):
        if not (self.setpoint.valid and self.measured.valid):
            return
        y = self.measured.value
        error = self.setpoint.value - y
        slope = 0.0 if self.last is None else y - self.last
        self.last = y

        filter_time = self.td / self.n
        self.derivative = (filter_time * self.derivative - self.kp * self.td * slope) / (
            filter_time + self.dt
        )
        wanted = self.kp * error + self.integral + self.derivative
        effort = np.clip(wanted, -self.limit, self.limit)
        tracking = np.sqrt(self.ti * self.td) if self.td > 0.0 else self.ti
        self.integral += self.dt * (self.kp / self.ti * error + (effort - wanted) / tracking)
        self.effort.write(effort)
