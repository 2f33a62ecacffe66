"""Arrays of three dimensions: compiled, they have the results of NumPy, bit by bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf.component import DeclarationError, describe
from rtcf.component.interpreter import record_of
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

SHAPES = [
    *((2, 3, 4), (1, 3, 4), (2, 1, 4), (2, 3, 1), (1, 1, 5), (3, 1, 1), (1, 9, 1), (9, 1, 1)),
    *((2, 2, 9), (2, 9, 2), (9, 2, 2), (2, 9, 1), (1, 2, 150), (2, 150, 1), (1, 1, 1)),
]
# The value of `r`, an array. `axis` is each of an array's axes, and one that it does not have.
VALUES = [
    *("np.sum(x, axis=axis)", "np.min(x, axis=axis, keepdims=True)", "np.std(x, axis=axis)"),
    *("np.argmax(x, axis=axis)", "np.any(x > 0.0, axis=axis)", "np.linalg.norm(x, axis=1)"),
    *("np.stack((x[0], x[-1]), axis=axis)", "np.sum(x[:, 0], axis=1)", "np.diff(x)"),
    *("np.ravel(x.T)", "x[:, ::-1].flatten()", "x.reshape(-1, x.shape[2])", "x.copy().T.copy()"),
    *("x[0].reshape(1, -1, 1)", "np.arange(24.0).reshape(2, 3, 4)", "x[:, k - 1]"),
    *("x[k, :, -1]", "x[:, :1, ::2]", "x[(x > 0.0) & (x < 1.0)] * 2.0", "np.flip(x)"),
    *(
        "x[0][:, :2, None] * x[-1][:, None, :2]",
        "x[0].T[None, :, ::2] + x[0, 0, 0]",
        "x[k, :, None]",
    ),
    *(
        "x[0, :, ::2][..., None]",
        "x[:, 0][:, None, 1:]",
        "x[None, :, 0, -1]",
        "x[:, 1:, 0][:, None]",
    ),
    *("np.where(x > 0.0, x, -1.0)", "np.clip(x, -0.5, 0.5)", "x / (2.0 + x[:, :1])"),
    *("np.array([x[0], 2.0 * x[-1]])", "np.array([[[1.0, 2.0], [3.0, x[0, 0, 0]]]])"),
    *("(10.0 * x).astype(np.int64) % 3", "x[0, :3] @ x[-1, :3].T"),
]
# The value of `number`.
NUMBERS = [
    *("np.sum(x)", "np.mean(x) + np.max(x, axis=None, keepdims=True)[0, 0, 0]", "np.median(x)"),
    *("np.count_nonzero(x > 0.0)", "x[k, 0, -1]", "len(x) + x.size + x.ndim"),
    *("np.array_equal(x, x + 0.0)", "np.linalg.norm(x)"),
]
# Statements that change y, a copy of x.
CHANGES = [
    *("y[0] = 1.0", "y[:, 0] = y[:, -1]", "y[0, :, -1] = y[-1, :, 0]", "y[:] = y[::-1]"),
    *("y[y > 0.0] = 2.0 * y[y > 0.0]", "y[-1, -1, -1] -= 2.0", "y.fill(2.0)"),
    *("y[:] = y[0]", "y[:] = y[0, 0]", "y[:] = y[:, :, -1:]", "y[k] += y[k - 1]"),
    *("y[0], y[-1] = y[-1].copy(), y[0].copy()", "y[1:] = y[:1]", "z = y.reshape(-1); z[0] = 5.0"),
    *("z = y[:, ::-1].ravel(); z[0] = 5.0", "z = y.T; z[0, 0, 0] = 8.0", "z = y[:, 0]; z += 1.0"),
    *("for m in y: m[0] = m[-1] + 1.0", "z = y[0].T[:, :, None]; z[0, 0, 0] = 7.0"),
]
CASES = [*VALUES, *NUMBERS, *CHANGES]
HEAD = """\
import numpy as np
from rtcf.component import Component, State


