"""Motor of rtcf_control."""

import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

REVOLUTION = 2.0 * math.pi
MOST_STEPS = 1000.0  # in one cycle, which bound its duration
# Largest step, by the fastest rate of the motor: the error of a step is below 1e-5 of the motion.
STEP_BY_RATE = 0.25
# Elements of the motion, and of its rate of change.
ANGLE, SPEED, LOAD_ANGLE, LOAD_SPEED, CURRENT = range(5)


class Drive(enum.IntEnum):
    """Quantities of the command."""

    torque = 0
    voltage = 1


class Motor(Component):
    """Simulated DC motor with friction and an elastic load (Spong, Modeling and Control of Elastic
    Joint Robots, 1987; friction: Armstrong-Hélouvry, Dupont & Canudas de Wit, A survey of models,
    analysis tools and compensation methods for the control of machines with friction, 1994;
    stiction: Karnopp, 1985).

    Unlike the component in C++, it accepts a step of which a cycle has too many, and then lags.
    """

    command: Input[float]
    load_torque: Input[float]
    position: Output[float] = Output(unit="rad", finite=True)
    velocity: Output[float] = Output(unit="rad/s", finite=True)
    load_position: Output[float] = Output(unit="rad", finite=True)
    load_velocity: Output[float] = Output(unit="rad/s", finite=True)
    torque: Output[float] = Output(unit="N m", finite=True)

    drive: Parameter[Drive] = Parameter(
        Drive.torque, doc="quantity of command: torque in N m, voltage in V"
    )
    inertia: Parameter[float] = Parameter(
        1e-4, min=1e-12, max=1e9, unit="kg m²", doc="inertia of the rotor"
    )
    load_inertia: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e9, unit="kg m²", doc="inertia of the load"
    )
    stiffness: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e12, unit="N m/rad", doc="stiffness of the shaft; 0 = rigid"
    )
    damping: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e12, unit="N m s/rad", doc="damping of the shaft"
    )
    viscous: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e12, unit="N m s/rad", doc="viscous friction of the rotor"
    )
    coulomb: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e12, unit="N m", doc="Coulomb friction of the rotor"
    )
    static_friction: Parameter[float] = Parameter(
        0.0,
        min=0.0,
        max=1e12,
        unit="N m",
        doc="torque that starts the rotor; at least coulomb counts",
    )
    stribeck_velocity: Parameter[float] = Parameter(
        1.0,
        min=1e-6,
        max=1e9,
        unit="rad/s",
        doc="velocity at which 1/e of static_friction - coulomb is left",
    )
    torque_limit: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="N m", doc="largest torque of the motor"
    )
    torque_constant: Parameter[float] = Parameter(
        0.05,
        min=1e-9,
        max=1e9,
        unit="N m/A",
        doc="torque by current, and voltage by velocity in V s/rad",
    )
    resistance: Parameter[float] = Parameter(
        1.0, min=1e-9, max=1e9, unit="ohm", doc="resistance of the winding"
    )
    inductance: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e9, unit="H", doc="inductance of the winding; 0 = none"
    )
    encoder: Parameter[float] = Parameter(
        0.0,
        min=0.0,
        max=1e12,
        unit="1/turn",
        doc="counts of the encoder by turn of the rotor; 0 = exact",
    )
    step: Parameter[float] = Parameter(
        1e-4, min=1e-9, max=1.0, unit="s", doc="longest step of the integration"
    )

    motion: State[np.float64, 5] = State(
        unit="rad, rad/s, rad, rad/s, A", doc="motion of the rotor and the load, and current"
    )
    counted: State[float] = State(0.0, unit="rad", doc="position at the last cycle, by the encoder")
    lags: State[bool] = State(False, doc="a cycle has too many steps")

    def prepare(self):
        if self.stiffness > 0.0 and self.load_inertia == 0.0:
            raise ValueError("stiffness needs a load_inertia above 0")
        if self.stiffness == 0.0 and self.damping > 0.0:
            raise ValueError("damping needs a stiffness above 0: without one the shaft is rigid")
        if self.step * self.fastest_rate() > STEP_BY_RATE:
            raise ValueError("step is too long for the fastest motion: make it shorter")

    def fastest_rate(self):
        """Return an upper estimate of the fastest rate of the linear parts, 1/s."""
        drop = max(self.static_friction - self.coulomb, 0.0)
        rotor = self.moved_inertia
        total = self.viscous / rotor + drop / (self.stribeck_velocity * rotor)
        if self.stiffness > 0.0:
            both = 1.0 / rotor + 1.0 / self.load_inertia
            total += math.sqrt(self.stiffness * both) + self.damping * both
        if self.drive is Drive.voltage:
            coupling = self.torque_constant * self.torque_constant / rotor
            if self.inductance > 0.0:
                total += self.resistance / self.inductance + math.sqrt(coupling / self.inductance)
            else:
                total += coupling / self.resistance
        return total

    def start(self):
        self.motion[:] = 0.0
        self.counted = 0.0
        self.lags = False

    @property
    def moved_inertia(self):
        """Return the inertia that moves with the rotor."""
        return self.inertia if self.stiffness > 0.0 else self.inertia + self.load_inertia

    def motor_torque(self, motion, wanted):
        """Return the torque of the motor within its limit."""
        free = wanted
        if self.drive is Drive.voltage:
            if self.inductance > 0.0:
                free = self.torque_constant * motion[CURRENT]
            else:
                back_emf = self.torque_constant * motion[SPEED]
                free = self.torque_constant * ((wanted - back_emf) / self.resistance)
        return np.clip(free, -self.torque_limit, self.torque_limit)

    def shaft_torque(self, motion):
        """Return the torque of an elastic shaft against the rotor."""
        return self.stiffness * (motion[ANGLE] - motion[LOAD_ANGLE]) + self.damping * (
            motion[SPEED] - motion[LOAD_SPEED]
        )

    def applied(self, motion, wanted, load):
        """Return the torque on the rotor without its friction."""
        against = self.shaft_torque(motion) if self.stiffness > 0.0 else load
        return self.motor_torque(motion, wanted) - against

    def rates(self, motion, direction, wanted, load):
        """Return rates of change. `direction` is that of the dry friction, 0 = the rotor sticks."""
        rate = np.zeros(5)
        if direction != 0.0:
            ratio = motion[SPEED] / self.stribeck_velocity
            drop = max(self.static_friction, self.coulomb) - self.coulomb
            dry = self.coulomb + drop * math.exp(-ratio * ratio)
            friction = direction * dry + self.viscous * motion[SPEED]
            rate[ANGLE] = motion[SPEED]
            rate[SPEED] = (self.applied(motion, wanted, load) - friction) / self.moved_inertia
        if self.stiffness > 0.0:
            rate[LOAD_ANGLE] = motion[LOAD_SPEED]
            rate[LOAD_SPEED] = (self.shaft_torque(motion) - load) / self.load_inertia
        else:
            rate[LOAD_ANGLE] = rate[ANGLE]
            rate[LOAD_SPEED] = rate[SPEED]
        if self.drive is Drive.voltage and self.inductance > 0.0:
            rate[CURRENT] = (
                wanted - self.resistance * motion[CURRENT] - self.torque_constant * motion[SPEED]
            ) / self.inductance
        return rate

    def moved(self, start, direction, time, wanted, load):
        """Return the motion after one step of the Runge-Kutta method of order 4."""
        a = self.rates(start, direction, wanted, load)
        b = self.rates(start + time / 2.0 * a, direction, wanted, load)
        c = self.rates(start + time / 2.0 * b, direction, wanted, load)
        d = self.rates(start + time * c, direction, wanted, load)
        end = start + time / 6.0 * a + time / 3.0 * b + time / 3.0 * c + time / 6.0 * d
        most = self.torque_limit / self.torque_constant
        end[CURRENT] = np.clip(end[CURRENT], -most, most)
        return end

    def direction(self, motion, wanted, load):
        """Return the direction of the dry friction: that of the motion, or of the torque that
        starts it; 0 = the torque does not start the rotor.
        """
        if motion[SPEED] != 0.0:
            return math.copysign(1.0, motion[SPEED])
        torque = self.applied(motion, wanted, load)
        if abs(torque) <= max(self.static_friction, self.coulomb):
            return 0.0
        return math.copysign(1.0, torque)

    def stopped(self, motion):
        """Return a motion at which the rotor has come to rest."""
        rest = motion.copy()
        rest[SPEED] = 0.0
        if self.stiffness == 0.0:
            rest[LOAD_SPEED] = 0.0
        return rest

    def advanced(self, start, time, wanted, load):
        """Return the motion after a step, in which the rotor may come to rest."""
        if self.coulomb == 0.0 and self.static_friction == 0.0:
            return self.moved(start, 1.0, time, wanted, load)
        direction = self.direction(start, wanted, load)
        end = self.moved(start, direction, time, wanted, load)
        if direction * end[SPEED] >= 0.0:
            return end
        # The rotor has come to rest within the step, and stays, or begins to move from there.
        share = 0.0
        if start[SPEED] != 0.0:
            share = start[SPEED] / (start[SPEED] - end[SPEED])
        rest = self.stopped(self.moved(start, direction, share * time, wanted, load))
        following = self.direction(rest, wanted, load)
        end = self.moved(rest, following, (1.0 - share) * time, wanted, load)
        return self.stopped(end) if following * end[SPEED] < 0.0 else end

    def run(self):
        """Move the motor by a cycle."""
        wanted = self.command.value if self.command.valid else 0.0
        load = self.load_torque.value if self.load_torque.valid else 0.0
        if not math.isfinite(wanted + load):
            self.position.write(math.nan)  # rejected as not finite: readers keep the last outputs
            return
        motion = self.motion.copy()
        if self.stiffness == 0.0:
            motion[LOAD_SPEED] = motion[SPEED]  # as one inertia, also if it was elastic before
        span = min(self.dt, MOST_STEPS * self.step)
        if span < self.dt and not self.lags:
            self.warn("the motor lags: {} s have more than {} steps", self.dt, MOST_STEPS)
        self.lags = span < self.dt
        steps = max(1, math.ceil(span / self.step - 1e-6))
        for _ in range(steps):
            motion = self.advanced(motion, span / steps, wanted, load)
        if not math.isfinite(np.sum(motion)):
            self.position.write(math.nan)  # as above: the motor stands still
            return
        self.motion[:] = motion
        measured = motion[ANGLE]
        if self.encoder > 0.0:
            count = REVOLUTION / self.encoder
            measured = count * np.floor(motion[ANGLE] / count)
        self.position.write(measured)
        self.velocity.write(
            (measured - self.counted) / self.dt if self.encoder > 0.0 else motion[SPEED]
        )
        self.counted = measured
        self.load_position.write(motion[LOAD_ANGLE])
        self.load_velocity.write(motion[LOAD_SPEED])
        self.torque.write(self.motor_torque(motion, wanted))

    def update(self):
        self.run()

    def safe(self):
        self.run()  # to follow the safe command of a controller
