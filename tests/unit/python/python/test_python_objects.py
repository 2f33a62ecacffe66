"""Objects of NamedTuples and dataclasses mean what Python means, or are rejected."""

from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import NamedTuple

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


FIXED = Profile(0.5, 3.0)
NEAR = Pair(np.ones(3), np.zeros(3))


def planned(t: float, top: float):
    return Base(abs(t) + 0.1, top=top)


def swapped(pair: Pair) -> Pair:
    return Pair(pair.second, pair.first)


def effect(x):
    return x


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
    "objects in a loop": """
        y = 0.0
        for p in (Sample(u, 1.0), Sample(2.0, u)):
            y += p.s - 2.0 * p.v
        self.y.write(y)""",
    "a constant object": """
        p = planned(u, FIXED.top) if u > 0.0 else FIXED
        self.a = self.a + NEAR.first
        self.y.write(FIXED.at(u).s + p.t + self.a[0])""",
    "one field for several classes": """
        p: Other = Other(u, 2.0)
        q = Sample(3.0, u)
        self.y.write(p.s - 2.0 * q.s + p.v * q.v)""",
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
    "an operator": ("p = Summed(u) + Summed(1.0)  # here", "an object of Summed is not compiled"),
    "a list of its own": ("p = Counted()  # here", "an object of Counted is not compiled"),
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
    "calls in another order": (
        "p = Point(y=effect(u), x=effect(2.0))  # here",
        "calls are not in the order of the fields: write them in this order: x, y",
    ),
    "a default that is not a number": (
        "p = Named(u)  # here",
        "the default of name is not a number: write name=…",
    ),
    "a field of two classes": (
        "for k, p in enumerate([Sample(u, 1.0)]):\n            self.y.write(p.v)  # here",
        "Other and Sample have v: annotate the variable: x: ",
    ),
    "a field of a number": (
        "p = 2.0 * u\n        self.y.write(p.first)  # here",
        "a field of a float: give it an object",
    ),
    "an unknown object that is changed": (
        "for p in (Point(u, 1.0),):\n            self.y.write(p._replace(z=1.0)[0])  # here",
        "Point has no _replace: it has x, y",
    ),
    "a method of two classes": (
        "p: Profile = planned(u, 1.0)\n        self.y.write(p.weight)  # here",
        "Long has a weight of its own, and the type is not known: write a function for each class",
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
