"""Mistakes in Python components: each is one line with place, problem and advice."""

import re
from pathlib import Path

import pytest
from rtcf_compile.main import main

HEAD = """\
import enum
import random
import time
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import PoseStamped, Twist
from rtcf.component import Component, Derived, Input, Output, Parameter, Queue, State
from std_msgs.msg import Float64MultiArray

A = np.eye(2)
GAINS = {"kp": 1.0}
SIZE = 100
TABLE = [1.0, 2.0]


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1


class Other(enum.IntEnum):
    A = 0



def twice(x):
    return 2 * twice(x - 1) if x > 0 else 0


def same(x):
    return x


class Faulty(Component):
    u: Input[float]
    x: Output[np.float64, 2]
    y: Output[float]
    kp: Parameter[float] = Parameter(1.0)
    z: State[np.float64, 2]
    n: State[int]
    on: State[bool]
    q: Queue[float] = Queue(size=4)
    d: Derived[float]
    g: Parameter[np.float64, 2] = Parameter([1.0, 2.0])
    w: Input[np.float64, 2]
    t: Input[Twist]
    p: Output[PoseStamped]
    o: State[float | None]
    s: Input[PoseStamped]
    mode: State[Mode]

    @classmethod
    def made(cls):
        return 1

    @property
    def half(self):
        return 0.5 * self.kp
"""

