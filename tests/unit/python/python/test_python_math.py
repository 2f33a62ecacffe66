"""Functions of math have exactly the values of Python, and raise where Python raises."""

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

# Of x, y and z, floats, n, k and m, ints, on, a bool, v and w, vectors of floats, and i, of ints.
OF_FLOATS = [
    *("math.hypot(x, y)", "math.hypot(x, y, z)", "math.hypot(x)", "math.hypot()"),
    *("math.hypot(n, x, on)", "math.dist(v, w)", "math.dist((x, y), (z, 1))"),
    *("math.dist(v, [x] * 4)",),
    *("math.fsum(v)", "math.fsum((x, y, z, 1e16, -x))", "math.fsum([x, n, on, y])", "math.fsum(i)"),
    *("math.prod(v)", "math.prod((x, n, y))", "math.prod(v, start=x)"),
    *("math.prod((n, k), start=x)",),
    *("math.gamma(x)", "math.lgamma(x)", "math.gamma(n)", "math.lgamma(n)", "math.erf(x)"),
    *("math.erfc(x)", "math.erf(on)", "math.cbrt(x)", "math.exp2(x)", "math.cbrt(n)"),
    *("math.nextafter(x, y)", "math.nextafter(n, math.inf)", "math.ulp(x)", "math.ulp(n)"),
    *("math.ldexp(x, n)", "math.ldexp(k, n)", "math.frexp(x)[0]", "math.frexp(x)[1]"),
    *("math.modf(x)[0]", "math.modf(x)[1]", "math.modf(n)[1]", "math.copysign(x, y)"),
    *("math.copysign(n, y)", "math.degrees(x)", "math.radians(x)", "math.degrees(n)"),
    *("math.isclose(x, y)", "math.isclose(x, y, rel_tol=0.1, abs_tol=z)", "math.isclose(n, k)"),
    *("math.fabs(x)", "math.atan2(x, y)"),
]
OF_INTS = [
    *("math.isqrt(n)", "math.factorial(n)", "math.comb(n, k)", "math.perm(n, k)", "math.perm(n)"),
    *("math.gcd(n, k)", "math.gcd(n, k, m)", "math.gcd(n)", "math.gcd()", "math.lcm(n, k)"),
    *("math.lcm(n, k, m)", "math.lcm()", "math.lcm(n)", "math.prod((n, k, m))", "math.prod(i)"),
    *("math.isqrt(on)", "math.comb(n, on)", "math.prod((on, on))", "math.gcd(on, k)"),
]
HEAD = """\
import math

import numpy as np
from rtcf.component import Component, State


class Functions(Component):
    which: State[int]
    x: State[float]
    y: State[float]
    z: State[float]
    n: State[int]
    k: State[int]
    m: State[int]
    on: State[bool]
    v: State[np.float64, 4]
    w: State[np.float64, 4]
    i: State[np.int64, 3]
    out: State[float]
    whole: State[int]

    def update(self):
        x, y, z, n, k, m, on = self.x, self.y, self.z, self.n, self.k, self.m, self.on
        v, w, i = self.v, self.w, self.i
"""
FLOATS = [
    *(0.0, -0.0, 0.5, 1.0, -1.0, 1.5, -1.5, 2.0, 3.0, 23.0, 24.5, 171.5, 200.5, -150.5, -200.5),
    *(1e-21, 1e-300, 5e-324, -5e-324, 1e-310, 2.2250738585072014e-308, 1e155, 1e300, -1e300),
    *(1.7976931348623157e308, 1e16, -1e16, 2.0**53, math.inf, -math.inf, math.nan),
]
INTS = [
    *(0, 1, -1, 2, 3, 4, 7, 12, 20, 21, 60, 62, 64, 66, 67, 100, 128, 1000, 2**31, 3037000499),
    *(3037000499**2, 3037000499**2 - 1, 2**52 - 1, 2**53 + 1, 2**62, 2**63 - 1, -(2**63), -6),
]


