"""Names of arrays have the meaning of NumPy: random programs give the results of a plain class, or
are rejected.
"""

import os
import random
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from name_programs import Program, component, plain
from rtcf.component import describe
from rtcf.component.interpreter import fresh_record
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.rewriting import references
from rtcf_compile.rewriting.functions import Functions
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

CYCLES = 8  # of each program
TOGETHER, SEEDS = 2, 50  # programs in one component, seeds in one process
# Runs update on a record; returns the text of its exception, or None.
Update = Callable[[Any], str | None]


def machine_code(cls: type) -> Update:
    inside = Inside(object_file.compile_component(cls))
    return lambda record: inside.call("update", record)


class _Members:
    """The members of a record for rewritten functions: arrays are views."""

    def __init__(self, record: Any) -> None:
        vars(self)["record"] = record

    def __getattr__(self, name: str) -> Any:
        value = vars(self)["record"][name]
        return value if value.ndim else value.item()

    def __setattr__(self, name: str, value: Any) -> None:
        vars(self)["record"][name] = value


def rewritten(cls: type) -> Update:
    """Return the functions that are compiled, run by Python. This takes a hundredth of the time."""
    update = Functions(cls, describe(cls), lambda function: function).hooks()["update"]

    def run(record: Any) -> None:
        update(_Members(record))

    return run


class Programs:
    """Programs of a seed in one component."""

    def __init__(
        self, programs: dict[int, Program], folder: Path, compiler: Callable[[type], Update]
    ) -> None:
        self.programs = programs
        self.rejected: dict[int, str] = {}
        file = folder / "names.py"
        while True:
            file.write_text(component(self.programs))
            (cls,) = modules.components(modules.load(file))
            try:
                self._update = compiler(cls)
                break
            except Mistake as mistake:
                self._reject(file, mistake)
                file = file.with_stem(f"{file.stem}_")  # modules are loaded once
        self._record = fresh_record(describe(cls))
        self._draw = np.random.default_rng(1)

    @classmethod
    def drawn(
        cls, seed: int, folder: Path, together: int, compiler: Callable[[type], Update]
    ) -> "Programs":
        """Return the programs of a seed."""
        draw = random.Random(seed)
        programs = {number: Program.drawn(draw, number) for number in range(together)}
        (folder / str(seed)).mkdir()
        return cls(programs, folder / str(seed), compiler)

    def _reject(self, file: Path, mistake: Mistake) -> None:
        assert mistake.line, mistake
        before = "\n".join(file.read_text().splitlines()[: mistake.line])
        number = int(re.findall(r"def \w+?_(\d+)(?:_\d+)?\(", before)[-1])
        self.rejected[number] = f"{mistake}\n{self.programs[number].text}"
        del self.programs[number]

    def different(self) -> dict[int, str]:
        """Return the first difference of each program."""
        found: dict[int, str] = {}
        for number, program in self.programs.items():
            scope: dict[str, Any] = {}
            exec(plain(program, number), scope)
            model, method = scope["Plain"](), f"program_{number}"
            for cycle in range(CYCLES):
                if said := self._cycle(number, model, method):
                    found[number] = f"cycle {cycle}: {said}\n{program.text}"
                    break
        return found

    def _cycle(self, number: int, model: Any, method: str) -> str:
        record = self._record
        record["which"] = number
        for name in ("v", "w"):
            values = self._draw.integers(-4, 5, 4).astype(float)
            record[name] = values
            getattr(model, name).array = values
        for name in ("which", "v", "w"):
            record[f"{name}__new"] = record[f"{name}__valid"] = True
        raised = ""
        with np.errstate(all="ignore"):
            try:
                getattr(model, method)()
            except ValueError as error:
                raised = str(error)
            said = self._update(record)
        if raised or said:
            return f"{said} compiled, {raised} in NumPy"
        for name in ("y", "z", "a", "_b", "c", "m", "k", "t", "s"):
            ours, theirs = record[f"{name}{number}"], getattr(model, f"{name}{number}")
            theirs = getattr(theirs, "value", theirs)
            if not np.isfinite(theirs).all() or np.max(np.abs(theirs)) > 1e100:
                continue
            # Products of matrices sum in another order.
            most = 1e-9 * max(1.0, np.max(np.abs(theirs)))
            if not np.allclose(ours, theirs, 1e-9, most, True):
                return f"{name} is {ours} compiled, {theirs} in NumPy"
        return ""


