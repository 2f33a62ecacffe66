"""Enums of ints that are no ints (enum.Enum), and sets of flags: they mean what Python means, or
are rejected.
"""

from pathlib import Path
from typing import Any

import pytest
from rtcf.component import DeclarationError, describe
from rtcf_compile.comparison import verify
from rtcf_compile.machine_code import object_file
from rtcf_compile.source import modules
from rtcf_compile.source.mistake import Mistake

HEAD = """\
from enum import Enum, Flag, IntFlag, auto

import numpy as np
from rtcf.component import Component, Input, Output, Parameter, State


class Phase(Enum):
    OPEN = auto()
    CLOSING = auto()
    HOLD = 7


class Other(Enum):
    X = 1


class Text(Enum):
    K = "k"


class Fault(IntFlag):
    NONE = 0
    HOT = 1
    LATE = 2
    LOST = 4


class Bits(Flag):
    A = 1


CRITICAL = Fault.HOT | Fault.LOST
SPEED = {Phase.OPEN: 0.5, Phase.CLOSING: 1.0}


class Enums(Component):
    u: Input[float]
    p: Input[Phase]
    y: Output[float]
    f: Output[int]
    q: Output[Phase]
    phase: State[Phase]
    last: State[Phase | None]
    wanted: Parameter[Phase] = Parameter(Phase.CLOSING)
    n: State[int]
"""
COMPONENT = """
    def start(self):
        self.phase = Phase.OPEN
        self.last = None

    def go(self, new):
        if new is not self.phase:
            self.info("{} to {}", self.phase.name, self.n)
            self.last = self.phase
        self.phase = new

    def update(self):
        match self.phase:
            case Phase.OPEN | Phase.HOLD:
                if self.u.value > 0.3:
                    self.go(Phase.CLOSING)
            case Phase.CLOSING:
                self.go(Phase.HOLD if self.u.value < 0.0 else self.phase)
        if self.phase in (Phase.OPEN, Phase.HOLD) or self.wanted == Phase.HOLD:
            self.n += self.phase.value
        y = SPEED[self.phase] if self.phase in SPEED else 0.0
        y += SPEED.get(self.p.value, 3.0)
        local = {Phase.OPEN: self.u.value, Phase.HOLD: 2.0}
        y += local.get(self.phase, 5.0)
        if self.last == Phase.OPEN:
            y += 1.0
        if self.last is Phase.HOLD:
            y += 10.0
        flags = Fault.NONE
        y += int(~Fault.HOT) + (~CRITICAL ^ Fault.LATE)
        if self.u.value > 0:
            flags |= Fault.HOT
        if y > 1:
            flags |= Fault.LATE
        if flags & CRITICAL and not flags & ~Fault.HOT:
            y -= 1
        if Phase(2 if self.u.value > 1 else 1) == self.p.value:
            y += 100.0
        self.y.write(y)
        self.f.write(int(flags))
        self.q.write(self.phase)
"""


def test_an_enum_means_what_python_means(tmp_path: Path) -> None:
    cls = _loaded(tmp_path, COMPONENT)
    result = verify.compare(cls, object_file.compile_component(cls), 2000)
    assert result.problem == ""
    assert result.largest_ulp == 0
    assert result.raised == 0


def test_the_interpreter_takes_and_gives_members(tmp_path: Path) -> None:
    component: Any = _loaded(tmp_path, COMPONENT)(wanted="HOLD")
    phases = type(component.wanted)
    assert component.wanted is phases.HOLD
    component.p.put("OPEN")
    component.u.put(0.5)
    component.cycle()
    assert component.q.value is phases.CLOSING
    component.u.put(-0.5)
    component.cycle()
    assert component.phase is phases.HOLD
    assert component.last is phases.CLOSING
    with pytest.raises(ValueError, match="p is 'SHUT', which is none of OPEN, CLOSING, HOLD"):
        component.p.put("SHUT")


_VALUE = "compare it with its members by == or is, or write .value"
REJECTED = {
    "compared with an int": ("y = 1.0 if self.phase == 1 else 0.0", _VALUE),
    "compared with another enum": ("y = 1.0 if self.phase == Other.X else 0.0", _VALUE),
    "order": ("y = 1.0 if self.phase < Phase.HOLD else 0.0", _VALUE),
    "arithmetic": ("y = self.phase + 1.0", _VALUE),
    "truth": ("y = 1.0 if self.phase else 0.0", _VALUE),
    "set to an int": ("self.phase = 1", "an int is not a Phase: give it a member, such as"),
    "set to another enum": ("self.phase = Other.X", "Other is not Phase"),
    "output of an int": ("self.q.write(2)", "an int is not a Phase"),
    "state of an int": ("self.n = self.phase", "an enum Phase: write .value"),
    "log of a member": ('self.info("{}", self.phase)', "write .name, or .value"),
    "key that is an int": ("y = SPEED[self.n]", "an int is not a Phase"),
    "key that is a constant": ("y = SPEED[1]", "SPEED has no 1"),
    "search for an int": ("y = 1.0 if self.n in SPEED else 2.0", _VALUE),
    "index": ("y = np.zeros(3)[self.phase]", "cannot be indexed by an enum Phase"),
    "all other flags of a variable": (
        "flags = Fault.HOT\n        y = float(~flags)",
        "~ of flags keeps to the bits of their class",
    ),
    "key of a dict of the hook": (
        "t = {Phase.OPEN: 1.0, Phase.HOLD: 2.0}\n        y = t.get(self.n, 9.0)",
        "an int is not a Phase",
    ),
    "keys of two kinds": (
        "t = {Phase.OPEN: 1.0, 7: 2.0}\n        y = t.get(self.phase, 9.0)",
        "a dict allocates memory",
    ),
    "member of a flag": ("self.n = Bits.A", "write .value"),
}
DECLARED = {
    "enum of texts": ("    v: State[Text]", "has Text.K = 'k', which is no int"),
    "flags": ("    v: State[Fault]", "is a set of flags Fault: declare an int"),
}


@pytest.mark.parametrize("mistake", REJECTED)
def test_other_uses_are_rejected(tmp_path: Path, mistake: str) -> None:
    text, message = REJECTED[mistake]
    body = f"    def update(self):\n        y = 0.0\n        {text}\n        self.y.write(y)\n"
    with pytest.raises(Mistake) as caught:
        object_file.compile_component(_loaded(tmp_path, body))
    assert message in str(caught.value)


@pytest.mark.parametrize("mistake", DECLARED)
def test_declarations_of_other_enums_are_rejected(tmp_path: Path, mistake: str) -> None:
    text, message = DECLARED[mistake]
    with pytest.raises(DeclarationError) as caught:
        describe(_loaded(tmp_path, f"{text}\n\n    def update(self):\n        pass\n"))
    assert message in str(caught.value)


def _loaded(folder: Path, text: str) -> type:
    file = folder / "enums.py"
    file.write_text(HEAD + text)
    return modules.components(modules.load(file))[0]
