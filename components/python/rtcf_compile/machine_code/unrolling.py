"""Marks loops of a few turns for LLVM to unroll them, by editing LLVM assembly.

These loops carry a temporary array from turn to turn, as in `x = a @ x`, or make arrays of a size
that depends on the turn, as in `a[:i] + b[:i]`. stack.py cannot move such arrays from the arena to
the stack. In the unrolled loop, each turn has an array of its own, of a constant size.
"""

import operator
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

_MOST_TURNS, _MOST_LINES = 32, 4000  # of an unrolled loop
_NAME = r'%(?:"[^"]*"|[\w.$-]+)'
_LABEL = re.compile(r'^("[^"]*"|[\w.$-]+):')
_PHI = re.compile(rf"  ({_NAME}) = phi (i\d+|i8\*|ptr) (.*)")
_WAY = re.compile(rf"\[ ([^,]*), ({_NAME}) \]")
_COUNTED = re.compile(rf"@NRT_(?:incref|decref)\([^%()]*({_NAME})\)")
_ALLOCATED = re.compile(r"@NRT_MemInfo_alloc(?:_safe)?_aligned\(i64 (?:noundef )?%")
_TARGET = re.compile(rf"label ({_NAME})")
_BRANCH = re.compile(rf"  br i1 ({_NAME}), label ({_NAME}), label ({_NAME})")
_COMPUTED = re.compile(rf"  ({_NAME}) = (\w+) (.*?)(?:, ![^,]*)*$")
_INSTRUCTION = re.compile(
    rf"(?:nuw |nsw |exact )*(\w+ )??i(\d+) ({_NAME}|-?\w+)(?:, (?:i(\d+) )?({_NAME}|-?\w+))?"
    rf"(?:, i\d+ ({_NAME}|-?\w+))?(?: to i(\d+))?"
)
_NUMBER = re.compile(r"^!(\d+) = ", re.M)
_MARK = "llvm.loop.unroll.full"
_OPERATIONS: dict[str, Callable[[int, int], int]] = {
    **{"add": operator.add, "sub": operator.sub, "mul": operator.mul},
    **{"and": operator.and_, "or": operator.or_, "xor": operator.xor},
}
_COMPARISONS: dict[str, Callable[[int, int], bool]] = {
    **{"eq": operator.eq, "ne": operator.ne, "lt": operator.lt, "le": operator.le},
    **{"gt": operator.gt, "ge": operator.ge},
}


class _UnknownError(Exception):
    """A value that is not computed from constants."""


@dataclass
class _Loop:
    """A loop: the number of its turns, its lines, and that of the branch to its begin."""

    turns: int
    lines: list[int]
    end: int


@dataclass
class _Block:
    """A basic block: its lines, from the label to the branch at its end, and where that goes."""

    begin: int
    end: int
    following: list[str]


def marked(assembly: str) -> str | None:
    """Return assembly with these loops marked; None if there are none."""
    lines = assembly.split("\n")
    # The lines of a loop become as many as the turns of it and of those around it.
    weights = [1] * len(lines)
    chosen: list[_Loop] = []
    for each in sorted(_loops(lines), key=lambda loop: len(loop.lines)):
        if each.turns * sum(weights[number] for number in each.lines) <= _MOST_LINES:
            for number in each.lines:
                weights[number] *= each.turns
            chosen.append(each)
    if not chosen:
        return None
    first = 1 + max((int(each) for each in _NUMBER.findall(assembly)), default=-1)
    lines.append(f'!{first} = !{{!"{_MARK}"}}')
    for number, loop in enumerate(chosen, first + 1):
        lines[loop.end] += f", !llvm.loop !{number}"
        lines.append(f"!{number} = distinct !{{!{number}, !{first}}}")
    return "\n".join([*lines, ""])


def unmarked(assembly: str) -> str:
    """Return assembly in which loops that LLVM has not unrolled are not marked any more."""
    return assembly.replace(f'!"{_MARK}"', '!"rtcf.loop"')


def _loops(lines: list[str]) -> Iterator[_Loop]:
    begin = 0
    for number, line in enumerate(lines):
        if line.startswith("define "):
            begin = number
        elif line == "}":
            yield from _Function(lines, begin, number).loops()


