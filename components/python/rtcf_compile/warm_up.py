"""Compiles a component that uses what most components use, for the worker."""

# mypy does not understand declarations.
# mypy: ignore-errors

import contextlib
import math

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

from rtcf_compile.machine_code import object_file
from rtcf_compile.source.mistake import Mistake


class WarmUp(Component):
    """A component of numbers, vectors and matrices."""

    u: Input[float]
    z: Input[np.float64, 2]
    y: Output[float]
    v: Output[np.float64, 2]
    kp: Parameter[float] = Parameter(1.0, min=0.0)
    gain: Derived[np.float64, 2, 2]
    x: State[np.float64, 2]
    p: State[np.float64, 2, 2]
    count: State[int]
    is_on: State[bool]

    def prepare(self) -> None:
        """Compute a matrix."""
        self.gain = self.kp * np.eye(2)

    def update(self) -> None:
        """Filter the inputs."""
        if not self.z.new:
            return
        a = np.array([[1.0, self.dt], [0.0, math.exp(-self.dt)]])
        error = self.z.value - self.x
        self.x = a @ self.x + self.gain @ error
        self.p = a @ self.p @ a.T + np.diag([1.0, 2.0])
        self.x[0] = min(max(self.x[0], -1.0), 1.0)
        self.x += np.clip(error, -1.0, 1.0)
        for i in range(2):
            self.p[i, i] += math.sin(self.u.value) + np.sqrt(np.sum(error**2))
        self.count += 1
        self.is_on = self.count > 3
        if self.count % 1000 == 0:
            self.info("x {:.3f}", self.x[0])
        self.v.write(self.x)
        self.y.write(np.max(np.abs(self.p)))


def run() -> None:
    """Compile the component."""
    with contextlib.suppress(Mistake):
        object_file.compile_component(WarmUp, is_kept=False)
