"""Conditions on the values of a cycle: `wave.phase > 0.9 and abs(/arm/pid.effort) < 2`.

A condition consists of signals by their full names (the leading "/" is optional, `name[2]` is an
element of an array), numbers, `true` and `false`, + - * /, comparisons, `and`, `or`, `not`,
parentheses, and the functions abs, min, max, sqrt and isnan.  "/" begins a name where an operand is
expected; otherwise it divides.
"""

import ast
import math
import re
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from rtcf_shared.printable import printable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from rtcf_shared.ports import PortBatch, PortSchema

_LONGEST = 1000  # characters
_DEEPEST = 50
_SPACE = re.compile(r"\s*")
_NAME = re.compile(r"/?(?:[A-Za-z_]\w*/)*[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+(?:\[state\])?(?:\[\d+\])?")
_NUMBER = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_WORD = re.compile(r"[A-Za-z_]\w*")
_SIGN = re.compile(r"<=|>=|==|!=|&&|\|\||[-+*/<>(),!]")
_WORDS = {"and": "and", "or": "or", "not": "not", "true": "True", "false": "False", "inf": "inf",
          "&&": "and", "||": "or", "!": "not"}  # fmt: skip
_FUNCTIONS = ("abs", "min", "max", "sqrt", "isnan")
_BEFORE_AN_OPERAND = re.compile(r"(?:[-+*/<>(,=]|\b(?:and|or|not))$")
_NODES = (
    *(ast.Expression, ast.BoolOp, ast.And, ast.Or, ast.UnaryOp, ast.Not, ast.USub, ast.UAdd),
    *(ast.BinOp, ast.Add, ast.Sub, ast.Mult, ast.Div, ast.Compare, ast.Lt, ast.LtE, ast.Gt),
    *(ast.GtE, ast.Eq, ast.NotEq, ast.Call, ast.Name, ast.Load, ast.Constant),
)


class ConditionError(ValueError):
    """A condition is invalid, or its signals do not exist."""


class Condition:
    """A condition on signals; `signals` has their full names, in order of appearance."""

    def __init__(self, text: str) -> None:
        """Parse a condition; raises ConditionError."""
        if len(text) > _LONGEST:
            raise ConditionError(
                f"the condition has {len(text)} characters: at most {_LONGEST} are allowed"
            )
        self.text = text
        self.signals: list[str] = []
        source = " ".join(self._translated())
        if not source:
            raise ConditionError("no condition: write one as in `wave.phase > 0.5`")
        try:
            tree = ast.parse(source, mode="eval")
        except (SyntaxError, RecursionError, MemoryError):
            raise ConditionError(_no_condition(text)) from None
        if _is_deep(tree):
            raise ConditionError(f'"{printable(text[:40])}…" has too many parentheses')
        functions = set()
        for node in ast.walk(tree):
            if not isinstance(node, _NODES):
                raise ConditionError(_no_condition(text))
            if isinstance(node, ast.Call):
                functions.add(_called_function(node))
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in _FUNCTIONS and node not in functions:
                raise ConditionError(f"{node.id} is a function: write {node.id}(…)")
        self._tree = tree.body
        if not self.signals:
            raise ConditionError(
                f'"{printable(text)}" names no signal: write one as in `wave.phase > 0.5`'
            )
        if not _is_truth(self._tree):
            line = printable(text)
            raise ConditionError(f'"{line}" is a number: compare it, as in `{line} > 0`')

    @property
    def columns(self) -> list[str]:
        """The outputs and states to select in a stream."""
        # The name of a column ends after the word at the first dot; fields follow.
        return sorted({re.sub(r"^([^.]*\.\w+).*$", r"\1", name) for name in self.signals})

    def check(self, schema: "PortSchema") -> None:
        """Raise ConditionError if a signal is not in a stream or is not a single number."""
        for name in self.signals:
            _find(schema, name)

    def where(self, batch: "PortBatch") -> "NDArray[np.bool_]":
        """Return for each cycle of a batch whether the condition is true.

        Raises ConditionError like check().
        """
        values = [_column(batch, name) for name in self.signals]
        return self.over(values, len(batch))

    def over(self, values: "list[NDArray[Any]]", count: int) -> "NDArray[np.bool_]":
        """Return for each of `count` cycles whether the condition is true.

        `values` has an array for each of `signals`.
        """
        import numpy as np

        with np.errstate(all="ignore"):
            found = _value(self._tree, values)
        return np.broadcast_to(np.asarray(found, bool), (count,))

    def _translated(self) -> Iterator[str]:
        """Yield the tokens as Python source, with s0, s1 … for the signals."""
        at, last = 0, ""
        while (at := _matched(_SPACE, self.text, at).end()) < len(self.text):
            operand = not last or _BEFORE_AN_OPERAND.search(last) is not None
            if operand and (name := _NAME.match(self.text, at)):
                at, full = name.end(), "/" + name[0].removeprefix("/")
                if full not in self.signals:
                    self.signals.append(full)
                last = f"s{self.signals.index(full)}"
            elif number := _NUMBER.match(self.text, at):
                at = number.end()
                last = repr(float(number[0]))
            elif word := _WORD.match(self.text, at):
                at, last = word.end(), _WORDS.get(word[0], word[0])
                if word[0] not in _WORDS and word[0] not in _FUNCTIONS:
                    raise ConditionError(
                        f'"{word[0]}" in "{printable(self.text)}" is not a signal: name one as '
                        "COMPONENT.PORT, COMPONENT.STATE or COMPONENT.PORT.FIELD"
                    )
            elif sign := _SIGN.match(self.text, at):
                at, last = sign.end(), _WORDS.get(sign[0], sign[0])
            else:
                part, line = printable(self.text[at : at + 10]), printable(self.text)
                raise ConditionError(f'"{part}" in "{line}" is not valid in a condition')
            yield last


