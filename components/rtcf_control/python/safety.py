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

    latched: State[bool] = State(False, doc="the command is stopped")
    fresh: State[bool] = State(False, doc="a command has come after the reason to stop has ended")
    pressed: State[bool] = State(True, doc="last value of reset: at first as if it was stuck")
    silence: State[int] = State(0, unit="ns", doc="time since the last command")
    last: State[float] = State(0.0, doc="the last output")
    begun: State[bool] = State(False, doc="the first command has come")
    resumes: State[bool] = State(False, doc="the output moves to the command at resume_rate")

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
        step = rate * self.dt
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
        doc="deceleration for the braking distance before lower and upper",
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
        doc="effort by excess velocity; 0 = no effort towards excess velocity",
    )
    last: State[float | None] = State(doc="the last output")

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")
        if self.soft_lower > self.soft_upper:
            raise ValueError("soft_lower is above soft_upper")
        if self.k_position == 0.0 and (
            math.isfinite(self.soft_lower) or math.isfinite(self.soft_upper)
        ):
            raise ValueError("soft limits need a k_position above 0")

    def start(self):
        self.last = None

    @property
    def needs_position(self):
        """Return whether a limit depends on the position."""
        return (
            math.isfinite(self.lower)
            or math.isfinite(self.upper)
            or math.isfinite(self.soft_lower)
            or math.isfinite(self.soft_upper)
        )

    def softened(self, limit, x, down, up, factor):
        """Return the velocity towards a soft limit, within those of braking and the largest."""
        wanted = limit if math.isinf(limit) else factor * (limit - x)
        return np.clip(np.clip(wanted, -down, up), -self.max_velocity, self.max_velocity)

    def velocities(self, x):
        """Return the range of the velocity at a position. Braking comes before soft limits, where
        both disagree.
        """
        period = max(1e-9 * self.period, self.dt)
        up = braking_velocity(max(self.upper - x, 0.0), self.deceleration, period)
        down = braking_velocity(max(x - self.lower, 0.0), self.deceleration, period)
        # A larger factor would cross the soft limit in one period.
        factor = min(self.k_position, 1.0 / period)
        low = self.softened(self.soft_lower, x, down, up, factor)
        return low, self.softened(self.soft_upper, x, down, up, factor)

    def efforts(self, x, v):
        """Return the range of the effort: it drives the velocity back into its range."""
        low, high = self.velocities(x)
        most = self.max_effort
        if self.k_velocity == 0.0:
            return 0.0 if v <= low else -most, 0.0 if v >= high else most
        return (
            np.clip(-self.k_velocity * (v - low), -most, most),
            np.clip(-self.k_velocity * (v - high), -most, most),
        )

    def followed(self, wanted, start):
        """Return the position of this cycle on the way from another one."""
        low, high = self.velocities(start)
        target = np.clip(wanted, self.lower, self.upper)
        step = np.clip(target - start, low * self.dt, high * self.dt)
        # Exactly there if only rounding is left.
        rest = abs(target - start - step)
        following = target if rest <= 1e-12 * abs(target - start) else start + step
        # Rounding must not cross a limit that has not been crossed before.
        return np.clip(following, min(self.lower, start), max(self.upper, start))

    def send(self, wanted, value):
        """Write the limited value of a command."""
        if not math.isfinite(wanted):
            self.y.write(wanted)  # rejected as not finite: readers keep the last output
            return
        self.y.write(value)
        self.limited.write(value != wanted)
        self.last = value

    def update(self):
        if not self.u.valid:
            return
        wanted = self.u.value
        x = self.position.value
        v = self.velocity.value
        if self.command is Command.position:
            if self.last is not None:
                self.send(wanted, self.followed(wanted, self.last))
            elif not self.position.valid:
                self.send(wanted, self.followed(wanted, np.clip(wanted, self.lower, self.upper)))
            elif math.isfinite(x):
                # Begins at the measured position, so that the joint does not jump.
                self.send(wanted, self.followed(wanted, x))
            else:
                self.y.write(x)  # rejected, as above
            return
        if not math.isfinite(x):
            self.y.write(x)  # rejected, as above
            return
        if self.needs_position and not self.position.valid:
            return
        if self.command is Command.velocity:
            low, high = self.velocities(x)
            self.send(wanted, np.clip(wanted, low, high))
            return
        if not math.isfinite(v):
            self.y.write(v)  # rejected, as above
            return
        if (self.needs_position or math.isfinite(self.max_velocity)) and not self.velocity.valid:
            return
        low, high = self.efforts(x, v)
        self.send(wanted, np.clip(wanted, low, high))

    def safe(self):
        """Hold the position, or command no velocity or effort."""
        if self.command is not Command.position:
            self.y.write(0.0)
        elif self.last is not None:
            self.y.write(self.last)
