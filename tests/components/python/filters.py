"""Components of realistic size, compared with the interpreter and with C++."""

import enum

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, Queue, State


class Pid(Component):
    """PID controller with limited effort and a filtered derivative."""

    setpoint: Input[float]
    measured: Input[float]
    effort: Output[float] = Output(unit="N m")
    kp: Parameter[float] = Parameter(2.0, min=0.0, max=10.0)
    ki: Parameter[float] = Parameter(1.0, min=0.0, max=10.0)
    kd: Parameter[float] = Parameter(0.01, min=0.0, max=1.0)
    limit: Parameter[float] = Parameter(10.0, min=0.1, max=100.0)
    integral: State[float]
    filtered: State[float]
    last: State[float]

    def update(self):
        """Control."""
        error = self.setpoint.value - self.measured.value
        bound = self.limit
        self.integral = min(max(self.integral + self.ki * error * self.dt, -bound), bound)
        rate = (error - self.last) / self.dt
        self.filtered += 0.1 * (rate - self.filtered)
        self.last = error
        effort = self.kp * error + self.integral + self.kd * self.filtered
        self.effort.write(min(max(effort, -bound), bound))


DT = 1e-3
F = np.eye(6)
F[:3, 3:] = DT * np.eye(3)
H = np.hstack((np.eye(3), np.zeros((3, 3))))
Q = 1e-4 * np.eye(6)
R = 1e-2 * np.eye(3)


class Kalman(Component):
    """Kalman filter of a position in space: six states, three measured."""

    position: Input[np.float64, 3]
    estimate: Output[np.float64, 6]
    x: State[np.float64, 6]
    p: State[np.float64, 6, 6] = State(np.eye(6))

    def update(self):
        """Predict and correct."""
        self.x = F @ self.x
        self.p = F @ self.p @ F.T + Q
        if self.position.new:
            innovation = self.p[:3, :3] + R
            gain = self.p[:, :3] @ np.linalg.inv(innovation)
            self.x += gain @ (self.position.value - self.x[:3])
            self.p = (np.eye(6) - gain @ H) @ self.p
        self.estimate.write(self.x)


class Phase(enum.IntEnum):
    """Phases of a machine."""

    IDLE = 0
    ACCELERATE = 1
    CRUISE = 2
    BRAKE = 3


class Machine(Component):
    """Goes through phases as commanded, and logs each change."""

    wanted: Input[float]
    enable: Input[bool]
    speed: Output[float] = Output(unit="m/s")
    phase_out: Output[Phase]
    steepness: Parameter[float] = Parameter(0.5, min=0.01, max=1.0)
    phase: State[Phase] = State(Phase.IDLE)
    velocity: State[float]
    changes: State[int]

    def update(self):
        """Decide, then move."""
        before = self.phase
        target = self.wanted.value if self.enable.value else 0.0
        if not np.isfinite(target):
            target = 0.0
        gap = target - self.velocity
        if abs(gap) < 1e-6:
            self.phase = Phase.IDLE if target == 0.0 else Phase.CRUISE
        elif gap > 0.0:
            self.phase = Phase.ACCELERATE
        else:
            self.phase = Phase.BRAKE
        if self.phase == Phase.ACCELERATE:
            self.velocity += min(gap, self.steepness)
        elif self.phase == Phase.BRAKE:
            self.velocity += max(gap, -self.steepness)
        if self.phase != before:
            self.changes += 1
            self.info("phase {} after {}, at {:.3f}", self.phase, before, self.velocity)
        self.speed.write(self.velocity)
        self.phase_out.write(self.phase)


class Raiser(Component):
    """Raises in a cycle determined by its input."""

    value: Input[float]
    out: Output[float]
    total: State[float]

    def update(self):
        """Sum up until an exception is due."""
        value = self.value.value
        if np.isnan(value):
            raise ValueError("not a number")
        if value > 1e3:
            self.fault("out of range")
        self.total = 0.9 * self.total + 1.0 / (1.0 + value * value)
        self.out.write(np.sqrt(self.total) + 1.0 / value)


