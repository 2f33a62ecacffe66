"""CommandTimeout and JointLimiter of rtcf_control."""

import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Stop(enum.IntEnum):
    """Values of the output `state`."""

    running = 0
    stopped = 1  # until a command newer than the stop comes
    resettable = 2  # a reset ends the stop
    waiting = 3  # no command has come yet


class CommandTimeout(Component):
    """Stops a command that is not renewed in time; a reset needs a command newer than the stop."""

    u: Input[float]
    reset: Input[bool]
    y: Output[float] = Output(finite=True)
    stopped: Output[bool]
    state: Output[Stop]
    age: Output[float] = Output(unit="s", finite=True)

    timeout: Parameter[float] = Parameter(
        0.1,
        min=0.0,
        max=1e6,
        unit="s",
        doc="longest time without a new command; 0 = each cycle needs one",
    )
    latching: Parameter[bool] = Parameter(
        True, doc="a timeout needs a reset; false: the next command ends it"
    )
    safe_value: Parameter[float] = Parameter(
        0.0, doc="output before the first command, during a stop and in the last cycle"
    )
    stop_rate: Parameter[float] = Parameter(
        math.inf, min=1e-9, unit="1/s", doc="rate of change to safe_value; infinite = at once"
    )
    resume_rate: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="1/s", doc="rate of change to the command after a stop"
    )

    latched: State[bool] = State(False, doc="the command is stopped", live=True)
    fresh: State[bool] = State(
        False, doc="a command has come after the reason to stop has ended", live=True
    )
    pressed: State[bool] = State(
        True, doc="last value of reset: at first as if it was stuck", live=True
    )
    silence: State[int] = State(0, unit="ns", doc="time since the last command", live=True)
    last: State[float] = State(0.0, doc="the last output", live=True)
    begun: State[bool] = State(False, doc="the first command has come", live=True)
    resumes: State[bool] = State(
        False, doc="the output moves to the command at resume_rate", live=True
    )

    def start(self):
        self.latched = False
        self.fresh = False
        self.pressed = True
        self.silence = 0
        self.last = self.safe_value
        self.begun = False
        self.resumes = True

    def latch(self, late, arrived):
        """Begin or end the stop in a cycle. Only a change of reset to true ends it, so that a
        button that is stuck resets nothing.
        """
        pressed = self.reset.valid and self.reset.value
        edge = pressed and not self.pressed
        self.pressed = pressed
        if late:
            self.latched = True
            self.fresh = False
        elif self.latched:
            self.fresh = self.fresh or arrived
            if (edge and self.fresh) or (arrived and not self.latching):
                self.latched = False
                self.resumes = True

    def move(self, target, rate):
        """Move the output towards a value."""
        step = rate * min(self.dt, 1e-8 * self.period)  # of a late cycle: ten periods at most
        self.last = np.clip(target, self.last - step, self.last + step)

    def update(self):
        value = self.u.value
        arrived = self.u.new and math.isfinite(value)  # any other value is no command
        self.silence = 0 if arrived else self.silence + round(1e9 * self.dt)
        self.begun = self.begun or arrived
        self.latch(self.begun and self.silence > round(1e9 * self.timeout), arrived)
        if self.latched or not self.begun:
            self.move(self.safe_value, self.stop_rate)
        elif math.isfinite(value):
            self.move(value, self.resume_rate if self.resumes else math.inf)
            if self.last == value:
                self.resumes = False
        self.y.write(self.last)
        self.stopped.write(self.latched)
        if not self.begun:
            self.state.write(Stop.waiting)
        elif not self.latched:
            self.state.write(Stop.running)
        else:
            self.state.write(Stop.resettable if self.fresh else Stop.stopped)
        self.age.write(1e-9 * self.silence)

    def safe(self):
        self.last = self.safe_value
        self.y.write(self.last)


class Command(enum.IntEnum):
    """Quantities of the command of a joint."""

    position = 0
    velocity = 1
    effort = 2


