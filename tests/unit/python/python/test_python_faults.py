"""Run-time faults of components: the machine code reports line, index and sizes."""

from pathlib import Path

import numpy as np
import pytest
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code.object_file import compile_component
from rtcf_compile.source.modules import components, load

HEAD = """\
import numpy as np
from rtcf.component import Component, Input, Queue, State

TABLE = [1.0, 2.0]
LIMITS = (0.5, 1.5, 2.5)


class Faulty(Component):
    n: Input[int]
    q: Queue[float] = Queue(size=2)
    f: State[float]
    z: State[np.float64, 3]
    m: State[np.float64, 3, 4]
    o: State[float | None]

    def update(self):
        n = self.n.value
"""

# A statement for each n, from 100 on in this order, and the text of its fault.
FAULTS = {
    "index of a vector": (
        "self.f = self.z[n]",
        "IndexError: index {n} is out of bounds for size 3",
    ),
    "negative index": ("self.f = self.z[-n]", "IndexError: index -{n} is out of bounds for size 3"),
    "index that is set": (
        "self.z[n - 99] = 1.0",
        "IndexError: index 3 is out of bounds for size 3",
    ),
    "column of a matrix": (
        "self.f = self.m[0, n]",
        "IndexError: index {n} is out of bounds for size 4",
    ),
    "index of a list": ("self.f = TABLE[n]", "IndexError: index {n} is out of bounds for size 2"),
    "index in a loop": (
        "for i in range(n):\n                self.f += LIMITS[i]",
        "IndexError: index 3 is out of bounds for size 3",
    ),
    "indices in an array": (
        "self.f = self.z[np.array([0, n])][0]",
        "IndexError: index {n} is out of bounds for size 3",
    ),
    "mask of another size": (
        "self.f = self.z[np.ones(n) > 0.0][0]",
        "IndexError: a mask of {n} elements for an array of size 3",
    ),
    "vector of another size": (
        "self.z[:] = np.ones(n)",
        "ValueError: an array of size 3 is set to one of size {n}",
    ),
    "product": (
        "self.z[:] = self.m @ np.ones(n)",
        "ValueError: @ of sizes 4 and {n}, which do not fit",
    ),
    "product of vectors": (
        "self.f = self.z @ np.ones(n)",
        "ValueError: @ of sizes 3 and {n}, which do not fit",
    ),
    "unpacked": ("a, b = np.ones(n)", "ValueError: {n} values for 2 names"),
    "division": ("self.f = 1 / (n - n)", "ZeroDivisionError: division by zero"),
    "queue": ("self.f = self.q.front", "IndexError: front of an empty queue"),
    "number that is not known": ("self.f = self.o", "TypeError: None is not a number"),
}


@pytest.fixture(scope="module")
def component(tmp_path_factory: pytest.TempPathFactory) -> tuple[Inside, np.dtype[np.void], str]:
    """One component that contains all faults, selected one by one."""
    source = HEAD
    for number, (text, _) in enumerate(FAULTS.values(), 100):
        source += f"        if n == {number}:\n            {text}\n"
    file: Path = tmp_path_factory.mktemp("faults") / "faulty.py"
    file.write_text(source)
    (cls,) = components(load(file))
    compiled = compile_component(cls)
    return Inside(compiled), compiled.description.record, source


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_names_line_and_sizes(
    name: str, component: tuple[Inside, np.dtype[np.void], str]
) -> None:
    inside, dtype, source = component
    number = 100 + list(FAULTS).index(name)
    record = np.zeros((), dtype)
    record["n"] = number
    text, words = FAULTS[name]
    said = inside.call("update", record)
    lines = source.splitlines()
    first = lines.index(f"        if n == {number}:") + 2
    assert said is not None
    line, _, rest = said.partition(": ")
    assert int(line) - first in range(text.count("\n") + 1), said
    assert rest == words.format(n=number)


def test_a_text_with_braces_stays_unchanged(tmp_path: Path) -> None:
    file = tmp_path / "faulty.py"
    file.write_text(
        f"{HEAD}        if n == 100:\n            raise IndexError('index {{}} of {{}}')\n"
    )
    (cls,) = components(load(file))
    compiled = compile_component(cls)
    record = np.zeros((), compiled.description.record)
    record["n"] = 100
    said = Inside(compiled).call("update", record)
    assert said is not None and said.endswith(": IndexError: index {} of {}")


BASE = """\
import numpy as np
from rtcf.component import Component, Input, State


class _Base(Component):
    n: Input[int]
    z: State[np.float64, 3]

    def update(self):
        self.z[0] = self.element()

    def element(self):
        return self.z[self.n.value] + 1.0 / self.n.value
"""
CALLING = """\
from {module} import _Base


class Calling(_Base):
    def update(self):
        self.z[1] = 0.0
        super().update()
"""
INHERITING = """\
from {module} import _Base


class Inheriting(_Base):
    pass
"""


@pytest.mark.parametrize(("text", "line"), [(CALLING, 7), (INHERITING, 4)])
def test_a_line_refers_to_the_file_of_the_class(
    text: str, line: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    module = f"base_at_{line}"
    (tmp_path / f"{module}.py").write_text(BASE)
    file = tmp_path / "child.py"
    file.write_text(text.format(module=module))
    (cls,) = components(load(file))
    inside = Inside(compile_component(cls))
    for number, said in ((0, "ZeroDivisionError: division by zero"), (9, "IndexError: index 9 ")):
        record = cls()._record
        record["n"], record["n__valid"] = number, True
        assert (inside.call("update", record) or "").startswith(f"{line}: {said}")
