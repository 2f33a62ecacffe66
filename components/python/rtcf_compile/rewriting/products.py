"""What holds in hooks and in other functions alike: `@`, np.linalg and assignment to slices become
the functions of `helpers`, constants their values.
"""

import ast
import copy
import dataclasses
import enum
import inspect
import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from rtcf_compile.rewriting.helpers import IN_PLACE, INSTEAD, rtcf_round
from rtcf_compile.source.checks import resolve
from rtcf_compile.source.mistake import at
from rtcf_compile.source.modules import Source

_Node = TypeVar("_Node", bound=ast.AST)


class Products(ast.NodeTransformer):
    """Puts the helpers in the place of `@`, np.linalg and assignment to slices."""

    def __init__(self, source: Source) -> None:
        """Rewrite a function of that source."""
        self.source = source
        self.constants: dict[str, Any] = {}
        self._counted: set[str] | None = None

    def mistake(self, node: ast.AST, what: str, way_out: str) -> Exception:
        """Return a mistake at a node."""
        return at(self.source.file, node, what, way_out)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """`GAINS.kp` of a dataclass of constants, `Mode.RUN` of an enum."""
        owner = resolve(node.value, self.source)
        if isinstance(member := resolve(node, self.source), enum.IntEnum):
            return like(node, ast.Constant(int(member)))
        if dataclasses.is_dataclass(owner) and not isinstance(owner, type):
            name = f"constant_{ast.unparse(node).replace('.', '_')}"
            self.constants[name] = getattr(owner, node.attr)
            return like(node, ast.Name(name, ast.Load()))
        self.generic_visit(node)
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """`a @ b`, `a ** b`."""
        self.generic_visit(node)
        if isinstance(node.op, ast.MatMult):
            return like(node, call_of("rtcf_matmul", node.left, node.right))
        # A constant power is a product, which has a value everywhere.
        if isinstance(node.op, ast.Pow) and not _is_power(node.right):
            return like(node, call_of("rtcf_pow", node.left, node.right))
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """`np.linalg.solve(a, b)`, `a.dot(b)`."""
        target = resolve(node.func, self.source)
        if target is math.log and len(node.args) == 2 and not node.keywords:
            parts = [like(node, ast.Call(node.func, [each], [])) for each in node.args]
            return self.visit(like(node, ast.BinOp(parts[0], ast.Div(), parts[1])))
        instead = next((own for each, own in INSTEAD.items() if each is target), None)
        if instead is not None:
            return self._instead(node, instead)
        if target is round and len(node.args) == 1 and not node.keywords:
            return self._instead(node, rtcf_round)
        if target is range and not node.keywords:
            node.args = [
                each if isinstance(each, ast.Constant) else like(each, call_of("rtcf_index", each))
                for each in (self.visit(each) for each in node.args)
            ]
            return node
        if isinstance(target, np.ufunc) and len(node.args) + len(node.keywords) > target.nin:
            raise self.mistake(
                node, f"{target.__name__} has an argument too many", "set what it returns: x[:] = …"
            )
        if isinstance(node.func, ast.Attribute) and target is None and node.func.attr == "dot":
            arguments = [self.visit(each) for each in node.args]
            return like(node, call_of("rtcf_matmul", self.visit(node.func.value), *arguments))
        if getattr(target, "__module__", "") == "numpy.linalg" or (
            isinstance(node.func, ast.Attribute)
            and resolve(node.func.value, self.source) is np.linalg
        ):
            raise self.mistake(
                node, "calls LAPACK, which allocates", "np.linalg has solve, inv and cholesky here"
            )
        self.generic_visit(node)
        return node

    def _instead(self, node: ast.Call, helper: Callable[..., Any]) -> ast.AST:
        """Return the call of what stands in the place of a function."""
        takes = len(inspect.signature(helper).parameters)
        if node.keywords or len(node.args) != takes:
            name = ast.unparse(node.func)
            raise self.mistake(node, f"{name} takes {_number(takes)}", "write it so")
        return like(node, call_of(helper.__name__, *(self.visit(each) for each in node.args)))

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """`x[i]`, where i may be an array."""
        parts = _parts(node)
        self.generic_visit(node)
        if isinstance(node.ctx, ast.Load) and any(self._may_select(each) for each in parts):
            return like(node, call_of("rtcf_get", node.value, _index(node.slice)))
        return node

    def _may_select(self, node: ast.expr) -> bool:
        """Tell whether an index may be an array."""
        return not _is_view(node) and not self._is_whole(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """`x[1:3] = value`, `x[i] = value`."""
        target = node.targets[0]
        if len(node.targets) == 1 and isinstance(target, ast.Subscript):
            return self._set_part(node, target)
        self.generic_visit(node)
        return node

    def _set_part(self, node: ast.Assign, target: ast.Subscript) -> ast.stmt | list[ast.stmt]:
        """`x[…] = value`: of one element as it is, else by what looks at the index's type."""
        parts = list(_parts(target))
        self._check_constant(target)
        if all(_is_view(each) or self._is_whole(each) for each in parts):
            dimensions, is_float = self._known(target.value)
            if any(_is_view(each) for each in parts) or len(parts) < dimensions:
                read = self.visit(loaded(target))
                return like(node, ast.Expr(call_of("rtcf_assign", read, self.visit(node.value))))
            if len(parts) == dimensions and is_float:
                self.generic_visit(node)
                return node
        before: list[ast.stmt] = []
        value = self.visit(node.value)
        if any(isinstance(each, ast.Call) for part in parts for each in ast.walk(part)):
            # Python computes the value before the index.
            name = f"rtcf_value_{node.lineno}_{node.col_offset}"
            before = [like(node, ast.Assign([ast.Name(name, ast.Store())], value))]
            value = ast.Name(name, ast.Load())
        base, index = self.visit(loaded(target.value)), _index(self.visit(target.slice))
        return [*before, like(node, ast.Expr(call_of("rtcf_set", base, index, value)))]

    def _check_constant(self, target: ast.expr) -> None:
        """Refuse to set elements of what belongs to the module."""
        base = target
        while isinstance(base, ast.Subscript | ast.Attribute):
            base = base.value
        if isinstance(base, ast.Name) and base.id not in self.source.function.__code__.co_varnames:
            raise self.mistake(
                target, f"{base.id} is a constant of the module", "declare a State, or copy it"
            )

    def _known(self, base: ast.expr) -> tuple[int, bool]:
        """Return how many dimensions an array is declared with, 0 if it is not, and whether its
        elements are floats.
        """
        return 0, False

    def _is_whole(self, node: ast.expr) -> bool:
        """Tell whether an index is an int, whatever the types of variables are."""
        if isinstance(node, ast.UnaryOp):
            return isinstance(node.op, ast.USub | ast.UAdd) and self._is_whole(node.operand)
        if isinstance(node, ast.BinOp):
            whole = (ast.Add, ast.Sub, ast.Mult, ast.FloorDiv, ast.Mod)
            both = self._is_whole(node.left) and self._is_whole(node.right)
            return isinstance(node.op, whole) and both
        if isinstance(node, ast.Constant):
            return type(node.value) is int
        if isinstance(node, ast.Name) and node.id in self.source.function.__code__.co_varnames:
            return node.id in self._counters()
        return type(resolve(node, self.source)) is int

    def _counters(self) -> set[str]:
        """Return the variables that are set by `for … in range(…)` alone."""
        if self._counted is None:
            sets = [each.id for each in ast.walk(self.source.tree)
                    if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)]  # fmt: skip
            loops = [each for each in ast.walk(self.source.tree) if isinstance(each, ast.For)]
            by_range = [each.target.id for each in loops
                        if isinstance(each.target, ast.Name) and _is_range(each.iter)]  # fmt: skip
            taken = {each.arg for each in self.source.tree.args.args}
            self._counted = {each for each in by_range if by_range.count(each) == sets.count(each)}
            self._counted -= taken
        return self._counted

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | list[ast.stmt]:
        """`x += value`, `x[1:3] += value`, `x @= m`."""
        before, target = self._steady(node.target)
        in_parts = isinstance(target, ast.Subscript)
        if in_parts or isinstance(node.op, ast.MatMult | ast.Pow):
            value: ast.expr = ast.BinOp(loaded(target), node.op, node.value)
        elif type(node.op) in IN_PLACE:
            value = call_of(IN_PLACE[type(node.op)].__name__, loaded(target), node.value)
        else:
            self.generic_visit(node)
            return node
        new = self.visit(like(node, ast.Assign([target], like(node, value))))
        return [*before, *(new if isinstance(new, list) else [new])]

    def _steady(self, target: ast.expr) -> tuple[list[ast.stmt], ast.expr]:
        """Return a target that is evaluated twice with the effect of once, and what comes before:
        calls in its indices.
        """
        before: list[ast.stmt] = []

        class Calls(ast.NodeTransformer):
            def visit_Call(self, node: ast.Call) -> ast.AST:
                name = f"rtcf_index_{node.lineno}_{node.col_offset}"
                before.append(like(node, ast.Assign([ast.Name(name, ast.Store())], node)))
                return like(node, ast.Name(name, ast.Load()))

        if isinstance(target, ast.Subscript):
            target = Calls().visit(copy.deepcopy(target))
        return [self.visit(each) for each in before], target


