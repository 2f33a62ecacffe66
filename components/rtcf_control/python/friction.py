"""FrictionCompensation of rtcf_control."""

import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

FARTHEST = 1e30  # velocity, in stribeck_velocity, above which breakaway has no effect


def friction(law, v):
    """Return the effort of a law at a velocity."""
    coulomb, breakaway, viscous, stribeck_velocity, stribeck_exponent, smoothing, share = law
    ratio = min(abs(v) / stribeck_velocity, FARTHEST)
    bristles = math.exp(-(ratio**stribeck_exponent))
    dry = coulomb + (max(breakaway, coulomb) - coulomb) * bristles
    return share * (dry * math.tanh(v / smoothing) + viscous * v)


class FrictionCompensation(Component):
    """Effort against Coulomb, viscous and Stribeck friction of a joint, smooth at velocity 0
    (Armstrong-Hélouvry, Dupont & Canudas-de-Wit, Automatica 30, 1994).
    """

    velocity: Input[float]
    effort: Output[float] = Output(finite=True)
    coulomb: Parameter[float] = Parameter(
        0.0, min=0.0, unit="N m", doc="Coulomb friction, in motion"
    )
    breakaway: Parameter[float] = Parameter(
        0.0, min=0.0, unit="N m", doc="static friction; 0 = that of coulomb"
    )
    viscous: Parameter[float] = Parameter(0.0, min=0.0, unit="N m s/rad", doc="viscous friction")
    stribeck_velocity: Parameter[float] = Parameter(
        0.1, min=1e-9, unit="rad/s", doc="velocity of the transition from breakaway to coulomb"
    )
    stribeck_exponent: Parameter[float] = Parameter(
        2.0, min=0.1, max=10.0, doc="shape of this transition: 2 = Gaussian, 1 = exponential"
    )
    smoothing: Parameter[float] = Parameter(
        0.01,
        min=1e-9,
        unit="rad/s",
        doc="velocity at which Coulomb and static friction have 76 % of their size",
    )
    share: Parameter[float] = Parameter(1.0, min=0.0, max=1.0, doc="compensated share")
    max_effort: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="N m", doc="largest effort, either way"
    )
    fade: Parameter[float] = Parameter(
        0.2,
        min=0.0,
        unit="s",
        doc="time of the transition after a change of parameters; 0 = at once",
    )
    measurement_timeout: Parameter[float] = Parameter(
        0.2,
        min=0.0,
        unit="s",
        doc="longest time without a new finite measured value, then: effort = 0",
    )
    frozen_timeout: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="s", doc="the same for a measured value that does not change"
    )
    silence: State[int] = State(0, unit="ns", doc="age of the last finite velocity")
    unchanged: State[int] = State(0, unit="ns", doc="time since the last change of the velocity")
    last_finite: State[float] = State(math.nan, doc="last finite velocity; NaN = none")
    law: State[np.float64, 7] = State(doc="parameters of the last cycle")
    offset: State[float] = State(
        0.0, unit="N m", doc="difference to the law before the last change"
    )
    rest: State[float] = State(0.0, doc="part of the transition that is left, 1 to 0")
    begun: State[bool] = State(False, doc="the law has been used")

    def prepare(self):
        if self.breakaway != 0.0 and self.breakaway < self.coulomb:
            raise ValueError("breakaway is below coulomb; 0 stands for coulomb")

    def start(self):
        self.begun = False
        self.silence = 0
        self.unchanged = 0
        self.last_finite = math.nan

    def lost(self):
        """Return whether the velocity is too old, or frozen. Once per cycle."""
        v = self.velocity.value
        finite = math.isfinite(v)
        step = round(1e9 * self.dt)
        changed = finite and v != self.last_finite
        self.silence = self.velocity.age if finite else self.silence + step
        self.unchanged = self.velocity.age if changed else self.unchanged + step
        if finite:
            self.last_finite = v
        return (
            self.silence > 1e9 * self.measurement_timeout
            or self.unchanged > 1e9 * self.frozen_timeout
        )

    def update(self):
        if not self.velocity.valid:
            return
        if self.lost():
            self.effort.write(0.0)
            return
        v = self.velocity.value
        if not math.isfinite(v):
            return  # readers keep the last effort
        if self.begun and self.rest > 0.0:
            self.rest = max(0.0, self.rest - self.dt / self.fade) if self.fade > 0.0 else 0.0
        law = np.array(
            (
                self.coulomb,
                self.breakaway,
                self.viscous,
                self.stribeck_velocity,
                self.stribeck_exponent,
                self.smoothing,
                self.share,
            )
        )
        wanted = friction(law, v)
        if not self.begun:
            self.rest = 0.0
        elif np.any(law != self.law):
            self.offset = friction(self.law, v) + self.rest * self.offset - wanted
            self.rest = 1.0 if self.fade > 0.0 else 0.0
        self.law[:] = law
        self.begun = True
        self.effort.write(
            np.clip(wanted + self.rest * self.offset, -self.max_effort, self.max_effort)
        )

    def safe(self):
        self.effort.write(0.0)  # an effort along the motion would outlast it in the drive
