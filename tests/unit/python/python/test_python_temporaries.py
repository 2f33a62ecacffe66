"""Temporary arrays have the values that NumPy gives them, on the stack and in the arena."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pages import TREE
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

HEAD = """\
import numpy as np
from rtcf.component import Component, Input, Output, State


def turned(a):
    return np.array((-a[1], a[0], a[2]))


def chosen(first, a, b):
    if first:
        return a + 1.0
    return b - 1.0


class Temporaries(Component):
    a: Input[np.float64, 3]
    b: Input[np.float64, 3]
    n: Input[int]
    m: State[np.float64, 3, 3]
    x: Output[np.float64, 3]
    y: Output[np.float64, 3]

    def update(self):
        a, b, n = self.a.value, self.b.value, self.n.value
"""
BODIES = {
    "kept over a turn of a loop": """
        x, previous = a + b, a - b
        for _ in range(5):
            following = 0.5 * (x + turned(previous))
            previous = x
            x = following
        self.x.write(x)
        self.y.write(previous)
""",
    "one of two": """
        x = a + b if n > 0 else a - b
        y = chosen(n % 2 == 0, x, 2.0 * b)
        x += y
        self.x.write(x)
        self.y.write(y)
""",
    "columns in a loop": """
        x = a
        for k in range(3):
            y = 0.5 * x + self.m[:, k]
            self.m[:, k] = x - 0.25 * y
            x = y
        self.x.write(x)
        self.y.write(self.m[:, 0] + self.m[1] + b)
""",
    "in a loop of many turns": """
        x = a
        for k in range(5000):
            y = 0.5 * x + self.m[k % 3]
            x = y
        self.x.write(x)
        self.y.write(x + b)
""",
    "parts of others": """
        wide = np.zeros(8)
        wide[:3] = a + b
        part = wide[1:4]
        part += a
        self.x.write(part)
        self.y.write(wide[:3] + wide[5:])
""",
    "of variable size": """
        total = np.zeros(3)
        for i in range(3):
            for k in range(i, 3):
                total[i] += np.sum(a[i : k + 1] * b[i : k + 1])
        self.x.write(total)
        count = max(1, abs(n) % 3)
        self.y.write((a + b)[:count][0] * a)
""",
    "changed after they were read": """
        x = a + b
        y = x
        z = x.copy()
        x[0] = 7.0
        self.m[0, :] = z
        self.m[:, 1] = self.m[0, :]
        self.x.write(y + z)
        self.y.write(self.m @ x)
""",
    "large": """
        wide = np.zeros((20, 20))
        wide[2] = a[0]
        wide[:, 3] += b[1]
        self.x.write(wide[1:4, 3] + a)
        self.y.write((wide @ wide)[:3, 2])
""",
}


def component(folder: Path, body: str) -> Any:
    file = folder / "temporaries.py"
    file.write_text(HEAD + body)
    (cls,) = modules.components(modules.load(file))
    return cls


@pytest.mark.parametrize("body", BODIES.values(), ids=BODIES)
def test_temporaries_match_the_interpreter(body: str, tmp_path: Path) -> None:
    cls = component(tmp_path, body)
    found = verify.compare(cls, object_file.compile_component(cls), 2000)
    assert found.differences == []


def test_arrays_of_constant_size_do_not_use_the_arena(tmp_path: Path) -> None:
    cls = component(tmp_path, BODIES["parts of others"])
    inside = Inside(object_file.compile_component(cls, arena_bytes=128))
    record = cls()._record
    record["a"], record["b"] = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    assert inside.call("update", record) is None
    np.testing.assert_array_equal(record["x"], (7.0 + 1.0, 9.0 + 2.0, 0.0 + 3.0))


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("tests/bench/components/notch_bank.py", "NotchSections"),
        ("components/rtcf_examples/python/gravity_pd.py", "GravityPd"),
    ],
    ids=["carried to the next turn", "of a size that depends on the turn"],
)
def test_arrays_of_a_loop_of_few_turns_do_not_use_the_arena(file: str, name: str) -> None:
    classes = {each.__name__: each for each in modules.components(modules.load(TREE / file))}
    inside = Inside(object_file.compile_component(classes[name], arena_bytes=64))
    assert inside.call("update", classes[name]()._record) is None
