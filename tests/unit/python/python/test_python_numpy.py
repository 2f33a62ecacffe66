"""Functions of NumPy have the values of NumPy, to the sign of zeros."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

# Of x and y, floats, n, an int, on, a bool, c and d, vectors of 3 floats, v and w, of 6, i, of 6
# ints, b, of 6 bools, m, a matrix of 3 x 4, and q, of 3 x 3.
MOVED = [
    *("np.roll(v, n)", "np.roll(v, -2, axis=0)", "np.roll(m, 1)", "np.roll(m, n, axis=1)"),
    *("np.roll(m, -1, axis=0)", "np.roll(i, n)", "np.flip(v)", "np.flip(m, axis=0)"),
    *("np.flip(m, 1)", "np.flip(m)", "np.flipud(m)", "np.fliplr(m)", "np.stack([v, w])"),
    *("np.stack((v, w), axis=1)", "np.vstack((v, w))", "np.hstack((c, x, d))"),
    *("np.concatenate((v, c))", "np.concatenate((m, q), axis=1)", "np.meshgrid(c, v)[0]"),
    *("np.meshgrid(c, v)[1]", "np.meshgrid(c, i, indexing='ij')[1]", "np.atleast_1d(x)"),
    *("np.atleast_1d(v)", "np.atleast_1d(n)", "np.atleast_2d(v)", "np.atleast_2d(x)"),
    *("np.atleast_2d(m)", "np.atleast_1d([x, y])", "np.einsum('ij->ji', m)"),
    *("np.einsum('ii->i', q)", "np.einsum('ba', m)", "np.einsum('i', v[::2])"),
]
OF_ELEMENTS = [
    *("np.heaviside(v, 0.5)", "np.heaviside(x, y)", "np.heaviside(v, w)", "np.heaviside(i, 1)"),
    *("np.heaviside(m, x)", "np.clip(v, -1.0, None)", "np.clip(v, None, 2.0)"),
    *("np.clip(v, np.minimum(i, 3), 5.0)", "np.clip(x, -1.0, 1.0)", "v.clip(min=0.0)"),
    *("v.clip(-1.0, 1.0)", "m.clip(max=2.0)", "np.clip(i, 0, 4)", "np.hypot(v, w)"),
    *("np.hypot(x, y)", "np.deg2rad(v)", "np.rad2deg(x)", "np.radians(m)", "np.degrees(v)"),
    *("np.nan_to_num(v)", "np.nan_to_num(x, nan=1.0, posinf=9.0, neginf=-9.0)"),
    *("np.nan_to_num(m, copy=True, nan=-1.0)", "np.isclose(v, w)", "np.isclose(x, v)"),
    *("np.isclose(v, v, equal_nan=True)", "np.isclose(i, v, rtol=0.1)", "np.allclose(v, v)"),
    *("np.array_equal(v, v)", "np.array_equal(v, v, equal_nan=True)", "np.array_equal(v, w)"),
    *("np.select([v > 0.0, w > 1.0], [v, w])", "np.select([v > w, b], [x, v], default=y)"),
    *("np.select([b], [1.0], -1.0)", "np.select([m > 0.0], [m], default=np.nan)"),
    *("np.select([v > 0, b], [i, 2])", "np.select([b, on], [v, w], x)", "np.select((b,), (i,))"),
]
OF_SAMPLES = [
    *("np.unwrap(v)", "np.unwrap(v, period=2.0)", "np.unwrap(m, axis=0)", "np.unwrap(m)"),
    *("np.unwrap(v, discont=4.0)", "np.unwrap(i)", "np.unwrap(v, period=3)", "np.diff(v)"),
    *("np.diff(v, n=2)", "np.diff(m, axis=0)", "np.diff(m, n=2, axis=1)", "np.diff(i, append=3)"),
    *("np.diff(v, prepend=0.0)", "np.diff(v, prepend=x, append=[y, 1.0])", "np.cumsum(v)"),
    *("np.cumsum(m, axis=1)", "np.gradient(v)", "np.gradient(v, 0.5)", "np.gradient(v, PLACES)"),
    *("np.gradient(v, 2, edge_order=2)", "np.gradient(v, PLACES, edge_order=2)"),
    *("np.gradient(v, EVEN)", "np.gradient(m, axis=0)", "np.gradient(m, 0.1, axis=1)"),
    *("np.gradient(m)[0]", "np.gradient(m, 0.5, 2.0)[1]", "np.gradient(m, 2.0)[1]"),
    *("np.gradient(i)", "np.gradient(m, [0.0, 1.0, 4.0], 2)[0]", "np.interp(v, PLACES, v)"),
    *("np.interp(x, PLACES, w)", "np.polyval(c, x)", "np.polyval(c, v)"),
]
REDUCED = [
    *("np.trace(q)", "np.trace(m, offset=1)", "np.trace(q, -1)", "q.trace()", "np.outer(c, v)"),
    *("np.cross(c, d)", "np.cross(q, c)", "np.cross(c, q)", "np.cross(q, q.T)", "np.ptp(v)"),
    *("np.ptp(m, axis=0)", "np.median(v)", "np.median(m, axis=0)", "np.median(i)"),
    *("np.median(m, axis=1)", "np.percentile(v, 30)", "np.percentile(v, [10, 50.0, 90])"),
    *("np.quantile(v, 0.25)", "np.percentile(m, 75.0, axis=1)", "np.quantile(i, 0.3)"),
    *("np.quantile(v, 1)", "np.percentile(m, 50, axis=0)", "np.quantile(v, 0.9, method='linear')"),
    *("np.quantile(i, 1)", "np.quantile(v, [0, 1])", "np.quantile(m, 0, axis=0)"),
    *("np.argsort(v, kind='stable')", "np.count_nonzero(m)", "np.count_nonzero(m, axis=0)"),
    *("np.count_nonzero(b)", "np.linalg.norm(v, np.inf)", "np.linalg.norm(v, 0)"),
    *("np.linalg.norm(v, -np.inf)", "np.linalg.norm(m, axis=1)", "np.linalg.norm(m, 1, axis=0)"),
    *("np.linalg.norm(m, np.inf, axis=1)", "np.linalg.norm(m, axis=1, keepdims=True)"),
    *("np.linalg.norm(v, 1)", "np.linalg.norm(m, 1)", "np.linalg.norm(m, np.inf)"),
    *("np.linalg.norm(m, -1)", "np.linalg.norm(m, -np.inf)", "np.linalg.norm(m, 0, axis=0)"),
]
# Sums of products, whose order differs from NumPy's. With whole numbers, they are exact.
PRODUCTS = [
    *("np.linalg.norm(v)", "np.linalg.norm(m)", "np.linalg.norm(m, 'fro')"),
    *("np.linalg.norm(v, ord=2)", "np.linalg.norm(v, keepdims=True)", "np.convolve(v, c)"),
    *("np.convolve(c, v, 'same')", "np.convolve(v, w, mode='valid')", "np.convolve(i, [1, 2])"),
    *("np.convolve(v, d, 'valid')", "np.correlate(v, c)", "np.correlate(c, v, 'full')"),
    *("np.correlate(v, w, 'same')", "np.correlate(c, v, 'same')", "np.correlate(i, i)"),
    *("np.convolve([1.0, x], v)",),
]
EINSUM = [
    *("np.einsum('ij,j->i', q, c)", "np.einsum('ij,jk->ik', q, m)", "np.einsum('i,i->', v, w)"),
    *("np.einsum('i,j->ij', c, v)", "np.einsum('ij->', m)", "np.einsum('ii', q)"),
    *("np.einsum('ij->i', m)", "np.einsum('ij->j', m)", "np.einsum('i,i', v, i)"),
    *("np.einsum('ij,j', q, c)", "np.einsum('ij,ij->', q, q.T)", "np.einsum('ij,ij->ij', m, m)"),
    *("np.einsum('i,ij,j->', c, q, d)", "np.einsum('ij,i->j', m, c)", "np.einsum('i,ij', c, m)"),
    *("np.einsum('ij,kj->ik', m, m)", "np.einsum('ij,kj->ki', q, m.T[:3, :])"),
    *("np.einsum('ij,ik->kj', m, q)", "np.einsum('ii,i->i', q, c)", "np.einsum('i,->i', v, x)"),
    *("np.einsum('i,i,i->i', v, w, i)", "np.einsum('i,i->', i, i)", "np.einsum('ij,j->j', q, c)"),
    *("np.einsum('a,b,a->b', c, v, d)", "np.einsum('ii->', q)", "np.einsum(' ij , j -> i', q, c)"),
    *("np.einsum('i,i->', [1.0, x, 2.0], c)", "np.einsum('i,j->', c, v)", "np.einsum('ij', q)"),
]
# Within a few units in the last place, for finite numbers.
CLOSE = [
    *("np.linalg.norm(v, 3)", "np.linalg.norm(m, 4, axis=1)", "np.linalg.norm(v, 0.5)"),
    *("np.linalg.norm(v, y)", "np.sinc(v)", "np.sinc(x)", "np.sinc(m)", "np.sinc(i)"),
]
# NumPy defines no order of 0.0 and -0.0, and no sign of a sum of products that are -0.0.
SIGNLESS = ("clip", "median", "percentile", "quantile", "ptp", "norm", "convolve", "correlate")
HEAD = """\
import numpy as np
from rtcf.component import Component, State