def _parts(node: ast.Subscript) -> list[ast.expr]:
    return node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]


def _is_view(index: ast.AST) -> bool:
    return isinstance(index, ast.Slice) or _is_ellipsis(index)


def _is_range(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("range",)


def _index(node: ast.expr) -> ast.expr:
    """Return an index as an argument: slices become objects."""
    if isinstance(node, ast.Tuple):
        return like(node, ast.Tuple([_index(each) for each in node.elts], ast.Load()))
    if isinstance(node, ast.Slice):
        bounds = [each or ast.Constant(None) for each in (node.lower, node.upper, node.step)]
        return like(node, call_of("slice", *bounds[: 3 if node.step else 2]))
    return node


def _is_power(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and type(node.value) is int and node.value >= 0


def _number(count: int) -> str:
    return "one argument" if count == 1 else f"{count} arguments"


def _is_ellipsis(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is ...


def loaded(target: ast.expr) -> ast.expr:
    """Return a target as an expression that reads it."""
    new = copy.deepcopy(target)
    new.ctx = ast.Load()  # type: ignore[attr-defined]
    return new


def call_of(function: str, *arguments: Any) -> ast.Call:
    """Return a call of a function by its name."""
    for each in arguments:
        if isinstance(each, ast.Attribute):
            each.ctx = ast.Load()
    return ast.Call(ast.Name(function, ast.Load()), list(arguments), [])


def like(node: ast.AST, new: _Node) -> _Node:
    """Return a new node in the place of another."""
    ast.copy_location(new, node)
    return ast.fix_missing_locations(new)
