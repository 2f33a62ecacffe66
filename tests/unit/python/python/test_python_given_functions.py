"""Functions that are given to functions, lambdas of the module, and functions that other functions
have made: they mean what Python means, or are rejected.
"""

from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
import functools
import math

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


def rk4(f, x, u, dt):
    k1 = f(x, u)
    k2 = f(x + 0.5 * dt * k1, u)
    k3 = f(x + 0.5 * dt * k2, u)
    k4 = f(x + dt * k3, u)
    return x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def decay(x, u):
    return u - x


def newton(f, df, x, n=3):
    for _ in range(n):
        x = x - f(x) / df(x)
    return x


def twice(g, x):
    return newton(g, lambda y: 2.0 * y + 1e-3, x) + applied(g, x)


def applied(h, x):
    return h(x)


K = 1.0


def scaled(g, x, k=K):
    return k * g(x)


K = 2.0
LIMIT = 100.0


def made(k):
    c = 2.0

    def f(x, g=k):
        return c * g * x

    return f


k = 5.0
tripled = made(3.0)


def plain(x):
    return 2.0 * x


def wrapped(f):
    @functools.wraps(f)
    def inner(x):
        return 2.0 * f(x)

    return inner


doubled = wrapped(plain)
again = made(made(3.0)(1.0))


def shifted(f, x):
    def by(g, y):
        return g(y) + f(y)

    return applied(lambda y: f(y) + 1.0, x) + by(lambda y: f(y) - 2.0, x)


def kept(f, x):
    g = f
    return g(x)


def overwritten(f, x):
    x = f(x)
    f = x
    return f


def endless(f, x):
    return endless(lambda y: f(y) + 1.0, x)


skew = lambda w: np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
up, down = (lambda x: x + 1.0), (lambda x: x - 1.0)


def deadband(width):
    def apply(x):
        return 0.0 if abs(x) < width else x - width * np.sign(x)

    return apply


def cubic(amount):
    return lambda x: (1.0 - amount) * x + amount * x**3


def composed(f, k):
    return lambda x: k * f(x)


def counter():
    count = 0

    def step(x):
        nonlocal count
        count += 1
        return x + count

    return step


narrow, wide, curve = deadband(0.05), deadband(0.1), cubic(0.3)
curves = composed(curve, np.array([1.0, 2.0]))
counted = counter()


class Given(Component):
    u: Input[float]
    p: Input[float]
    v: Input[np.float64, 3]
    y: Output[float]
    x: State[np.float64, 2]
    m: State[np.float64, 3, 3]
    w: Parameter[float] = 3.0

    LIMIT = 3.0

    def top(self, f, x, limit=LIMIT):
        return min(f(x), limit)

    def dynamics(self, x, u):
        return np.array([x[1], -self.w**2 * x[0] + u])

    def moved(self, x, by):
        self.x[0] += by
        return self.x[0] + x

    def integrated(self, f, x, h):
        return x + h * f(x)

    @staticmethod
    def euler(f, x, h):
        return x + h * f(x)

    def update(self):
        u, k = self.u.value, 0.5 * self.w
"""

WAYS = {
    "a method": "self.x = rk4(self.dynamics, self.x, u, 1e-3)",
    "a method with effects": "self.y.write(rk4(self.moved, 1.0, u, 1e-3))",
    "a function of the module": "self.y.write(rk4(decay, 1.0, u, 0.01))",
    "lambdas that use variables and members": """
        z = rk4(lambda x, u: -k * x + u, 1.0, u, 0.01)
        z += rk4(dt=0.01, f=lambda x, u: -k * x * self.w + u, x=1.0, u=u)
        self.y.write(z)
""",
    "functions of math and NumPy": """
        z = newton(math.sin, math.cos, 0.3, 2)
        self.y.write(z + newton(np.sin, x=0.3, df=np.cos))
""",
    "nested functions, passed on": """
        def g(x):
            return x * x - abs(k) - 1.0

        self.y.write(newton(g, lambda x: 2 * x, 1.0) + twice(g, 2.0))
""",
    "methods that take functions": """
        self.x = self.integrated(lambda v: -v * k, self.x, 0.01)
        self.x = self.euler(lambda v: -v * k, self.x, 0.01)
""",
    "copies for different functions": """
        self.y.write(shifted(up, u) + 2.0 * shifted(down, u) + shifted(math.sin, u))
        self.x[0] = shifted(lambda x: x * k, u) - shifted(lambda x: x / k, u)
""",
    "defaults, which are computed once": """
        self.y.write(scaled(math.cos, u) + self.top(lambda x: x * 10.0, u) + tripled(u) + again(u))
""",
    "a function that wraps another": "self.y.write(doubled(u))",
    "lambdas of a loop that is written out": """
        for port in (self.u, self.p, self.u):
            self.x[0] = 2.0 * self.x[0] + applied(lambda x: port.value * x, 1.0)
""",
    "nested functions that take functions": """
        def own(q, v):
            return q(v) + k

        self.x[0] = own(lambda s: s * u, self.x[0] * 1e-3)
        values = [own(up, q) for q in (0.1, 0.2)]
        self.x[1] = sum(own(lambda s: s * q, u) for q in (0.1, 0.2)) + values[0] - values[1]
""",
    "a variable that changes between calls": """
        z = 0.0
        for j in range(3):
            z += applied(lambda x: x * k, u)
            k = k + j
        self.y.write(z)
""",
    "lambdas of the module": """
        self.m[:] = skew(self.v.value)
        self.y.write(up(u) * down(u))
""",
    "functions that functions have made": """
        self.x = curves(narrow(u) + wide(u))
        self.y.write(curve(u) + rk4(lambda x, u: narrow(x) - wide(u), 1.0, u, 0.01))
""",
}


@pytest.mark.parametrize("way", WAYS)
def test_functions_are_given(tmp_path: Path, way: str) -> None:
    cls = _loaded(tmp_path, WAYS[way])
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.largest_ulp == 0


REJECTED = {
    "a function that is kept": (
        "self.y.write(kept(lambda x: x, u))",
        "f is a function, used as a value",
    ),
    "a function that is overwritten": (
        "self.y.write(overwritten(lambda x: x, u))  # here",
        "overwritten sets f, which is a function",
    ),
    "functions of functions without end": (
        "self.y.write(endless(lambda x: x, u))",
        "functions are given to functions without end",
    ),
    "a function with a variable of its own that changes": (
        "self.y.write(counted(u))",
        "nonlocal is not compiled",
    ),
    "an error in a function that is given": (
        "self.y.write(applied(lambda x: print(x), u))  # here",
        "printing calls the system",
    ),
    "a function that takes other arguments": (
        "self.y.write(applied(lambda x, y: x, u))",
        "h takes x, y",
    ),
}


@pytest.mark.parametrize("mistake", REJECTED)
def test_other_uses_of_functions_are_rejected(tmp_path: Path, mistake: str) -> None:
    text, message = REJECTED[mistake]
    with pytest.raises(Mistake) as caught:
        object_file.compile_component(_loaded(tmp_path, text))
    assert message in str(caught.value)
    line = (tmp_path / "given.py").read_text().splitlines()[caught.value.line - 1]
    assert line.endswith("# here") or "# here" not in text


def _loaded(folder: Path, text: str) -> type:
    file = folder / "given.py"
    file.write_text(f"{HEAD}        {text.lstrip()}\n")
    return modules.components(modules.load(file))[0]