# Statements of update (a mark {} is at the expected line), and the expected message.
IN_UPDATE = {
    "list growth": ("values = []", "a list that grows allocates"),
    "element of a list set": ("a = [1.0]\n        a[0] = 2.0", "a list that changes allocates"),
    "list times a variable": ("a = [0.0] * self.n", "arithmetic on lists without an array"),
    "number of values": ("a, b = self.z[0], 1, 2", "3 values for 2 names"),
    "order of equal elements": ("a = np.argsort(self.z)", 'write kind="stable"'),
    "unknown option of a function": ("a = np.sum(self.z, where=True)", "np.sum takes a, axis"),
    "rounded to digits": ("a = round(self.kp, self.n)", "use np.round(x, digits)"),
    "truth of what may be None": (
        "a = self.o\n        if a:\n            self.n = 1",
        "may be None, or 0",
    ),
    "name of an enum": ("a = self.mode.name", "text cannot be built"),
    "another enum": ("self.mode = Other.A", "Other is not Mode"),
    "pattern that takes apart": (
        "match self.z:\n            case [a, b]:\n                self.n = 1",
        "a pattern that unpacks",
    ),
    "walrus after what it changes": ("self.n = self.n + a * (a := 2)", "a may have no value"),
    "array larger than the arena": (
        "a = np.zeros((100, SIZE))",
        "is larger than the memory for temporary arrays",
    ),
    "class method": ("self.n = self.made()", "made is a classmethod"),
    "property set": ("self.half = 1.0", "half is a read-only property"),
    "unknown method of a base": ("super().stop()", "no base has stop"),
    "append": ("self.z.append(1.0)", "cannot grow"),
    "list comprehension": ("a = [x for x in self.z]\n        b = a", "a list allocates"),
    "dict": ("gains = {'kp': 1.0}\n        other = gains", "a dict allocates"),
    "dict of the module": ("a = GAINS", "a dict of the module"),
    "set": ("a = {1, 2}", "a set allocates"),
    "string formatting": ("name = 'x %d' % self.n", "text cannot be built"),
    "format method": ("name = 'x {}'.format(self.n)", "text cannot be built"),
    "f-string in a log call": ("self.info(f'x {self.n!r}')", "text cannot be built"),
    "log without constant text": ("self.info(self.n)", "constant text"),
    "array in a log call": ("self.info('z {}', self.z)", "a log call stores numbers"),
    "global variable": ("global A", "shared by all instances"),
    "print": ("print(self.n)", "printing calls the system"),
    "undeclared attribute": ("self.sum = 1.0", "is not declared"),
    "undefined name": ("self.n = sum_of", "sum_of is not defined"),
    "variable without a value": (
        "if self.on:\n            a = 1.0\n        self.y.write(a)",
        "a may have no value here",
    ),
    "variable of a loop": (
        "for i in range(self.n):\n            a = 1.0\n        self.y.write(a)",
        "a may have no value here",
    ),
    "range of a float": ("for i in range(self.kp):\n            self.n += i", "range of a float"),
    "result as an argument": ("np.add(self.z, 1.0, self.z)", "add has too many arguments"),
    "function of an array": ("a = round(self.z)", "int of a vector"),
    "parameter set": ("self.kp = 2.0", "a parameter is set from outside"),
    "input set": ("self.u = 2.0", "is an Input"),
    "port as value": ("self.y.write(self.u)", "is an Input"),
    "output assigned": ("self.y = 2.0", "is an Output"),
    "port's unknown field": ("self.n = self.u.count", "an Input has no count"),
    "wrong shape": ("self.z[:] = np.zeros(3)", "shape"),
    "types that nothing is for": ("a = np.clip(self.z, A, 'x')", "has no meaning here"),
    "message of another type": ("self.p.value.pose = self.t.value", "geometry_msgs/Pose is not"),
    "text copied": ("self.p.write(self.s.value)", "frame_id is not copied in the cycle"),
    "variable that is a message": (
        "a = self.t.value\n        a = 1.0",
        "a is a message",
    ),
    "product of wrong shapes": ("self.z[:] = A @ np.zeros(3)", "@ of sizes"),
    "number set to an array": ("self.y.write(self.z)", "a number is set to"),
    "array set to a matrix": ("self.z[:] = np.eye(2)", "is set to"),
    "int set to a float": ("self.n = 0.5", "a whole number is set to a float"),
    "bool set to a number": ("self.on = self.n", "a bool is set to an int"),
    "integer overflow": ("self.n = 2**63", "does not fit int64"),
    "big literal": ("self.n = 9223372036854775808", "does not fit int64"),
    "element of a constant set": ("A[0, 0] = 2.0", "A is a constant of the module"),
    "list of the module set": ("TABLE[0] = 2.0", "TABLE is a constant of the module"),
    "list of the module that grows": ("TABLE.append(2.0)", "TABLE is a constant of the module"),
    "constant sorted": ("A.sort()", "a constant of the module is sorted"),
    "constant filled": ("A.fill(0.0)", "a constant of the module is set"),
    "constant changed in place": (
        "a = A\n        a += 1.0",
        "a constant of the module",
    ),
    "number among rows": ("a = np.array([self.z, 1.0])", "an array of arrays and numbers"),
    "new axis of a number": ("a = self.u.value[None]", "a new axis of a float"),
    "constant set by another name": ("a = A\n        a[0, 0] = 2.0", "a constant of the module"),
    "float set to a whole element": (
        "i = np.zeros(2, np.int64)\n        i[self.n] = 0.5",
        "elements of int64 are set to float64",
    ),
    "vector set to an element": ("self.z[self.n] = self.z", "an element is set to a vector"),
    "float as an index": ("self.z[self.kp] = 1.0", "cannot be indexed by a float"),
    "recursion": ("self.n = twice(self.n)", "twice calls itself"),
    "generator": ("yield self.n", "a generator cannot be compiled"),
    "generator expression": ("a = (i for i in range(3))", "a generator cannot be compiled"),
    "np.delete": (
        "self.z[:] = np.delete(self.z, 1)",
        "np.delete changes the size of an array",
    ),
    "np.concatenate": ("a = np.concatenate((self.z, A))", "of vectors and matrices"),
    "eigenvalues": ("a = np.linalg.eigvals(A)", "calls LAPACK"),
    "another clock": ("t = time.time()", "a clock other than the loop's"),
    "random numbers": ("r = random.random()", "would draw different numbers in a replay"),
    "NumPy's random numbers": ("r = np.random.rand()", "would draw different numbers in a replay"),
    "a file": ("f = open('x')", "opening a file calls the system"),
    "try": (
        "try:\n            pass\n        except ValueError:\n            pass",
        "exceptions cannot be caught",
    ),
    "with": ("with self.n:\n            pass", "cannot open or lock"),
    "import": ("import math", "an import cannot be compiled"),
    "lambda": ("self.n = (lambda x: x)(2)", "a function cannot be a value"),
    "function in a function": (
        "def f(x):\n            return x\n        g = f",
        "f is a function, used as a value",
    ),
    "class in a hook": ("class A:\n            pass", "a class in a hook"),
    "endless loop": ("while True:\n            self.n += 1", "an endless loop"),
    "returning a value": ("return self.n", "a hook returns nothing"),
    "write as value": ("a = self.y.write(1.0)", "write returns no value"),
    "self passed on": ("same(self)", "self cannot be used as a value"),
    "several targets": ("self.n, self.kp = 1, 2.0", "a parameter is set from outside"),
    "two types of a variable": (
        "a = 1.0\n        if self.on:\n            a = self.z\n        self.y.write(a)",
        "a is a float in one place and a vector of float64 in another",
    ),
    "unsupported function of NumPy": ("a = np.polyfit(self.z, self.z, 1)", "np.polyfit"),
    "np.where of other dimensions": ("self.z[:] = np.where(self.z > 0.0, A, 0.0)", "np.where of"),
    "np.where of other shapes": ("self.z[:] = np.where(self.on, np.zeros(3), self.z)", "shape"),
    "misspelled function of NumPy": ("a = np.sinn(1.0)", "numpy has no sinn"),
    "read call": ("self.u.read()", "inputs are read before each update"),
    "queue as value": ("self.y.write(self.q)", "is a Queue"),
    "queue's unknown field": ("self.n = self.q.value", "a Queue has no value"),
    "pop as value": ("self.y.write(self.q.pop())", "pop returns no value"),
    "pop of an array": ("self.z.pop()", "cannot shrink"),
    "queue assigned": ("self.q = 2.0", "is a Queue"),
    "message as value": ("self.y.write(self.t.value)", "geometry_msgs/Twist is not a number"),
    "part of a message": ("self.y.write(self.t.value.linear)", "Twist.linear is not a number"),
    "field that a message has not": ("a = self.t.value.linear.w", "Twist.linear.w does not exist"),
    "text of a message": ("self.p.value.header.frame_id = 'base'", "header.frame_id is text"),
    "message of an input set": ("self.t.value.linear.x = 1.0", "belongs to an Input"),
    "message written": ("self.p.write(1.0)", "a message cannot be written as a whole"),
    "float to a message's int": (
        "self.p.value.header.seq = 0.5",
        "a whole number is set to a float",
    ),
    "element of a parameter set": ("self.g[0] = 2.0", "a parameter is set from outside"),
    "element of an input set": ("self.w.value[0] = 2.0", "belongs to an Input"),
    "derived value set": ("self.d = 2.0", "is Derived: only prepare sets it"),
    "fault with a variable": ("self.fault(self.n)", "a fault takes one constant text"),
    "isinstance": ("a = isinstance(self.n, int)", "types are fixed at compile time"),
    "time set": ("self.dt = 1.0", "belongs to the loop"),
    "complex number": ("self.n = 1j", "a whole number is set to a complex number"),
}
IN_PREPARE = {
    "input in prepare": ("self.d = self.u.value", "prepare runs beside the loop"),
    "state in prepare": ("self.n += 1", "prepare runs beside the loop"),
    "period in prepare": ("self.d = self.twice_dt()", "prepare runs beside the loop"),
}
IN_CLASS = {
    "port that may be None": ("    v: Input[float | None]", "only a State may be None"),
    "method __init__": (
        "    def __init__(self):\n        super().__init__()",
        "__init__ is not compiled",
    ),
    "missing annotation": ("    v = State(0.0)", "has no annotation"),
    "annotation without a type": ("    v: State", "has no type"),
    "annotation of another kind": ("    v: float = 0.0", "is neither Input, Queue"),
    "list as a type": ("    v: State[list]", "without element type and size"),
    "size of a variable": ("    v: State[np.float64, -1]", "use an integer above 0"),
    "parameter without default": ("    v: Parameter[float]", "has no default"),
    "initial value of another shape": ("    v: State[np.float64, 3] = State([1.0, 2.0])", "shape"),
    "initial value of another type": ("    v: State[int] = State(0.5)", "is an int"),
    "unknown option": ("    v: State[int] = State(unitt='m')", "has no option"),
    "queue without size": ("    v: Queue[float]", "has no size"),
    "queue of no size": ("    v: Queue[float] = Queue(size=0)", "use 1 to 1024 messages"),
    "message of any size": (
        "    v: Input[Float64MultiArray]",
        "of variable size: write its largest size",
    ),
    "size of a fixed message": ("    v: Input[Twist, 3]", "has no array of variable size"),
    "message as state": ("    v: State[Twist]", "declare an Input or an Output"),
    "unknown text of a message": (
        "    v: Output[Twist] = Output(texts={'frame': 'base'})",
        "texts do not match",
    ),
    "parameter's name taken": (
        "    g_0: Parameter[float] = Parameter(1.0)",
        "both have a parameter",
    ),
    "bounds of an enum": ("    v: Parameter[Mode] = Parameter(Mode.OFF, min=0)", "set by name"),
    "enum without members": ("    v: State[enum.IntEnum('Empty', [])]", "has no members"),
    "enum of more than 64 bits": (
        "    v: State[enum.IntEnum('Large', {'A': 2**63})]",
        "Large.A, which does not fit 64 bits",
    ),
    "reserved name": ("    dt: State[float]", "is a reserved name"),
}