class Volumes(Component):
    which: State[int]
    shape: State[int]
    out: State[np.float64, 1000]
    size: State[int]
    k: State[int]
    axis: State[int]
"""


def _source() -> str:
    """Return the component: a method for each case, called with an array of each shape."""
    lines = [HEAD.rstrip()]
    for place, shape in enumerate(SHAPES):
        lines.append(f"    a{place}: State[np.float64, {', '.join(map(str, shape))}]")
    for number, text in enumerate(CASES):
        lines += ["", f"    def case_{number}(self, x, y, k, axis):"]
        if text in VALUES:
            lines += [f"        return np.ravel({text}) * 1.0"]
        elif text in NUMBERS:
            lines += [f"        return np.array([{text}]) * 1.0"]
        else:
            parts = [text] if text.startswith("for") else text.split("; ")
            lines += [f"        {part}" for part in parts] + ["        return y.ravel()"]
    lines += ["", "    def compute(self, x):", "        r, k, axis = x[0, 0], self.k, self.axis"]
    for number in range(len(CASES)):
        lines += [f"        if self.which == {number}:"]
        lines += [f"            r = self.case_{number}(x, x.copy(), k, axis)"]
    lines += ["        self.size = len(r)", "        self.out[: len(r)] = r"]
    # One call, which is compiled for arrays of any size.
    lines += ["", "    def update(self):", "        x = self.a0"]
    for place in range(1, len(SHAPES)):
        lines += [f"        if self.shape == {place}:", f"            x = self.a{place}"]
    lines.append("        self.compute(x)")
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the class and its machine code."""
    file = tmp_path_factory.mktemp("volumes") / "volumes.py"
    file.write_text(_source())
    (cls,) = modules.components(modules.load(file))
    return cls, Inside(object_file.compile_component(cls))


@pytest.mark.parametrize("text", CASES)
def test_results_are_those_of_numpy(text: str, both: Any) -> None:
    cls, inside = both
    draw = np.random.default_rng(3)
    ran = 0
    axes = range(-4, 4) if "axis=axis" in text else (0,)
    for place, shape, axis in ((*each, axis) for each in enumerate(SHAPES) for axis in axes):
        component = cls()
        record = record_of(component)
        record["which"], record["axis"] = CASES.index(text), axis
        record["shape"], record["k"] = place, draw.integers(0, shape[0])
        record[f"a{place}"] = draw.normal(0.0, 1.0, shape)
        found = record.copy()
        with np.errstate(all="ignore"):
            said, raised = inside.call("update", found), ""
            try:
                component.update()
            except (ValueError, IndexError) as error:
                raised = type(error).__name__
        # NumPy's AxisError is both a ValueError and an IndexError.
        raised = "ValueError" if raised == "AxisError" else raised
        assert (said or "").partition(": ")[2].partition(":")[0] == raised, (shape, axis, said)
        if raised:
            continue  # sizes that do not fit, or no such axis
        ran += 1
        expected = record_of(component)
        assert found["size"] == expected["size"], (shape, axis)
        # Sums of products, and of parts of an array, may be added in another order than NumPy's.
        last_places = 1e-14 if "norm" in text or "@" in text or "[:, 0], " in text else 0.0
        for name in ("out", f"a{place}"):
            np.testing.assert_allclose(found[name], expected[name], last_places, 0.0,
                                       err_msg=f"{shape}, axis {axis}")  # fmt: skip
    assert ran > 0


