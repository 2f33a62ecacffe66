"""Random programs for Python components: assignments, slices, views, broadcasting, NumPy functions,
lists, products of matrices, match and control flow on a state of two vectors, two matrices,
numbers (one of them optional), a bool, an enum, and vectors of float32 and of small ints.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass

HEAD = """\
import enum
import math

import numpy as np
from rtcf.component import Component, Input, State


class Mode(enum.IntEnum):
    OFF = 0
    RUN = 1
    HOLD = 2


def blend(p, q, share):
    return share * p + (1.0 - share) * q


class Programs(Component):
    which: Input[np.int64]
    vectors: Input[np.float64, (2, 6)]
    matrices: Input[np.float64, (6, 3)]
    numbers: Input[np.float64, 2]
    singles: Input[np.float32, (2, 6)]
    bytes: Input[np.uint8, 6]
    count: Input[np.int64]
    a: State[np.float64, 6]
    b: State[np.float64, 6]
    m: State[np.float64, (3, 3)]
    k: State[np.float64, (3, 3)]
    x: State[float]
    y: State[float]
    n: State[int]
    flag: State[bool]
    mode: State[Mode]
    last: State[float | None]
    g: State[np.float32, 6]
    h: State[np.float32, 6]
    u: State[np.uint8, 6]
    w: State[np.int16, 6]

    @property
    def gap(self):
        return self.x - self.y

    def update(self):
        self.a[:] = self.vectors.value[0]
        self.b[:] = self.vectors.value[1]
        self.m[:] = self.matrices.value[:3]
        self.k[:] = self.matrices.value[3:]
        self.x = self.numbers.value[0]
        self.y = self.numbers.value[1]
        self.n = self.count.value % 7
        self.flag = self.x > self.y
        self.mode = Mode.RUN
        self.last = None
        self.g[:] = self.singles.value[0]
        self.h[:] = self.singles.value[1]
        self.u[:] = self.bytes.value
        self.w[:] = self.bytes.value
        which = self.which.value % {count}
