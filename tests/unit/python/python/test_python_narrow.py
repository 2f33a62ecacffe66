"""Numbers of other types than Python's: arrays of float32 and of small ints have NumPy's type if
its two releases agree, and are rejected otherwise.
"""

import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf.component.declaration import own_field
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
import math

import numpy as np
from rtcf.component import Component, Input, Parameter, State

HALF = 0.5
TABLE = np.array([0.1, 0.2, 0.3, 0.4], np.float32)


def scaled(x, factor):
    return x * float(factor)


class Tried(Component):
    which: Input[int]
    f: Input[np.float32, 4]
    g: Input[np.float32, 4]
    m: Input[np.float32, 3, 4]
    u: Input[np.uint8, 4]
    w: Input[np.uint8, 4]
    i: Input[np.int16, 4]
    j: Input[np.int32, 4]
    l: Input[np.uint64, 4]
    d: Input[np.float64, 4]
    k: Input[np.int64, 4]
    b: Input[np.bool_, 4]
    s: Input[np.float32]
    t: Input[np.uint8]
    x: Input[float]
    n: Input[int]
    gain: Parameter[float] = Parameter(0.3)
    counts: State[np.int32, 4]
    bytes: State[np.uint8, 4]
    filtered: State[np.float32, 4]
    small: State[np.uint8]
    out: State[np.float64, 12]
