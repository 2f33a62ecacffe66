"""Ordinary ways to write Python in a component: they are accepted, and mean what Python means."""

import ast
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules

HEAD = """\
import enum
import math
from types import SimpleNamespace

import numpy as np
import {helper}
from rtcf.component import Component, Input, Output, State


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1
    HOLD = 2


class Gains:
    KP = 2.0
    TABLE = np.array([1.0, 2.0])


FILTER = SimpleNamespace(alpha=0.25, order=2)
LIMITS = {{"low": -1.0, "high": 1.5}}
FIRST, REST = slice(0, 2), np.s_[2:]
CYCLIC = np.zeros((2, 2, 2))
CYCLIC[0, 1, 0] = CYCLIC[1, 0, 1] = 1.5
SPEEDS = {{Mode.OFF: 0.0, Mode.RUN: 1.0, Mode.HOLD: 0.5}}


def limited(x, *, low=-1.0, high=1.0):
    return min(max(x, low), high)


class Written(Component):
    u: Input[float]
    i: Input[int]
    w: Input[np.float64, 4]
    y: Output[float]
    k: Output[int]
    mode: State[Mode]
    a: State[np.float64, 4]
    m: State[np.float64, 2, 2]
    crc: State[np.uint32] = State(0xFFFF)

    ENDS = slice(None, None, 3)

    def error(self, x):
        return x - 1.0

    @property
    def level(self):
        return self.a[0]

    @level.setter
    def level(self, x):
        self.k.write(self.k.value + 1)
        self.a[0] = min(x, 1.5)

    @property
    def part(self):
        return self.a[1:]

    @part.setter
    def part(self, x):
        self.a[:3] = 2.0 * x

    def _half(self):
        return 0.5 * self.a[1]

    def _set_half(self, x):
        self.a[1] = x + 1.0

    half = property(_half, _set_half)

    def update(self):
        self.mode = Mode.RUN if self.u.value > 0.0 else Mode.OFF
        {text}
"""
WAYS = {
    "keyword-only argument": "self.y.write(limited(self.u.value, high=2.0))",
    "function of an imported module": "self.y.write({helper}.twice(self.u.value))",
    "constant of a class": "self.y.write(Gains.KP * self.u.value + Gains.TABLE[1])",
    "constant of a namespace": "self.y.write(FILTER.alpha * self.u.value + FILTER.order)",
    "element of a dict": "self.y.write(LIMITS['low'] * self.u.value)",
    "element of a dict by an enum": "self.y.write(SPEEDS[self.mode] * self.u.value)",
    "truth of an enum": "self.y.write(1.0 if self.mode else self.u.value)",
    "method named as a level": "self.y.write(self.error(self.u.value))",
    "infinity as text": "self.y.write(min(float('inf'), max(self.u.value, float('-inf'))))",
    "all elements": "self.a[...] = 0; self.a[0] = self.u.value; self.m[...] = self.u.value",
    "f-string in a log": 'self.info(f"u {{self.u.value:.3f}} {{{{}}}} {{self.mode.name}}")',
    "percent in a log": 'self.info("u %5.2f of %d, %s, 100 %%" % (self.u.value, self.i.value, 1))',
    "texts joined in a log": 'self.warn("u = " + str(self.u.value) + " {{}} m")',
    "format in a log": 'self.warn("u {{:.3f}} of {{}}".format(self.u.value, self.i.value))',
    "fault with values": """
        if self.u.value > 2.0:
            self.fault(f"u is {{self.u.value:.1f}} in {{self.i.value}}")""",
    "key in a dict": "self.y.write(1.0 if self.mode in SPEEDS else 0.0)",
    "int in a dict": "self.y.write(1.0 if self.i.value not in SPEEDS else 0.0)",
    "unsigned default": "self.crc = np.uint32(self.i.value & 255); self.k.write(int(self.crc))",
    "round to digits": "self.y.write(round(self.u.value, 2))",
    "remainder": "self.y.write(math.remainder(self.u.value, 2.0 * math.pi))",
    "length of an enum": "self.a[len(Mode)] = self.u.value",
    "constant slices": "self.a[FIRST] = self.w.value[REST]; self.m[0, FIRST] = self.a[FIRST]",
    "slice of the class": "self.a[self.ENDS] = self.u.value; self.m[0] = self.a[Written.ENDS]",
    "setter": "self.level = self.u.value",
    "setter with another name": "self.half = self.u.value + self.half",
    "setter in place": "self.level += self.u.value",
    "setter of a view in place": "self.a += self.w.value; self.part += 1.0; self.part *= 0.25",
    "sum over three dimensions": (
        "self.a[:2] = np.einsum('ijk,j,k', CYCLIC, self.a[:2], self.w.value[2:])"
    ),
    "append": "self.a = np.append(self.w.value[1:], self.u.value)",
    "append of a vector": "self.a = np.append(self.w.value[:1], self.w.value[1:])",
    "tile": "self.a = np.tile(self.w.value[:2], 2)",
    "repeat": "self.a = np.repeat(self.w.value[:2], 2)",
    "kron": "self.y.write(np.sum(np.kron(self.m, np.outer(self.w.value, self.w.value))))",
}


