"""Where an operation of Python raises, compiled code raises, too."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

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
    return cls, Inside(object_file.compile_component(cls))


def by_python(text: str, x: float, y: float, n: int) -> Any:
    """Return the value, or None if Python raises or gives a complex number or no int64."""
    try:
        value = eval(text, {"math": math, "x": x, "y": y, "n": n})
    except (ValueError, OverflowError, ZeroDivisionError):
        return None
    fits = not isinstance(value, int) or -(2**63) <= value < 2**63
    return value if fits and not isinstance(value, complex) else None


@pytest.mark.parametrize("text", ONE + TWO)
def test_compiled_code_has_a_value_where_python_has_one(text: str, inside: Any) -> None:
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
def test_compiled_code_raises_with_a_message(text: str, inside: Any) -> None:
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


def test_powers_of_arrays_match_numpy(tmp_path: Path) -> None:
    lines = ARRAYS.splitlines()
    for number, text in enumerate(OF_ARRAYS):
        lines += [f"        if self.which == {number}:", f"            self.out[:] = {text}"]
    file = tmp_path / "powers.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    compiled = Inside(object_file.compile_component(cls))
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
            assert np.array_equal(found["out"], component._record["out"], equal_nan=True), text


def test_a_bound_of_nan_gives_nan_compiled_and_interpreted(tmp_path: Path) -> None:
    file = tmp_path / "bounds.py"
    file.write_text(ARRAYS + "        self.out[:] = np.clip(self.a, self.low.value, 1.0)\n"
                    "        self.out[0] = np.clip(0.5, -1.0, self.high.value)\n")  # fmt: skip
    (cls,) = modules.components(modules.load(file))
    compiled = object_file.compile_component(cls)
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
    assert Inside(object_file.compile_component(cls)).call("update", record) is None
    component.update()
    for name in ("k", "out"):
        assert np.array_equal(record[name], component._record[name])


SHIFTS = """\
import numpy as np
from rtcf.component import Component, State


def halved(x, n):
    return x >> n


class Shifts(Component):
    which: State[int]
    x: State[int]
    n: State[int]
    small: State[np.int8]
    k: State[np.int64, 5]
    b: State[np.uint8, 5]
    c: State[np.int64, 5]
    whole: State[int]
    out: State[np.int64, 5]

    def update(self):
        x, n, k, b, c = self.x, self.n, self.k, self.b, self.c