def _inside(folder: Path) -> Any:
    lines = HEAD.splitlines()
    for number, text in enumerate(OF_FLOATS + OF_INTS):
        target = "self.out = float" if text in OF_FLOATS else "self.whole = int"
        lines += [f"        if self.which == {number}:", f"            {target}({text})"]
    file = folder / "functions.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls, Inside(object_file.compile_component(cls))


@pytest.fixture(scope="module")
def inside(tmp_path_factory: pytest.TempPathFactory) -> Any:
    return _inside(tmp_path_factory.mktemp("functions"))


def _drawn(count: int) -> list[dict[str, Any]]:
    draw = random.Random(1)
    found = []
    for number in range(count):
        any_float: Callable[[], float] = draw.choice(
            [
                lambda: draw.choice(FLOATS),
                lambda: draw.uniform(-5.0, 5.0),
                lambda: draw.uniform(-220.0, 220.0),
                lambda: draw.uniform(-1.0, 1.0) * 10.0 ** draw.randrange(-308, 308),
                lambda: draw.uniform(-1.0, 1.0) * 2.0 ** draw.randrange(-8, 8),
            ]
        )
        any_int: Callable[[], int] = draw.choice(
            [
                lambda: draw.choice(INTS),
                lambda: draw.randrange(70),
                lambda: draw.randrange(-1100, 1100),
                lambda: draw.randrange(-(2**63), 2**63),
            ]
        )
        values: dict[str, Any] = {name: any_float() for name in "xyz"}
        if number < len(FLOATS):
            values["x"] = FLOATS[number]
        values |= {name: any_int() for name in "nkm"}
        values |= {name: np.array([any_float() for _ in range(4)]) for name in "vw"}
        values["i"] = np.array([draw.randrange(-1000, 1000) for _ in range(3)])
        values["on"] = bool(number % 2)
        found.append(values)
    return found


def by_python(text: str, values: dict[str, Any]) -> Any:
    """Return the value, or the exception; OverflowError for an int beyond int64."""
    # Python's products of NumPy numbers are those of floats.
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value
             for name, value in values.items()}  # fmt: skip
    if text in OF_INTS:
        ints = [plain[name] for name in "nkm" if name in text]
        huge = "comb(n, k)" in text and 0 <= plain["k"] <= plain["n"] and min(
            plain["k"], plain["n"] - plain["k"]
        ) > 64  # fmt: skip
        huge |= "factorial" in text and ints[0] > 20
        huge |= "perm(n)" in text and ints[0] > 20
        huge |= "perm(n, k)" in text and 20 < plain["k"] <= plain["n"]
        if huge:
            return OverflowError()
    try:
        value = eval(text, {"math": math, **plain})
    except (ValueError, OverflowError) as error:
        return error
    if text in OF_INTS and not -(2**63) <= value < 2**63:
        return OverflowError()
    return value


@pytest.mark.parametrize("text", OF_FLOATS + OF_INTS)
def test_a_function_has_the_value_of_python(text: str, inside: Any) -> None:
    cls, compiled = inside
    for values in _drawn(1500):
        record = cls()._record
        record["which"] = (OF_FLOATS + OF_INTS).index(text)
        for name, value in values.items():
            record[name] = value
        said, expected = compiled.call("update", record), by_python(text, values)
        if isinstance(expected, OverflowError) and "prod" in text:
            continue  # ints wrap around
        if isinstance(expected, Exception):
            assert said is not None and type(expected).__name__ in said, (values, said)
            continue
        assert said is None, (values, said)
        if text in OF_INTS:
            assert record["whole"] == int(expected), values
            continue
        wanted = np.float64(expected)
        found = record["out"]
        assert found.tobytes() == wanted.tobytes() or (found != found and wanted != wanted), (
            values, found, wanted,
        )  # fmt: skip
