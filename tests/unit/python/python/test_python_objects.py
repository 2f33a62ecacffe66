"""Objects of NamedTuples and dataclasses mean what Python means, or are rejected."""

from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
from collections import defaultdict
from dataclasses import InitVar, dataclass, field, replace
from enum import IntEnum
from typing import NamedTuple, Self

import math

import numpy as np
from geometry_msgs.msg import Vector3
from rtcf.component import Component, Input, Output, Parameter, State


class Phase(IntEnum):
    REST = 0
    MOVE = 1


class Sample(NamedTuple):
    s: float
    v: float
    a: float = 0.0

    def energy(self, mass: float = 2.0) -> float:
        return 0.5 * mass * self.v**2

    def later(self, t: float) -> "Sample":
        return Sample(self.s + self.v * t, self.v + self.a * t, self.a)


@dataclass
class Profile:
    t: float
    top: float
    phase: Phase = Phase.REST

    @property
    def length(self) -> float:
        return self.t * self.top

    @property
    def weight(self) -> float:
        return 2.0 * self.length

    def at(self, t: float) -> Sample:
        if t < self.t:
            return Sample(self.top * t, self.top)
        return Sample(a=1, s=self.length, v=0)


@dataclass(frozen=True)
class Limits:
    low: float
    high: float = 2.0
    WIDEST = 7.0

    @staticmethod
    def half(x):
        return 0.5 * x

    @classmethod
    def symmetric(cls, x):
        return cls(-x, x)

    def clip(self, x: float) -> float:
        return min(max(x, self.low), self.high)


class Pair(NamedTuple):
    first: np.ndarray
    second: np.ndarray


class Nested(NamedTuple):
    begin: Sample
    end: Sample


class Summed(NamedTuple):
    x: float

    def __add__(self, other):
        return Summed(self.x + other.x)


@dataclass
class Counted:
    values: list = field(default_factory=list)


@dataclass
class Point:
    x: float
    y: float


class Named(NamedTuple):
    x: float
    name: str = "a"


class Other(NamedTuple):
    v: float
    s: float


class Long(Profile):
    @property
    def weight(self) -> float:
        return 3.0 * self.length


class Base(Profile):
    pass


class Shadowed(NamedTuple):
    T: np.ndarray
    size: float

    def scaled(self) -> np.ndarray:
        return self.size * self.T


class A_b(NamedTuple):
    x: float

    def c(self):
        return self.x + 1.0


class A(NamedTuple):
    x: float

    def b_c(self):
        return self.x + 2.0


class Louder(Sample):
    def energy(self, mass: float = 2.0) -> float:
        return 7.0 * self.s


@dataclass(order=True)
class Ordered:
    x: float
    y: int = 0


@dataclass(eq=False)
class Unequal:
    x: float


@dataclass
class Tagged:
    x: float
    tag: int = field(default=0, compare=False)


@dataclass
class Computed:
    x: float

    def __post_init__(self):
        self.x = 2.0 * self.x


@dataclass(kw_only=True)
class Named_only:
    x: float


@dataclass
class Started:
    x: InitVar[float]
    y: float = 0.0


@dataclass
class Config:
    gain: float
    table: dict
    rows: list

    def __str__(self):
        return "a configuration"


class Walker(NamedTuple):
    x: float
    n: int | None = None

    def step(self, dx) -> Self:
        return self._replace(x=self.x + dx)

    @staticmethod
    def at(x) -> "Walker":
        return Walker(x, 2)


@dataclass
class Constants:
    x: float
    TOP = np.deg2rad(90)
    PAIR = (1.0, 2.0)
    PHASE = Phase.MOVE
    LIMIT = 3


@dataclass
class Vector:
    x: np.ndarray


@dataclass
class Turned:
    x: float
    angle: float = np.deg2rad(90)


@dataclass
class Begun:
    begin: Sample


@dataclass
class Farther(Begun):
    more: float


class Hidden(Sample):
    v = 5.0


class SameAs(NamedTuple):
    x: float

    __eq__ = object.__eq__


class Made(type):
    def __call__(cls, *given):
        return 1.0