"""
# Statements that set `whole` from Python ints.
OF_INTS = [
    *("x << n", "x >> n", "halved(x, n)", "1 << n", "x >> 70", "x << 64", "self.small >> n"),
    *("x << (n & 63)", "x << True", "x >> (n & 7) << 1"),
]
# Statements, and the value that they leave in `whole`.
OF_NAMES = ["x <<= n", "x >>= n", "self.x <<= n", "self.x >>= n"]
# Statements that set `out` from NumPy arrays.
OF_VECTORS = [
    *("k << n", "k >> n", "k << c", "k >> c", "1 << c", "x >> c", "k[::-1] >> 64", "b << 1"),
    *("b >> b", "b << b", "np.left_shift(k, c)", "np.right_shift(k, n)", "k << -1", "k >> -1"),
]


def _goes_round(value: int) -> int:
    return (value + 2**63) % 2**64 - 2**63


@pytest.fixture(scope="module")
def shifts(tmp_path_factory: pytest.TempPathFactory) -> Any:
    lines = SHIFTS.splitlines()
    steps = [f"self.whole = {text}" for text in OF_INTS]
    steps += [f"{text}; self.whole = {text.split()[0]}" for text in OF_NAMES]
    steps += [f"self.out[:] = {text}" for text in OF_VECTORS]
    steps += ["k <<= 3; self.out[:] = k", "k[1:] >>= c[1:]; self.out[:] = k"]
    for number, text in enumerate(steps):
        lines += [f"        if self.which == {number}:"]
        lines += [f"            {each}" for each in text.split("; ")]
    file = tmp_path_factory.mktemp("shifts") / "shifts.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls, Inside(object_file.compile_component(cls)), steps


COUNTS = (0, 1, 7, 8, 62, 63, 64, 65, 127, 128, 1000, -1, -64)


@pytest.mark.parametrize("text", OF_INTS + OF_NAMES)
def test_ints_are_shifted_as_in_python(text: str, shifts: Any) -> None:
    cls, compiled, steps = shifts
    which = next(i for i, each in enumerate(steps) if text in each)
    for x in (0, 1, -1, 5, -7, 2**62, -(2**63), 2**63 - 1):
        for n in COUNTS:
            record = cls()._record
            record["which"], record["x"], record["n"], record["small"] = which, x, n, x % 5 - 3
            said = compiled.call("update", record)
            names: dict[str, Any] = {"x": x, "n": n, "halved": lambda x, n: x >> n}
            plain = text.replace("self.small", str(x % 5 - 3)).replace("self.x", "x")
            try:
                if "=" in text:
                    exec(plain, names)
                expected = names["x"] if "=" in text else eval(plain, names)
            except ValueError as error:
                assert said is not None and f"ValueError: {error}" in said
                continue
            assert said is None
            assert record["whole"] == _goes_round(expected), (x, n)


@pytest.mark.parametrize("text", OF_VECTORS)
def test_arrays_are_shifted_as_in_numpy(text: str, shifts: Any) -> None:
    cls, compiled, steps = shifts
    names = {
        "k": np.array([1, -1, 77, -(2**63), 2**62]),
        "b": np.array([1, 2, 8, 9, 200], np.uint8),
    }
    for n in COUNTS:
        for c in ([0, 1, 63, 64, 65], [-1, 3, 1000, -64, 2]):
            record = cls()._record
            record["which"] = steps.index(f"self.out[:] = {text}")
            values = {**names, "c": np.array(c), "n": n, "x": -77}
            for name, value in values.items():
                record[name] = value
            assert compiled.call("update", record) is None
            with np.errstate(all="ignore"):
                assert np.array_equal(record["out"], eval(text, {**values, "np": np})), (n, c)


def test_arrays_are_shifted_in_place(shifts: Any) -> None:
    cls, compiled, steps = shifts
    for which in (len(steps) - 2, len(steps) - 1):
        component = cls()
        record = component._record
        record["which"], record["k"], record["c"] = which, [1, -5, 7, 9, 2**60], [0, 1, 2, 64, 63]
        found = record.copy()
        assert compiled.call("update", found) is None
        component.update()
        record = component._record
        assert np.array_equal(found["out"], record["out"])
        assert np.array_equal(found["k"], record["k"])


NAMES = """\
        on, off, a, b, v = self.on.value, self.off.value, self.a.value, self.b.value, self.v.value
        x, n = self.x.value, self.n.value
"""
MEMBERS = """\
import numpy as np
from rtcf.component import Component, Input, State


def largest(a, b):
    return max(a, b)


def either(on, n):
    if on:
        return n
    return 0.5


class Tried(Component):
    which: State[int]
    on: Input[bool]
    off: Input[bool]
    a: Input[np.bool_, 3]
    b: Input[np.bool_, 3]
    v: Input[np.float64, 3]
    x: Input[float]
    n: Input[int]
    f: State[float]
    k: State[int]
    flag: State[bool]
    z: State[np.float64, 3]
