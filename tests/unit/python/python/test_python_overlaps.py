"""Overlapping assignments within a vector: compiled code gives NumPy's result, even where it
depends on NumPy's copying order.
"""

from pathlib import Path
from typing import Any

import numpy as np
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

SIZE = 8
SOURCE = """\
import numpy as np
from rtcf.component import Component, State


class Overlap(Component):
    a: State[np.float64, 8]
    to: State[np.int64, 3]
    at: State[np.int64, 3]

    def update(self):
        begin, end, step = self.to
        first, last, by = self.at
        self.a[begin:end:step] = self.a[first:last:by]
"""
PARTS = [
    (begin, end, step)
    for step in (1, 2, 3, -1, -2)
    for begin in range(SIZE)
    for end in (range(begin + 1, SIZE + 1) if step > 0 else (-SIZE - 1, *range(begin)))
]


ROWS = """\
import numpy as np
from rtcf.component import Component, Input, State


class Rows(Component):
    matrix: Input[np.float64, 3, 3]
    i: Input[int]
    k: State[np.float64, 3, 3]

    def update(self):
        i = self.i.value % 3
        self.k = self.matrix.value
        self.k[i] = self.k[:, 2]
        self.k[:, i] = self.k[2]
        self.k[i, 1:] = self.k[1:, 1]
"""


def test_rows_are_assigned_from_columns_as_in_numpy(tmp_path: Path) -> None:
    file = tmp_path / "rows.py"
    file.write_text(ROWS)
    (cls,) = modules.components(modules.load(file))
    assert verify.compare(cls, object_file.compile_component(cls), 300).differences == []


def test_overlapping_slices_are_assigned_as_in_numpy(tmp_path: Path) -> None:
    file = tmp_path / "overlap.py"
    file.write_text(SOURCE)
    (cls,) = modules.components(modules.load(file))
    inside = Inside(object_file.compile_component(cls))
    interpreted: Any = cls()
    values = np.arange(1.0, SIZE + 1.0)
    sizes = {part: len(values[slice(*part)]) for part in PARTS}
    compared = 0
    for to in PARTS:
        for at in PARTS:
            if sizes[at] not in (sizes[to], 1):
                continue
            interpreted.a, interpreted.to, interpreted.at = values, to, at
            record = interpreted._record.copy()
            interpreted.update()
            assert inside.call("update", record) is None
            assert np.array_equal(record["a"], interpreted.a), (to, at)
            compared += 1
    assert compared > 5000
