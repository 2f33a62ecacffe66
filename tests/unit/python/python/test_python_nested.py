"""Nested functions, lambdas, comprehensions, local dicts and loops over ports: they mean what
Python means, or are rejected.
"""

from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
import enum
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State

LIMITS = [1.0, 2.0, 3.0]
COUNT = 3
scale = 5.0


def spread(values, middle):
    def distance(x):
        return abs(x - middle)

    return max(distance(x) for x in values)


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1
    HOLD = 5


SPEEDS = {Mode.OFF: 0.0, Mode.RUN: 1.5}


def product(a, b, c):
    return a * b - c


def clamped(x, low, high=5):
    return max(low, min(high, x))


class Nested(Component):
    u: Input[float]
    error: Input[float]
    o: Output[float]
    mode: State[Mode]
    v: Input[np.float64, 3]
    y: Output[float]
    w: Output[np.float64, 3]
    gain: Parameter[float] = 2.0
    a: State[np.float64, 3]
    m: State[np.float64, 2, 3]
    n: State[int]

    def bump(self):
        self.n += 1
        return self.n

    def norm(self):
        return math.sqrt(sum(x * x for x in self.a))

    def update(self):
        u, v = self.u.value, self.v.value
"""
WAYS = {
    "nested function": """
        def clip(x, low=-1.0):
            return min(max(x, low), top)
        top = 1.5
        y = clip(u) + clip(u, 0.0) + clip(x=u, low=0.5)
        top = 0.7
        self.y.write(y + clip(u))""",
    "nested function with a name of the module": """
        def scaled(scale):
            return scale * u
        self.y.write(scaled(3.0) + scale)""",
    "nested function that calls another": """
        def half(x):
            return x / self.gain if self.gain else x
        def quarter(x):
            return half(half(x)) + u
        self.y.write(quarter(u))""",
    "nested function in a nested function": """
        def outer(x):
            def inner(z):
                return z * x + u
            return inner(x) + inner(2.0)
        self.y.write(outer(u))""",
    "nested function that sets members": """
        def shift(x):
            self.a[1:] = self.a[:-1].copy()
            self.a[0] = x
            self.n += 1
        shift(u)
        shift(2.0 * u)
        self.y.write(self.a[2])""",
    "nested function that changes an array": """
        def add(k):
            total[k] += v[k]
        total = np.zeros(3)
        for k in range(3):
            add(k)
        self.w.write(total)""",
    "nested function that replaces a member": """
        def renew():
            self.a = 0.5 * self.a + v
        old = self.a
        renew()
        self.w.write(self.a - old)""",
    "nested function of its own name": """
        def gain(x):
            return self.gain * x
        self.y.write(gain(u))""",
    "several returned values": """
        def turned(x, y):
            return c * x - s * y, s * x + c * y
        c, s = math.cos(u), math.sin(u)
        a, b = turned(v[0], v[1])
        self.y.write(a + 2.0 * b)""",
    "lambda": """
        sign = lambda x: 1.0 if x > 0.0 else -1.0
        self.y.write(sign(u) * sign(v[0]))""",
    "lambda in a branch": """
        y = 0.0
        if u > 0.0:
            square = lambda x: x * x
            y = square(u)
        self.y.write(y)""",
    "sum": "self.y.write(sum(k * x for k, x in zip(LIMITS, v)))",
    "sum with a start": "self.y.write(sum((x for x in v), 10.0) + sum((x for x in v), start=u))",
    "sum of a list": "self.y.write(sum([x * x for x in v]))",
    "sum of ints": "self.n = sum(i * i for i in range(COUNT)); self.y.write(u / (1 + self.n))",
    "sum of bools": """
        self.n = sum(x > u for x in v) + sum([x > 0.0 for x in v])
        self.y.write(self.n)""",
    "annotated nested function": """
        def half(x: float, by: "float" = 2.0) -> float:
            return x / by
        self.y.write(half(u) + half(u, by=4.0))""",
    "sum of rows": """
        self.y.write(sum(row[0] + sum(x for x in row) for row in self.m))
        self.m[0] += v""",
    "sum with conditions": "self.y.write(sum(x for x in v if x > 0.0 if x < u))",
    "sum of two loops": "self.y.write(sum(x * y for x in v for y in LIMITS if y > x))",
    "product": "self.y.write(math.prod(x for x in v) + math.prod((i for i in range(4)), start=2))",
    "any, all": """
        limit = abs(u)
        self.y.write(1.0 if any(abs(x) > limit for x in v) else 2.0)
        if all(abs(x) > limit for x in v):
            self.n += 1""",
    "any is lazy": "self.n = 0; any(self.bump() >= 2 for _ in range(5)); self.y.write(self.n + u)",
    "max, min": "self.y.write(max(abs(x) for x in v) - min([x * x for x in v]))",
    "max with a default": """
        self.y.write(max((x for x in v if x > u), default=-1.0) + min((x for x in v if x > u),
                     default=self.gain))""",
    "max of nothing raises": "self.y.write(max(x for x in v if x > u))",
    "first": "self.n = next((i for i, x in enumerate(v) if x > u), -1); self.y.write(self.n)",
    "number of elements": "self.y.write(len([x for x in v if x > u]))",
    "array": "self.w.write(np.array([x * k for k, x in enumerate(v)]))",
    "array of ints": "b = np.array([i * i for i in range(3)]); self.y.write(u * (b[2] // 3))",
    "array of bools": "self.w.write(np.where(np.array([x > u for x in v]), v, self.a))",
    "array of rows": "self.m = np.array([[x * k for x in v] for k in (1.0, 2.0)])",
    "matrix": "self.m = np.array([[i + 10.0 * j + u for j in range(3)] for i in range(2)])",
    "rows of a matrix": "self.m[:] = [[x for x in v], [x * x for x in v]]",
    "written list": "self.w.write([min(x, top) for x, top in zip(v, LIMITS)])",
    "member": "self.a = [0.5 * x + 0.5 * old for x, old in zip(v, self.a)]; self.w.write(self.a)",
    "a member that the elements read": """
        self.a = [self.norm() + x for x in v]
        self.w.write(self.a)""",
    "part of a member": "self.a[:2] = [x for x in v[1:]]; self.w.write(self.a)",
    "unpacked": """
        a, b, c = (2.0 * x for x in v)
        d, e = [x for x in (u, a)]
        self.y.write(a + b * c + e)""",
    "iterated list": """
        for k, x in enumerate([x * x for x in v]):
            self.a[k] += x
        self.w.write(self.a)""",
    "list in a variable": """
        errors = [x - old for x, old in zip(v, self.a)]
        self.a = v
        errors[0] = 0.0
        self.y.write(sum(errors) + errors[1] * len(errors) + max(abs(x) for x in errors))""",
    "list of a few numbers": """
        pair = [k * u for k in (1.0, 2.0)] + [3.0]
        self.y.write(pair[0] + pair[2])""",
    "tuple": "self.y.write(sum(tuple(k * u for k in LIMITS)))",
    "function of NumPy": "self.y.write(np.mean([x * x for x in v]) + np.max([abs(x) for x in v]))",
    "norm": "self.y.write(np.linalg.norm([x - 1.0 for x in v]))",
    "two comprehensions of one variable": """
        self.y.write(sum(x for x in v) + max(x for x in self.a) - min(v[i] for i in range(3)))
        self.a = v""",
    "names of the module": "self.y.write(sum(scale * x for scale in v for x in LIMITS) + scale)",
    "function of the module": "self.y.write(spread(v, u))",
    "effects in order": "self.y.write(self.bump() + sum(self.bump() * x for x in v) - self.bump())",
    "in a condition": "self.y.write(u if u > 0.0 and sum(x for x in v) > u else -u)",
    "in a loop": """
        n = 0
        while sum(x for x in self.a) < 3.0 and n < 10:
            self.a = [x + 0.5 for x in self.a]
            n += 1
        self.y.write(n)
        self.a = v""",
    "comprehension in a comprehension": """
        self.y.write(sum(max(abs(x - other) for other in v) for x in self.a))
        self.a = v""",
    "sum over ports": "self.y.write(sum(p.value for p in (self.u, self.error) if p.valid))",
    "conditions of ports": """
        if all(p.valid for p in [self.u, self.error]) or any(p.value > 1 for p in (self.u, self.o)):
            self.y.write(u)""",
    "array of ports": "self.w.write(np.array([p.value for p in (self.u, self.error, self.u)]))",
    "loop over ports": """
        for port, k in zip((self.y, self.o), (1.0, 2.0)):
            port.write(k * u)""",
    "dict by an enum": """
        self.mode = Mode.RUN if u > 0.0 else Mode.HOLD if u < -1.0 else Mode.OFF
        speeds = {Mode.OFF: 0.0, Mode.RUN: u, Mode.HOLD: -u}
        names = {"slow": 0.1, "fast": 2.0 * u}
        self.y.write(speeds[self.mode] + names["fast"])""",
    "dict with a default": """
        self.mode = Mode.RUN if u > 0.0 else Mode.HOLD if u < -1.0 else Mode.OFF
        speeds = {Mode.OFF: 0.0, Mode.RUN: u}
        self.y.write(speeds.get(self.mode, 7.0) + SPEEDS.get(self.mode, 9.0))""",
    "dict without a key": """
        speeds = {1: 0.0, 2: u}
        self.y.write(speeds[int(abs(u)) % 4])""",
    "elements as arguments": """
        f = lambda a, b: a - b * u
        self.y.write(product(*v) + product(u, *v[:2]) + f(*v[1:3]) + max(*v))""",
    "ints as bounds": """
        self.w.write([clamped(x, -1, 1) for x in v])
        self.y.write(clamped(u, low=0))""",
    "joined numbers and vectors": "self.w.write(np.r_[u, v[:2]] + np.c_[v, v][:, 1])",
    "errors of NumPy that are ignored": """
        with np.errstate(divide="ignore", invalid="ignore"):
            self.w.write(v / self.a)""",
    "enumerate from 1": "self.y.write(sum(k * x for k, x in enumerate(v, start=1)))",
    "arrays of a loop that are replaced": """
        self.a = 1.0 * v
        for old, b in zip((self.a, v), (1.0, 2.0)):
            self.a = self.a + b
            self.m[0, 1] += old[0]
        for row, x in zip(self.m, self.a):
            self.m = 0.5 * self.m + x
            self.a[2] += row[1]
        for k, (x, z) in enumerate(zip(reversed(self.a), v)):
            self.a = self.a * 0.9 + z
            self.m[1, k] = x
        self.w.write(self.m[1])""",
    "nested function in a comprehension over its values": """
        def half(x):
            return x / 2.0 + u
        self.w.write([half(x) for x in [half(z) for z in v]])""",
    "array that is replaced in a comprehension over it": """
        def swapped():
            self.a, self.m[0] = self.m[0].copy(), self.a
            return self.a[0]
        self.m[0] = v
        self.w.write([x - swapped() for k, x in enumerate(self.a)])""",
    "nested function in a comprehension": """
        def error(k):
            return v[k] - self.a[k]
        self.w.write([error(k) for k in range(COUNT)])
        self.a = v""",
}


@pytest.mark.parametrize("way", WAYS)
def test_a_nested_function_means_what_python_means(tmp_path: Path, way: str) -> None:
    cls = _loaded(tmp_path, WAYS[way])
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.largest_ulp == 0


REJECTED = {
    "dict in a comprehension": (
        "t = {3: 5.0, 2: 7.0}  # here\n        self.y.write(sum(t[k] for k in (2, 3)))",
        "a dict allocates memory",
    ),
    "dict with a key twice": (
        "t = {1: 9.0, 1: 11.0}  # here\n        self.y.write(t[self.n])",
        "a dict allocates memory",
    ),
    "start with an effect": (
        "self.y.write(sum((x for x in v), self.bump()))  # here",
        "a generator cannot be compiled",
    ),
    "function as a value": (
        "f = lambda x: x  # defined\n        g = f  # here",
        "`f`: f is a function, used as a value: call it",
    ),
    "lambda as an argument": (
        "self.y.write(max(v, key=lambda x: x))  # here",
        "max takes no key: use np.argmax, or a loop",
    ),
    "lambda that is called at once": (
        "self.y.write((lambda x: x)(u))  # here",
        "a function cannot be a value: write name = lambda …, then call name(…)",
    ),
    "recursion": (
        "def f(x):  # here\n            return f(x - 1.0) if x > 0.0 else 0.0\n"
        "        self.y.write(f(u))",
        "f calls itself: use a loop",
    ),
    "a function before its definition": (
        "self.y.write(f(u))  # here\n        f = lambda x: x",
        "f is not defined here: define it before, outside of if and loops",
    ),
    "a function of a branch": (
        "if u > 0:\n            f = lambda x: x\n        self.y.write(f(u))  # here",
        "f is not defined here: define it before, outside of if and loops",
    ),
    "two functions of one name": (
        "f = lambda x: x  # here\n        f = lambda x: 2 * x\n        self.y.write(f(u))",
        "f is set twice: use two names",
    ),
    "a number of arguments": (
        "f = lambda x, y=1.0: x + y + u\n        self.y.write(f(u, 1.0, 2.0))  # here",
        "f takes x, y=1.0: write f(x, y=1.0)",
    ),
    "a default that changes": (
        "f = lambda x, y=u: x + y  # here\n        self.y.write(f(u))",
        "a default of f is a variable: use the variable in f itself",
    ),
    "a variable of the function around it": (
        "def f(x):\n            nonlocal u  # here\n            u = x\n        f(1.0)\n"
        "        self.y.write(u)",
        "nonlocal is not compiled: declare a State, or return the value",
    ),
    "a decorator": (
        "@staticmethod  # here\n        def f(x):\n            return x\n"
        "        self.y.write(f(u))",
        "a decorator is not compiled: remove it",
    ),
    "a list whose size changes": (
        "self.w.write([x for x in v if x > u])  # here",
        "the size of this list is not fixed: use np.where, or a loop that counts",
    ),
    "a list as a value": (
        "b = [x for x in v]  # here\n        c = b\n        self.w.write(c)",
        "a list allocates memory: write np.array([… for …])",
    ),
    "a generator as a value": (
        "b = (x for x in v)  # here\n        self.y.write(sum(b))",
        "a generator cannot be compiled: write np.array([… for …]), or a loop",
    ),
    "next without a default": (
        "self.y.write(next(x for x in v if x > u))  # here",
        "next without a default may raise: write next(…, default)",
    ),
    "a := in a comprehension": (
        "self.y.write(sum((last := x) for x in v))  # here",
        "a := in a comprehension: write a loop",
    ),
    "a dict that grows": (
        "d = {1: u}  # here\n        d[2] = u\n        self.y.write(d[1])",
        "a dict allocates memory",
    ),
    "a dict of arrays": (
        "d = {1: v, 2: self.a}\n        self.w.write(d[self.n])  # here",
        "the values of a dict are not of one type: use if and elif",
    ),
    "a text that is no key": (
        "d = {'a': u, 'b': 1.0}\n        self.y.write(d['c'])  # here",
        "d has no 'c': use one of 'a', 'b'",
    ),
    "elements of an unknown number": (
        "self.y.write(clamped(*v))  # here",
        "* unpacks a value that has no fixed size: write the elements",
    ),
    "an int of any size as a bound": (
        "self.y.write(clamped(u, self.n))",
        "return max(low, min(high, x))`: is an int in one place and a float",
    ),
    "a name that is not defined": (
        "self.y.write(sum(x * missing for x in v))  # here",
        "missing is not defined",
    ),
    "an error in a nested function": (
        "def f(x):\n            print(x)  # here\n        f(u)",
        "printing calls the system",
    ),
}


@pytest.mark.parametrize("mistake", REJECTED)
def test_other_uses_of_nested_functions_are_rejected(tmp_path: Path, mistake: str) -> None:
    text, message = REJECTED[mistake]
    with pytest.raises(Mistake) as caught:
        object_file.compile_component(_loaded(tmp_path, text))
    assert message in str(caught.value)
    line = (tmp_path / "nested.py").read_text().splitlines()[caught.value.line - 1]
    assert line.endswith("# here") or "# here" not in text


def _loaded(folder: Path, text: str) -> type:
    file = folder / "nested.py"
    file.write_text(f"{HEAD}        {text.lstrip()}\n")
    return modules.components(modules.load(file))[0]