PLACES = [-1.0, 0.0, 0.5, 2.0, 3.0, 7.0]
EVEN = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


class Functions(Component):
    x: State[float]
    y: State[float]
    n: State[int]
    on: State[bool]
    c: State[np.float64, 3]
    d: State[np.float64, 3]
    v: State[np.float64, 6]
    w: State[np.float64, 6]
    i: State[np.int64, 6]
    b: State[np.bool_, 6]
    m: State[np.float64, 3, 4]
    q: State[np.float64, 3, 3]
"""
SHAPES: dict[str, Any] = {
    **{"x": (), "y": (), "c": 3, "d": 3, "v": 6, "w": 6},
    **{"m": (3, 4), "q": (3, 3)},
}
CONSTANTS: dict[str, Any] = {
    "np": np,
    "PLACES": [-1.0, 0.0, 0.5, 2.0, 3.0, 7.0],
    "EVEN": [0.0, 0.5, 1.0, 1.5, 2.0, 2.5],
}
SPECIAL = [0.0, -0.0, 1.0, -1.0, 2.0, np.pi, -np.pi, 1e300, np.inf, -np.inf, np.nan]


def _drawn(draw: Any, number: int, kind: str) -> dict[str, Any]:
    def floats(shape: Any) -> Any:
        if kind == "whole":
            return draw.integers(-8, 9, shape).astype(float)
        found = draw.normal(0.0, draw.choice([1.0, 10.0]), shape)
        if kind == "any" and number % 3:
            is_special = draw.random(shape) < (0.1 if number % 3 == 1 else 0.5)
            found = np.where(is_special, draw.choice(SPECIAL, shape), found)
        return found

    values: dict[str, Any] = {name: floats(shape) for name, shape in SHAPES.items()}
    values |= {name: float(values[name]) for name in "xy"}
    values["n"] = int(draw.integers(-9, 10))
    values["on"] = bool(number % 2)
    values["i"] = draw.integers(-5, 9, 6)
    values["b"] = draw.random(6) < 0.5
    return values


def _by_numpy(text: str, values: dict[str, Any]) -> Any:
    copies = {name: value.copy() if isinstance(value, np.ndarray) else value
              for name, value in values.items()}  # fmt: skip
    with np.errstate(all="ignore"):
        return np.asarray(eval(text, {**CONSTANTS, **copies}))


def _component(folder: Path, texts: list[str], samples: dict[str, Any]) -> Any:
    lines, body = HEAD.splitlines(), []
    for number, text in enumerate(texts):
        wanted = _by_numpy(text, samples)
        shape = "".join(f", {size}" for size in wanted.shape)
        of = {"f": "np.float64", "i": "np.int64", "b": "np.bool_"}[wanted.dtype.kind]
        plain = {"f": "float", "i": "int", "b": "bool"}[wanted.dtype.kind]
        lines.append(f"    out_{number}: State[{of}{shape}]" if shape else
                     f"    out_{number}: State[{plain}]")  # fmt: skip
        body.append(f"        self.out_{number} = {text}")
    lines += ["", "    def update(self):"]
    lines += [f"        {', '.join(SHAPES)} = {', '.join(f'self.{name}' for name in SHAPES)}"]
    lines += ["        n, on, i, b = self.n, self.on, self.i, self.b"]
    file = folder / "functions.py"
    file.write_text("\n".join([*lines, *body]) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls


@pytest.mark.parametrize(
    ("texts", "kind"),
    [
        (MOVED, "any"),
        (OF_ELEMENTS, "any"),
        (OF_SAMPLES, "any"),
        (REDUCED, "any"),
        (PRODUCTS, "whole"),
        (EINSUM, "whole"),
        (CLOSE, "finite"),
    ],
    ids=["moved", "of elements", "of samples", "reduced", "products", "einsum", "close"],
)
def test_functions_have_the_values_of_numpy(texts: list[str], kind: str, tmp_path: Path) -> None:
    draw = np.random.default_rng(1)
    cls = _component(tmp_path, texts, _drawn(draw, 0, kind))
    compiled = Inside(object_file.compile_component(cls))
    differences: dict[str, Any] = {}
    for number in range(400):
        values = _drawn(draw, number, kind)
        record = cls()._record
        for name, value in values.items():
            record[name] = value
        said = compiled.call("update", record)
        assert said is None, (values, said)
        for place, text in enumerate(texts):
            found, wanted = record[f"out_{place}"], _by_numpy(text, values)
            if not _are_same(text, found, wanted, is_close=texts is CLOSE):
                differences.setdefault(text, (values, found, wanted))
    assert not differences


def _are_same(text: str, found: Any, wanted: Any, is_close: bool) -> bool:
    if is_close:
        return np.allclose(found, wanted, rtol=4e-15, atol=1e-300, equal_nan=True)
    if wanted.dtype.kind != "f":
        return np.array_equal(found, wanted)
    same = np.array_equal(found, wanted, equal_nan=True)
    if any(each in text for each in SIGNLESS):
        return same
    return same and bool(np.all((np.signbit(found) == np.signbit(wanted)) | np.isnan(wanted)))


VIEWS = """\
import numpy as np
from rtcf.component import Component, Input, State


