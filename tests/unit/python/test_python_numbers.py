"""Where Python's numbers have no value it raises; compiled code raises there, too."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison import verify
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
    *("x ** 0", "n ** 0", "n ** -1", "2 ** -2"),
]
TWO = ["x ** y", "math.pow(x, y)", "math.fmod(x, y)", "math.log(x, y)"]
WHOLE = ("int", "round", "math.floor", "math.ceil", "math.trunc", "2 ** n", "n ** n", "n ** 0")
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


ARRAYS = """\
import numpy as np
from rtcf.component import Component, Input, State


class Powers(Component):
    which: State[int]
    a: State[np.float64, 3]
    k: State[np.int64, 3]
    low: Input[float]
    high: Input[float]
    out: State[np.float64, 3]

    def update(self):
"""
OF_ARRAYS = [
    *("self.a ** 0", "self.a ** 2", "self.a ** -1", "self.a ** -2", "self.a ** self.k"),
    *("self.a ** self.which", "2.0 ** self.k", "self.k ** 2", "self.k ** 0"),
    *("self.k ** -1", "self.k ** self.k", "2 ** self.k"),
]


def test_powers_of_arrays_are_those_of_numpy(tmp_path: Path) -> None:
    lines = ARRAYS.splitlines()
    for number, text in enumerate(OF_ARRAYS):
        lines += [f"        if self.which == {number}:", f"            self.out[:] = {text}"]
    file = tmp_path / "powers.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    compiled = Inside(lowering.compile_component(cls))
    for number, text in enumerate(OF_ARRAYS):
        for numbers in ((0, 0, 0), (0, 1, 2), (3, -2, 0), (-1, -3, 5)):
            component = cls()
            record = component._record
            record["which"], record["a"], record["k"] = number, numbers, numbers
            found = record.copy()
            said, expected = compiled.call("update", found), None
            with np.errstate(all="ignore"):
                try:
                    component.update()
                except ValueError as error:
                    expected = error
            assert (said is None) == (expected is None), f"{text} of {numbers}: {said}"
            assert np.array_equal(found["out"], record["out"], equal_nan=True), text


def test_a_bound_that_is_nan_gives_nan_in_the_comparison_too(tmp_path: Path) -> None:
    file = tmp_path / "bounds.py"
    file.write_text(ARRAYS + "        self.out[:] = np.clip(self.a, self.low.value, 1.0)\n"
                    "        self.out[0] = np.clip(0.5, -1.0, self.high.value)\n")  # fmt: skip
    (cls,) = modules.components(modules.load(file))
    compiled = lowering.compile_component(cls)
    component: Any = cls()
    component.low.put(math.nan)
    component.high.put(math.nan)
    record = component._record.copy()
    assert Inside(compiled).call("update", record) is None
    assert np.isnan(record["out"]).all()
    assert verify.compare(cls, compiled, 1000, edges=0.5).differences == []


def test_sums_of_unsigned_ints_are_ints(tmp_path: Path) -> None:
    body = """\
        self.k[0] = self.small.value.sum()
        self.k[1] = np.sum(self.table.value)
        self.out[:] = np.sum(self.table.value, axis=1)
"""
    file = tmp_path / "sums.py"
    ports = "    small: Input[np.uint8, 4]\n    table: Input[np.uint32, 3, 2]\n"
    file.write_text(ARRAYS.replace("    low:", f"{ports}    low:") + body)
    (cls,) = modules.components(modules.load(file))
    component: Any = cls()
    component.small.put(np.array([255, 255, 255, 255], np.uint8))
    component.table.put(np.full((3, 2), 2**32 - 1, np.uint32))
    record = component._record.copy()
    assert Inside(lowering.compile_component(cls)).call("update", record) is None
    component.update()
    for name in ("k", "out"):
        assert np.array_equal(record[name], component._record[name])
