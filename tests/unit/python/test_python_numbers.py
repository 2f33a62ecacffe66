"""Where Python's numbers have no value it raises; compiled code raises there, too."""

import math
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import lowering
from rtcf_compile.source import modules

FLOATS = [
    *(0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1.5, 2.5, -2.5, 3.0, 1e-300, 710.0, -710.0, 1e10, -1e10),
    *(2.0**63, -(2.0**63), 1e300, -1e300, math.inf, -math.inf, math.nan),
]
ONE = [
    *("int(x)", "round(x)", "math.floor(x)", "math.ceil(x)", "math.trunc(x)"),
    *(f"math.{name}(x)" for name in ("sqrt", "exp", "expm1", "log", "log1p", "log2", "log10")),
    *(f"math.{name}(x)" for name in ("sin", "cos", "tan", "asin", "acos", "atan")),
    *(f"math.{name}(x)" for name in ("sinh", "cosh", "tanh", "asinh", "acosh", "atanh")),
    *("x ** 2", "x ** 0.5", "x ** -1", "x ** -2.0", "0.0 ** x", "(-2.0) ** x", "2 ** n", "n ** n"),
]
TWO = ["x ** y", "math.pow(x, y)", "math.fmod(x, y)", "math.log(x, y)"]
WHOLE = ("int", "round", "math.floor", "math.ceil", "math.trunc", "2 ** n", "n ** n")
HEAD = """\
import math

from rtcf.component import Component, State


class Numbers(Component):
    which: State[int]
    x: State[float]
    y: State[float]
    n: State[int]
    out: State[float]
    whole: State[int]

    def update(self):
        x, y, n = self.x, self.y, self.n
"""


@pytest.fixture(scope="module")
def inside(tmp_path_factory: pytest.TempPathFactory) -> Any:
    lines = HEAD.splitlines()
    for number, text in enumerate(ONE + TWO):
        target = "whole" if text.startswith(WHOLE) else "out"
        lines += [f"        if self.which == {number}:", f"            self.{target} = {text}"]
    file = tmp_path_factory.mktemp("numbers") / "numbers.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls, Inside(lowering.compile_component(cls))


def by_python(text: str, x: float, y: float, n: int) -> Any:
    """Return the value, or None where Python raises, makes a complex number or no int64."""
    try:
        value = eval(text, {"math": math, "x": x, "y": y, "n": n})
    except (ValueError, OverflowError, ZeroDivisionError):
        return None
    fits = not isinstance(value, int) or -(2**63) <= value < 2**63
    return value if fits and not isinstance(value, complex) else None


@pytest.mark.parametrize("text", ONE + TWO)
def test_it_has_a_value_where_python_has_one(text: str, inside: Any) -> None:
    cls, compiled = inside
    for x in FLOATS:
        for y in FLOATS if text in TWO else (0.0,):
            n = int(x) % 5 if abs(x) < 100 else 3
            if text == "2 ** n" and x == -2.5:
                n = -1
            record = cls()._record
            record["which"], record["x"], record["y"] = (ONE + TWO).index(text), x, y
            record["n"] = n
            said = compiled.call("update", record)
            expected = x * x if text == "x ** 2" else by_python(text, x, y, n)  # a product
            if isinstance(expected, float) and text.endswith("** n"):
                expected = None  # an int to a negative power
            assert (said is None) == (expected is not None), f"{text} of {x}, {y}, {n}: {said}"
            if expected is not None:
                found = record["whole" if text.startswith(WHOLE) else "out"].item()
                assert np.isclose(found, expected, rtol=1e-15, atol=0.0, equal_nan=True), (x, y)


@pytest.mark.parametrize("text", ["int(x)", "round(x)", "math.floor(x)"])
def test_it_says_so(text: str, inside: Any) -> None:
    cls, compiled = inside
    record = cls()._record
    record["which"], record["x"] = ONE.index(text), math.nan
    assert "ValueError: cannot convert float NaN to integer" in compiled.call("update", record)
