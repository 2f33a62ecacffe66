"""Loops over texts and ports, such as `for name, x in zip(("base", "wrist"), self.q.value):` and
`for port in (self.left, self.right):`, which are written out: in each iteration the text is a
constant, and the port is known.
"""

import ast
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from rtcf_compile.source.port_loops import uses_attributes
from rtcf_compile.source.scopes import everywhere

_MOST = 16  # iterations


class _Column(NamedTuple):
    """A target of a loop, and its iterated elements or array; neither if unknown."""

    target: ast.expr
    elements: list[ast.expr] | None
    array: ast.expr | None = None


class Written(NamedTuple):
    """A loop that can be written out.

    `rounds`: for each iteration, the texts and ports by name, the assignments before the body, and
    the iterated arrays.
    """

    before: list[ast.stmt]
    rounds: list[tuple[dict[str, ast.expr], list[ast.stmt], list[ast.expr]]]


def written(
    loop: ast.For,
    constant: Callable[[ast.expr], Any],
    is_port: Callable[[ast.expr], bool],
    prefix: str,
) -> Written | None:
    """Return a loop over texts or ports, or None for another.

    `constant` returns the value of a name of the module, or None. `prefix`: of names of variables.
    """
    columns = list(_columns(loop.target, loop.iter, constant))
    known = [each for each in columns if each.elements is not None]
    if any(each.elements is None and each.array is None for each in columns) or not known:
        return None
    rounds = min(len(each.elements or ()) for each in known)
    replaced = [_is_replaced(each, loop.body, is_port) for each in columns]
    if not any(replaced) or not 0 < rounds <= _MOST:
        return None
    result = Written([], [({}, [], []) for _ in range(rounds)])

    def kept(value: ast.expr, number: int) -> ast.expr:
        """Return a variable that is set to a value before the loop."""
        name = f"{prefix}_{number}"
        result.before.append(ast.Assign([ast.Name(name, ast.Store())], value))
        return ast.Name(name, ast.Load())

    arrays = [kept(each.array, number) if each.array is not None else None
              for number, each in enumerate(columns)]  # fmt: skip
    # Values in the order of the text.
    for k in range(max(len(each.elements or ()) for each in known)):
        for number, (column, array) in enumerate(zip(columns, arrays, strict=True)):
            if array is None and k >= len(column.elements or ()):
                continue
            value: ast.expr = ast.Subscript(array, ast.Constant(k), ast.Load()) if array else (
                column.elements or []
            )[k]  # fmt: skip
            is_simple = array is not None or replaced[number] or _is_constant(value, constant)
            if not is_simple:
                value = kept(value, len(columns) * (k + 1) + number)
            if k >= rounds:
                continue
            names, sets, longer = result.rounds[k]
            if array is not None:
                longer.append(array)
            if replaced[number]:
                names[column.target.id] = value  # type: ignore[attr-defined]
            else:
                sets.append(ast.Assign([column.target], value))
    return result


def _columns(
    target: ast.expr, iterated: ast.expr, constant: Callable[[ast.expr], Any]
) -> Iterator[_Column]:
    """Yield what each target of a loop iterates."""
    targets = target.elts if isinstance(target, ast.Tuple | ast.List) else []
    if isinstance(iterated, ast.Call):
        yield from _of_call(target, targets, iterated, constant)
        return
    elements: list[ast.expr] | None = None
    if isinstance(iterated, ast.Tuple | ast.List):
        elements = list(iterated.elts)
    elif isinstance(value := constant(iterated), tuple | list):
        places = [ast.Subscript(iterated, ast.Constant(k), ast.Load()) for k in range(len(value))]
        elements = [_of_value(*each) for each in zip(value, places, strict=True)]
    if elements is None:
        yield _Column(target, None, iterated)
    elif targets and all(
        isinstance(each, ast.Tuple | ast.List) and len(each.elts) == len(targets)
        for each in elements
    ):
        for number, one in enumerate(targets):
            yield _Column(one, [each.elts[number] for each in elements])  # type: ignore[attr-defined]
    else:
        is_known = not any(isinstance(each, ast.Starred) for each in elements)
        yield _Column(target, elements if is_known else None)