@dataclass
class Found:
    """Results of the programs of some seeds."""

    features: Counter[str] = field(default_factory=Counter)  # number of programs with each
    rejected: int = 0
    different: list[str] = field(default_factory=list)


def run(seeds: range, folder: Path, together: int, compiler: Callable[[type], Update]) -> Found:
    """Compare the programs of these seeds with NumPy."""
    found = Found()
    for seed in seeds:
        programs = Programs.drawn(seed, folder, together, compiler)
        for number, said in programs.different().items():
            found.different.append(f"seed {seed}, program {number}: {said}")
        for each in programs.programs.values():
            found.features.update(dict.fromkeys(each.features, 1))
        found.rejected += len(programs.rejected)
    return found


@pytest.mark.random(8)
@settings(max_examples=9, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1))
def test_names_of_arrays_mean_what_they_mean_in_numpy(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    found = run(range(seed, seed + 1), tmp_path_factory.mktemp("names"), 8, machine_code)
    assert not found.different


@pytest.mark.random(4)
@settings(max_examples=200, phases=[Phase.explicit, Phase.reuse, Phase.generate])
@given(seed=st.integers(0, 2**32 - 1))
def test_rewritten_functions_mean_what_is_written(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    found = run(range(seed, seed + 1), tmp_path_factory.mktemp("names"), 1, rewritten)
    assert not found.different


@pytest.mark.long
@pytest.mark.parametrize(("compiler", "count"), [(rewritten, 100_000), (machine_code, 2000)])
def test_many_programs_of_names(tmp_path: Path, compiler: Any, count: int) -> None:
    begin = int(os.environ.get("RTCF_SEED", "51"))
    starts = range(begin, begin + count // TOGETHER, SEEDS)
    total = Found()
    # Processes end with the modules that they have loaded, through which inspect searches.
    with get_context("fork").Pool(maxtasksperchild=1) as pool:
        one = partial(_one, folder=tmp_path, compiler=compiler)
        for found in pool.imap_unordered(one, starts):
            assert not found.different
            total.features += found.features
            total.rejected += found.rejected
    print(f"{total.rejected} of {count} rejected; {dict(total.features.most_common())}")
    assert min(total.features.values()) > count // 200, total.features


def _one(start: int, folder: Path, compiler: Callable[[type], Update]) -> Found:
    return run(range(start, start + SEEDS), folder, TOGETHER, compiler)


# Statements of update, which NumPy's names give a meaning.
STATEMENTS = {
    "rate": "old = self.a\nself.a = 0.9 * self.a + self.v.value\nself.b = self.a - old",
    "swap": "self.a, self.b = self.b, self.a\nself.a = self.a + self.v.value",
    "swap in place": "self.a, self.b = self.b, self.a\nself.a[:] = self.b + self.v.value",
    "turn": "self.a, self.b, self.c = self.c, self.a, self.b\nself.a += self.v.value",
    "swap by a name": "old = self.a\nself.a = self.b\nself.b = old\nself.a += self.v.value",
    "output": "old = self.y.value\nself.y.write(0.5 * old + self.v.value)\n"
    "self.a = self.y.value - old",
    "delayed": "self.c = self.b\nself.b = self.a\nself.a = self.v.value",
    "row": "row = self.m[1]\nself.m = 0.5 * self.m + self.v.value\nself.a = row - self.m[1]",
    "column": "part = self.m[:, 1]\nself.m = self.m.T + self.v.value\nself.a = part + 1.0",
    "transposed": "t = self.m.T\nself.m = self.m + self.v.value\nself.k = t - self.m",
    "tuple": "pair = (self.a, self.b)\nself.a = self.a + self.v.value\nself.b = pair[0] - self.a",
    "conditional": "x = self.a if self.s < 3.0 else self.b\nself.s += 1.0\n"
    "self.a = self.a + self.v.value\nself.b = x - self.a",
    "property": "old = self.now\nself.a = self.a + self.v.value\nself.b = self.now - old",
    "argument": "self.b = self.stepped(self.a)",
    "loop over rows": "for row in self.m:\n    self.m = self.m + self.v.value\n    self.a = row",
    "loop over elements": "for x in self.a:\n    self.a = self.a + self.v.value\n    self.s += x",
    "loop": "for _ in range(3):\n    old = self.a\n    self.a = 0.5 * old + self.v.value\n"
    "    self.b = self.a - old",
    "operand": "self.b = self.m @ self.set_m()",
    "pending sum": "self.b = (2.0 * self.a) + self.set_a()",
    "in place with a call": "self.a += self.set_a()",
    "element with a call": "self.a[1] = self.a[2] + self.set_a()[0]",
    "call in the target": "self.get_m()[1] = self.m[0] + self.a",
    "input changed": "x = self.v.value\nx += 1.0\nself.a = x - self.v.value",
    "input kept": "self.a = self.v.value\nself.a += 1.0",
    "branch": "old = self.a\nif self.v.value[0] > 0.0:\n    self.a = self.a + 1.0\n"
    "self.b = self.a - old",
    "helper": "old = same(self.a)\nself.a = self.a + self.v.value\nself.b = old",
    "shared, not changed": "self.b = self.a\nself.a = self.a + self.v.value",
    "selected": "old = self.a\nself.a = self.a if self.v.value[0] > 0.0 else 2.0 * self.v.value\n"
    "self.b = self.a - old",
    "selected by a function": "old = self.a\nself.a = self.halved(self.a, self.v.value[0])\n"
    "self.b = self.a - old",
    "tuples joined": "t = (self.a,) + (self.b,)\nself.a = self.a + self.v.value\nself.b = t[0]",
    "part of a tuple": "t = (self.a, self.b, self.c)[1:]\nself.b = self.b + self.v.value\n"
    "self.c = t[0] - self.b",
    "list repeated": "t = [self.a] * 2\nself.a = self.a + self.v.value\nself.b = t[1] - self.a",
    "annotated again": "old = self.a\nself.a = self.a + self.v.value\nold: np.ndarray\n"
    "self.b = self.a - old",
    "element after its member": "x = self.a\nself.a, x[0] = self.v.value, 50.0",
    "ravel of a column": "x = self.m[:, 0].ravel()\nx[0] += 4.0\nself.a = x + 1.0",
    "ravel of a reversed vector": "x = self.a[::-1].ravel()\nx[0] += 4.0\nself.b = x + 1.0",
    "contiguous": "x = np.ascontiguousarray(self.m.T)\nx[0, 0] += 4.0\nself.k = x + 1.0",
    "first power": "x = self.a**1\nx[0] = 5.0\nself.b = x",
    "new axis": "x = self.a[None, :]\nrow = x[0]\nself.a = self.a + self.v.value\nself.b = row",
    "diagonal matrix": "x = np.diag(self.v.value)\nx[0, 1] = 3.0\nself.k = x",
    "rows by a list": "self.k = self.m[[2, 0, 1, 3]]\nself.k[0, 0] += 1.0",
    "row by an int of a function": "row = self.m[np.argmax(self.a)]\n"
    "self.m = self.m + self.v.value\nself.b = row",
    "selected twice": "up = self.v.value[0] > 0.0\nself.a = self.a if up else self.v.value\n"
    "self.b = self.b if up else self.v.value\nself.a[0] += 1.0",
    "array of its own type": "x = np.asarray(self.a, dtype=float)\nx[0] += 5.0",
    "input sorted": "self.v.value.sort()\nself.a = self.v.value",
    "match": "match int(self.v.value[0]):\n    case 0:\n        x, y = self.a, self.b\n"
    "    case _:\n        x, y = self.b, self.a\nself.a = self.a + self.v.value\nself.c = x - y",
    "matrix of a block": "x = self.t[1]\nself.t = self.t + self.v.value\nself.m = x - self.t[1]",
    "column of a block": "x = self.t[0, :, 1]\nself.t[0, 2] = self.v.value\nself.a = x + 1.0",
    "row of a name": "x = self.t\nself.t = 0.5 * self.t + self.v.value\nself.a = x[1, 2] - 1.0",
    "blocks in a loop": "for x in self.t:\n    self.t = self.t + self.v.value\n    self.k = x",
    "block as a vector": "x = self.t.reshape(-1)\nx[3] += 4.0\nself.s = x[3]",
    "block transposed": "x = self.t.T\nx[1, 1] = self.v.value[:2]\nself.m = self.t[0] + 1.0",
    "view of a new array": "x = self.v.value + 1.0\nhead = x[:2]\nhead[0] = 9.0\nself.a = x",
}
METHODS = """\
    @staticmethod
    def halved(x, share):
        if share > 0.0:
            return 0.5 * x
        return x

    @property
    def now(self):
        return self.a

    def stepped(self, p):
        self.a = self.a + self.v.value
        return self.a - p

    def set_m(self):
        self.m = self.m + 1.0
        return self.v.value

    def set_a(self):
        self.a = 0.5 * self.a + self.v.value
        return self.a

    def get_m(self):
        self.a = self.a + 1.0
        return self.m

"""


@pytest.mark.parametrize("compiler", [rewritten, machine_code])
def test_statements_mean_what_they_mean_in_numpy(tmp_path: Path, compiler: Any) -> None:
    programs = {}
    for number, text in enumerate(STATEMENTS.values()):
        body = "".join(f"        {line}\n" for line in text.split("\n"))
        whole = METHODS + f"    def program(self):\n{body}"
        members = r"self\.([abcmkstyz])\b(?!\()"
        whole = re.sub(members, rf"self.\g<1>{number}", whole).replace("self.b", "self._b")
        names = r"\b(now|halved|stepped|set_m|set_a|get_m|same|program)\b"
        programs[number] = Program(re.sub(names, rf"\g<1>_{number}", whole))
    found = Programs(programs, tmp_path, compiler)
    assert not found.rejected
    assert not found.different()


def test_programs_with_many_ways_mean_what_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(references, "_EFFORT", ((12, 1), (1, 10_000)))
    found = run(range(20), tmp_path, 1, rewritten)
    assert not found.different
    assert found.rejected < 10
    monkeypatch.setattr(references, "_EFFORT", ((12, 1), (1, 1)))
    with pytest.raises(Mistake, match="too many names of arrays in loops and calls") as raised:
        rewritten(modules.components(modules.load(tmp_path / "0" / "names.py"))[0])
    assert raised.value.line


def test_the_interpreter_binds_names_as_numpy_does(tmp_path: Path) -> None:
    file = tmp_path / "names.py"
    file.write_text(
        "import numpy as np\nfrom rtcf.component import Component, Input, Output, State\n\n\n"
        "class Names(Component):\n    v: Input[np.float64, 2]\n    y: Output[np.float64, 2]\n"
        "    a: State[np.float64, 2]\n    b: State[np.float64, 2] = State([1.0, 2.0])\n\n"
        "    def update(self):\n        old, last = self.a, self.y.value\n"
        "        self.a, self.b = self.b, self.a\n        self.a += self.v.value\n"
        "        self.v.value[0] = 7.0\n        self.y.write(self.a - old + last)\n"
    )
    (cls,) = modules.components(modules.load(file))
    component: Any = cls()
    component.v.put([1.0, 1.0])
    component.cycle()
    assert component.a.tolist() == [2.0, 3.0]
    assert component.b.tolist() == [0.0, 0.0]
    assert component.y.value.tolist() == [2.0, 3.0]
    component.cycle()
    assert component.a.tolist() == [1.0, 1.0]
    assert component.b.tolist() == [2.0, 3.0]
    assert component.y.value.tolist() == [1.0, 1.0]


OPTIONAL = """\
import numpy as np
from rtcf.component import Component, Input, Output, State


class Optional(Component):
    n: Input[int]
    v: Input[np.float64, 4]
    y: Output[np.float64, 4]
    o: State[np.float64 | None, 4]
    p: State[np.float64 | None, 4]

    def start(self):
        self.o = np.ones(4) * 2.0
        self.o, self.p = self.p, self.o

    def update(self):
        old = self.o
        self.o = None if self.n.value == 0 else self.v.value * 2.0
        x = None if self.n.value == 1 else self.v.value + 1.0
        y = None if self.n.value == 2 else self.v.value + 2.0
        if x is not None and y is not None:
            self.y.write(y - x)
        if old is not None:
            self.p = old
        self.o, self.p = self.p, self.o
"""


def test_temporary_arrays_that_may_be_none_keep_their_elements(tmp_path: Path) -> None:
    file = tmp_path / "optional.py"
    file.write_text(OPTIONAL)
    (cls,) = modules.components(modules.load(file))
    found = verify.compare(cls, object_file.compile_component(cls), 1000)
    assert (found.differences, found.raised) == ([], 0)