class _Function:
    """The lines of a function."""

    def __init__(self, lines: list[str], begin: int, end: int) -> None:
        self._lines = lines
        self._computed: dict[str, tuple[str, str]] = {}
        self._counted: set[str] = set()
        self._blocks: dict[str, _Block] = {}
        label, start = "", begin
        for number in range(begin, end):
            line = lines[number]
            if found := _COMPUTED.match(line):
                self._computed[found[1]] = found[2], found[3]
            elif begun := _LABEL.match(line):
                label, start = f"%{begun[1]}", number
            elif line.startswith("  br "):
                self._blocks[label] = _Block(start, number, _TARGET.findall(line))
            self._counted.update(_COUNTED.findall(line))

    def loops(self) -> Iterator[_Loop]:
        """Yield the loops of a known number of turns that use the arena and need not."""
        before: dict[str, list[str]] = {}
        for label, block in self._blocks.items():
            for each in block.following:
                before.setdefault(each, []).append(label)
        for last, begin in self._back():
            inside = {begin}
            waiting = [last]
            while waiting:
                label = waiting.pop()
                if label not in inside:
                    inside.add(label)
                    waiting += before.get(label, [])
            lines = [
                number
                for label in inside
                for number in range(self._blocks[label].begin, self._blocks[label].end + 1)
            ]
            end = self._blocks[last].end
            is_needed = "!llvm.loop" not in self._lines[end] and self._uses_arena(begin, lines)
            if is_needed and (turns := self._turns(begin, last)) is not None:
                yield _Loop(turns, lines, end)

    def _back(self) -> list[tuple[str, str]]:
        """Return the last and the first blocks of loops."""
        found: list[tuple[str, str]] = []
        path = list(self._blocks)[:1]
        seen = set(path)
        rest = [list(self._blocks[label].following) for label in path]
        while rest:
            if not rest[-1]:
                rest.pop()
                path.pop()
                continue
            label = rest[-1].pop()
            if label in path:
                found.append((path[-1], label))
            elif label not in seen and label in self._blocks:
                path.append(label)
                rest.append(list(self._blocks[label].following))
            seen.add(label)
        return found

    def _uses_arena(self, begin: str, lines: list[int]) -> bool:
        """Tell whether a loop carries an array, or makes arrays of a variable size."""
        phis = (_PHI.match(each) for each in self._lines_of(begin))
        carried = (each for each in phis if each and each[2] in ("i8*", "ptr"))
        if any(each[1] in self._counted for each in carried):
            return True
        return any(_ALLOCATED.search(self._lines[number]) for number in lines)

    def _lines_of(self, label: str) -> list[str]:
        block = self._blocks[label]
        return self._lines[block.begin : block.end + 1]

    def _turns(self, begin: str, last: str) -> int | None:
        """Return the number of turns of a loop by its first and last block; None if unknown."""
        branch = _BRANCH.match(self._lines[self._blocks[last].end])
        if branch is None or branch[2] == branch[3]:
            return None
        state: dict[str, int] = {}
        following: dict[str, str] = {}
        for line in self._lines_of(begin):
            if (phi := _PHI.match(line)) is None:
                continue
            ways = _WAY.findall(phi[3])
            again = [value for value, label in ways if label == last]
            others = {value for value, label in ways if label != last}
            if len(again) == len(others) == 1 and (value := _constant(others.pop())) is not None:
                state[phi[1]], following[phi[1]] = value, again[0]
        try:
            for turn in range(1, _MOST_TURNS + 1):
                if self._value(branch[1], state) != (branch[2] == begin):
                    return turn
                state = dict(self._next(state, following))
        except _UnknownError:
            pass
        return None

    def _next(self, state: dict[str, int], following: dict[str, str]) -> Iterator[tuple[str, int]]:
        for name in state:
            try:
                yield name, self._value(following[name], state)
            except _UnknownError:
                continue

    def _value(self, text: str, state: dict[str, int]) -> int:
        """Return a value computed from the state of a loop."""
        if (constant := _constant(text)) is not None:
            return constant
        if text in state:
            return state[text]
        instruction, rest = self._computed.get(text, ("", ""))
        found = _INSTRUCTION.match(rest)
        if found is None:
            raise _UnknownError
        word, bits = (found[1] or "").strip(), int(found[2])
        first, second = found[3], found[5] or ""
        if instruction in ("sext", "zext") and found[7]:
            value = self._value(first, state)
            return _signed(value, bits) if instruction == "sext" else value % (1 << bits)
        if instruction == "select" and bits == 1 and found[6]:
            return self._value(second if self._value(first, state) else found[6], state)
        if instruction == "icmp":
            pair = [self._value(each, state) for each in (first, second)]
            pair = [each % (1 << bits) if word[0] == "u" else _signed(each, bits) for each in pair]
            return int(_COMPARISONS[word if word in _COMPARISONS else word[1:]](*pair))
        if instruction not in _OPERATIONS or not second:
            raise _UnknownError
        result = _OPERATIONS[instruction](self._value(first, state), self._value(second, state))
        return result % 2 if bits == 1 else _signed(result, bits)


def _constant(text: str) -> int | None:
    if text in ("true", "false"):
        return int(text == "true")
    return int(text) if re.fullmatch(r"-?\d+", text) else None


def _signed(value: int, bits: int) -> int:
    value %= 1 << bits
    return value - (1 << bits) if value >= 1 << (bits - 1) else value
