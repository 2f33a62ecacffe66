"""Outputs and enums whose values are checked."""

import enum

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, Queue, State


class Guarded(Component):
    u: Input[float]
    y: Output[float] = Output(finite=True)
    pair: Output[np.float64, 2] = Output(finite=True)
    unchecked: Output[float]
    last: State[float]
    before: State[float]
    quiet: State[bool]

    def update(self):
        self.before = self.y.value
        if self.quiet:
            return
        self.y.write(self.u.value)
        self.pair.write(np.array((self.u.value, -self.u.value)))
        self.unchecked.write(self.u.value)
        self.last = self.y.value


class Mode(enum.IntEnum):
    IDLE = 0
    RUN = 1


class Switched(Component):
    mode: Parameter[Mode] = Parameter(Mode.IDLE)
    wanted: Input[Mode]
    queued: Queue[Mode] = Queue(size=4)
    state: Output[Mode]

    def update(self):
        self.state.write(self.mode)