@pytest.mark.parametrize("way", WAYS)
def test_it_is_accepted_and_means_what_python_means(way: str, tmp_path: Path) -> None:
    helper = f"helper_{way.replace(' ', '_').replace('-', '_')}"
    (tmp_path / f"{helper}.py").write_text("def twice(x):\n    return 2.0 * x\n")
    file = tmp_path / "written.py"
    text = WAYS[way].replace("; ", "\n        ")
    file.write_text(HEAD.format(helper=helper, text=text.format(helper=helper)))
    (cls,) = modules.components(modules.load(file))
    found = verify.compare(cls, object_file.compile_component(cls), 400)
    assert found.differences == []
    assert found.raised < 100


def test_texts_with_values_are_logged_as_written(tmp_path: Path) -> None:
    texts = {
        "'%5.2f|%-6d|%+d|%04d|%x|%s|%5s|%%|{{}}' % (1.5, 2, 3, 4, 255, 6.25, 7)": 7,
        "'a' + str(1.5) + 'b{{}}' + str(2)": 2,
        "'{{:.3f}} {{}}'.format(1.5, 2)": 2,
        "f'{{1.5:8.3f}} {{2}} {{{{x}}}}'": 2,
    }
    body = "\n        ".join(f"self.info({text})" for text in texts)
    file = tmp_path / "texts.py"
    file.write_text(HEAD.format(helper="math", text=body.replace("{{", "{").replace("}}", "}")))
    (cls,) = modules.components(modules.load(file))
    update: Any = cls.update
    tree = modules.read(update).tree
    calls = [each.value for each in tree.body if isinstance(each, ast.Expr)]
    logged = []
    for call in calls:
        assert isinstance(call, ast.Call)
        text, *values = map(ast.literal_eval, call.args)
        logged.append(text.format(*values))
    assert logged == [eval(text.replace("{{", "{").replace("}}", "}")) for text in texts]
    assert [len(each.args) - 1 for each in calls] == list(texts.values())  # type: ignore[attr-defined]


ABSTRACT = """from rtcf.component import Component, Input, Output


class Filter(Component):
    u: Input[float]
    y: Output[float]

    def step(self, x):
        \"\"\"Return the next output.\"\"\"
        raise NotImplementedError("step")

    def update(self):
        self.y.write(self.step(self.u.value))


class Half(Filter):
    def step(self, x):
        return 0.5 * x
"""


def test_a_base_with_a_method_that_subclasses_define_is_no_component(tmp_path: Path) -> None:
    file = tmp_path / "abstract.py"
    file.write_text(ABSTRACT)
    assert [each.__name__ for each in modules.components(modules.load(file))] == ["Half"]
    file = tmp_path / "whole.py"
    file.write_text(ABSTRACT.replace('raise NotImplementedError("step")', "return x"))
    names = [each.__name__ for each in modules.components(modules.load(file))]
    assert names == ["Filter", "Half"]


def test_floats_are_rounded_to_digits_as_in_python(tmp_path: Path) -> None:
    file = tmp_path / "rounded.py"
    file.write_text(
        "from rtcf.component import Component, Input, Output\n\n\nclass Rounded(Component):\n"
        + "    u: Input[float]\n"
        + "".join(f"    y{digits}: Output[float]\n" for digits in range(16))
        + "\n    def update(self):\n"
        + "".join(
            f"        self.y{each}.write(round(self.u.value, {each}))\n" for each in range(16)
        )
    )
    (cls,) = modules.components(modules.load(file))
    inside, record = Inside(object_file.compile_component(cls)), cls()._record
    draw = random.Random(1)
    halves = [k / 2.0**n for n in range(8) for k in range(-40, 40)]
    values = [2.675, 1.005, -0.0, 1e300, 5e-324, np.inf, np.nan, 70368744177664.015625, *halves]
    values += [draw.uniform(-1.0, 1.0) * 10.0 ** draw.randrange(-3, 17) for _ in range(3000)]
    values += [draw.randrange(10**6) / 10.0 ** draw.randrange(1, 7) for _ in range(3000)]
    for value in values:
        record["u"], record["u__new"], record["u__valid"] = value, True, True
        assert inside.call("update", record) is None
        for digits in range(16):
            expected: Any = np.float64(round(float(value), digits))
            assert record[f"y{digits}"].tobytes() == expected.tobytes() or np.isnan(value), (
                value, digits, record[f"y{digits}"], expected,
            )  # fmt: skip
