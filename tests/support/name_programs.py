"""Random programs full of names of arrays: views, swaps, calls with effects, nested functions,
comprehensions, loops, conditions.

A program is the text of some methods of a class. It runs in a component, and in a plain class with
NumPy arrays as attributes, which knows nothing of rtcf.
"""

import random
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

SIZE = 4
VECTORS, MATRICES = ("a", "_b", "c"), ("m", "k")

FUNCTIONS = """\
def half_{n}(p):
    return 0.5 * p


def same_{n}(p):
    return p


def first_{n}(p):
    p[0] += 1.0
    return p


class Both_{n}(NamedTuple):
    one: np.ndarray
    other: np.ndarray

    def front(self):
        return same_{n}(self.one)


@dataclass
class Two_{n}:
    one: np.ndarray
    other: np.ndarray

    @property
    def back(self):
        return self.other[::-1]


def both_{n}(p, q) -> Both_{n}:
    return Both_{n}(other=q, one=p)


"""
IMPORTS = """\
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
"""
HEAD = f"""\
{IMPORTS}\
from rtcf.component import Component, Input, Output, State


"""
CLASS = """\
class Names(Component):
    which: Input[np.int64]
    v: Input[np.float64, 4]
    w: Input[np.float64, 4]
"""
MEMBERS = """\
    y{n}: Output[np.float64, 4]
    z{n}: Output[np.float64, 4, 4]
    a{n}: State[np.float64, 4]
    _b{n}: State[np.float64, 4]
    c{n}: State[np.float64, 4]
    m{n}: State[np.float64, 4, 4]
    k{n}: State[np.float64, 4, 4]
    t{n}: State[np.float64, 2, 4, 4]
    s{n}: State[float]
"""
PLAIN = """\
class In:
    def __init__(self):
        self.array = np.zeros(4)

    @property
    def value(self):
        return self.array.copy()


class Out:
    def __init__(self, shape):
        self.value = np.zeros(shape)

    def write(self, value):
        self.value = np.array(value)

    def publish(self):
        pass


class Plain:
    def __init__(self):
        self.v, self.w = In(), In()
        self.y{n}, self.z{n} = Out(4), Out((4, 4))
        self.a{n}, self._b{n}, self.c{n} = np.zeros(4), np.zeros(4), np.zeros(4)
        self.m{n}, self.k{n} = np.zeros((4, 4)), np.zeros((4, 4))
        self.t{n} = np.zeros((2, 4, 4))
        self.s{n} = 0.0
"""


@dataclass
class _Scope:
    """The local names of a function: vectors, matrices, arrays of three dimensions, pairs, objects
    of two vectors, and nested functions; `outside`: the vectors of the function around it.
    """

    vectors: list[str] = field(default_factory=list)
    matrices: list[str] = field(default_factory=list)
    blocks: list[str] = field(default_factory=list)
    pairs: list[str] = field(default_factory=list)
    objects: list[str] = field(default_factory=list)
    depth: int = 0
    has_methods: bool = True
    functions: list[str] = field(default_factory=list)
    outside: list[str] = field(default_factory=list)

    def inner(self) -> "_Scope":
        """Return the scope of a block that may not run."""
        return _Scope(
            list(self.vectors), list(self.matrices), list(self.blocks), list(self.pairs),
            list(self.objects), self.depth + 1, self.has_methods, list(self.functions),
            self.outside,
        )  # fmt: skip

    def nested(self) -> "_Scope":
        """Return the scope of a nested function that takes a vector p."""
        return _Scope(["p"], depth=1, has_methods=self.has_methods, functions=list(self.functions),
                      outside=self.readable)  # fmt: skip

    @property
    def readable(self) -> list[str]:
        """Return the vectors that can be read."""
        return [*self.vectors, *self.outside]


@dataclass
class Program:
    """The text of methods whose members and names end with a number; how often it uses features."""

    text: str
    features: Counter[str] = field(default_factory=Counter)

    @classmethod
    def drawn(cls, draw: random.Random, number: int) -> "Program":
        """Return a random program."""
        return _Drawn(draw, number).program