@dataclass
class ByMeta(metaclass=Made):
    x: float


def effect(x):
    return x


def rtcf_of_Sample_energy(p):
    return 5.0


def of_maybe(p: Sample | None, u):
    return u if p is None else p.s


def twice(x) -> Sample:
    return Sample(2.0 * x, x)


NEXT = {Phase.REST: Phase.MOVE, Phase.MOVE: Phase.REST}
READY = {Phase.REST: True, Phase.MOVE: False}
MIXED = {Phase.REST: True, Phase.MOVE: 2}
LATER = defaultdict(float, {0: 1.0})
MATRIX = np.arange(6.0).reshape(3, 2)
PARTS = {Phase.REST: Pair(np.ones(3), np.zeros(3)), Phase.MOVE: Pair(np.zeros(3), np.ones(3))}
CHANGED = Profile(0.5, 3.0)
CHANGED.weight_of = 7.0
COARSE = [Sample(0, 1.0), Sample(0.5, 3)]
SAMPLES = [Sample(0.5, 1.0), Sample(2.0, 3.0)]
BY_PHASE = {Phase.REST: Sample(0.0, 1.0), Phase.MOVE: Sample(2.0, 3.0)}
FIXED = Profile(0.5, 3.0)
NEAR = Pair(np.ones(3), np.zeros(3))


def planned(t: float, top: float):
    return Base(abs(t) + 0.1, top=top)


def swapped(pair: Pair) -> Pair:
    return Pair(pair.second, pair.first)


class Objects(Component):
    u: Input[float]
    x: Input[np.float64, 3]
    force: Input[Vector3]
    y: Output[float]
    w: Output[np.float64, 3]
    a: State[np.float64, 3]
    b: State[np.float64, 3]
    n: State[int]
    phase: State[Phase]

    HOME = Sample(1.0, 2.0)
    TABLE = (Sample(0.1, 0.2), Sample(0.3, 0.4, 0.5))
    SPEEDS = {Phase.REST: 1.0, Phase.MOVE: 2.0}
    CONFIG = Config(2.0, {"a": 1}, [1.0, 2.0])

    @staticmethod
    def scaled(p: Sample, k):
        return p.s * k

    def maybe(self, u) -> "Sample | None":
        return Sample(u, 1.0) if u > 0 else None

    def changed(self, u):
        self.n += 2
        return u

    def parts(self, u) -> "Pair | None":
        return Pair(self.a, self.b) if u < 0.5 else None

    def late(self, p: "Pair | None", x):
        self.a = self.a + x
        return p.first[0] if p is not None else x[0]

    def from_home(self, u, home=Sample(1.0, 2.0)):
        return u * home.s + home.v

    @property
    def count(self):
        self.n += 1
        return self.n

    @property
    def now(self) -> Sample:
        return Sample(self.a[0], self.b[1])

    def pair(self):
        return Pair(self.a, self.b)

    def update(self):
        u, x = self.u.value, self.x.value
