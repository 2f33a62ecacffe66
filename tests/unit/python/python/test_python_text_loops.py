"""Loops over texts and ports, which are written out, and texts of the module in log calls."""

import ast
from pathlib import Path

import pytest
from rtcf_compile.comparison import verify
from rtcf_compile.library import log_text
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
from enum import Enum, auto

import numpy as np
from rtcf.component import Component, Input, Output, State

JOINTS = ("base", "shoulder", "elbow", "wrist")
LIMITS = {"base": 1.0, "wrist": 0.5}
CHECKS = (("hot", 80.0), ("cold", -10.0))


class Phase(Enum):
    A = auto()
    B = auto()


NAMES = {Phase.A: "first", Phase.B: "second"}


class Loops(Component):
    tau: Input[np.float64, 4]
    left: Input[float]
    right: Input[float]
    y: Output[float]
    phase: State[Phase]
    n: State[np.int64, 4]
    k: State[int]

    def moved(self):
        self.k += 1
        return self.k

    def update(self):
        self.phase = Phase.B if self.k % 2 else Phase.A
        self.k += 1
        total, tau = 0.0, self.tau.value
"""
WAYS = {
    "zip, which keeps the old array": """
        for name, t, limit in zip(JOINTS, tau, (0.2, 0.6, 0.3, 0.8)):
            if abs(t) > limit:
                self.warn(f"{name}: {t:.2f} Nm above {limit} Nm")
                total += t
            tau = tau * 2.0
""",
    "zip with a shorter array": """
        for name, t in zip(JOINTS, tau[:2]):
            self.info("{} {}", name, t)
            total += t
""",
    "enumerate and continue": """
        for bit, name in enumerate(("stale", "lost", "late"), 1):
            if self.k & (1 << bit):
                self.n[bit] += 1
                self.warn(f"{name} no. {self.n[bit]}, again {name:>20}")
                continue
            total += 1.0
""",
    "items of a dict and break": """
        for name, limit in LIMITS.items():
            if self.left.value > limit:
                self.info("{} {}", name, limit)
                total += limit
                break
            total -= 2.0
""",
    "pairs of the module, with a loop inside": """
        for i, (name, limit) in enumerate(CHECKS):
            for q in range(4):
                if q == 1:
                    continue
                if q == 3:
                    break
                total += q
            if self.right.value * 100.0 > limit:
                total += limit + i
                self.error(name + " " + JOINTS[i] + f" in {NAMES[self.phase]}")
                break
""",
    "pairs with values that change in the loop": """
        self.n[0], self.n[1] = 3, 5
        for name, value in (("left", self.n[0]), ("right", self.n[1])):
            self.n[1] += value
            total = 10.0 * total + value
            self.info(name + " %d" % value)
""",
    "ports with names": """
        for name, port in (("left", self.left), ("right", self.right)):
            if port.new and port.value < 0.0:
                self.info("%s is %.1f" % (name, port.value))
                total += port.value
""",
    "comprehensions in it": """
        for name in ("base", "wrist"):
            total = 2.0 * total + sum(LIMITS[name] * x for x in tau)
        for port in (self.left, self.right):
            total = 3.0 * total + sum(port.value * x for x in tau)
""",
    "enums, which are no ports": """
        for phase in (self.phase, self.phase):
            self.phase = Phase.B
            total = 10.0 * total + phase.value
""",
    "else and continue": """
        for i in range(3):
            for x in tau:
                if x > 0.5:
                    break
            else:
                continue
            total += i
""",
    "ports and break": """
        for port in (self.left, self.right):
            if port.value > 0.0:
                total += 3.0
                break
            total += port.value
""",
    "texts by index and by enum": """
        self.info("{} {}", NAMES[self.phase], JOINTS[self.k % 4])
        self.info(JOINTS[-self.k % 4 - 4] + " is last")
""",
}


@pytest.mark.parametrize("way", WAYS)
def test_a_loop_means_what_python_means(tmp_path: Path, way: str) -> None:
    cls = _loaded(tmp_path, WAYS[way])
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.largest_ulp == 0
    assert result.raised == 0


def test_a_wrong_index_of_a_text_raises(tmp_path: Path) -> None:
    cls = _loaded(tmp_path, 'self.info("{}", JOINTS[self.k])\n        self.k = 9\n')
    result = verify.compare(cls, object_file.compile_component(cls), 300)
    assert result.problem == ""
    assert result.raised > 200


def test_the_texts_of_log_calls_are_constants(tmp_path: Path) -> None:
    ways = ("enumerate and continue", "texts by index and by enum", "ports with names")
    texts = {}
    for way in ways:
        component = object_file.compile_component(_loaded(tmp_path, WAYS[way]))
        texts[way] = [each.text for each in component.logs.calls]
    assert texts["enumerate and continue"] == [
        f"{name} no. {{}}, again {name:>20}" for name in ("stale", "lost", "late")
    ]
    assert texts["ports with names"] == ["left is {:.1f}", "right is {:.1f}"]
    found = texts["texts by index and by enum"]
    joints = ("base", "shoulder", "elbow", "wrist")
    names = {f"{phase} {joint}" for phase in ("first", "second") for joint in joints}
    assert set(found) == names | {f"{joint} is last" for joint in joints}


REJECTED = {
    "number joined to a text": ('self.info("k " + self.k)', "a log call needs a constant text"),
    "element joined to a text": ('self.info("k " + tau[0])', "joins a number to a text"),
    "text that is set": (
        'for name in JOINTS:\n            name = "base"\n            total += LIMITS[name]',
        "LIMITS is a dict with other keys or values",
    ),
    "text of a log beside a call": (
        'self.info("{} {}", self.moved(), JOINTS[self.k % 4])',
        "a log call stores numbers and bools, not text",
    ),
    "text that is kept": (
        "for name in JOINTS:\n            last = name\n        self.info(last)",
        "a log call needs a constant text",
    ),
}


@pytest.mark.parametrize("mistake", REJECTED)
def test_other_texts_are_rejected(tmp_path: Path, mistake: str) -> None:
    text, message = REJECTED[mistake]
    with pytest.raises(Mistake) as caught:
        compiled = object_file.compile_component(_loaded(tmp_path, text))
        log_text.check(compiled.logs)
    assert message in str(caught.value)


def _loaded(folder: Path, text: str) -> type:
    body = f"        {text.strip()}\n        self.y.write(total)\n"
    ast.parse(HEAD + body)
    file = folder / "loops.py"
    file.write_text(HEAD + body)
    return modules.components(modules.load(file))[0]