"""
TOGETHER = 20
INPUTS = "fgmuwijldkbstxn"
# Values of inputs, by name.
VALUES = [
    *("f * 0.1", "0.1 * f", "f + 1", "f / 3", "f - x", "f * self.gain", "f / n", "f * HALF"),
    *("f + g", "f * g / 3.0", "f * d", "f + k", "f * b", "f + u", "f + i", "f + j", "-f * 0.1"),
    *("f // 0.3", "f % 0.7", "f ** 2", "f ** 0.5", "f * g[0]"),
    *("u + 1", "u * 2", "u - 1", "200 + u", "u + w", "u * w", "u - w", "u // 7", "u % 9", "u / 7"),
    *("u * 0.5", "u + f", "u + i", "u + j", "u + d", "-u", "u & 15", "u | w", "u ^ w", "~u"),
    "u ** 2",
    *("i * 3", "i + 1", "j * 2", "j + k", "l + 1", "l * l", "l // 3", "l % 7", "i // 5", "i % 5"),
    *("f < 0.1", "f <= x", "f == g", "f > d", "u < 7", "u > 300", "u == n", "i < x", "f > 1"),
    *("f[0] + g[1]", "f[0] * g[0] - f[2]", "f[0] / g[0]", "u[0] + w[0]", "u[0] * w[1]"),
    "u[0] - w[0]",
    *("-u[0] + w[0]", "abs(i[0])", "f[0] * f[1] * f[2]", "u[0] * 0.5"),
    *("f[0] > 0.5", "f[0] < 0", "u[0] > 100", "u[0] == n", "f[0] < g[0]", "i[0] > u[0]"),
    *("float(f[0]) * 0.1", "int(u[0]) + 200", "float(f[0]) < x", "s * 0.1", "s * s", "t + 200"),
    "-t",
    *("t - 255", "self.small + 250", "s + x", "math.sqrt(abs(f[0]))", "max(f[0], g[0])"),
    *("np.sum(f)", "f.sum()", "np.sum(m, axis=0)", "np.sum(m, axis=1)", "np.mean(f)", "f.mean()"),
    *("np.mean(m, axis=0)", "np.mean(m, axis=1)", "np.std(f)", "np.var(m, axis=1)", "np.std(m)"),
    *("np.median(f)", "np.max(f) * g[0]", "np.ptp(f)", "np.prod(f)", "np.cumsum(f)", "np.sum(u)"),
    *("np.mean(u)", "np.std(i)", "np.max(u)", "np.ptp(i)", "np.cumsum(u)", "np.sum(u) * 0.5"),
    *("np.minimum(f, 0.1)", "np.maximum(0.3, f)", "np.clip(f, -0.1, 0.1)", "np.clip(u, 5, 200)"),
    *("np.clip(f, -x * x, x * x)", "np.minimum(f, g) * 0.1", "np.clip(u, 1, w)"),
    "np.clip(f, 0, 1)",
    *("np.where(b, f, 0.1)", "np.where(b, f, g)", "np.where(b, 0.5, f) * 0.1", "np.where(b, u, 7)"),
    *("np.where(b, f, d)", "np.sqrt(abs(f))", "np.floor(f)", "np.abs(f) * 0.1", "np.sign(f)"),
    *("np.isfinite(f)", "np.interp(x, [0.0, 1.0], [f[0], f[1]])", "np.argsort(f, kind='stable')"),
    *("np.sort(f) * 0.1", "np.concatenate((f, g)) * 0.1", "np.concatenate((f, d))", "np.diff(f)"),
    *("f[::-1] * 0.1", "m.T[0] * 0.1", "np.array([f[0], 0.1])"),
    "f + [0.1, 0.2, 0.3, 0.4]",
    *("np.array([f[0], g[0]]) * 0.1", "f.astype(float) * 0.1", "d.astype(np.float32) * 0.1"),
    *("np.float32(x) * f", "np.float32(x) * np.float32(0.1)", "np.zeros(4, np.float32) + 0.1"),
    *("TABLE * 0.1", "TABLE + f", "np.add(f, 0.1)", "np.multiply(u, 2)"),
    *("scaled(f, x)", "f * math.sin(x)", "f * (x if n > 0 else 0.5)", "f * min(x, 0.1)"),
    *("f * float(d[0])", "f * abs(x)", "u + len(u)", "np.square(f) * 0.1"),
    "np.outer(f[:2], g[:3])",
    *("np.roll(f, 1) * 0.1", "np.count_nonzero(u)", "np.any(f > 0.1)"),
    "np.searchsorted(np.sort(f), x)",
    *("np.cross(f[:3], g[:3])", "np.trace(m[:, :3])", "divmod(n, 7)[1]", "np.hstack((f, g)) * 0.1"),
]  # fmt: skip
# Statements that change the state.
STEPS = [
    "self.filtered[:] = 0.9 * self.filtered + 0.1 * f",
    "for _ in range(9):\n    self.filtered[:] = 0.9 * self.filtered + 0.1 * f",
    "self.filtered *= 0.1",
    "self.filtered += d",
    "self.filtered[1:] -= self.gain",
    "z = self.filtered\nz /= 3.0",
    "z = f[b] * 0.1\nself.out[: len(z)] = z",
    "self.filtered = f * x",
    "self.counts[1] += 1",
    "self.counts += k",
    "self.counts[:] = k",
    "self.counts[0] = n",
    "self.counts <<= 2",
    "self.counts[n % 4] -= 3",
    "self.bytes += 200",
    "self.bytes[2] += 100",
    "self.bytes[:] = u - w",
    "self.bytes[:2] *= 3",
    "self.bytes &= w",
    "self.bytes[1] -= 1",
    "self.small += 1",
    "self.small = t * 3",
    "self.small -= 200",
]
REFUSED = {
    "f * d[0]": "float64 in NumPy 2",
    "f * np.sin(x)": "NumPy 2",
    "f + k[0]": "NumPy 2",
    "u + k[0]": "NumPy 2",
    "f[0] * 0.1": "a single float32",
    "f[0] + x": "a single float32",
    "f[0] < x": "a single float32",
    "f[0] > 0.1": "a single float32",
    "u[0] + 1": "a single uint8",
    "f[0] ** 2": "a single float32",
    "f * j[0]": "a single int32",
    "u + i[0]": "a single int16",
    "u + 300": "300 does not fit uint8",
    "u - -1": "-1 does not fit uint8",
    "np.clip(u, 0, 300)": "300 does not fit",
    "np.sum(u) + 1": "a single uint64",
    "l - k[0]": "NumPy 2",
    "sum(f)": "np.sum",
    "max(f[0], 0.5)": "a single float32",
    "f[0] if n > 0 else 0.5": "",
    "u[0] << 1": "a single uint8",
    "~u[0]": "a single uint8",
    "np.sin(u)": "np.sin",
    "np.sqrt(u)": "np.sqrt",
    "np.polyval(f, x)": "np.polyval",
    "np.isclose(f, g)": "np.isclose",
    "np.linalg.norm(f)": "np.linalg.norm",
    "np.linalg.inv(m[:, :3])": "np.linalg.inv",
    "np.minimum(f, d[0])": "NumPy 2",
    "np.where(b, f, d[0])": "NumPy 2",
    "np.where(n > 0, f[0], x)": "a single float32",
    "np.hypot(f, d[0])": "NumPy 2",
    "np.fmin(f, 0.1)": "np.fmin",
    "np.trapz(f)" if hasattr(np, "trapz") else "np.trapezoid(f)": "np.trap",
}
REFUSED_STEPS = {
    "self.bytes += k": "uint8 would become int64",
    "self.bytes[1:] += k[1:]": "uint8 would become int64",
    "z = u.copy()\nz |= k": r"uint8 \|= a vector of int64",
    "self.bytes[0] = 300": "300 does not fit uint8",
    "self.filtered[0] += 0.1": "a single float32",
}
FAULTS = {
    "self.bytes[0] = n": "a number does not fit uint8",
    "self.bytes[:] = n": "a number does not fit uint8",
    "self.out[:4] = u + n": "a number does not fit uint8",
    "self.bytes[1] += n": "a number does not fit uint8",
}


def _component(folder: Path, ways: list[str]) -> Any:
    """Return a component that runs one of several statements."""
    lines = HEAD.splitlines()
    for number, way in enumerate(ways):
        lines += ["", f"    def way_{number}(self):"]
        used = [name for name in INPUTS if re.search(rf"\b{name}\b", way)]
        lines += [f"        {name} = self.{name}.value" for name in used]
        lines += [f"        {line}" for line in way.split("\n")]
    lines += ["", "    def update(self):", f"        which = self.which.value % {len(ways)}"]
    for number in range(len(ways)):
        lines += [f"        if which == {number}:", f"            self.way_{number}()"]
    file = folder / "tried.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls


def _fill(component: Any, draw: np.random.Generator) -> None:
    record = component._record
    for name in (*INPUTS, "counts", "bytes", "filtered", "small"):
        kind, shape = record[name].dtype, record[name].shape
        if kind.kind == "f":
            record[name] = draw.normal(size=shape) * 10.0 ** draw.integers(-2, 3, shape)
        elif kind.kind == "b":
            record[name] = draw.random(shape) < 0.5
        else:
            low, high = (1 if kind.kind == "u" else -30_000), min(np.iinfo(kind).max, 30_000)
            record[name] = draw.integers(low, high, shape)
    record["n"] = draw.integers(1, 100)


def _set(value: str, component: Any) -> str:
    """Return a statement that sets `out` to a value of any shape."""
    scope = vars(sys.modules[type(component).__module__]) | {"self": component}
    scope |= {name: getattr(component, name).value for name in INPUTS}
    shape = np.shape(eval(value, scope))
    if not shape:
        return f"self.out[0] = {value}"
    return f"self.out[:{np.prod(shape)}] = {value if len(shape) == 1 else f'np.ravel({value})'}"


@pytest.mark.parametrize("begin", range(0, len(VALUES) + len(STEPS), TOGETHER))
def test_numbers_of_other_types_match_numpy(begin: int, tmp_path: Path) -> None:
    ways = [*VALUES, *STEPS][begin : begin + TOGETHER]
    component = _component(tmp_path, ["pass"])()
    _fill(component, np.random.default_rng(1))
    ways = [_set(each, component) if each in VALUES else each for each in ways]
    cls = _component(tmp_path, ways)
    compiled = object_file.compile_component(cls)
    inside = Inside(compiled)
    draw = np.random.default_rng(1)
    component = cls()
    for which in [*range(len(ways))] * 20:
        _fill(component, draw)
        component._record["which"] = which
        record = component._record.copy()
        assert inside.call("update", record) is None, ways[which]
        with np.errstate(all="ignore"):
            component.update()
        for name in set(record.dtype.names) - {own_field("line")}:
            theirs = component._record[name]
            assert np.array_equal(record[name], theirs, equal_nan=True), ways[which]
    # The comparison uses special values, too.
    assert verify.compare(cls, compiled, 40 * len(ways)).differences == []


@pytest.mark.parametrize("text", REFUSED)
def test_expressions_on_which_numpy_releases_differ_are_rejected(text: str, tmp_path: Path) -> None:
    cls = _component(tmp_path, [f"value = {text}\nself.counts[0] += 1"])
    with pytest.raises(Mistake, match=REFUSED[text]) as raised:
        object_file.compile_component(cls)
    assert raised.value.text in (f"value = {text}", text)


@pytest.mark.parametrize("text", REFUSED_STEPS)
def test_an_assignment_that_numpy_rejects_is_rejected(text: str, tmp_path: Path) -> None:
    cls = _component(tmp_path, [text])
    with pytest.raises(Mistake, match=REFUSED_STEPS[text]) as raised:
        object_file.compile_component(cls)
    assert raised.value.text == text.split("\n")[-1]


def test_a_number_that_does_not_fit_is_a_fault(tmp_path: Path) -> None:
    cls = _component(tmp_path, list(FAULTS))
    inside = Inside(object_file.compile_component(cls))
    for which, words in enumerate(FAULTS.values()):
        for n, fits in ((7, True), (255, True), (256, False), (-1, False)):
            record = cls()._record
            record["which"], record["n"] = which, n
            said = inside.call("update", record)
            assert (said is None) == fits
            assert fits or (said is not None and f"OverflowError: {words}" in said)


def test_a_uint64_beyond_int64_is_a_fault(tmp_path: Path) -> None:
    source = HEAD.replace("t: Input[np.uint8]", "t: Input[np.uint64]")
    file = tmp_path / "tried.py"
    file.write_text(f"{source}\n    def update(self):\n        self.out[0] = self.t.value >> 1\n")
    (cls,) = modules.components(modules.load(file))
    inside = Inside(object_file.compile_component(cls))
    component: Any = cls()
    component.t.put(2**63 - 1)
    record = component._record.copy()
    assert inside.call("update", record) is None
    assert record["out"][0] == (2**63 - 1) >> 1
    component.t.put(2**63)
    said = inside.call("update", component._record.copy())
    assert said is not None and "OverflowError: does not fit int64" in said
    with pytest.raises(OverflowError, match="t does not fit int64"):
        component.update()


SUMS = """\
import numpy as np
from rtcf.component import Component, State