STATES = """\
import numpy as np
from rtcf.component import Component, Derived, Input, Output, Parameter, State

KERNEL = np.arange(24.0).reshape(2, 3, 4)
TABLE = [[[1, 2], [3, 4]], [[5, 6], [7, 8]]]


class Kept(Component):
    u: Input[np.float64, 4]
    i: Input[int]
    y: Output[np.float64, 3, 4]
    z: Output[float]
    gain: Parameter[float] = Parameter(0.5, min=0.1, max=1.0)
    k: Derived[np.float64, 2, 3, 4]
    _x: State[np.float64, 2, 3, 4]
    n: State[np.int32, 2, 3, 4] = 3
    on: State[bool, 2, 2, 2]
    first: State[np.float32, 2, 2, 2] = State([[[1, 2], [3, 4]], [[5, 6], [7, 8]]])
    maybe: State[np.float64 | None, 2, 2, 2]
    delayed: State[np.float64, 2, 3, 4]
    MASK = np.ones((2, 2, 2), bool)

    def prepare(self):
        self.k = self.gain * KERNEL

    def latest(self):
        return self._x[self.i.value % 2]

    def update(self):
        i = self.i.value % 2
        old = self._x
        self._x = np.clip(0.9 * self._x + self.k, -100.0, 100.0)
        self._x[i, 1] = self.u.value
        self._x[:, 0, 1] += 0.5
        self.delayed = old
        self.latest()[2, 3] = self.z.value
        self.n[i, :, 1] += 1
        self.on = (self.first > 4.5) & self.MASK
        self.first[i, 0, 0] = self.n[i, 0, 1]
        if self.maybe is None:
            self.maybe = np.ones((2, 2, 2))
        elif self.n[0, 0, 0] == 3:
            self.maybe[0, :, :] = 0.5 * self.maybe[1]
        x = np.sum(self._x[0]) - np.sum(self.delayed[1]) + TABLE[1][0][1]
        self.z.write(x if np.isfinite(x) else 0.0)
        self.y.write(self._x[1] - old[0])
"""


def kept(folder: Path) -> Any:
    file = folder / "kept.py"
    file.write_text(STATES)
    return modules.load(file).Kept


def test_states_and_constants_of_three_dimensions_work_in_hooks(tmp_path: Path) -> None:
    cls = kept(tmp_path)
    found = verify.compare(cls, object_file.compile_component(cls), 600)
    assert found.differences == [] and found.raised == 0


def test_the_interpreter_has_arrays_of_three_dimensions(tmp_path: Path) -> None:
    component: Any = kept(tmp_path)(gain=1.0)
    assert component.first[1, 0].tolist() == [5.0, 6.0]
    assert component.n.dtype == np.int32 and component.n.shape == (2, 3, 4)
    component.u.put([1.0, 2.0, 3.0, 4.0])
    component.i.put(1)
    component.cycle()
    assert component._x[1].tolist() == [[12, 13.5, 14, 15], [1, 2, 3, 4], [20, 21, 22, 0]]
    assert component.maybe.shape == (2, 2, 2)
    with pytest.raises(ValueError, match=r"_x has shape \(2, 3, 4\), not \(3, 4\)"):
        component._x = np.zeros((3, 4))
    members = describe(type(component)).members
    assert members["_x"].type.shape == members["k"].type.shape == (2, 3, 4)


# The declaration that is rejected, and the error.
REJECTED = {
    "Input[np.float64, 2, 2, 2]": "has 3 dimensions, but an Input has at most two",
    "Output[np.float64, 2, 2, 2]": "but an Output has at most two: declare one or two sizes",
    "Parameter[np.float64, 2, 2, 2] = 0.0": "but a Parameter has at most two",
    "Queue[np.float64, 2, 2, 2] = Queue(size=2)": "but a Queue has at most two",
    "State[np.float64, 2, 2, 2, 2]": "has 4 dimensions: declare one to three sizes",
    "State[np.float64, 20, 20, 20]": "has 8000 elements: declare at most 4096",
    "State[np.float64, 2, 2, 2] = [[1.0, 2.0], [3.0, 4.0]]": r"has shape \(2, 2, 2\)",
}


@pytest.mark.parametrize("declaration", REJECTED)
def test_other_members_have_at_most_two_dimensions(declaration: str, tmp_path: Path) -> None:
    file = tmp_path / "rejected.py"
    file.write_text(f"{STATES}\n\nclass Rejected(Kept):\n    v: {declaration}\n".replace(
        "Parameter, State", "Parameter, Queue, State"
    ))  # fmt: skip
    with pytest.raises(DeclarationError, match=REJECTED[declaration]):
        describe(modules.load(file).Rejected)