def compiled(tmp_path: Path, source: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Compile a source that must fail; return the message."""
    file = tmp_path / "faulty.py"
    file.write_text(source)
    assert main([str(file), "-o", str(tmp_path / "faulty.so")]) == 1
    assert not (tmp_path / "faulty.so").exists()
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    return said


@pytest.mark.parametrize("name", IN_UPDATE)
def test_a_mistake_in_update_is_one_line_with_advice(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, expected = IN_UPDATE[name]
    source = f"{HEAD}\n    def update(self):\n        self.n += 1\n        {text}\n"
    said = compiled(tmp_path, source, capsys)
    found = re.fullmatch(r"rtcf-compile: .*faulty\.py:(\d+): (?:`.*?`: )?(.*): (.+)\n", said)
    assert found, said
    assert expected in said
    begin = source.split(text)[0].count("\n") + 1
    in_function = HEAD.split("def twice")[0].count("\n") + 1
    assert int(found[1]) in (*range(begin, begin + text.count("\n") + 1), in_function), said


@pytest.mark.parametrize("name", [name for name, (_, said) in IN_CLASS.items() if said])
def test_a_bad_declaration_is_rejected_with_its_line(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, expected = IN_CLASS[name]
    source = f"{HEAD}{text}\n\n    def update(self):\n        self.n += 1\n"
    said = compiled(tmp_path, source, capsys)
    assert expected is not None and expected in said
    assert f"faulty.py:{HEAD.count(chr(10)) + 1}: " in said


@pytest.mark.parametrize("name", IN_PREPARE)
def test_prepare_can_use_only_parameters(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, expected = IN_PREPARE[name]
    method = "    def twice_dt(self):\n        return 2.0 * self.dt\n"
    source = f"{HEAD}\n    def prepare(self):\n        {text}\n\n{method}"
    source += "\n    def update(self):\n        self.n += 1\n"
    said = compiled(tmp_path, source, capsys)
    assert expected in said
    wanted = "2.0 * self.dt" if "twice" in text else text
    assert f"faulty.py:{source.split(wanted)[0].count(chr(10)) + 1}: " in said


def test_an_array_larger_than_the_arena_is_rejected_in_real_time_hooks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    head = HEAD.replace("class Faulty", "def large():\n    return np.zeros(9000)\n\n\nclass Faulty")
    source = f"{head}\n    def half(self):\n        return large()[0]\n"
    source += "\n    def update(self):\n        self.z[0] = self.half()\n"
    line = source.split("np.zeros(9000)")[0].count("\n") + 1
    said = compiled(tmp_path, source, capsys)
    assert f"faulty.py:{line}: `np.zeros(9000)`: is larger than the memory for temporary" in said
    file = tmp_path / "faulty.py"
    file.write_text(
        source.replace("def update", "def start") + "\n    def update(self):\n        self.n = 1\n"
    )
    assert main([str(file), "--verify", "1"]) == 0


def test_a_class_without_update_is_rejected(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "write `def update(self):`" in compiled(tmp_path, HEAD, capsys)
    assert "has no component" in compiled(tmp_path, "x = 1\n", capsys)
    assert "correct the syntax" in compiled(tmp_path, "x = = 1\n", capsys)
    assert "run as Python first" in compiled(tmp_path, "import no_such_module\n", capsys)
