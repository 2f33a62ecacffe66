"""Model-predictive control of an axis: ten steps ahead with three inputs, limits on the inputs,
solved by an accelerated projected gradient (Richter, Jones and Morari, 2012).
"""

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

HORIZON, INPUTS, STATES = 10, 3, 6
PERIOD = 0.01
A = np.eye(STATES)
A[:3, 3:] = np.eye(3) * PERIOD
B = np.vstack((np.eye(3) * PERIOD**2 / 2.0, np.eye(3) * PERIOD))
N = HORIZON * INPUTS


class Mpc(Component):
    """Accelerates a mass in three axes to its set point."""

    state: Input[np.float64, STATES]
    setpoint: Input[np.float64, STATES]
    command: Output[np.float64, INPUTS] = Output(finite=True)

    position_weight: Parameter[float] = Parameter(100.0, min=0.0)
    velocity_weight: Parameter[float] = Parameter(1.0, min=0.0)
    effort: Parameter[float] = Parameter(0.01, min=1e-6)
    limit: Parameter[float] = Parameter(5.0, min=0.0, unit="m/s^2")
    iterations: Parameter[int] = Parameter(20, min=1, max=100)

    hessian: Derived[np.float64, (N, N)]
    linear: Derived[np.float64, (N, STATES)]
    step: Derived[float]
    plan: State[np.float64, N]

    def prepare(self):
        q = np.diag([self.position_weight] * 3 + [self.velocity_weight] * 3)
        forced = np.zeros((HORIZON * STATES, N))
        free = np.zeros((HORIZON * STATES, STATES))
        power = np.eye(STATES)
        for i in range(HORIZON):
            power = A @ power
            free[i * STATES : (i + 1) * STATES] = power
            for k in range(i + 1):
                block = np.linalg.matrix_power(A, i - k) @ B
                forced[i * STATES : (i + 1) * STATES, k * INPUTS : (k + 1) * INPUTS] = block
        weighted = np.zeros((N, HORIZON * STATES))
        for i in range(HORIZON):
            part = slice(i * STATES, (i + 1) * STATES)
            weighted[:, part] = forced[part].T @ q
        self.hessian = weighted @ forced + self.effort * np.eye(N)
        self.linear = weighted @ free
        self.step = 1.0 / np.max(np.sum(np.abs(self.hessian), axis=1))

    def update(self):
        gradient = self.linear @ (self.state.value - self.setpoint.value)
        u = np.concatenate((self.plan[INPUTS:], self.plan[-INPUTS:]))
        previous = u.copy()
        momentum = 1.0
        for _ in range(self.iterations):
            following = (1.0 + np.sqrt(1.0 + 4.0 * momentum**2)) / 2.0
            v = u + (momentum - 1.0) / following * (u - previous)
            previous = u
            u = np.clip(v - self.step * (self.hessian @ v + gradient), -self.limit, self.limit)
            momentum = following
        self.plan = u
        self.command.write(u[:INPUTS])