"""
WITH_BOOLS = [
    *("self.f = float(on)", "self.k = int(off)", "self.k = on + off", "self.k = (x > 0) + (n > 0)"),
    *("self.k = on * 3 - off", "self.flag = max(on, off)", "self.flag = min(on, off, x > 0.0)"),
    *("self.f = x * on", "self.f = x * a[0]", "self.k = n + a[1]", "self.z[:] = a * v"),
    *("self.k = np.sum(a)", "self.k = a.sum() + b.sum()", "self.k = sum(a)", "self.z[:] = a * 2"),
    *("self.f = np.mean(a)", "self.flag = a.any() and not b.all()", "self.z[:] = a & b"),
    *("self.z[:] = a | b", "self.z[:] = a ^ b", "self.z[:] = ~a", "self.flag = a[0] & b[0]"),
    *("self.z[:] = np.where(a, v, 0.0)", "self.k = np.cumsum(a)[2]", "self.f = a[0] / 2.0"),
    *("self.flag = largest(on, off)", "self.k = np.argmax(a)", "self.z[:] = a + v", "self.k += on"),
    *("self.f = float(a[0])", "self.k = int(b[1]) + int(b[0])", "self.z[:] = np.minimum(a, b)"),
    *("self.k = -on", "self.z[:] = a == b"),
]
REFUSED_BOOLS = {
    "self.k = a[0] + b[0]": "logic",
    "self.k = a[0] * b[0] + 1": "logic",
    "self.k = (v[0] > 0.0) + (v[1] > 0.0)": "logic",
    "self.z[:] = a + b": "logic",
    "self.z[:] = (v > 0.0) - (v < 0.0)": "logic",
    "self.z[:] = a * b": "logic",
    "self.z[:] = np.add(a, b)": "logic",
    "self.z[:] = a ** 2": "logic",
    "self.z[:] = a + on": "logic",
    "self.k = -a[0]": "bools",
    "self.flag = ~on": "write not",
    "self.f = np.ptp(a)": "bools",
    "self.f = np.sin(on)": "np.sin",
    "c = a[0]\nc += b[0]  # here\nself.k = c + 1": "logic",
}
SMALL = [
    "y = 0\nfor i in range(3):\n    y += v[i]\nself.f = y",
    "y = 1 if on else 0.5\nself.f = y * x",
    "y = 0\nif on:\n    y = 2 * y + 0.5\nself.f = y // 2",
    "y = -3\nif on:\n    y = x\nself.f = 2 * y + len(v)",
    "y = 0.5\nfor i in range(3):\n    if on:\n        y = i\nself.f = y",
    "y = 0\nfor i in range(4):\n    y += 1 if on else 0.25\nself.f = y",
    "y = len(v) if on else x\nself.f = y",
    "y = True if on else 0.25\nself.f = y * 2",
    "self.f = max(0, x) + min(x, 10)",
    "y = float(n) if on else x\nself.f = y",
    "y = n % 10 if on else x\nself.f = y",
    "self.f = np.where(on, n, 0.5)",
    "y = n\ny = y * 0.5\nself.f = y",
    "self.k = n if on else 3\nself.f = n",
]
LARGE = {
    "y = n if on else 0.5  # here\nself.f = y": "is an int in one place",
    "y = 0.5\nif on:\n    y = n  # here\nself.f = y": "y is an int in one place",
    "y = self.k  # here\nfor i in range(3):\n    y = y * 0.5\nself.f = y": "y is an int in",
    "self.f = max(n, 0.5)  # here": "an int in one place",
    "self.f = min(x, self.k)  # here": "an int in one place",
    "y = 1\nfor i in range(9):  # here\n    y = y * 1000\nif on:\n    y = 0.5\nself.f = y": "y is",
    "y = 1 if on else 0.5\nself.f = y * n % 7  # here": "y is an int in one place",
    "self.f = either(on, n)": "is an int in one place",
}


def _class(folder: Path, ways: list[str]) -> Any:
    """Return a component that runs one of several statements."""
    lines = MEMBERS.splitlines()
    for number, way in enumerate(ways):
        lines += ["", f"    def way_{number}(self):", *NAMES.splitlines()]
        lines += [f"        {line}" for line in way.split("\n")]
    lines += ["", "    def update(self):"]
    for number in range(len(ways)):
        lines += [f"        if self.which == {number}:", f"            self.way_{number}()"]
    file = folder / "tried.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls


@pytest.mark.parametrize("ways", [WITH_BOOLS, SMALL], ids=["bools", "small ints"])
def test_numbers_match_python(ways: list[str], tmp_path: Path) -> None:
    cls = _class(tmp_path, ways)
    compiled = Inside(object_file.compile_component(cls))
    draw = np.random.default_rng(1)
    for which in [*range(len(ways))] * 8:
        component: Any = cls()
        for name in ("on", "off"):
            getattr(component, name).put(bool(draw.random() < 0.5))
        for name in ("a", "b"):
            getattr(component, name).put(draw.random(3) < 0.5)
        component.v.put(draw.normal(size=3))
        component.x.put(draw.normal() * 10)
        component.n.put(int(draw.integers(-20, 20)))
        component.which = which
        record = component._record.copy()
        assert compiled.call("update", record) is None
        component.update()
        for name in ("f", "k", "flag", "z"):
            assert np.array_equal(record[name], component._record[name]), ways[which]


@pytest.mark.parametrize("way", [*REFUSED_BOOLS, *LARGE])
def test_results_that_differ_from_python_are_rejected(way: str, tmp_path: Path) -> None:
    cls = _class(tmp_path, [way])
    with pytest.raises(Mistake, match={**REFUSED_BOOLS, **LARGE}[way]) as raised:
        object_file.compile_component(cls)
    text = (tmp_path / "tried.py").read_text().splitlines()
    marked = next((i for i, line in enumerate(text, 1) if line.endswith("# here")), 0)
    first = text.index("    def way_0(self):") + 4
    in_either = text.index("        return n") + 1
    assert raised.value.line == (in_either if "either" in way else marked or first)


DIVISIONS = """\
import enum