class Sums(Component):
    n: State[int]
    step: State[int]
    f: State[np.float32, 700]
    d: State[np.float64, 700]
    k: State[np.int16, 700]
    g: State[np.float32, 20, 30]
    h: State[np.float64, 20, 30]
    single: State[np.float64, 12]
    rows: State[np.float64, 4, 20]
    columns: State[np.float64, 4, 30]

    def update(self):
        f, d = self.f[: self.n : self.step], self.d[: self.n : self.step]
        self.single[:3] = [np.sum(f), np.mean(f), np.std(f)]
        self.single[3:6] = [np.sum(d), np.mean(d), np.std(d)]
        self.single[6:9] = [np.var(f), np.var(d, ddof=1), np.mean(self.k[: self.n])]
        self.single[9:] = [np.sum(self.g), np.std(self.g), np.mean(self.h)]
        self.rows[0] = np.sum(self.g, axis=1)
        self.rows[1] = np.std(self.g, axis=1)
        self.rows[2] = np.mean(self.h, axis=1)
        self.rows[3] = np.var(self.h, axis=1)
        self.columns[0] = np.sum(self.g, axis=0)
        self.columns[1] = np.mean(self.g, axis=0)
        self.columns[2] = np.std(self.h, axis=0)
        self.columns[3] = np.var(self.g, axis=0)
"""


def test_sums_of_any_length_match_numpy(tmp_path: Path) -> None:
    file = tmp_path / "sums.py"
    file.write_text(SUMS)
    (cls,) = modules.components(modules.load(file))
    inside = Inside(object_file.compile_component(cls))
    draw = np.random.default_rng(1)
    for n in (*range(1, 40), 127, 128, 129, 136, 255, 256, 257, 300, 511, 513, 640, 700):
        for step in (1, 3):
            component: Any = cls()
            record = component._record
            record["n"], record["step"] = n, step
            for name in "fdkgh":
                shape = record[name].shape
                record[name] = 100.0 + draw.normal(size=shape) * 10.0 ** draw.integers(-3, 4, shape)
            found = record.copy()
            assert inside.call("update", found) is None
            component.update()
            for name in ("single", "rows", "columns"):
                np.testing.assert_array_equal(found[name], component._record[name], f"{n} {step}")