"""
WAYS = {
    "positions, names, defaults": """
        p, q = Sample(u, 2.0), Sample(v=u, s=1.0, a=3.0)
        self.y.write(p.s - p.v * q.v + q.a + p.a)""",
    "unpacked, an element, len": """
        p = Sample(u, 2.0, 1.0)
        s, v, _ = p
        self.y.write(s * v + p[0] + p[-1] + len(p))""",
    "a method": """
        p = Sample(u, 2.0 * u)
        self.y.write(p.energy() + p.energy(mass=u) + p.later(0.5).s)""",
    "a property": """
        p = planned(u, 2.0)
        self.y.write(p.length + p.top)""",
    "returned and passed": """
        p = Profile(abs(u), 2.0)
        now = p.at(0.5)
        self.y.write(now.s + now.v + 3 * now.a)""",
    "an int and a float for a field": """
        p = Sample(1, 2.0) if u > 0.0 else Sample(u, 3)
        self.y.write(p.s / 2 + p.v)""",
    "an enum": """
        p = Profile(u, 1.0, Phase.MOVE if u > 0.0 else Phase.REST)
        self.phase = p.phase
        if p.phase == Phase.MOVE:
            self.n += 1
        self.y.write(self.n)""",
    "a new object for a changed one": """
        p = Sample(u, 2.0)
        if u > 0.0:
            p = p._replace(v=u * u, a=1.0)
        self.y.write(p.s + 2.0 * p.v + 3.0 * p.a)""",
    "a new dataclass object for a changed one": """
        p = Point(u, 2.0)
        p = replace(p, y=p.x)
        self.y.write(p.x - 3.0 * p.y)""",
    "a static method, a method of the class": """
        p = Limits(-1.0)
        self.y.write(Limits.half(u) + Limits.clip(p, u))""",
    "a method named as one of arrays": """
        p = Limits(-1.0)
        self.w.write(p.clip(u) + x.clip(-0.5, 0.5))""",
    "a constant of the class": """
        p = Limits(u)
        self.y.write(p.WIDEST + Limits.WIDEST)""",
    "objects in objects": """
        p = Nested(Sample(u, 1.0), end=Sample(2.0 * u, 3.0))
        self.y.write(p.begin.s + p.end.v * p.end.s)""",
    "a property of self": """
        old = self.now
        self.a = self.a + x
        self.b = 0.5 * self.b + x
        self.y.write(old.s - self.now.v)""",
    "arrays": """
        p = self.pair()
        self.a = self.a + x
        self.b = 0.5 * self.b - p.first
        self.w.write(p.first - p.second)""",
    "arrays that are swapped": """
        p = swapped(Pair(self.a, self.b))
        self.a, self.b = p.first, p.second
        self.a = self.a + x
        self.w.write(p.first - self.b)""",
    "an array that changes": """
        p = Pair(1.0 * x, self.a)
        p.first[0] = 7.0
        p.first[1:] += 1.0
        self.a = self.a + p.first
        self.w.write(p.first + p.second)""",
    "in nested functions and comprehensions": """
        p = Sample(u, 2.0)
        f = lambda k: k * p.s + p.energy()
        self.w.write([f(z) + p.v for z in x])""",
    "objects that are counted": """
        for k, p in enumerate([Sample(u, 1.0), Sample(2.0, u)]):
            self.y.write(k * p.v)""",
    "objects in a loop": """
        y = 0.0
        for p in (Sample(u, 1.0), Sample(2.0, u)):
            y += p.s - 2.0 * p.v
        self.y.write(y)""",
    "a constant object": """
        p = Profile(u, FIXED.top) if u > 0.0 else FIXED
        self.a = self.a + NEAR.first
        self.y.write(FIXED.at(u).s + p.t + self.a[0])""",
    "one field for several classes": """
        p: Other = Other(u, 2.0)
        q = Sample(3.0, u)
        self.y.write(p.s - 2.0 * q.s + p.v * q.v)""",
    "a dataclass compared by ==": """
        p = Point(u, 1.0)
        self.y.write(1.0 if p == Point(u, 1.0) else 0.0)""",
    "a dataclass that is ordered": """
        p = Ordered(u, 1)
        self.y.write(1.0 if p < Ordered(0.5) else 0.0)""",
    "a NamedTuple that is compared": """
        p = Sample(u, 1.0)
        self.y.write(1.0 if p != Sample(1.0, u) and p < (2.0, 1.0, 0.0) else 0.0)""",
    "a NamedTuple as a tuple": """
        p = Sample(u, 1.0, 2.0)
        y = 0.0
        for z in p:
            y += z
        for k in range(3):
            y += k * p[k]
        q = p + (4.0,)
        self.w.write(p)
        self.a = np.array(p)
        self.b[:] = p
        self.y.write(y + sum(p) + max(*p) + len(p) + q[3])""",
    "an object or None": """
        p = self.maybe(u)
        q = twice(u) if u < 0.0 else None
        if p:
            self.n += 1
        self.y.write((p.s if p is not None else -1.0) + of_maybe(q, u) + of_maybe(None, u))""",
    "a static method of an object": """
        p = Limits(u)
        self.y.write(p.half(u) + self.scaled(Sample(u, 1.0), 2.0))""",
    "a constant object with a dict": """
        self.y.write(self.CONFIG.gain * u + self.CONFIG.rows[1])""",
    "constants of the class": """
        y = 0.0
        for p in self.TABLE:
            y += p.s * p.energy()
        for k, q in enumerate(SAMPLES):
            y += k * q.v
        self.n += 1
        self.y.write(y + self.HOME.energy(u) + self.TABLE[self.n % 2].s + SAMPLES[self.n % 2].v)""",
    "objects in a dict": """
        phase = Phase.MOVE if u > 0.0 else Phase.REST
        p = BY_PHASE[phase]
        q = BY_PHASE.get(phase, Sample(u, 1.0))
        self.y.write(p.energy() + q.v + self.SPEEDS[phase])""",
    "a method that returns its class": """
        p = Walker.at(u).step(2.0).step(u)
        self.y.write(p.x + p.n + (0.0 if Walker(u).n is None else 1.0))""",
    "fields named as attributes of arrays": """
        for p in (Shadowed(x, u), Shadowed(2.0 * x, 3.0)):
            self.w.write(p.T * p.size + p.scaled())""",
    "similar names": """
        self.y.write(A_b(u).c() + A(u).b_c() + Sample(u, u).energy() + rtcf_of_Sample_energy(u))""",
    "a class by its value": """
        p = Louder(u, 2.0)
        q: Profile = planned(u, 2.0)
        self.y.write(p.energy() + p.s + q.weight + Long(u, 1.0).weight)""",
    "a field of a base": """
        p: Sample = Louder(u, 2.0)
        self.y.write(p.s + 2.0 * p.v)""",
    "all fields replaced": """
        p = Point(u, 1.0)
        p = replace(p, x=p.y, y=p.x)
        self.y.write(p.x - 2.0 * p.y)""",
    "two arrays as one object, swapped": """
        self.a, self.b = Pair(self.b, self.a)
        self.w.write(self.a - self.b)
        self.a += x""",
    "objects of a comprehension": """
        self.y.write(sum(p.v * p.s for p in SAMPLES) * u)""",
    "fields in another order than their values": """
        p = Point(y=self.count, x=self.count)
        q = Point(y=self.changed(u), x=effect(self.n))
        p = replace(p, y=self.count, x=self.count)
        self.y.write(p.x - 2.0 * p.y + 3.0 * q.x - 5.0 * q.y)""",
    "an object of arrays or None": """
        p = Pair(self.a, self.b) if u > 0.0 else None
        q = self.parts(u)
        self.a = self.a + x
        self.b = 0.5 * self.b - x
        self.w.write((p.first if p is not None else x) - (q.second if q is not None else x))
        self.y.write(self.late(q, x))""",
    "None that is compared with None": """
        p, q = self.maybe(u), self.maybe(x[0])
        self.n = (p == q) + 2 * (p != q)
        self.y.write(1.0 if p == Sample(u, 1.0) else 0.0)""",
    "conditions that may be None": """
        y = 0.0
        if self.maybe(u):
            y += 1.0
        if (p := self.maybe(x[0])) and p.s > 0.5:
            y += 2.0
        if not self.maybe(x[1]):
            y += 4.0
        for q in (self.maybe(u), self.maybe(x[2])):
            if q:
                y += q.s
        t = (self.maybe(u), 1.0)
        if t[0]:
            y += 8.0
        self.y.write(y)""",
    "enums and bools of dicts": """
        phase = Phase.MOVE if u > 0.0 else Phase.REST
        y = 1.0 if NEXT[phase] is Phase.MOVE else 2.0
        if READY[phase] is True:
            y += 4.0
        if NEXT.get(phase, Phase.REST) is not Phase.REST:
            y += 8.0
        self.y.write(y)""",
    "reversed tuples of tuples": """
        y = 0.0
        for a, b in reversed(((1.0, 2.0), (3.0, u))):
            y = 2.0 * y + a - b
        for p in reversed((Sample(u, 1.0), Sample(2.0, u))):
            y = 2.0 * y + p.s - p.v
        for k, r in enumerate(reversed(MATRIX)):
            y = 2.0 * y + k * r[0] - r[1]
        self.y.write(y)""",
    "other constants of the class": """
        p = Constants(u)
        self.y.write(p.TOP + p.PAIR[1] * p.LIMIT if p.PHASE is Phase.MOVE else p.x)""",
    "a NumPy number as a default": """
        self.y.write(Turned(u).angle + Turned(u, 2.0).angle)""",
    "an inherited field of a class": """
        p = Farther(Sample(u, 1.0), 2.0)
        self.y.write(p.begin.energy() + p.begin.s * p.more)""",
    "an object as a default": """
        self.y.write(self.from_home(u) + self.from_home(u, Sample(u, u)))""",
    "objects of constants with ints and floats": """
        y = 0.0
        for p in COARSE:
            y += p.s / 2 + p.v
        self.n = (self.n + 1) % 2
        self.y.write(y + COARSE[self.n].v / 3)""",
    "an int that is small": """
        p = Sample(0, -3) if u > 0.0 else Sample(u, 1.0)
        for k in range(2):
            p = Sample(p.s + u, p.v, p.a)
        self.y.write(p.s + p.v + p.a)""",
    "a message with the same field": """
        force = self.force.value
        p = Point(u, 2.0)
        self.y.write(force.x - p.x + p.y * self.force.value.y)""",
}


@pytest.mark.parametrize("way", WAYS)
def test_an_object_means_what_python_means(tmp_path: Path, way: str) -> None:
    cls = _loaded(tmp_path, WAYS[way])
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.largest_ulp == 0


REJECTED = {
    "a field that is set": (
        "p = Point(u, 1.0)\n        p.x = 2.0  # here",
        "p.x is a field of an object: make a new object: Point(…), or keep it in a State",
    ),
    "a field that is changed": (
        "p = Point(u, 1.0)\n        p.x += 2.0  # here",
        "p.x is a field of an object",
    ),
    "an operator": (
        "p = Summed(u) + Summed(1.0)  # here",
        "an object of Summed is not compiled, because it has __add__: write a method, such as plus",
    ),
    "a list of its own": (
        "p = Counted()  # here",
        "an object of Counted is not compiled, because values has a default_factory: give it a",
    ),
    "a class method": ("p = Limits.symmetric(u)  # here", "Limits.symmetric is not compiled: "),
    "a missing field": ("p = Sample(u)  # here", "Sample has the fields s, v, a: write Sample(s,"),
    "too many fields": ("p = Point(u, 1.0, 2.0)  # here", "Point has the fields x, y"),
    "an unknown field": ("p = Point(u, z=1.0)  # here", "Point has the fields x, y"),
    "a field given twice": ("p = Point(u, x=1.0)  # here", "Point has the fields x, y"),
    "any number of fields": ("p = Point(*x[:2])  # here", "Point of any number of values: write"),
    "a field that is not there": (
        "p = Profile(u, 1.0)\n        self.y.write(p.tops)  # here",
        "Profile has no tops: correct its name (top)",
    ),
    "a method without ( )": (
        "p = Sample(u, 1.0)\n        self.y.write(p.energy)  # here",
        "p.energy is a method: call it: p.energy(…)",
    ),
    "a default that is not a number": (
        "p = Named(u)  # here",
        "the default of name is not a number: write name=…",
    ),
    "a field of a number": (
        "p = 2.0 * u\n        self.y.write(p.first)  # here",
        "a field of a float, not of an object: give it an object of Pair",
    ),
    "an unknown object that is changed": (
        "for p in (Point(u, 1.0),):\n            self.y.write(p._replace(z=1.0)[0])  # here",
        "Point has no _replace: it has x, y",
    ),
    "a method of another class": (
        "p: Profile = Long(u, 1.0)\n        self.y.write(p.weight)  # here",
        "an object of Long, whose weight is not that of Profile: annotate the variable with its",
    ),
    "a method of another NamedTuple": (
        "p: Sample = Louder(u, 1.0)\n        self.y.write(p.energy())  # here",
        "an object of Louder, whose energy is not that of Sample",
    ),
    "another class than annotated": (
        "p: Sample = Other(u, 1.0)\n        self.y.write(p.s)  # here",
        "an object of Other, whose s is not that of Sample",
    ),
    "one of two classes": (
        "p = Sample(u, 1.0) if u > 0.0 else Other(u, 2.0)\n        self.y.write(p.s)  # here",
        "Other and Sample have s: annotate the variable: x: ",
    ),
    "two classes in a variable": (
        "p = planned(u, 2.0) if u > 0.0 else FIXED  # here\n        self.y.write(p.t)",
        "is a Base in one place and a Profile in another: give it one type",
    ),
    "another variable of the same name": (
        "p = Sample(u, 1.0)\n        f = lambda p: p.s  # here\n        self.n = f(Other(u, 1))",
        "Other and Sample have s",
    ),
    "a field of a tuple": (
        "p = (u, 1.0)\n        self.y.write(p.x)  # here",
        "a field of a list or tuple, not of an object: give it an object of Point",
    ),
    "the length of a dataclass": (
        "p = Point(u, 1.0)\n        self.y.write(len(p))  # here",
        "len of a Point: use its fields, such as p.x",
    ),
    "an element of a dataclass": (
        "p = Point(u, 1.0)\n        self.y.write(p[0])  # here",
        "a Point cannot be indexed by an int: use its fields, such as p.x",
    ),
    "a dataclass that is unpacked": (
        "p = Point(u, 1.0)\n        a, b = p  # here\n        self.y.write(a)",
        "a Point is unpacked into 2 names",
    ),
    "a loop over a dataclass": (
        "p = Point(u, 1.0)\n        for a in p:  # here\n            self.n += 1",
        "a loop over a Point: use its fields, such as p.x",
    ),
    "an order that dataclasses do not have": (
        "p = Point(u, 1.0)\n        self.n = p < Point(1.0, u)  # here",
        "a Point is compared with a Point by <: compare their fields",
    ),
    "a sum of dataclasses": (
        "p = Point(u, 1.0)\n        p = p + p  # here",
        "a Point + a Point: use its fields, such as p.x",
    ),
    "a dataclass as arguments": (
        "p = Point(u, 1.0)\n        self.y.write(max(*p))  # here",
        "max of a Point: use its fields, such as p.x",
    ),
    "a number in a dataclass": (
        "p = Point(u, 1.0)\n        self.n = u in p  # here",
        "a Point in a float: use its fields, such as p.x",
    ),
    "an array of a dataclass": (
        "p = Point(u, 1.0)\n        self.y.write(np.array(p)[0])  # here",
        "an array of a Point: use numbers",
    ),
    "a State set to a dataclass": (
        "self.a[:2] = Point(u, 1.0)  # here",
        "a vector of float64 is set to a Point",
    ),
    "an Output set to a dataclass": (
        "self.w.write(Profile(u, 1.0))  # here",
        "a vector of float64 is set to a Profile",
    ),
    "a dataclass compared with a tuple": (
        "self.n = Point(u, 1.0) == (u, 1.0)  # here",
        "a Point is compared with a list or tuple by ==: compare their fields",
    ),
    "a dataclass without ==": (
        "self.n = Unequal(u) == Unequal(u)  # here",
        "a Unequal is compared with a Unequal by ==: compare their fields",
    ),
    "a field that == leaves out": (
        "self.n = Tagged(u, 1) == Tagged(u, 2)  # here",
        "a Tagged is compared with a Tagged by ==",
    ),
    "the identity of objects": (
        "p = Sample(u, 1.0)\n        q = p\n        self.n = p is q  # here",
        "the identity of a Sample is not known: compare it by ==",
    ),
    "the identity of tuples": (
        "p = (u, 1.0)\n        q = (u, 1.0)\n        self.n = p is not q  # here",
        "the identity of a list or tuple is not known: compare it by ==",
    ),
    "an array of a dict of constants": (
        "self.a = PARTS[self.phase].first\n        self.a += 1.0  # here",
        "are the same array in NumPy, and this changes both",
    ),
    "an array of a dict of constants, with a default": (
        "self.a = PARTS.get(self.phase, Pair(x, x)).first\n        self.a += 1.0  # here",
        "are the same array in NumPy, and this changes both",
    ),
    "a constant that hides a field": (
        "p = Hidden(u, 1.0)  # here",
        "an object of Hidden is not compiled, because v is a field, and a float: give one another",
    ),
    "another ==": (
        "p = SameAs(u)  # here",
        "because it has an __eq__ of its own: write a method, such as is_near",
    ),
    "a metaclass": (
        "p = ByMeta(u)  # here",
        "an object of ByMeta is not compiled, because it has a metaclass: write a plain class",
    ),
    "the identity of an int and True": (
        "q = u > 0.0 if x[0] > 0 else self.n\n        self.y.write(3 if q is True else 4)  # here",
        "an int is compared with True or False by is: write ==",
    ),
    "the identity of an int and an enum": (
        "q = Phase.MOVE if u > 0.0 else self.n\n        self.n = q is Phase.MOVE  # here",
        "an int is compared with a Phase by is: write ==",
    ),
    "objects with arrays that are compared": (
        "self.y.write(1.0 if Vector(x) == Vector(self.a) else 0.0)  # here",
        "objects with arrays are compared by ==: compare their fields, by np.array_equal",
    ),
    "a dict of bools and ints": (
        "self.n = MIXED[self.phase]  # here",
        "MIXED is a dict with other keys or values",
    ),
    "a dict with a default": ("self.y.write(LATER[self.n])  # here", "LATER is a defaultdict: use"),
    "an int that may be large": (
        "p = Sample(self.n, 1.0) if u > 0.0 else Sample(u, 1.0)  # here",
        "is a Sample in one place and a Sample in another: give it one type, such as 0.0",
    ),
    "a function as a field": (
        "p = Point(math.sqrt, u)  # here",
        "a function is a field of an object: call it where it is needed",
    ),
    "a function in a variable": (
        "f = math.sqrt  # here\n        self.y.write(f(u))",
        "math.sqrt is kept as a value: call it where it is needed",
    ),
    "a function in a tuple": (
        "fs = (math.sqrt, math.exp)  # here\n        self.y.write(fs[0](u))",
        "math.sqrt is kept as a value: call it where it is needed",
    ),
    "other arguments of a method": (
        "p = Sample(u, 1.0)\n        self.y.write(p.energy(1.0, 2.0))  # here",
        "p.energy takes mass: write p.energy(mass)",
    ),
    "an attribute of a constant object only": (
        "self.y.write(CHANGED.top)  # here",
        "a field of a Profile in an object, not of an object",
    ),
    "fields computed by the class": (
        "p = Computed(u)  # here",
        "its fields are computed by __post_init__: compute them in a function",
    ),
    "fields with names only": (
        "p = Named_only(x=u)  # here",
        "its fields are keyword-only: remove kw_only=True",
    ),
    "an InitVar": (
        "p = Started(u)  # here",
        "x is an InitVar: make the object in a function",
    ),
    "a dict of an object": (
        'self.y.write(self.CONFIG.table["a"])  # here',
        "a dict in an object cannot be indexed",
    ),
    "the names of the fields": (
        "p = Sample(u, 1.0)\n        self.n = len(p._fields)  # here",
        "Sample._fields is a tuple, which is not compiled: write a method",
    ),
    "an object in a log": (
        'self.info("%s", Sample(u, 1.0))  # here',
        "stores numbers and bools, not objects: log each",
    ),
    "a list of objects": (
        "ps = [Sample(z, u) for z in x]  # here",
        "a list of objects of Sample: make an array of each field",
    ),
}


@pytest.mark.parametrize("mistake", REJECTED)
def test_an_object_with_another_meaning_is_rejected(tmp_path: Path, mistake: str) -> None:
    body, said = REJECTED[mistake]
    with pytest.raises(Mistake) as caught:
        object_file.compile_component(_loaded(tmp_path, body))
    assert said in str(caught.value)
    line = (tmp_path / "objects.py").read_text().splitlines()[caught.value.line - 1]
    assert line.endswith("# here")


def _loaded(folder: Path, body: str) -> type:
    file = folder / "objects.py"
    file.write_text(f"{HEAD}        {body.lstrip()}\n")
    return modules.components(modules.load(file))[0]