def braking_velocity(distance, deceleration, period):
    """Return the largest constant velocity of one period from which a joint stops within a
    distance, if it slows down by deceleration times the period in each later period: the inverse of
    D(v) = h ((n + 1) v - n (n + 1) / 2 a h), n = floor(v / (a h)).
    """
    unit = deceleration * period * period
    if math.isinf(distance) or math.isinf(unit):
        return distance / period
    relative = distance / unit
    n = np.floor(0.5 * (math.sqrt(1.0 + 8.0 * relative) - 1.0))
    return deceleration * period * (relative / (n + 1.0) + 0.5 * n)


class JointLimiter(Component):
    """Limits a position, velocity or effort command by position, velocity, effort, soft limits (as
    joint_limits_interface of ros_control) and braking distance.
    """

    u: Input[float]
    position: Input[float]
    velocity: Input[float]
    y: Output[float] = Output(finite=True)
    limited: Output[bool]

    command: Parameter[Command] = Parameter(
        Command.position,
        doc="quantity of u and y; position and velocity: the measured ones",
    )
    lower: Parameter[float] = Parameter(-math.inf, unit="rad", doc="lowest position")
    upper: Parameter[float] = Parameter(math.inf, unit="rad", doc="highest position")
    soft_lower: Parameter[float] = Parameter(-math.inf, unit="rad", doc="lower soft limit")
    soft_upper: Parameter[float] = Parameter(math.inf, unit="rad", doc="upper soft limit")
    max_velocity: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="rad/s", doc="largest velocity, either way; 0 holds"
    )
    deceleration: Parameter[float] = Parameter(
        math.inf,
        min=1e-9,
        unit="rad/s^2",
        doc="largest acceleration of a position or velocity command, either way, and that of the "
        "braking distance before lower and upper",
    )
    max_effort: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="N m", doc="largest effort, either way"
    )
    k_position: Parameter[float] = Parameter(
        10.0, min=0.0, unit="1/s", doc="velocity by distance to a soft limit"
    )
    k_velocity: Parameter[float] = Parameter(
        0.0,
        min=0.0,
        unit="N m s/rad",
        doc="effort by excess velocity; needed for limits of position or velocity",
    )
    measurement_timeout: Parameter[float] = Parameter(
        0.2,
        min=0.0,
        unit="s",
        doc="longest time without a new finite measured value, then: a velocity slows down to 0, "
        "an effort is 0",
    )
    frozen_timeout: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="s", doc="the same for a measured value that does not change"
    )
    last: State[float | None] = State(doc="the last output", live=True)
    pace: State[float] = State(
        0.0, unit="rad/s", doc="velocity of the last position or velocity command", live=True
    )
    last_wanted: State[float] = State(0.0, doc="last wanted position", live=True)
    travel: State[float] = State(
        0.0, unit="rad", doc="way of the joint since the last position, estimated", live=True
    )
    kind: State[int] = State(-1, doc="command of the last cycle", live=True)
    silence: State[np.int64, 2] = State(
        unit="ns", doc="age of the last finite value of each measured input"
    )
    unchanged: State[np.int64, 2] = State(
        unit="ns", doc="time since the last change of each measured input"
    )
    last_finite: State[np.float64, 2] = State(
        doc="last finite value of each measured input; NaN = none"
    )

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")
        if self.soft_lower > self.soft_upper:
            raise ValueError("soft_lower is above soft_upper")
        soft = math.isfinite(self.soft_lower) or math.isfinite(self.soft_upper)
        if soft and self.k_position == 0.0:
            raise ValueError("soft limits need a k_position above 0")
        if self.command is not Command.effort:
            return
        hard = math.isfinite(self.lower) or math.isfinite(self.upper)
        if hard and math.isinf(self.deceleration):
            raise ValueError("command = effort with limits of the position needs a deceleration")
        if (hard or soft or math.isfinite(self.max_velocity)) and self.k_velocity == 0.0:
            raise ValueError(
                "command = effort with limits of position or velocity needs a k_velocity above 0"
            )

    def start(self):
        self.last = None
        self.pace = 0.0
        self.travel = 0.0
        self.silence[:] = 0
        self.unchanged[:] = 0
        self.last_finite[:] = math.nan

    @property
    def needs_position(self):
        """Return whether a limit depends on the position."""
        return (
            math.isfinite(self.lower)
            or math.isfinite(self.upper)
            or math.isfinite(self.soft_lower)
            or math.isfinite(self.soft_upper)
        )

    @property
    def needs_velocity(self):
        """Return whether a limit of the effort depends on the velocity."""
        return self.needs_position or math.isfinite(self.max_velocity)

    @property
    def step(self):
        """Return the time by which a command moves on, in s: ten periods at most."""
        return min(self.dt, 1e-8 * self.period)

    @property
    def longest_period(self):
        """Return the period in s, or the time of a longer cycle."""
        return max(1e-9 * self.period, self.step)

    def note(self, i, value, age):
        """Note a measured value that is needed."""
        step = round(1e9 * self.dt)
        finite = math.isfinite(value)
        changed = finite and value != self.last_finite[i]
        self.silence[i] = age if finite else self.silence[i] + step
        self.unchanged[i] = age if changed else self.unchanged[i] + step
        if finite:
            self.last_finite[i] = value

    def lost(self, i):
        """Return whether a measured input is too old, or frozen."""
        return (
            self.silence[i] > 1e9 * self.measurement_timeout
            or self.unchanged[i] > 1e9 * self.frozen_timeout
        )

    def softened(self, limit, x):
        """Return the velocity towards a soft limit, within the largest. It slows down by at most
        deceleration: proportional near the limit, before it along the braking parabola that
        continues this line.
        """
        # A larger factor would cross the soft limit in one period.
        factor = min(self.k_position, 1.0 / self.longest_period)
        distance = limit - x
        if math.isinf(limit):
            return np.clip(limit, -self.max_velocity, self.max_velocity)
        line = self.deceleration / (factor * factor)
        size = abs(distance)
        if size <= line:
            speed = factor * size
        else:
            speed = math.sqrt(self.deceleration * (2.0 * size - line))
        return np.clip(np.copysign(speed, distance), -self.max_velocity, self.max_velocity)

    def towards(self, distance, pace):
        """Return the largest velocity towards a limit, after a velocity towards it."""
        h = self.longest_period
        allowed = braking_velocity(max(distance, 0.0), self.deceleration, h)
        slower = pace - self.deceleration * h
        if slower <= allowed:
            return allowed
        # Too fast, e.g. after a change of the limit. Beyond it, brakes by deceleration, before it
        # by as much as is needed.
        if distance <= 0.0:
            return slower
        return max(allowed, pace - 0.5 * pace * pace * h / distance)

    def limited_velocity(self, speed, below, above):
        """Return a velocity within the limits at a place, between two positions. Where they
        disagree, braking before lower and upper comes first, then the acceleration, then soft
        limits and max_velocity.
        """
        change = self.deceleration * self.step
        slowest = self.pace - change
        fastest = self.pace + change
        low = np.clip(self.softened(self.soft_lower, below), slowest, fastest)
        high = np.clip(self.softened(self.soft_upper, above), slowest, fastest)
        down = -self.towards(below - self.lower, -self.pace)
        up = self.towards(self.upper - above, self.pace)
        return np.clip(speed, np.clip(low, down, up), np.clip(high, down, up))

    def efforts(self, below, above, v):
        """Return the range of the effort: it drives the velocity back into its range."""
        most = self.max_effort
        if self.k_velocity == 0.0:
            return -most, most
        down = -self.towards(below - self.lower, 0.0)
        up = self.towards(self.upper - above, 0.0)
        low = np.clip(self.softened(self.soft_lower, below), down, up)
        high = np.clip(self.softened(self.soft_upper, above), down, up)
        return (
            np.clip(-self.k_velocity * (v - low), -most, most),
            np.clip(-self.k_velocity * (v - high), -most, most),
        )

    def followed(self, wanted, start):
        """Return the position of this cycle on the way from another one. `wanted` may move itself:
        the way slows down before it relative to its velocity.
        """
        h = self.step
        target = np.clip(wanted, self.lower, self.upper)
        drift = (target - self.last_wanted) / h
        distance = self.last_wanted - start
        self.last_wanted = target
        speed = (target - start) / h
        if math.isfinite(self.deceleration):
            approach = braking_velocity(abs(distance), self.deceleration, self.longest_period)
            speed = drift + np.copysign(approach, distance)
        v = self.limited_velocity(speed, start, start)
        # Exactly there if only rounding is left.
        rest = abs(target - start - v * h)
        following = target if rest <= 1e-12 * abs(target - start) else start + v * h
        # Rounding must not cross a limit that has not been crossed before.
        reached = np.clip(
            following,
            -math.inf if start < self.lower else self.lower,
            math.inf if start > self.upper else self.upper,
        )
        self.pace = (reached - start) / h
        return reached

    def slower(self):
        """Return a velocity on the way to 0."""
        change = self.deceleration * self.step
        return np.clip(self.pace, -max(0.0, -self.pace - change), max(0.0, self.pace - change))

    def send(self, wanted, value):
        """Write the limited value of a command."""
        self.y.write(value)
        self.limited.write(value != wanted)
        self.last = value

    def begin(self, wanted):
        """Begin at the measured position, so that the joint does not jump; return whether it is
        known.
        """
        self.last_wanted = np.clip(wanted, self.lower, self.upper)
        if not self.position.valid:
            if self.position.connected:
                return False  # it has not come yet
            self.last = self.last_wanted
            return True
        x = self.position.value
        if not math.isfinite(x) or self.lost(0):
            return False
        self.last = x
        return True

    def update(self):
        x = self.position.value
        v = self.velocity.value
        if self.kind != self.command:
            self.last = None  # another quantity
        self.kind = self.command
        moved = self.position.new and math.isfinite(x) and x != self.last_finite[0]
        needed = self.last is None if self.command is Command.position else self.needs_position
        if needed and self.position.valid:
            self.note(0, x, self.position.age)
        if self.command is Command.effort and self.needs_velocity and self.velocity.valid:
            self.note(1, v, self.velocity.age)
        pace = self.last_finite[1] if self.command is Command.effort else self.pace
        if moved or not math.isfinite(pace):
            self.travel = 0.0
        else:
            self.travel += pace * self.dt
        if not self.u.valid:
            return
        wanted = self.u.value
        last = self.last
        if not math.isfinite(wanted):
            if last is None:
                return
            # The last output or target counts.
            wanted = self.last_wanted if self.command is Command.position else last
        if self.command is Command.position:
            if last is None:
                if not self.begin(wanted):
                    return
                last = self.last
            if last is not None:
                self.send(wanted, self.followed(wanted, last))
            return
        if self.needs_position and not math.isfinite(self.last_finite[0]):
            return
        position_lost = self.needs_position and self.lost(0)
        below = min(self.last_finite[0], self.last_finite[0] + self.travel)
        above = max(self.last_finite[0], self.last_finite[0] + self.travel)
        if self.command is Command.velocity:
            if position_lost:
                self.send(wanted, self.slower())
            else:
                self.send(wanted, self.limited_velocity(wanted, below, above))
            self.pace = self.last if self.last is not None else 0.0
            return
        if self.needs_velocity and not math.isfinite(self.last_finite[1]):
            return
        self.pace = 0.0
        if position_lost or (self.needs_velocity and self.lost(1)):
            self.send(wanted, 0.0)
            return
        low, high = self.efforts(below, above, self.last_finite[1])
        self.send(wanted, np.clip(wanted, low, high))

    def safe(self):
        """Hold the position, or command no velocity or effort."""
        if self.command is not Command.position:
            self.y.write(0.0)
        elif self.last is not None:
            self.y.write(self.last)
