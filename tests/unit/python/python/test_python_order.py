"""Compiled code evaluates the parts of a statement once, in Python's order, even if methods and
properties change values that other parts read.
"""

from pathlib import Path
from typing import Any

import pytest
from rtcf.component import describe
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.comparison.model import Model
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
import enum
from dataclasses import dataclass

import numpy as np
from rtcf.component import Component, State


class Places(enum.IntEnum):
    SECOND = 1


@dataclass(frozen=True)
class Sizes:
    last: int = 3


SIZES = Sizes()


class Order(Component):
    head: State[int]
    found: State[bool]
    which: State[int]
    row: State[np.float64, 4]
    counts: State[np.int64, 4]
    table: State[np.float64, 3, 4]

    def advance(self, by):
        self.head = (self.head * 3 + by) % 4
        return self.head + by

    @property
    def next(self):
        self.head = (self.head + 1) % 4
        return self.head

    def update(self):
"""
STATEMENTS = [
    "self.row[self.head] = self.advance(2)",
    "self.row[self.head] += self.advance(2)",
    "self.counts[self.head] -= self.advance(1)",
    "self.counts[self.advance(1) % 4] = self.advance(1)",
    "self.counts[self.next] += self.next",
    "self.counts[self.next] = self.next",
    "self.table[self.head % 3, self.head] = self.advance(1)",
    "self.table[self.head % 3, self.head :] = self.advance(1)",
    "self.table[self.head % 3, : self.head] += self.next",
    "self.table[self.head % 3] = self.next",
    "self.table[self.next % 3][self.next] -= self.next",
    "self.row[self.counts[0] % 4] = self.next",
    "self.row[self.next], self.row[self.next] = self.next, self.next",
    "self.row[SIZES.last] = self.next",
    "self.row[SIZES.last] += self.next",
    "self.row[Places.SECOND] = self.next",
    "self.table[Places.SECOND] -= self.next",
    "self.found = self.next in (1, 2)",
    "self.found = self.next not in (self.next, self.advance(1))",
    "self.found = 0 < self.next < self.next",
    "now = self.row; now += 2; now **= 2",
    "now = self.counts[1:]; now += 2; now **= self.head % 2",
    "now = self.head; now **= 2; self.counts[0] = now",
]


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Any]:
    """Return the class and its machine code."""
    lines = [HEAD]
    for number, text in enumerate(STATEMENTS):
        lines.append(f"        if self.which == {number}:\n            {text}\n")
    file: Path = tmp_path_factory.mktemp("order") / "order.py"
    file.write_text("".join(lines))
    (cls,) = modules.components(modules.load(file))
    return cls, object_file.compile_component(cls)


@pytest.mark.parametrize("text", STATEMENTS)
def test_a_statement_has_the_same_effect_as_in_python(text: str, both: tuple[Any, Any]) -> None:
    cls, compiled = both
    component, inside = cls(), Inside(compiled)
    component._record["which"] = STATEMENTS.index(text)
    record = component._record.copy()
    for _ in range(20):
        component.update()
        assert inside.call("update", record) is None
        for name in ("head", "found", "row", "counts", "table"):
            assert (record[name] == component._record[name]).all(), name


def test_the_comparison_evaluates_in_pythons_order(both: tuple[Any, Any]) -> None:
    component = both[0]()
    model = Model(both[0], describe(both[0]), ())
    for which in range(len(STATEMENTS)):
        for _ in range(5):
            component._record["which"] = which
            record = component._record.copy()
            component.update()
            model.load(record)
            model.run("update")
            model.store(record)
            for name in ("head", "found", "row", "counts", "table"):
                assert (record[name] == component._record[name]).all(), (STATEMENTS[which], name)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("self.counts[0] = self.head + (now := self.advance(1)) + now", "a statement before"),
        ("self.counts[:] = np.array([self.next] * 4)", "set variables to their results before"),
    ],
)
def test_statements_needing_another_order_are_rejected(
    text: str, remedy: str, tmp_path: Path
) -> None:
    file = tmp_path / "order.py"
    file.write_text(f"{HEAD}        {text}\n")
    (cls,) = modules.components(modules.load(file))
    with pytest.raises(Mistake, match=remedy):
        object_file.compile_component(cls)


@pytest.mark.parametrize(
    "text",
    [
        "self.head = self.head + (now := abs(self.counts[0])) + now",
        "self.counts[:] = np.array([self.head] * 4)",
    ],
)
def test_unchanged_members_may_be_read_in_any_order(text: str, tmp_path: Path) -> None:
    file = tmp_path / "order.py"
    file.write_text(f"{HEAD}        {text}\n")
    (cls,) = modules.components(modules.load(file))
    assert verify.compare(cls, object_file.compile_component(cls), 50).differences == []