def _no_condition(text: str) -> str:
    return f'"{printable(text)}" is not a condition: write one as in `wave.phase > 0.5`'


def _matched(pattern: re.Pattern[str], text: str, at: int) -> re.Match[str]:
    found = pattern.match(text, at)
    assert found is not None
    return found


def _is_deep(tree: ast.AST) -> bool:
    level = [tree]
    for _ in range(_DEEPEST):
        level = [child for each in level for child in ast.iter_child_nodes(each)]
    return bool(level)


def _is_truth(node: ast.expr) -> bool:
    """Return whether an expression is boolean and not a number."""
    if isinstance(node, ast.BoolOp):
        return all(_is_truth(each) for each in node.values)
    if isinstance(node, ast.UnaryOp):
        return isinstance(node.op, ast.Not)
    if isinstance(node, ast.Call):
        return isinstance(node.func, ast.Name) and node.func.id == "isnan"
    if isinstance(node, ast.Constant):
        return isinstance(node.value, bool)
    # A signal may be a bool.
    return isinstance(node, ast.Compare | ast.Name)


def _value(node: ast.expr, values: "list[NDArray[Any]]") -> Any:
    import numpy as np

    operators: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
        ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide,
        ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal,
        ast.Eq: np.equal, ast.NotEq: np.not_equal, ast.And: np.logical_and, ast.Or: np.logical_or,
    }  # fmt: skip
    match node:
        case ast.Constant(value=constant):
            return constant
        case ast.Name(id="inf"):
            return np.inf
        case ast.Name(id=name):
            return values[int(name[1:])]
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return np.logical_not(_value(operand, values))
        case ast.UnaryOp(op=op, operand=operand):
            value = np.asarray(_value(operand, values), float)
            return -value if isinstance(op, ast.USub) else value
        case ast.BinOp(left=left, op=op, right=right):
            one, other = (np.asarray(_value(each, values), float) for each in (left, right))
            return operators[type(op)](one, other)
        case ast.BoolOp(op=op, values=parts):
            found = _value(parts[0], values)
            for part in parts[1:]:
                found = operators[type(op)](found, _value(part, values))
            return found
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_value(each, values) for each in (left, *others)]
            found = operators[type(ops[0])](terms[0], terms[1])
            for sign, one, other in zip(ops[1:], terms[1:], terms[2:], strict=False):
                found = np.logical_and(found, operators[type(sign)](one, other))
            return found
        case ast.Call(func=ast.Name(id=function), args=given):
            return _called(function, [_value(each, values) for each in given])
    raise ConditionError("a condition can only call functions by name")


def _called_function(call: ast.Call) -> ast.Name:
    """Return the function of a call; raises ConditionError if the call is invalid."""
    if not isinstance(call.func, ast.Name) or call.func.id not in _FUNCTIONS:
        raise ConditionError(f"the functions of a condition are {', '.join(_FUNCTIONS)}")
    count = 2 if call.func.id in ("min", "max") else 1
    if len(call.args) != count or call.keywords:
        raise ConditionError(f"{call.func.id}() takes {count} value{'s' if count > 1 else ''}")
    return call.func


def _called(function: str, given: list[Any]) -> Any:
    import numpy as np

    if function == "isnan":
        return np.isnan(np.asarray(given[0], float))
    if function in ("min", "max"):
        return np.minimum(*given) if function == "min" else np.maximum(*given)
    value = np.asarray(given[0], float)
    return np.abs(value) if function == "abs" else np.sqrt(value)


def _find(schema: "PortSchema", name: str) -> tuple[str, int | None]:
    """Return the signal of a name, and the index in its flattened array (None: scalar)."""
    if name in schema.signals:
        if schema.signals[name].shape:
            size = "x".join(str(each) for each in schema.signals[name].shape)
            raise ConditionError(f"{name} is an array of {size}: name one number, as in {name}[0]")
        return name, None
    array, bracket, rest = name.rpartition("[")
    signal = schema.signals.get(array)
    if bracket and signal is not None and signal.shape:
        count = 1
        for each in signal.shape:
            count *= each
        if int(rest[:-1]) >= count:
            raise ConditionError(f"{name}: {array} has {count} numbers, from [0]")
        return array, int(rest[:-1])
    near = sorted(each for each in schema.signals if each.startswith(f"{name}."))
    known = ", ".join(near or sorted(schema.signals)[:10])
    raise ConditionError(f"{name} is not a number of this stream; it has {known or 'none'}")


def _column(batch: "PortBatch", name: str) -> "NDArray[Any]":
    signal, place = _find(batch.schema, name)
    column: NDArray[Any] = batch[signal]
    if place is None:
        return column
    # Not reshape(…, -1), which fails for a batch without cycles (which only reports lost ones).
    return column.reshape(len(batch), math.prod(batch.schema.signals[signal].shape))[:, place]