import numpy as np
from rtcf.component import Component, State


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1


class Divisions(Component):
    which: State[int]
    x: State[float]
    n: State[int]
    y: State[float]
    m: State[int]
    on: State[bool]
    mode: State[Mode]
    last: State[float | None]
    g: State[np.float32, 3]

    def narrow(self, x):
        y = self.g * 0.1
        x = x / self.mode
        return x if y[0] < 1.0 else 0.0

    def update(self):
        x, n, y, m, on, mode = self.x, self.n, self.y, self.m, self.on, self.mode
"""
# Statements that divide x or n by a number that is 0 or not.
DIVIDING = [
    *("x /= y", "x //= y", "x %= y", "n //= m", "n %= m", "x /= m", "n //= mode", "n %= mode"),
    *("x /= mode", "x = x / mode", "x /= on", "x /= self.last", "x = self.narrow(x)"),
    *("x = x / y", "n = n // m", "n = n % m", "x = divmod(x, y)[1]", "n = divmod(n, mode)[0]"),
    *("self.x /= y", "self.n //= mode"),
]


def test_single_numbers_are_not_divided_by_zero(tmp_path: Path) -> None:
    lines = DIVISIONS.splitlines()
    for number, text in enumerate(DIVIDING):
        name = text.split()[0]
        lines += [f"        if self.which == {number}:", f"            {text}"]
        lines += [] if "." in name else [f"            self.{name} = {name}"]
    file = tmp_path / "divisions.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    compiled = Inside(object_file.compile_component(cls))
    for which, text in enumerate(DIVIDING):
        for y, m, on in ((0.0, 0, False), (-0.0, 0, False), (0.75, -3, True)):
            component: Any = cls()
            component.which, component.x, component.n = which, 3.5, 7
            component.y, component.m, component.on, component.last = y, m, on, y
            component.mode = int(on)
            record = component._record.copy()
            said = compiled.call("update", record)
            if not on:
                assert said is not None and "ZeroDivisionError: " in said, text
                continue
            component.update()
            assert said is None, text
            assert (record["x"], record["n"]) == (component.x, component.n), text


QUOTIENTS = """\
import numpy as np
from rtcf.component import Component, State


class Quotients(Component):
"""
OF_PAIRS = ["a // b", "a % b", "np.floor_divide(a, b)", "np.mod(a, b)", "a // -1", "a % -1"]


def test_arrays_of_ints_are_divided_as_by_numpy(tmp_path: Path) -> None:
    # The smallest int by -1, too: the machine's instruction ends the process.
    steps = []
    lines = QUOTIENTS.splitlines()
    kinds: list[Any] = [np.int8, np.int16, np.int32, np.int64, np.uint8]
    for kind in kinds:
        limits = np.iinfo(kind)
        few = [
            *{
                limits.min,
                limits.min + 1,
                limits.max,
                0,
                1,
                3,
                7,
                *(-1, -2, -3, -7) * (limits.min < 0),
            }
        ]
        pairs = np.array([(a, b) for a in few for b in few], kind)
        texts = [each for each in OF_PAIRS if limits.min < 0 or "-1" not in each]
        texts += ["np.fmod(a, b)"] * (kind is np.int64)
        steps.append((kind.__name__, pairs, texts))
        for name in ("a", "b", "out"):
            size = f"{len(texts)}, {len(pairs)}" if name == "out" else str(len(pairs))
            lines += [f"    {name}_{kind.__name__}: State[np.{kind.__name__}, {size}]"]
    lines += ["", "    def update(self):"]
    for kind_name, _, texts in steps:
        lines += [f"        a, b = self.a_{kind_name}, self.b_{kind_name}"]
        lines += [f"        self.out_{kind_name}[{i}] = {text}" for i, text in enumerate(texts)]
    file = tmp_path / "quotients.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    record = cls()._record
    for kind_name, pairs, _ in steps:
        record[f"a_{kind_name}"], record[f"b_{kind_name}"] = pairs[:, 0], pairs[:, 1]
    assert Inside(object_file.compile_component(cls)).call("update", record) is None
    for kind_name, pairs, texts in steps:
        for found, text in zip(record[f"out_{kind_name}"], texts, strict=True):
            names = {"a": pairs[:, 0], "b": pairs[:, 1], "np": np}
            with np.errstate(all="ignore"):
                np.testing.assert_array_equal(found, eval(text, names), f"{kind_name} {text}")