def _of_call(
    target: ast.expr,
    targets: Sequence[ast.expr],
    call: ast.Call,
    constant: Callable[[ast.expr], Any],
) -> Iterator[_Column]:
    called, given = constant(call.func), call.args
    if called is zip and len(targets) == len(given) and not call.keywords:
        for one, of in zip(targets, given, strict=True):
            yield from _columns(one, of, constant)
        return
    if called is enumerate and len(targets) == 2 and given:
        start = [*given[1:], *(each.value for each in call.keywords)]
        first = start[0].value if start and isinstance(start[0], ast.Constant) else 0
        if not start or isinstance(start[0], ast.Constant):
            yield _Column(targets[0], [ast.Constant(first + k) for k in range(_MOST + 1)])
            yield from _columns(targets[1], given[0], constant)
            return
    of = call.func.value if isinstance(call.func, ast.Attribute) else call
    table = constant(of) if isinstance(call.func, ast.Attribute) else None
    is_items = isinstance(call.func, ast.Attribute) and call.func.attr == "items"
    if isinstance(table, dict) and is_items and len(targets) == 2 and (
        all(isinstance(each, str) for each in table)
    ):  # fmt: skip
        keys: list[ast.expr] = [ast.Constant(each) for each in table]
        yield _Column(targets[0], keys)
        yield _Column(targets[1], [ast.Subscript(of, key, ast.Load()) for key in keys])
        return
    yield _Column(target, None)


def _of_value(value: Any, place: ast.expr) -> ast.expr:
    """Return a constant of the module as an expression: texts and their tuples written out."""
    if type(value) in (str, int, float, bool):
        return ast.Constant(value)
    if isinstance(value, tuple | list):
        parts = [_of_value(each, ast.Subscript(place, ast.Constant(k), ast.Load()))
                 for k, each in enumerate(value)]  # fmt: skip
        return ast.Tuple(parts, ast.Load())
    return place


def _is_constant(node: ast.expr, constant: Callable[[ast.expr], Any]) -> bool:
    """Tell whether a value is a constant, or an element of one of the module."""
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Constant) and _is_constant(node.value, constant)
    return isinstance(node, ast.Constant) or constant(node) is not None


def _is_replaced(
    column: _Column, body: list[ast.stmt], is_port: Callable[[ast.expr], bool]
) -> bool:
    """Tell whether texts or ports replace a variable."""
    if not isinstance(column.target, ast.Name) or not column.elements:
        return False
    if column.target.id in everywhere(ast.Module(body, [])):
        return False
    texts = all(isinstance(each, ast.Constant) and isinstance(each.value, str)
                for each in column.elements)  # fmt: skip
    ports = all(map(is_port, column.elements)) and uses_attributes(column.target.id, body)
    return texts or ports


def rounds_of(
    rounds: Sequence[tuple[list[ast.stmt], list[ast.stmt], list[ast.expr]]], prefix: str
) -> list[ast.stmt]:
    """Return the statements of a loop that is written out.

    Each iteration has its assignments, its body, and the tests for its existence. `break` and
    `continue` leave a loop of one iteration.
    """
    over = f"{prefix}_over"
    has_break = any(_leaves(body, ast.Break) for _, body, _ in rounds)
    result: list[ast.stmt] = []
    if has_break:
        result.append(ast.Assign([ast.Name(over, ast.Store())], ast.Constant(False)))
    for before, body, tests in rounds:
        part = [*before, *body]
        if _leaves(body, ast.Break | ast.Continue):
            part = _Breaking(over).all(part)
            once = ast.Call(ast.Name("range", ast.Load()), [ast.Constant(1)], [])
            part = [ast.For(ast.Name(f"{prefix}_once", ast.Store()), once, part, [])]
        every = [
            *tests,
            *([ast.UnaryOp(ast.Not(), ast.Name(over, ast.Load()))] if has_break else []),
        ]
        for test in reversed(every):
            part = [ast.If(test, part, [])]
        result += part
    return result


def _leaves(body: Sequence[ast.stmt], kinds: Any) -> bool:
    """Tell whether statements leave the loop around them."""
    for each in body:
        if isinstance(each, kinds):
            return True
        if isinstance(each, ast.For | ast.While):
            if _leaves(each.orelse, kinds):
                return True
        elif any(
            _leaves(getattr(each, field, None) or [], kinds) for field in ("body", "orelse")
        ) or any(_leaves(case.body, kinds) for case in getattr(each, "cases", ())):
            return True
    return False


class _Breaking(ast.NodeTransformer):
    """Lets a `break` of a loop be noted."""

    def __init__(self, name: str) -> None:
        self._name = name

    def all(self, body: list[ast.stmt]) -> list[ast.stmt]:
        module = ast.Module(body, [])
        self.visit(module)
        return module.body

    def visit_For(self, node: ast.For) -> ast.AST:
        node.orelse = self.all(node.orelse)
        return node

    def visit_While(self, node: ast.While) -> ast.AST:
        node.orelse = self.all(node.orelse)
        return node

    def visit_Break(self, node: ast.Break) -> list[ast.stmt]:
        noted = ast.Assign([ast.Name(self._name, ast.Store())], ast.Constant(True))
        return [ast.fix_missing_locations(ast.copy_location(noted, node)), node]
