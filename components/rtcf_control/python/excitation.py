"""Excitation of rtcf_control."""

import enum
import math

import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

TURN = 2.0 * math.pi
# Phases closer than this to an edge count as on it: sums of rounded steps miss it by less.
PHASE_TOLERANCE = 1e-9
# First state of the shift register of PRBS: of all states, the one from which the sum of the first
# n bits stays within the square root of n for the longest time, 25808 bits.
PRBS_START = 0x1DF7


class Shape(enum.IntEnum):
    """Forms of the excitation."""

    step = 0
    relay = 1
    prbs = 2
    linear_chirp = 3
    log_chirp = 4
    multisine = 5


class Mode(enum.IntEnum):
    """Values to which the excitation is added."""

    add = 0
    replace = 1


class Progress(enum.IntEnum):
    """Values of the output `state`."""

    ready = 0
    running = 1
    completed = 2  # the duration is over
    stopped = 3  # by run, stop_now, or the end of the loop
    left_limits = 4  # by the measured value, or it is lost, or a value is not finite
    lease_ended = 5  # run has not been renewed
    not_begun = 6  # u or measured is outside its limits, or there are none


def nanoseconds(seconds):
    """Return a time in ns."""
    return round(1e9 * seconds)


def multisine(lines, phase):
    """Return the sum of sines with the phases of Schroeder (Synthesis of low-peak-factor signals,
    IEEE Transactions on Information Theory, 1970), which keep its peak low.
    """
    total = 0.0
    for k in range(1, lines + 1):
        total += math.sin(TURN * k * phase - TURN / 2.0 * k * (k - 1) / lines)
    return total