class Solver(Component):
    """Uses np.linalg on small matrices."""

    a: Input[np.float64, 4, 4]
    b: Input[np.float64, 4]
    x: Output[np.float64, 4]
    lower: Output[np.float64, 4, 4]
    spectrum: State[np.float64, 4]

    def update(self):
        """Solve, and decompose."""
        matrix = np.clip(self.a.value, -1e6, 1e6)
        if not np.all(np.isfinite(matrix)):
            return
        regular = matrix @ matrix.T + np.eye(4)
        self.x.write(np.linalg.solve(regular, self.b.value))
        self.lower.write(np.linalg.cholesky(regular))
        self.spectrum[1:] = np.where(self.b.value[1:] > 0.0, np.sin(self.b.value[1:]), 0.0)


class Chooser(Component):
    """Uses np.where with numbers, vectors and matrices, of floats, ints and bools."""

    a: Input[np.float64, 4]
    m: Input[np.float64, 2, 3]
    n: Input[np.int32, 4]
    f: Input[np.float32, 4]
    first: Input[bool]
    vector: Output[np.float64, 4]
    matrix: Output[np.float64, 2, 3]
    whole: Output[np.int32, 4]
    narrow: Output[np.float32, 4]
    number: Output[float]
    flags: Output[bool, 4]

    def update(self):
        """Select by element, and by one condition for all."""
        a, m, n, f = self.a.value, self.m.value, self.n.value, self.f.value
        self.vector.write(np.where(a > 0.0, a, -a))
        self.matrix.write(np.where(m > 1.0, m, 1))
        self.whole.write(np.where(n > 3, n, 3))
        self.narrow.write(np.where(self.first.value, f, 0.5))
        self.number.write(np.where(self.first.value, 1.0, a[0]))
        self.flags.write(np.where(a > 1.0, True, n > 2))


class Trajectory(Component):
    """Follows waypoints (position, speed, duration) one after the other by cubic polynomials."""

    waypoints: Queue[np.float64, 3] = Queue(size=4)
    hold: Input[bool]
    place: Output[float] = Output(unit="rad")
    speed: Output[float] = Output(unit="rad/s")
    coefficients: State[np.float64, 4]
    since: State[float] = State(0.0, unit="s", doc="the present waypoint was taken")
    duration: State[float]
    late: State[int] = State(0, doc="ns that the present one has waited")
    skipped: State[int]

    def update(self):
        """Continue, and start the next segment when the present waypoint is reached."""
        if self.hold.value:
            while self.waypoints.size > 2:
                self.waypoints.pop()
                self.skipped += 1
            return
        self.since += self.dt
        while self.since >= self.duration and self.waypoints.size:
            begin, velocity = self.at(self.duration)
            self.since = 0.0
            self.late = self.waypoints.age
            self.take(begin, velocity, self.waypoints.front)
            self.waypoints.pop()
        place, speed = self.at(min(self.since, self.duration))
        self.place.write(place)
        self.speed.write(speed)
        if self.waypoints.dropped > 1000:
            self.warn("{} waypoints lost", self.waypoints.dropped)

    def at(self, time):
        """Return position and speed at a time of the present polynomial."""
        a, b = self.coefficients[0], self.coefficients[1]
        c, d = self.coefficients[2], self.coefficients[3]
        return a + time * (b + time * (c + time * d)), b + time * (2.0 * c + time * 3.0 * d)

    def take(self, begin, velocity, waypoint):
        """Start the polynomial to a waypoint."""
        goal, speed = waypoint[0], waypoint[1]
        self.duration = min(max(waypoint[2], 0.002), 2.0)
        if not (np.isfinite(goal) and np.isfinite(speed) and np.isfinite(self.duration)):
            goal, speed = begin, 0.0
            self.duration = 0.002
        t = self.duration
        far = goal - begin
        self.coefficients[:] = np.array(
            (
                begin,
                velocity,
                (3.0 * far / t - 2.0 * velocity - speed) / t,
                (velocity + speed - 2.0 * far / t) / (t * t),
            )
        )