"""
_TO_ONE = ("sum", "mean", "std", "max")
_VECTORS = ("self.a", "self.b")
_MATRICES = ("self.m", "self.k")
_LONG, _SIDE = 6, 3


@dataclass
class _Scope:
    """Names that a statement may use."""

    views: dict[str, int]  # vector variables and their sizes
    indices: dict[str, int]  # loop variables and their exclusive upper bounds
    numbers: list[str]


class Program:
    """One program, drawn by a random number generator."""

    def __init__(self, draw: random.Random) -> None:
        """Draw the program."""
        self._draw = draw
        self._names = 0
        self.lines = self._block(_Scope({}, {}, []), draw.randint(1, 5), 0)

    def _name(self) -> str:
        self._names += 1
        return f"v{self._names}"

    def _block(self, scope: _Scope, count: int, depth: int) -> list[str]:
        scope = _Scope(dict(scope.views), dict(scope.indices), list(scope.numbers))
        lines: list[str] = []
        for _ in range(count):
            lines += self._statement(scope, depth)
        return lines

    def _statement(self, scope: _Scope, depth: int) -> list[str]:
        simple: list[Callable[[_Scope], list[str]]] = [
            self._set_slice, self._set_slice, self._change_slice, self._set_matrix, self._set_row,
            self._set_element, self._set_number, self._change_number, self._view, self._change_view,
            self._variable, self._set_whole, self._set_mode, self._set_selected, self._set_any,
            self._set_several, self._set_several, self._set_last, self._set_narrow,
        ]  # fmt: skip
        if depth < 2 and self._draw.random() < 0.3:
            ways = [self._if, self._for, self._while, self._match, self._walrus]
            return self._draw.choice(ways)(scope, depth)
        return self._draw.choice(simple)(scope)

    def _set_slice(self, scope: _Scope) -> list[str]:
        target, size = self._part(scope)
        value = self._vector(scope, size, 2) if self._draw.random() < 0.9 else self._float(scope, 2)
        return [f"{target} = {value}"]

    def _change_slice(self, scope: _Scope) -> list[str]:
        target, size = self._part(scope)
        value = self._vector(scope, size, 2) if self._draw.random() < 0.8 else self._float(scope, 1)
        return [f"{target} {self._operator()}= {value}"]

    def _set_matrix(self, scope: _Scope) -> list[str]:
        target = self._draw.choice(_MATRICES)
        how = self._draw.choice(["[:]", "", "[:, :]", " "])
        if how == " ":
            return [f"{target} {self._draw.choice('+-*')}= {self._matrix(scope, 2)}"]
        # A copy: a state that is a view of another one is rejected.
        value = self._matrix(scope, 2) if how else f"np.array({self._matrix(scope, 2)})"
        return [f"{target}{how} = {value}"]

    def _set_row(self, scope: _Scope) -> list[str]:
        place = self._draw.choice(["[{i}]", "[{i}, :]", "[:, {i}]", "[1:, {i}]", "[::-1, {i}]"])
        target = self._draw.choice(_MATRICES) + place.format(i=self._index(scope, _SIDE))
        size = 2 if "1:," in place else _SIDE
        change = self._draw.choice(["", "", "+", "-", "*"])
        return [f"{target} {change}= {self._vector(scope, size, 2)}"]

    def _set_element(self, scope: _Scope) -> list[str]:
        change = self._draw.choice(["", "", "+", "-", "*"])
        if self._draw.random() < 0.5:
            target = f"{self._draw.choice(_VECTORS)}[{self._index(scope, _LONG)}]"
        else:
            places = f"{self._index(scope, _SIDE)}, {self._index(scope, _SIDE)}"
            target = f"{self._draw.choice(_MATRICES)}[{places}]"
        return [f"{target} {change}= {self._float(scope, 2)}"]

    def _set_selected(self, scope: _Scope) -> list[str]:
        """Set the elements selected by a mask or an array of indices."""
        change = self._draw.choice(["", "", "+", "*"])
        if self._draw.random() < 0.3:
            mask = f"{self._matrix(scope, 0)} > {self._float(scope, 0)}"
            target = f"{self._draw.choice(_MATRICES)}[{mask}]"
            return [f"{target} {change}= {self._float(scope, 1)}"]
        count, lines, places = self._draw.randint(1, 4), [], self._name()
        taken = ", ".join(str(self._draw.randint(-_SIDE, _SIDE - 1)) for _ in range(count))
        lines = [f"{places} = np.array(({taken},))"]
        if self._draw.random() < 0.5:
            target, value = (
                f"{self._draw.choice(_VECTORS)}[{places}]",
                self._vector(scope, count, 1),
            )
        elif self._draw.random() < 0.5:
            value = self._vector(scope, _SIDE, 1)
            target = f"{self._draw.choice(_MATRICES)}[{places}]"
        else:
            value = self._vector(scope, count, 1)
            place = self._draw.choice([":, {}", "{}, :", "1, {}", "{}, 2", "{}, {}"])
            target = f"{self._draw.choice(_MATRICES)}[{place.format(places, places)}]"
            value = value if place != "{}, :" else self._vector(scope, _SIDE, 1)
        if self._draw.random() < 0.3:
            return [*lines, f"{target} {change}= {self._float(scope, 1)}"]
        if self._draw.random() < 0.2:
            sources = _MATRICES if target.startswith(_MATRICES) else _VECTORS
            index = target.partition("[")[2]
            return [*lines, f"{target} = {self._draw.choice(sources)}[{index}"]
        return [*lines, f"{target} {change}= {value}"]

    def _set_any(self, scope: _Scope) -> list[str]:
        """Set with an index whose type is not obvious."""
        index = self._name()
        lines = [f"{index} = {self._int(scope, 1)}"]
        if self._draw.random() < 0.5:
            target, value = f"{self._draw.choice(_VECTORS)}[{index}]", self._float(scope, 1)
        else:
            target = f"{self._draw.choice(_MATRICES)}[{index} % {_SIDE}]"
            value = self._vector(scope, _SIDE, 1)
        return [*lines, f"{target} {self._draw.choice(['', '+', '*'])}= {value}"]

    def _set_several(self, scope: _Scope) -> list[str]:
        """Set several targets at once, from several values or the elements of a vector."""
        draw = self._draw.random()
        numbers = ["self.x", "self.y", *scope.numbers]
        numbers += [f"{each}[{self._index(scope, _LONG)}]" for each in _VECTORS]
        one, other = self._draw.sample(numbers, 2)
        if draw < 0.3:
            return [f"{one}, {other} = {self._float(scope, 1)}, {self._float(scope, 1)}"]
        if draw < 0.5:
            return [f"{one} = {other} = {self._float(scope, 1)}"]
        if draw < 0.7:
            first, second = self._draw.sample(_VECTORS, 2)
            values = f"{self._vector(scope, _LONG, 1)}, {self._vector(scope, _LONG, 1)}"
            return [f"{first}, {second} = {values}"]
        names = [self._name() for _ in range(3)]
        lines = [f"{', '.join(names)} = {self._vector(scope, 3, 2)}"]
        scope.numbers += names
        return lines

    def _set_last(self, scope: _Scope) -> list[str]:
        value = self._float(scope, 1)
        how = self._draw.choice(["{0}", "None", "{0} if {1} else None", "self.last"])
        lines = [f"self.last = {how.format(value, self._bool(scope, 1))}"]
        if self._draw.random() < 0.5:
            lines += ["if self.last is not None:", f"    self.last += {self._float(scope, 1)}"]
        return lines

    def _set_narrow(self, scope: _Scope) -> list[str]:
        """Set arrays of float32 and of small ints, or numbers from these."""
        single, small = self._single(scope, 2), self._small(scope, 2)
        name, index = self._draw.choice("gh"), self._index(scope, _LONG)
        byte = self._draw.randint(0, 90)
        return [
            self._draw.choice(
                [
                    f"self.{name}[:] = {single}",
                    f"self.{name} = {single}",
                    f"self.{name}[{index}] = {self._float(scope, 1)}",
                    f"self.{name} {self._draw.choice('+-*')}= {single}",
                    f"self.{name}[1:5] {self._draw.choice('+-*')}= {self._float_of_python(scope)}",
                    f"self.{name}[:] = self.a",
                    f"self.a[:] = {single} * self.b",
                    f"self.a[:] = {single} * {self._float_of_python(scope)}",
                    f"self.x = float({single}[{index}]) * self.y",
                    f"self.x = float(np.{self._draw.choice(_TO_ONE)}({single}))",
                    f"self.u[:] = {small}",
                    f"self.u {self._draw.choice(['+', '-', '*', '&', '|', '^', '>>'])}= {byte}",
                    f"self.u[{index}] {self._draw.choice('+-*')}= {byte}",
                    f"self.w[:] = {small} - self.w",
                    f"self.w[{index}] += self.n",
                    f"self.a[:] = {small} {self._draw.choice('*/')} {self._float_of_python(scope)}",
                    f"self.n = int({small}[{index}]) % 7",
                    f"self.n = int(np.sum({small} > {byte}))",
                    f"self.flag = bool(np.any({single} > {self._float_of_python(scope)}))",
                ]
            )
        ]

    def _float_of_python(self, scope: _Scope) -> str:
        number = f"{self._draw.uniform(-4, 4):.2f}"
        return self._draw.choice(
            ["self.x", "self.y", "self.n", number, f"float({self._float(scope, 1)})"]
        )

    def _single(self, scope: _Scope, depth: int) -> str:
        """Return a vector of float32."""
        draw = self._draw.random()
        if depth == 0 or draw < 0.3:
            leaves = ["self.g", "self.h", "self.g[::-1]", "self.singles.value[1]"]
            return self._draw.choice([*leaves, "self.a.astype(np.float32)"])
        one, other = self._single(scope, depth - 1), self._single(scope, depth - 1)
        number, operation = self._float_of_python(scope), self._draw.choice("+-*")
        return self._draw.choice(
            [
                f"({one} {operation} {other})",
                f"({one} {operation} {number})",
                f"({number} {operation} {one})",
                f"np.minimum({one}, {number})",
                f"np.clip({one}, -2.0, {number})",
                f"np.where({one} > {number}, {other}, {number})",
                f"np.cumsum({one})",
                f"np.sort({one})",
                f"abs({one})",
                f"-{one}",
                f"({one} * {other}[{self._index(scope, _LONG)}])",
                f"({one} * self.u)",
            ]
        )

    def _small(self, scope: _Scope, depth: int) -> str:
        """Return a vector of uint8."""
        draw = self._draw.random()
        if depth == 0 or draw < 0.3:
            return self._draw.choice(["self.u", "self.u[::-1]", "self.bytes.value"])
        one, other = self._small(scope, depth - 1), self._small(scope, depth - 1)
        operation = self._draw.choice(["+", "-", "*", "&", "|", "^"])
        number = self._draw.randint(1, 200)
        return self._draw.choice(
            [
                f"({one} {operation} {other})",
                f"({one} {operation} {number})",
                f"({number} {operation} {one})",
                f"({one} {self._draw.choice(['//', '%'])} {number})",
                f"({one} {self._draw.choice(['<<', '>>'])} {self._draw.randint(0, 9)})",
                f"np.minimum({one}, {number})",
                f"np.where({one} > {other}, {one}, {number})",
                f"(-{one})",
                f"(~{one})",
            ]
        )

    def _set_number(self, scope: _Scope) -> list[str]:
        return [f"self.{self._draw.choice('xy')} = {self._float(scope, 3)}"]

    def _change_number(self, scope: _Scope) -> list[str]:
        name = self._draw.choice(["self.x", "self.y", *scope.numbers])
        return [f"{name} {self._draw.choice('+-*')}= {self._float(scope, 2)}"]

    def _set_whole(self, scope: _Scope) -> list[str]:
        if self._draw.random() < 0.5:
            return [f"self.flag = {self._bool(scope, 2)}"]
        return [f"self.n = {self._int(scope, 2)}"]

    def _set_mode(self, scope: _Scope) -> list[str]:
        modes = [f"Mode.{each}" for each in ("OFF", "RUN", "HOLD")]
        one, other = self._draw.sample(modes, 2)
        if self._draw.random() < 0.3:
            return [f"self.mode = Mode({self._int(scope, 1)} % {self._draw.choice([3, 3, 4])})"]
        return [f"self.mode = {one} if {self._bool(scope, 1)} else {other}"]

    def _variable(self, scope: _Scope) -> list[str]:
        name, value = self._name(), self._float(scope, 2)
        if self._draw.random() < 0.1:
            value = f"{self._draw.randint(-3, 3)} if {self._bool(scope, 1)} else {value}"
        scope.numbers.append(name)
        return [f"{name} = {value}"]

    def _view(self, scope: _Scope) -> list[str]:
        target, size = self._part(scope)
        name = self._name()
        scope.views[name] = size
        return [f"{name} = {target}"]

    def _change_view(self, scope: _Scope) -> list[str]:
        if not scope.views:
            return self._view(scope)
        name, size = self._draw.choice(sorted(scope.views.items()))
        value = self._vector(scope, size, 2)
        how = self._draw.choice([f"{name}[:] =", f"{name} {self._operator()}="])
        return [f"{how} {value}"]

    def _if(self, scope: _Scope, depth: int) -> list[str]:
        lines = [f"if {self._bool(scope, 2)}:", *self._inside(scope, depth)]
        if self._draw.random() < 0.3:
            lines += [f"elif {self._bool(scope, 2)}:", *self._inside(scope, depth)]
        if self._draw.random() < 0.5:
            lines += ["else:", *self._inside(scope, depth)]
        return lines

    def _match(self, scope: _Scope, depth: int) -> list[str]:
        if self._draw.random() < 0.5:
            subject, cases = "self.mode", ["Mode.OFF", "Mode.RUN | Mode.HOLD", "Mode.HOLD", "_"]
        else:
            name = self._name()
            subject = f"{self._int(scope, 1)} % 5"
            cases = ["0", "1 | 2", f"{name} if {name} > self.n", f"2 as {name}", "_"]
        lines = [f"match {subject}:"]
        for case in sorted(self._draw.sample(cases, self._draw.randint(1, 3)), key=cases.index):
            guard = f" if {self._bool(scope, 1)}" if self._draw.random() < 0.3 else ""
            guard = "" if " if " in case else guard
            lines.append(f"    case {case}{guard}:")
            lines += [f"    {line}" for line in self._inside(scope, depth)]
        return lines

    def _walrus(self, scope: _Scope, depth: int) -> list[str]:
        name, bound = self._name(), self._float(scope, 0)
        test = f"({name} := {self._float(scope, 2)}) > {bound}"
        if self._draw.random() < 0.3:
            test = f"{self._bool(scope, 1)} and {test}"
        inner = _Scope(dict(scope.views), dict(scope.indices), [*scope.numbers, name])
        lines = [f"if {test}:", *self._inside(inner, depth)]
        return [*lines, "else:", *self._inside(scope, depth)]

    def _for(self, scope: _Scope, depth: int) -> list[str]:
        index, end = self._name(), self._draw.randint(1, 4)
        inner = _Scope(dict(scope.views), {**scope.indices, index: end}, list(scope.numbers))
        lines = [f"for {index} in range({end}):", *self._inside(inner, depth)]
        if self._draw.random() < 0.2:
            way = self._draw.choice(["break", "continue"])
            lines += [f"    if {self._bool(inner, 1)}:", f"        {way}"]
            lines += self._inside(inner, depth)
        return lines

    def _while(self, scope: _Scope, depth: int) -> list[str]:
        turns = self._name()
        inside = self._inside(scope, depth)
        return [
            f"{turns} = 0",
            f"while {turns} < {self._draw.randint(1, 3)} and {self._bool(scope, 1)}:",
            *inside,
            f"    {turns} += 1",
        ]

    def _inside(self, scope: _Scope, depth: int) -> list[str]:
        return [f"    {line}" for line in self._block(scope, self._draw.randint(1, 2), depth + 1)]

    def _operator(self) -> str:
        return self._draw.choice(["+", "-", "*", "+", "-", "*", "/"])

    def _part(self, scope: _Scope) -> tuple[str, int]:
        """Return a part of a vector of the state, or of a view, and its size."""
        views = sorted(scope.views.items())
        if views and self._draw.random() < 0.3:
            name, long = self._draw.choice(views)
        else:
            name, long = self._draw.choice(_VECTORS), _LONG
        begin, end = sorted((self._draw.randint(0, long), self._draw.randint(0, long)))
        step = self._draw.choice([1, 1, 1, 2, -1])
        text = f"{begin or ''}:{end if end < long else ''}"
        if step == 2:
            text = f"{begin or ''}:{end if end < long else ''}:2"
        size = len(range(begin, end, abs(step)))
        if size == 0:
            return f"{name}[:]", long
        if step == -1:
            return f"{name}[{text}][::-1]" if begin or end < long else f"{name}[::-1]", size
        return f"{name}[{text}]", size

    def _vector(self, scope: _Scope, size: int, depth: int) -> str:
        draw = self._draw.random()
        if depth == 0 or draw < 0.32:
            return self._vector_leaf(scope, size)
        if draw < 0.4:
            return self._vector_of(scope, size, depth)
        if draw < 0.65:
            one, other = self._vector(scope, size, depth - 1), self._vector(scope, size, depth - 1)
            return f"({one} {self._draw.choice('+-*')} {other})"
        if draw < 0.8:
            one, other = self._vector(scope, size, depth - 1), self._float(scope, depth - 1)
            if self._draw.random() < 0.5:
                one, other = other, one
            return f"({one} {self._draw.choice('+-*')} {other})"
        if draw < 0.85:
            return f"np.abs({self._vector(scope, size, depth - 1)})"
        if draw < 0.9:
            return f"-{self._vector(scope, size, depth - 1)}"
        if draw < 0.95:
            parts = [self._vector(scope, size, depth - 1) for _ in range(4)]
            return f"np.where({parts[0]} > {parts[1]}, {parts[2]}, {parts[3]})"
        if size == _SIDE:
            one, other = self._matrix(scope, depth - 1), self._vector(scope, size, depth - 1)
            return self._draw.choice([f"({one} @ {other})", f"({other} @ {one})"])
        return f"blend({self._vector(scope, size, 0)}, {self._vector(scope, size, 0)}, 0.25)"

    def _vector_of(self, scope: _Scope, size: int, depth: int) -> str:
        """Return a vector created by a NumPy function."""
        first = self._draw.randint(0, size)
        parts = [self._vector(scope, each, 0) for each in (first, size - first, size)]
        numbers = [self._float(scope, 0) for _ in range(size)]
        ways = [
            f"np.concatenate(({parts[0]}, {parts[1]}))",
            f"np.sort({parts[2]})",
            f"np.roll({parts[2]}, {self._draw.randint(-3, 9)})",
            f"np.flip({parts[2]})",
            f"np.cumsum({parts[2]})",
            f"np.clip({parts[2]}, -2.0, {self._float(scope, 0)})",
            f"np.clip({parts[2]}, {self._vector(scope, size, 0)}, 3.0)",
            f"np.interp({parts[2]}, [-1.0, 0.0, 1.0, 4.0, 9.0, 9.5], [2.0, 1, 0, 3, 4.5, 5])",
        ]
        if numbers:
            listed = f"[{', '.join(numbers)}]"
            ways += [f"np.array({listed})", f"({parts[2]} + {listed})", f"np.asarray({listed})"]
            ways += [f"np.hstack(({numbers[0]}, {self._vector(scope, size - 1, 0)}))"]
        if size == _SIDE:
            matrix, axis = self._matrix(scope, depth - 1), self._draw.choice(["0", "1", "-1"])
            name = self._draw.choice(["sum", "max", "min", "mean", "std"])
            ways += [f"np.{name}({matrix}, axis={axis})", f"{matrix}.{name}(axis={axis})"]
            ways += [f"np.diag({matrix})", f"np.linalg.norm({matrix}, axis={axis})"]
            ways += [f"np.cross({parts[2]}, {self._vector(scope, size, 0)})"]
            ways += [f"np.einsum('ij,j->i', {matrix}, {parts[2]})"]
            ways += [f"np.einsum('ii->i', {self._matrix(scope, 0)})"]
        return self._draw.choice(ways)

    def _matrix_of(self, scope: _Scope, depth: int) -> str:
        """Return a matrix created by a NumPy function."""
        rows = [self._vector(scope, _SIDE, 0) for _ in range(_SIDE)]
        numbers = [[self._float(scope, 0) for _ in range(_SIDE)] for _ in range(_SIDE)]
        listed = ", ".join(f"[{', '.join(row)}]" for row in numbers)
        return self._draw.choice(
            [
                f"np.vstack(({', '.join(rows)}))",
                f"np.vstack([{self._matrix(scope, 0)}[:2], {rows[0]}])",
                f"np.column_stack(({', '.join(rows)}))",
                f"np.array([{listed}])",
                f"np.outer({rows[0]}, {rows[1]})",
                f"np.diag({rows[0]})",
                f"np.linalg.matrix_power({self._matrix(scope, 0)}, {self._draw.randint(0, 4)})",
                f"{self._matrix(scope, depth - 1)}.reshape(9)[::-1].reshape(3, -1)",
                f"np.sort({self._matrix(scope, 0)}, axis={self._draw.choice([0, 1])})",
                f"np.einsum('ij->ji', {self._matrix(scope, depth - 1)})",
                f"np.roll({self._matrix(scope, 0)}, 1, axis={self._draw.choice([0, 1])})",
            ]
        )

    def _number_of(self, scope: _Scope, depth: int) -> str:
        """Return a number computed by a function of an array or of numbers."""
        size = self._draw.randint(1, 5)
        vector, one = self._vector(scope, size, depth - 1), self._float(scope, depth - 1)
        other, matrix = self._float(scope, 0), self._matrix(scope, 0)
        name = self._draw.choice(["sum", "max", "min", "mean", "std", "median", "linalg.norm"])
        return self._draw.choice(
            [
                f"np.{name}({vector})",
                f"np.{self._draw.choice(['sum', 'max', 'linalg.norm', 'linalg.det'])}({matrix})",
                f"{matrix}.{self._draw.choice(['sum', 'min', 'trace', 'mean'])}()",
                f"np.clip({one}, -1.0, {other})",
                f"np.hypot({one}, {other})",
                f"np.sign({one})",
                f"np.mod({one}, {other})",
                f"math.fmod({one}, 3.0)",
                f"np.trapz({vector})",
                f"np.interp({one}, {self._vector_leaf_of_numbers()}, [3.0, -1.0, 2.0])",
                f"float(self.mode.value + np.argmax({vector}))",
                "self.gap",
            ]
        )

    def _vector_leaf_of_numbers(self) -> str:
        numbers = sorted(self._draw.uniform(-5, 5) for _ in range(3))
        return f"[{', '.join(f'{each:.2f}' for each in numbers)}]"

    def _vector_leaf(self, scope: _Scope, size: int) -> str:
        leaves = []
        for name, long in [*((each, _LONG) for each in _VECTORS), *sorted(scope.views.items())]:
            if long >= size:
                begin = self._draw.randint(0, long - size)
                leaves.append(f"{name}[{begin}:{begin + size}]")
                leaves.append(f"{name}[{begin}:{begin + size}][::-1]")
            if size and long >= 2 * size - 1:
                begin = self._draw.randint(0, long - 2 * size + 1)
                leaves.append(f"{name}[{begin}:{begin + 2 * size - 1}:2]")
            if long == size:
                leaves += [name, f"{name}.copy()"]
        if size == _SIDE:
            index = self._index(scope, _SIDE)
            for name in _MATRICES:
                leaves += [f"{name}[{index}]", f"{name}[:, {index}]", f"{name}.T[{index}, ::-1]"]
        if not leaves:
            return f"np.zeros({size})"
        return self._draw.choice(leaves)

    def _matrix(self, scope: _Scope, depth: int) -> str:
        draw = self._draw.random()
        if depth == 0 or draw < 0.4:
            name = self._draw.choice(_MATRICES)
            return name + self._draw.choice(["", ".T", "[::-1]", "[:, ::-1]", "[::-1, ::-1].T"])
        if draw < 0.48:
            return self._matrix_of(scope, depth)
        if draw < 0.6:
            one, other = self._matrix(scope, depth - 1), self._matrix(scope, depth - 1)
            return f"({one} {self._draw.choice('+-*')} {other})"
        if draw < 0.75:
            one, other = self._matrix(scope, depth - 1), self._vector(scope, _SIDE, depth - 1)
            return f"({one} {self._draw.choice('+-*')} {other})"
        if draw < 0.85:
            return f"({self._matrix(scope, depth - 1)} * {self._float(scope, depth - 1)})"
        return f"({self._matrix(scope, depth - 1)} @ {self._matrix(scope, depth - 1)})"

    def _float(self, scope: _Scope, depth: int) -> str:
        draw = self._draw.random()
        if depth == 0 or draw < 0.4:
            return self._draw.choice(
                [
                    *("self.x", "self.y", *scope.numbers, f"{self._draw.uniform(-4, 4):.2f}"),
                    f"{self._draw.choice(_VECTORS)}[{self._index(scope, _LONG)}]",
                    f"self.m[{self._index(scope, _SIDE)}, {self._index(scope, _SIDE)}]",
                ]
            )
        if draw < 0.48:
            return self._number_of(scope, depth)
        if draw < 0.65:
            one, other = self._float(scope, depth - 1), self._float(scope, depth - 1)
            return f"({one} {self._draw.choice('+-*')} {other})"
        if draw < 0.75:
            name = self._draw.choice(["sin", "cos", "tanh", "sqrt", "log", "atan", "acos", "exp"])
            return f"math.{name}({self._float(scope, depth - 1)})"
        if draw < 0.8:
            one, other = self._float(scope, depth - 1), self._float(scope, depth - 1)
            return f"{self._draw.choice(['min', 'max'])}({one}, {other})"
        if draw < 0.85:
            one, other = self._float(scope, depth - 1), self._float(scope, depth - 1)
            return f"({one} if {self._bool(scope, depth - 1)} else {other})"
        if draw < 0.9:
            power = self._draw.choice(["2", "3", "0.5", "-1", "1.5"])
            return f"({self._float(scope, depth - 1)}) ** {power}"
        if draw < 0.95:
            return f"abs({self._float(scope, depth - 1)})"
        return f"float({self._int(scope, depth - 1)})"

    def _int(self, scope: _Scope, depth: int) -> str:
        draw = self._draw.random()
        if depth == 0 or draw < 0.4:
            return self._draw.choice(["self.n", str(self._draw.randint(-5, 5)), *scope.indices])
        if draw < 0.6:
            one, other = self._int(scope, depth - 1), self._int(scope, depth - 1)
            return f"({one} {self._draw.choice(['+', '-', '*'])} {other})"
        if draw < 0.65:
            how = self._draw.choice(
                ["<< 2", ">> 1", f">> {self._int(scope, 0)}", "<< (self.n % 8)"]
            )
            return f"({self._int(scope, depth - 1)} {how})"
        if draw < 0.72:
            how = f"{self._draw.choice(['//', '%'])} {self._draw.choice([2, 3, -3])}"
            return f"({self._int(scope, depth - 1)} {how})"
        if draw < 0.8:
            name = self._draw.choice(["int", "round", "math.floor", "math.ceil"])
            return f"{name}({self._float(scope, depth - 1)})"
        if draw < 0.9:
            return f"abs({self._int(scope, depth - 1)})"
        return (
            f"({self._int(scope, 0)} if {self._bool(scope, depth - 1)} else {self._int(scope, 0)})"
        )

    def _bool(self, scope: _Scope, depth: int) -> str:
        draw = self._draw.random()
        if depth == 0 or draw < 0.3:
            # numba infers an int for two constants.
            name = self._draw.choice(["self.x", "self.y", *scope.numbers])
            compared = f"{name} {self._draw.choice(['<', '>', '<=', '=='])} {self._float(scope, 0)}"
            how = self._draw.choice(["==", "is", "!=", "is not"])
            mode = f"self.mode {how} Mode.{self._draw.choice(['OFF', 'RUN', 'HOLD'])}"
            others = [mode, "self.last is None", "self.last == self.x", "self.n in (0, 2, -3)"]
            others += [f"math.isclose({name}, {self._float(scope, 0)}, rel_tol=0.5)"]
            return f"({self._draw.choice(['self.flag', compared, compared, *others])})"
        if draw < 0.35:
            return f"np.any({self._vector(scope, 3, depth - 1)} > {self._float(scope, 0)})"
        if draw < 0.5:
            parts = [self._float(scope, depth - 1) for _ in range(2)]
            return f"({parts[0]} < self.x <= {parts[1]})"
        if draw < 0.8:
            one, other = self._bool(scope, depth - 1), self._bool(scope, depth - 1)
            return f"({one} {self._draw.choice(['and', 'or'])} {other})"
        if draw < 0.9:
            return f"(not {self._bool(scope, depth - 1)})"
        return f"(self.n {self._draw.choice(['<', '==', '>='])} {self._int(scope, depth - 1)})"

    def _index(self, scope: _Scope, end: int) -> str:
        known = [name for name, above in scope.indices.items() if above <= end]
        return self._draw.choice([str(self._draw.randint(-end, end - 1)), *known])


def module(programs: dict[int, Program]) -> str:
    """Return a module with one component that runs one of these programs in each cycle."""
    lines = HEAD.format(count=max(programs) + 1).splitlines()
    for number in programs:
        lines += [f"        if which == {number}:", f"            self.program_{number}()"]
    for number, program in programs.items():
        lines += ["", f"    def program_{number}(self):"]
        lines += [f"        {line}" for line in program.lines]
    return "\n".join([*lines, ""])
