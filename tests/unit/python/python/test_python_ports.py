"""Ports of values in machine code: order of elements, and status."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

# Sizes copied element by element, and sizes copied as a whole.
KINDS = {
    "number": "float",
    "flag": "bool",
    "pair": "np.float64, 2",
    "matrix": "np.float64, 2, 3",
    "small": "np.float32, 3, 2",
    "row": "np.float64, 1, 4",
    "whole": "np.int16, 2, 3",
    "large": "np.float64, 9, 8",
    "larger": "np.float32, 8, 9",
    "many": "np.int32, 70",
}
SOURCE = """\
import numpy as np
from rtcf.component import Component, Input, Output, State


class Ports(Component):
{declarations}
    fresh: State[int]
    known: State[int]

    def update(self):
        self.fresh += 1 if self.matrix.new else 0
        self.known += 1 if self.matrix.valid else 0
        if self.flag.new:
{writes}

    def safe(self):
        self.number_out.write(1.0)
        if self.flag.value:
            raise ValueError("on")
"""
DECLARATIONS = "\n".join(
    f"    {name}: Input[{kind}]\n    {name}_out: Output[{kind}]" for name, kind in KINDS.items()
)
WRITES = "\n".join(f"            self.{name}_out.write(self.{name}.value)" for name in KINDS)


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Inside]:
    """Return the component, interpreted and compiled."""
    file: Path = tmp_path_factory.mktemp("ports") / "ports.py"
    file.write_text(SOURCE.format(declarations=DECLARATIONS, writes=WRITES))
    (cls,) = modules.components(modules.load(file))
    return cls(), Inside(object_file.compile_component(cls))


def test_elements_keep_their_positions(both: tuple[Any, Inside]) -> None:
    component, inside = both
    draw = np.random.default_rng(1)
    record = component._record.copy()
    for name in KINDS:
        value = draw.integers(0, 2 if name == "flag" else 1000, record[name].shape)
        record[name] = value
        record[f"{name}__new"] = record[f"{name}__valid"] = True
    assert inside.call("update", record) is None
    for name in KINDS:
        assert record[f"{name}_out__written"]
        assert np.array_equal(record[f"{name}_out"], record[name]), name


@pytest.mark.parametrize(("is_new", "is_valid"), [(False, False), (False, True), (True, True)])
def test_an_input_has_its_status(both: tuple[Any, Inside], is_new: bool, is_valid: bool) -> None:
    component, inside = both
    record = component._record.copy()
    record["matrix__new"], record["matrix__valid"] = is_new, is_valid
    assert inside.call("update", record) is None
    assert (record["fresh"], record["known"]) == (is_new, is_valid)
    assert not record["matrix_out__written"]


def test_safe_writes_even_if_it_raises(both: tuple[Any, Inside]) -> None:
    component, inside = both
    record = component._record.copy()
    record["flag"] = record["flag__valid"] = True
    said = inside.call("safe", record)
    assert said is not None
    assert "ValueError" in said
    assert record["number_out__written"]
    assert record["number_out"] == 1.0