class Excitation(Component):
    """Excites a loop by a step, relay, PRBS, chirp or multisine within limits, and returns to the
    command before when a limit is left or its caller ends.
    """

    u: Input[float]
    measured: Input[float]
    run: Input[bool]
    stop_now: Input[bool]
    y: Output[float] = Output(finite=True)
    signal: Output[float] = Output(finite=True)
    state: Output[Progress]
    running: Output[bool]

    shape: Parameter[Shape] = Parameter(Shape.step, doc="form of the excitation")
    mode: Parameter[Mode] = Parameter(
        Mode.add, doc="add the excitation to u, or to the value of u at its begin"
    )
    amplitude: Parameter[float] = Parameter(1.0, doc="height of a step, peak value of other shapes")
    lower: Parameter[float] = Parameter(0.0, doc="lower limit of y while the excitation runs")
    upper: Parameter[float] = Parameter(
        0.0, doc="upper limit of y while the excitation runs; must be above lower"
    )
    measured_lower: Parameter[float] = Parameter(
        -math.inf, doc="a measured value below it stops the excitation"
    )
    measured_upper: Parameter[float] = Parameter(
        math.inf, doc="a measured value above it stops the excitation"
    )
    delay: Parameter[float] = Parameter(
        0.0, min=0.0, max=1e6, unit="s", doc="time before the signal"
    )
    duration: Parameter[float] = Parameter(
        10.0, min=1e-6, max=1e6, unit="s", doc="duration of the signal, and of a chirp"
    )
    lease: Parameter[float] = Parameter(
        1.0, min=0.0, max=1e6, unit="s", doc="longest time without a new true on run; 0 = any"
    )
    frequency_hz: Parameter[float] = Parameter(
        1.0,
        min=0.0,
        max=1e6,
        unit="Hz",
        doc="first frequency of a chirp, lowest one of a multisine, bits per second of a PRBS",
    )
    end_frequency: Parameter[float] = Parameter(
        10.0, min=0.0, max=1e6, unit="Hz", doc="last frequency of a chirp"
    )
    lines: Parameter[int] = Parameter(10, min=1, max=64, doc="number of sines of a multisine")
    hysteresis: Parameter[float] = Parameter(
        0.0,
        min=0.0,
        doc="distance of measured from its first value at which a relay switches",
    )
    idle: Parameter[float] = Parameter(0.0, doc="y until u has a value")
    measurement_timeout: Parameter[float] = Parameter(
        0.2,
        min=0.0,
        unit="s",
        doc="longest time without a new finite measured value, then: the excitation ends",
    )
    frozen_timeout: Parameter[float] = Parameter(
        math.inf, min=0.0, unit="s", doc="the same for a measured value that does not change"
    )

    progress: State[Progress] = State(doc="last value of state")
    armed: State[bool] = State(False, doc="run was false: the next true begins")
    silence: State[int] = State(0, unit="ns", doc="time since the last true on run")
    since: State[int] = State(0, unit="ns", doc="time since the begin")
    base: State[float] = State(0.0, doc="u at the begin")
    last_u: State[float] = State(math.nan, doc="last finite u; NaN = none")
    reference: State[float] = State(0.0, doc="measured at the begin")
    high: State[bool] = State(True, doc="the relay is at amplitude")
    playing: State[bool] = State(False, doc="the signal has begun")
    played: State[int] = State(0, unit="ns", doc="time since the signal began")
    phase: State[float] = State(0.0, doc="phase of the wave, from 0 to 1")
    bits: State[int] = State(PRBS_START, doc="shift register of PRBS")
    measured_age: State[int] = State(0, unit="ns", doc="age of the last finite measured value")
    unchanged: State[int] = State(0, unit="ns", doc="time since its last change")
    last_finite: State[float] = State(math.nan, doc="last finite measured value; NaN = none")
    peak: Derived[float]  # of the multisine

    def prepare(self):
        if self.lower > self.upper:
            raise ValueError("lower is above upper")
        if self.measured_lower > self.measured_upper:
            raise ValueError("measured_lower is above measured_upper")
        if self.shape is Shape.log_chirp and min(self.frequency_hz, self.end_frequency) <= 0.0:
            raise ValueError("log_chirp: frequency_hz and end_frequency must be above 0 Hz")
        self.peak = 1.0
        if self.shape is Shape.multisine:
            points = 256 * self.lines
            peak = 0.0
            for i in range(points):
                peak = max(peak, abs(multisine(self.lines, i / points)))
            self.peak = peak

    def start(self):
        self.progress = Progress.ready
        self.armed = False
        self.last_u = math.nan
        self.measured_age = 0
        self.unchanged = 0
        self.last_finite = math.nan

    @property
    def elapsed(self):
        """Return the time since the last cycle, ns."""
        return nanoseconds(self.dt)

    def command(self):
        """Return the value without excitation."""
        value = self.u.value if self.u.valid else self.idle
        if math.isfinite(value):
            self.last_u = value
        return value

    def watch(self):
        """Note the measured value of a cycle."""
        if not self.measured.valid:
            return
        value = self.measured.value
        finite = math.isfinite(value)
        changed = finite and value != self.last_finite
        age = self.measured.age
        self.measured_age = age if finite else self.measured_age + self.elapsed
        self.unchanged = age if changed else self.unchanged + self.elapsed
        if finite:
            self.last_finite = value

    def lost(self):
        """Return whether the measured value is too old, or frozen."""
        return (
            self.measured_age > 1e9 * self.measurement_timeout
            or self.unchanged > 1e9 * self.frozen_timeout
        )

    def inside(self):
        """Return whether the measured value is within its limits and not lost, or not needed."""
        if (
            self.shape is not Shape.relay
            and not math.isfinite(self.measured_lower)
            and not math.isfinite(self.measured_upper)
        ):
            return True
        value = self.measured.value
        return (
            self.measured.valid
            and not self.lost()
            and math.isfinite(value)
            and self.measured_lower <= value <= self.measured_upper
        )

    def begin(self, command):
        """Begin the excitation if limits, command and measured value allow it."""
        self.progress = Progress.not_begun
        if not self.lower < self.upper:
            self.warn("not begun: set lower and upper, the limits of y")
        elif not (math.isfinite(command) and self.lower <= command <= self.upper):
            self.warn(
                "not begun: u = {} is outside lower = {} to upper = {}",
                command,
                self.lower,
                self.upper,
            )
        elif not self.inside():
            self.warn(
                "not begun: measured has no value or is lost, or is outside "
                "measured_lower = {} to measured_upper = {}",
                self.measured_lower,
                self.measured_upper,
            )
        else:
            self.progress = Progress.running
            self.base = command
            self.reference = self.measured.value if self.measured.valid else 0.0
            self.high = True
            self.since = 0
            self.playing = False
            self.played = 0
            self.phase = 0.0
            self.bits = PRBS_START

    def relay(self):
        """Return 1 or -1: switch when the measured value has left its first value."""
        error = self.reference - self.measured.value
        if error > self.hysteresis:
            self.high = True
        if error < -self.hysteresis:
            self.high = False
        return 1.0 if self.high else -1.0

    def wave(self):
        """Return the signal in this cycle, between -1 and 1."""
        match self.shape:
            case Shape.relay:
                return self.relay()
            case Shape.prbs:
                return 1.0 if self.bits & 1 else -1.0
            case Shape.linear_chirp | Shape.log_chirp:
                return math.sin(TURN * self.phase)
            case Shape.multisine:
                return np.clip(multisine(self.lines, self.phase) / self.peak, -1.0, 1.0)
            case _:
                return 1.0

    def turns(self, time):
        """Return the turns of a chirp from its start to a time."""
        if self.shape is Shape.linear_chirp:
            rise = (self.end_frequency - self.frequency_hz) * time / (2.0 * self.duration)
            return time * (self.frequency_hz + rise)
        ratio = math.log(self.end_frequency / self.frequency_hz)
        if ratio == 0.0:
            return self.frequency_hz * time
        grown = math.expm1(ratio * time / self.duration)
        return self.frequency_hz * self.duration / ratio * grown

    def advance(self):
        """Move the wave to this cycle. A chirp begins again at its end."""
        before = 1e-9 * self.played
        self.played += self.elapsed
        if self.shape is Shape.linear_chirp or self.shape is Shape.log_chirp:
            if self.played >= nanoseconds(self.duration):
                self.played = 0
                self.phase = 0.0
                return
            self.phase += self.turns(1e-9 * self.played) - self.turns(before)
        else:
            self.phase += self.frequency_hz * (1e-9 * self.elapsed)
        whole = np.floor(self.phase + PHASE_TOLERANCE)
        self.phase -= whole
        # At most one new bit a cycle. x^15 + x^14 + 1 has the period 32767.
        if self.shape is Shape.prbs and whole > 0.0:
            bit = ((self.bits >> 14) ^ (self.bits >> 13)) & 1
            self.bits = ((self.bits << 1) | bit) & 0x7FFF
            if self.bits == 0:
                self.bits = PRBS_START

    def send(self, value, signal):
        """Write all outputs."""
        self.y.write(value)
        self.signal.write(signal)
        self.state.write(self.progress)
        self.running.write(self.progress is Progress.running)

    def update(self):
        command = self.command()
        self.watch()
        wanted = self.run.valid and self.run.value
        renewed = wanted and self.run.new
        stopped = self.stop_now.valid and self.stop_now.value
        self.silence = 0 if renewed else self.silence + self.elapsed
        if self.progress is Progress.running:
            self.since += self.elapsed
            if stopped or not wanted:
                self.progress = Progress.stopped
            elif self.lease > 0.0 and self.silence > nanoseconds(self.lease):
                self.progress = Progress.lease_ended
            elif not (math.isfinite(command) and self.inside()):
                self.progress = Progress.left_limits
            elif self.since >= nanoseconds(self.delay) + nanoseconds(self.duration):
                self.progress = Progress.completed
        elif renewed and self.armed and not stopped:
            self.begin(command)
        self.armed = not wanted or (self.armed and stopped)
        if self.progress is not Progress.running:
            self.send(self.last_u, 0.0)  # rejected if there was no finite one
            return
        unit = 0.0
        if self.since >= nanoseconds(self.delay):
            if self.playing:
                self.advance()
            self.playing = True
            unit = self.wave()
        base = command if self.mode is Mode.add else self.base
        value = np.clip(base + self.amplitude * unit, self.lower, self.upper)
        self.send(value, value - base)

    def safe(self):
        """End the excitation, and pass on the safe command of an upstream component."""
        if self.progress is Progress.running:
            self.progress = Progress.stopped
        self.command()
        self.send(self.last_u, 0.0)
