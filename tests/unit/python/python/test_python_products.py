"""`@` sums each element from the first product to the last, for any memory layout of its arrays."""

from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.rewriting.helpers import rtcf_matmul
from rtcf_compile.source import modules

# CommonRewriting of a (15 x 11), b (11 x 15), v (11), w (15), all of float64, and of other types.
PRODUCTS = [
    *("a @ v", "w @ a", "a @ b", "a.T @ w", "v @ a.T", "a @ a.T", "b.T @ b", "b.T @ a.T"),
    *("a[:, ::2] @ v[::2]", "w[::-1] @ a[:, 1:8]", "a[2:9] @ b[:, 3:8]", "a @ b[:, ::3]"),
    *("a.T[1:8, 2:] @ w[2:]", "a[:, 1:] @ a.T[1:, ::2]", "a[::2, ::-1] @ v", "a[:1] @ b[:, :1]"),
    *("a @ narrow", "narrow @ b", "narrow @ narrow", "whole @ b", "a @ whole", "whole @ a.T"),
]
WRONG = ["a @ w", "v @ a", "a @ a", "narrow @ a"]
SHAPES: dict[str, Any] = {
    "a": (15, 11),
    "b": (11, 15),
    "v": 11,
    "w": 15,
    "narrow": (11, 11),
    "whole": 11,
}
HEAD = """\
import numpy as np
from rtcf.component import Component, State


class CommonRewriting(Component):
    which: State[int]
    a: State[np.float64, 15, 11]
    b: State[np.float64, 11, 15]
    v: State[np.float64, 11]
    w: State[np.float64, 15]
    narrow: State[np.float32, 11, 11]
    whole: State[np.int32, 11]
    out: State[np.float64, 15, 15]

    def update(self):
        a, b, v, w, narrow, whole = self.a, self.b, self.v, self.w, self.narrow, self.whole
"""


def filled(cls: Any) -> tuple[Any, dict[str, Any]]:
    draw = np.random.default_rng(1)
    record = cls()._record
    for name in ("a", "b", "v", "w", "narrow"):
        # Of very different magnitudes, so that another order of the sum shows.
        exponents = draw.uniform(-9.0, 9.0, record[name].shape)
        record[name] = draw.normal(size=record[name].shape) * 10.0**exponents
    record["whole"] = draw.integers(-1000, 1000, 11)
    return record, {name: record[name].copy() for name in record.dtype.names}


@pytest.fixture(scope="module")
def inside(tmp_path_factory: pytest.TempPathFactory) -> Any:
    names = {name: np.zeros(shape) for name, shape in SHAPES.items()}
    lines = HEAD.splitlines()
    for number, text in enumerate(PRODUCTS):
        shape = np.shape(eval(text, names))
        place = ", ".join(f":{size}" for size in shape)
        place = f"0, {place}" if len(shape) == 1 else place
        lines += [f"        if self.which == {number}:"]
        lines += [f"            self.out[{place}] = {text}"]
    for number, text in enumerate(WRONG, len(PRODUCTS)):
        lines += [
            f"        if self.which == {number}:",
            f"            self.out[0, 0] = np.sum({text})",
        ]
    file = tmp_path_factory.mktemp("products") / "products.py"
    file.write_text("\n".join(lines) + "\n")
    (cls,) = modules.components(modules.load(file))
    return cls, Inside(object_file.compile_component(cls))


@pytest.mark.parametrize("text", PRODUCTS)
def test_a_product_sums_from_first_to_last(text: str, inside: Any) -> None:
    cls, compiled = inside
    record, names = filled(cls)
    record["which"] = PRODUCTS.index(text)
    assert compiled.call("update", record) is None
    left, right = text.split(" @ ")
    expected = rtcf_matmul(eval(left, names), eval(right, names))
    found = record["out"][0] if expected.ndim == 1 else record["out"]
    part = tuple(slice(size) for size in expected.shape)
    np.testing.assert_array_equal(found[part], expected)


@pytest.mark.parametrize("text", WRONG)
def test_mismatched_shapes_are_a_fault(text: str, inside: Any) -> None:
    cls, compiled = inside
    record, _ = filled(cls)
    record["which"] = len(PRODUCTS) + WRONG.index(text)
    assert "which do not fit" in compiled.call("update", record)