class _Drawn:
    """A random program."""

    def __init__(self, draw: random.Random, number: int) -> None:
        self._draw, self._n = draw, number
        self.features: Counter[str] = Counter()
        self._names = 0
        self._methods: list[tuple[str, str]] = []
        lines: list[str] = []
        for index in range(draw.randrange(4)):
            lines += self._method(index)
        scope = _Scope()
        lines.append(f"    def program_{number}(self):")
        lines += self._block(scope, draw.randrange(4, 11), "        ")
        lines.append(f"        self.y{number}.write({self._vector(scope)})")
        lines.append(f"        self.z{number}.write({self._matrix(scope)})")
        self.program = Program("\n".join(lines) + "\n", self.features)

    def _one(self, *of: str) -> str:
        return self._draw.choice(of)

    def _likely(self, share: float) -> bool:
        return self._draw.random() < share

    def _feature(self, name: str, text: str) -> str:
        self.features[name] += 1
        return text

    def _new(self, prefix: str) -> str:
        self._names += 1
        return f"{prefix}{self._names}"

    def _member(self, of: Sequence[str]) -> str:
        return f"self.{self._draw.choice(of)}{self._n}"

    # Methods with effects.

    def _method(self, index: int) -> list[str]:
        kind = self._one("vector", "vector", "matrix", "pair", "takes", "property", "none")
        name = f"{kind}_{self._n}_{index}"
        scope = _Scope(has_methods=False)
        head = f"    def {name}(self):"
        if kind == "takes":
            head, scope.vectors = f"    def {name}(self, p):", ["p"]
        if kind == "property":
            head = f"    @property\n    def {name}(self):"
        body = self._block(scope, self._draw.randrange(0, 4), "        ")
        result = ""
        if kind == "pair":
            result = f"{self._vector_view(scope)}, {self._vector_view(scope)}"
        elif kind != "none":
            view = self._matrix_view if kind == "matrix" else self._vector_view
            result = view(scope)
        if result:
            body.append(f"        return {result}")
        elif not body:
            body.append("        pass")
        self._methods.append((kind, name))
        return [head, *body, ""]

    def _calls(self, kind: str, scope: _Scope) -> list[str]:
        if not scope.has_methods:
            return []
        return [name for of, name in self._methods if of == kind]

    # Expressions.

    def _vector_view(self, scope: _Scope) -> str:
        """Return an expression that refers to an existing array, often."""
        draw, n = self._draw, self._n

        def matrix() -> str:
            return self._matrix_view(scope)

        def simple() -> str:
            return self._simple(scope)

        index = draw.randrange(SIZE)
        named: dict[str, Callable[[], str]] = {
            "row": lambda: f"{matrix()}[{index}]",
            "column": lambda: f"{matrix()}[:, {index}]",
            "transposed": lambda: f"{self._member(MATRICES)}.T[{index}]",
            "reversed": lambda: f"{simple()}[::-1]",
            "whole slice": lambda: f"{simple()}[:]",
            "row of a block": lambda: f"{self._block_view(scope)}[{index % 2}, {index}]",
            "column of a block": lambda: f"{self._block_view(scope)}[{index % 2}, :, {index}]",
            "output": lambda: f"self.y{n}.value",
            "input": lambda: f"self.{self._one('v', 'w')}.value",
            "diagonal": lambda: f"np.diag({matrix()})",
            "asarray": lambda: f"np.asarray({simple()})",
            "reshape": lambda: f"{simple()}.reshape(4)",
            "function": lambda: f"same_{n}({simple()})",
            "changing function": lambda: f"first_{n}({simple()})",
            "conditional": lambda: f"({simple()} if {self._test(scope)} else {simple()})",
            "copy": lambda: f"{simple()}.copy()",
        }
        for name in scope.functions[-2:]:
            named["nested call"] = lambda name=name: f"{name}({simple()})"  # type: ignore[misc]
        if scope.pairs:
            named["element of a pair"] = lambda: f"{draw.choice(scope.pairs)}[{index % 2}]"
        if scope.objects:
            part = self._one("one", "other", "one", "other", self._one("front()", "back"))
            of = [each for each in scope.objects if each.endswith(f"_{part[:4]}")]
            if part in ("one", "other") or of:
                name = draw.choice(of or scope.objects)
                named["field of an object"] = lambda: f"{name}.{part}"
        calls: dict[str, Callable[[str], str]] = {
            "vector": lambda name: f"self.{name}()",
            "property": lambda name: f"self.{name}",
            "takes": lambda name: f"self.{name}({simple()})",
        }
        choices = ["member"] * 4 + ["name"] * (4 if scope.readable else 0) + list(named)
        choices += ["nested call"] * (2 if scope.functions else 0)
        choices += [kind for kind in calls for _ in self._calls(kind, scope)] * 2
        choice = draw.choice(choices)
        if choice in ("member", "name"):
            return self._member(VECTORS) if choice == "member" else draw.choice(scope.readable)
        if choice in named:
            return self._feature(choice, named[choice]())
        call = calls[choice](draw.choice(self._calls(choice, scope)))
        return self._feature(f"call: {choice}", call)

    def _simple(self, scope: _Scope) -> str:
        if scope.readable and self._likely(0.5):
            return self._draw.choice(scope.readable)
        return self._member(VECTORS)

    def _vector(self, scope: _Scope, depth: int = 0) -> str:
        if depth > 2 or self._likely(0.3):
            return self._vector_view(scope)

        def part() -> str:
            return self._vector(scope, depth + 1)

        ways: list[Callable[[], str]] = [
            lambda: f"({part()} + {part()})",
            lambda: f"({part()} - {part()})",
            lambda: f"(0.5 * {part()} - {part()})",
            lambda: f"half_{self._n}({part()})",
            lambda: f"np.maximum({part()}, {part()})",
            lambda: f"(-{part()})",
            lambda: self._filled(scope),
            lambda: self._feature("product", f"(0.25 * ({self._matrix_view(scope)} @ {part()}))"),
        ]
        return self._draw.choice(ways)()

    def _filled(self, scope: _Scope) -> str:
        """Return an array made by a comprehension."""
        one, other = self._vector(scope, 2), self._vector(scope, 2)
        i = self._draw.randrange(SIZE)
        text = self._one(
            f"np.array([0.5 * x for x in {one}])",
            f"np.array([x - {other}[k] for k, x in enumerate({one})])",
            f"np.array([x + 0.5 * y for x, y in zip({one}, {other})])",
            f"np.array([{one}[k] for k in range(4)])",
            f"np.array([r[{i}] for r in {self._matrix_view(scope)}])",
        )
        return self._feature("comprehension", text)

    def _new_vector(self, scope: _Scope) -> str:
        """Return an expression that makes a new array."""
        left, right = self._vector(scope, 1), self._vector(scope, 1)
        half = f"half_{self._n}({left})"
        return self._one(
            f"{left} - {right}", f"0.5 * {left} + {right}", f"np.array({left})", half,
            self._filled(scope),
        )  # fmt: skip

    def _matrix_view(self, scope: _Scope) -> str:
        draw = self._draw
        ways: list[Callable[[], str]] = [lambda: self._member(MATRICES)] * 4
        ways += [
            lambda: self._feature(
                "matrix of a block", f"{self._block_view(scope)}[{draw.randrange(2)}]"
            )
        ]
        if scope.matrices:
            ways += [lambda: draw.choice(scope.matrices)] * 3
        ways += [lambda n=n: self._feature("matrix method", f"self.{n}()")
                 for n in self._calls("matrix", scope)] * 2  # fmt: skip
        return draw.choice(ways)()

    def _block_view(self, scope: _Scope) -> str:
        if scope.blocks and self._likely(0.4):
            return self._draw.choice(scope.blocks)
        return f"self.t{self._n}"

    def _matrix(self, scope: _Scope, depth: int = 0) -> str:
        if depth > 1 or self._likely(0.4):
            return self._matrix_view(scope)
        left, right = self._matrix(scope, depth + 1), self._matrix(scope, depth + 1)
        return self._one(
            f"({left} - {right})",
            f"(0.5 * {left} + {right})",
            f"{left} @ (0.1 * {right})",
            f"{left}.T",
            f"np.outer({self._vector(scope, 2)}, {self._vector(scope, 2)})",
        )

    def _test(self, scope: _Scope) -> str:
        return self._one(
            f"{self._simple(scope)}[{self._draw.randrange(SIZE)}] > 0.0",
            f"self.s{self._n} < 2.0",
            f"self.v.value[{self._draw.randrange(SIZE)}] > 0.0",
            self._feature("any", f"any(x > 1.0 for x in {self._simple(scope)})"),
        )

    # Statements.

    def _block(self, scope: _Scope, count: int, indent: str) -> list[str]:
        lines: list[str] = []
        for _ in range(count):
            while not (statement := self._statement(scope, indent)):
                pass
            lines += statement
        return lines

    def _statement(self, scope: _Scope, indent: str) -> list[str]:
        draw, n = self._draw, self._n
        i = draw.randrange(SIZE)
        kind = self._one(
            *("name", "name", "name", "matrix name", "member", "member", "member", "matrix member"),
            *("element", "element of a name", "slice", "in place", "in place name", "swap", "swap"),
            *("swap by a name", "pair", "unpacked", "output", "output in place", "scalar", "call"),
            *("object", "row set", "chain", "matrix in place", "fill", "nested function"),
            *("block name", "block member", "block part set", "block in place"),
            *(("member of a member",) if self._likely(0.4) else ()),
            *(("if", "for", "for rows", "while") if scope.depth < 2 else ()),
        )
        if kind == "name":
            given = self._vector_view(scope) if self._likely(0.7) else self._vector(scope)
            name = self._target(scope.vectors, "x")
            return [f"{indent}{self._feature('name', name)} = {given}"]
        if kind == "matrix name":
            given = self._matrix_view(scope) if self._likely(0.7) else self._matrix(scope)
            name = self._target(scope.matrices, "q")
            return [f"{indent}{self._feature('name', name)} = {given}"]
        if kind == "member":
            return [f"{indent}{self._member(VECTORS)} = {self._new_vector(scope)}"]
        if kind == "matrix member":
            given = self._matrix(scope)
            if given in scope.matrices or (given.startswith("self.") and self._likely(0.8)):
                given = f"0.5 * {given}"
            return [f"{indent}{self._member(MATRICES)} = {given}"]
        if kind == "member of a member":
            given = self._feature(kind, self._vector_view(scope))
            return [f"{indent}{self._member(VECTORS)} = {given}"]
        if kind == "element":
            text = f"{self._member(VECTORS)}[{i}] {self._one('=', '+=')} {self._number(scope)}"
            return [indent + self._feature(kind, text)]
        if kind == "element of a name" and scope.vectors:
            name = draw.choice(scope.vectors)
            return [indent + self._feature(kind, f"{name}[{i}] += 1.0")]
        if kind == "slice":
            text = f"{self._simple(scope)}[:] = {self._vector(scope)}"
            return [indent + self._feature(kind, text)]
        if kind == "row set":
            text = f"{self._matrix_view(scope)}[{i}] = {self._vector(scope)}"
            return [indent + self._feature(kind, text)]
        if kind == "block name":
            given = self._block_view(scope)
            if self._likely(0.3):
                given = f"0.5 * {given}"
            return [f"{indent}{self._feature(kind, self._target(scope.blocks, 'd'))} = {given}"]
        if kind == "block member":
            given = f"0.5 * {self._block_view(scope)} + {self._matrix(scope, 1)}"
            return [indent + self._feature(kind, f"self.t{n} = {given}")]
        if kind == "block part set":
            part, given = self._one(f"{i % 2}", ":"), self._vector(scope, 1)
            text = f"{self._block_view(scope)}[{part}{self._one('', f', {i}', f', :, {i}')}]"
            return [indent + self._feature(kind, f"{text} {self._one('=', '+=')} {given}")]
        if kind == "block in place":
            text = f"{self._block_view(scope)} {self._one('*=', '-=')} 0.5"
            return [indent + self._feature(kind, text)]
        if kind == "fill":
            return [indent + self._feature(kind, f"{self._simple(scope)}.fill({i}.0)")]
        if kind == "in place":
            text = f"{self._member(VECTORS)} {self._one('+=', '-=')} {self._vector(scope)}"
            return [indent + self._feature(kind, text)]
        if kind == "matrix in place":
            text = f"{self._member(MATRICES)} *= {self._one('0.5', '0.25')}"
            return [indent + self._feature(kind, text)]
        if kind == "in place name" and scope.vectors:
            name = draw.choice(scope.vectors)
            return [indent + self._feature(kind, f"{name} += {self._vector(scope)}")]
        if kind == "swap":
            of = self._one("vectors", "matrices")
            members = VECTORS if of == "vectors" else MATRICES
            one, other = (f"self.{each}{n}" for each in draw.sample(members, 2))
            return [indent + self._feature(kind, f"{one}, {other} = {other}, {one}")]
        if kind == "swap by a name":
            one, other = (f"self.{each}{n}" for each in draw.sample(VECTORS, 2))
            name = self._new("t")
            return [
                indent + self._feature(kind, f"{name} = {one}"),
                f"{indent}{one} = {other}", f"{indent}{other} = {name}",
            ]  # fmt: skip
        if kind == "pair":
            pairs = self._calls("pair", scope)
            given = f"({self._vector_view(scope)}, {self._vector_view(scope)})"
            if pairs and self._likely(0.6):
                given = self._feature("pair method", f"self.{draw.choice(pairs)}()")
            name = self._new("t")
            scope.pairs.append(name)
            return [indent + self._feature(kind, f"{name} = {given}")]
        if kind == "object":
            given = f"{self._vector_view(scope)}, {self._vector_view(scope)}"
            of = self._one("Both", "Two", "both")
            name = self._new("o") + ("_back" if of == "Two" else "_fron")
            text = f"{name} = {of}_{n}({given})"
            if scope.objects and self._likely(0.3):
                of = draw.choice([each for each in scope.objects if each.endswith("_fron")] or [""])
                name = self._new("o") + "_fron"
                if of:
                    text = f"{name} = {of}._replace(one={self._vector_view(scope)})"
            scope.objects.append(name)
            return [indent + self._feature(kind, text)]
        if kind == "unpacked" and (scope.pairs or self._calls("pair", scope)):
            calls = [f"self.{each}()" for each in self._calls("pair", scope)]
            given = draw.choice([*scope.pairs, *calls])
            targets = f"{self._new('x')}, {self._member(VECTORS)}"
            scope.vectors.append(targets.partition(",")[0])
            return [indent + self._feature(kind, f"{targets} = {given}")]
        if kind == "chain":
            name = self._new("x")
            given = self._new_vector(scope)
            scope.vectors.append(name)
            return [indent + self._feature(kind, f"{name} = {self._member(VECTORS)} = {given}")]
        if kind == "nested function" and scope.depth < 2:
            return self._nested_function(scope, indent)
        if kind == "output":
            return [indent + self._feature(kind, f"self.y{n}.write({self._vector(scope)})")]
        if kind == "output in place":
            return [indent + self._feature(kind, f"self.y{n}.value[{i}] = {self._number(scope)}")]
        if kind == "scalar":
            return [f"{indent}self.s{n} = {self._number(scope)}"]
        if kind == "call" and self._calls("none", scope):
            name = draw.choice(self._calls("none", scope))
            return [indent + self._feature("call", f"self.{name}()")]
        if kind == "if":
            lines = [indent + self._feature(kind, f"if {self._test(scope)}:")]
            lines += self._block(scope.inner(), draw.randrange(1, 4), indent + "    ")
            if self._likely(0.5):
                lines += [f"{indent}else:"]
                lines += self._block(scope.inner(), draw.randrange(1, 3), indent + "    ")
            return lines
        if kind == "for":
            lines = [
                indent
                + self._feature(kind, f"for i{scope.depth} in range({draw.randrange(1, 4)}):")
            ]
            inside = self._block(scope.inner(), draw.randrange(1, 4), indent + "    ")
            if self._likely(0.2):
                leave = self._one("break", "continue")
                inside += [f"{indent}    if {self._test(scope)}:", f"{indent}        {leave}"]
                inside += self._statement(scope.inner(), indent + "    ")
            return lines + inside
        if kind == "for rows":
            name, inner = self._new("r"), scope.inner()
            lines = [indent + self._feature(kind, f"for {name} in {self._matrix_view(scope)}:")]
            inner.vectors.append(name)
            return lines + self._block(inner, draw.randrange(1, 3), indent + "    ")
        if kind == "while":
            name = self._new("n")
            lines = [f"{indent}{name} = 0", indent + self._feature(kind, f"while {name} < {i}:")]
            lines += [f"{indent}    {name} += 1"]
            return lines + self._block(scope.inner(), draw.randrange(1, 3), indent + "    ")
        return []

    def _nested_function(self, scope: _Scope, indent: str) -> list[str]:
        name, inner = self._new("f"), scope.nested()
        if self._likely(0.4):
            lines = [f"{indent}{name} = lambda p: {self._vector(inner, 1)}"]
        else:
            lines = [f"{indent}def {name}(p):"]
            lines += self._block(inner, self._draw.randrange(3), indent + "    ")
            lines += [f"{indent}    return {self._vector_view(inner)}"]
        scope.functions.append(name)
        self.features["lambda" if len(lines) == 1 else "nested function"] += 1
        return lines

    def _target(self, names: list[str], prefix: str) -> str:
        """Return a name to bind: a new one, or one that is bound already."""
        if names and self._likely(0.35):
            return self._draw.choice(names)
        names.append(self._new(prefix))
        return names[-1]

    def _number(self, scope: _Scope) -> str:
        i = self._draw.randrange(SIZE)
        return self._one(
            f"{self._simple(scope)}[{i}]", f"self.s{self._n} + 1.0", f"self.v.value[{i}]",
            f"np.sum({self._vector_view(scope)})", f"{i}.0", f"self.t{self._n}[{i % 2}, {i}, 0]",
            f"np.sum({self._block_view(scope)}, axis={i % 3})[0, 1]", self._reduced(scope),
        )  # fmt: skip

    def _reduced(self, scope: _Scope) -> str:
        one, other = self._vector_view(scope), self._vector_view(scope)
        text = self._one(
            f"sum(x * y for x, y in zip({one}, {other}))",
            f"max(abs(x) for x in {one})",
            f"min(x for r in {self._matrix_view(scope)} for x in r)",
            f"sum(x for x in {one} if x > 0.0)",
            f"next((x for x in {one} if x > 1.0), 2.0)",
        )
        return self._feature("reduction", text)


def component(programs: dict[int, Program]) -> str:
    """Return a module with a component that has these programs, by their numbers."""
    text = HEAD + "".join(FUNCTIONS.format(n=number) for number in programs) + CLASS
    text += "".join(MEMBERS.format(n=number) for number in programs) + "\n"
    text += "    def update(self):\n        which = self.which.value\n"
    for number in programs:
        text += f"        if which == {number}:\n            self.program_{number}()\n"
    return text + "\n" + "\n".join(each.text for each in programs.values())


def plain(program: Program, number: int) -> str:
    """Return a module with a plain class that has a program."""
    return IMPORTS + FUNCTIONS.format(n=number) + PLAIN.format(n=number) + "\n" + program.text