class Views(Component):
    u: Input[np.float64, 3]
    q: State[np.float64, 3, 3]
    r: State[np.float64, 3, 3]
    v: State[np.float64, 3]
    w: State[np.float64, 3]

    def update(self):
        np.einsum("ij->ji", self.q)[0, 1] += self.u.value[0]
        diagonal = np.einsum("ii->i", self.q)
        diagonal[:] = self.u.value
        turned = np.einsum("ji", self.q)
        self.q = 0.5 * self.q
        self.r = turned + np.einsum("ij,j->i", self.q, self.u.value)
        np.atleast_1d(self.v)[0] = self.u.value[1]
        np.atleast_2d(self.v)[0, 1] += self.u.value[2]
        np.flip(self.r, axis=0)[0] -= self.v
        old = np.atleast_1d(self.w)
        self.w = self.v + old
        self.v = self.w - old
"""


def test_views_are_views(tmp_path: Path) -> None:
    file = tmp_path / "views.py"
    file.write_text(VIEWS)
    (cls,) = modules.components(modules.load(file))
    assert verify.compare(cls, object_file.compile_component(cls), 1000).differences == []


FAULTS = {
    "self.v[0] = np.percentile(self.v, self.x)": "percentiles 0 to 100",
    "self.v[0] = np.quantile(self.v, self.x)": "range 0 to 1",
    "self.v[0] = np.sum(np.roll(self.v, 1, axis=self.n - 6))": "axis is out of bounds",
    "self.v[0] = np.sum(np.gradient(self.v[: self.n - 1]))": "too few elements",
    "self.v[0] = np.einsum('i,i->', self.v, self.v[: self.n])": "sizes of the operands do not fit",
    "self.v[0] = np.sum(np.convolve(self.v, self.v[2 * (6 - self.n) :]))": "an empty vector",
    "self.v[0] = np.sum(np.diff(self.v, n=self.n - 5))": "order is 1 or more",
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_value_that_numpy_rejects_is_a_fault(text: str, tmp_path: Path) -> None:
    file = tmp_path / "faults.py"
    file.write_text(
        "import numpy as np\nfrom rtcf.component import Component, State\n\n\n"
        "class Faults(Component):\n    x: State[float] = State(0.5)\n"
        "    v: State[np.float64, 6]\n    n: State[int] = State(6)\n\n"
        f"    def update(self):\n        {text}\n"
    )
    (cls,) = modules.components(modules.load(file))
    compiled, record = Inside(object_file.compile_component(cls)), cls()._record
    record["x"], record["n"] = 101.0, 2
    assert FAULTS[text] in (compiled.call("update", record) or "")
