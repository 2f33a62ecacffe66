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

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """`x[1:3] = value`."""
        if len(node.targets) == 1 and is_slice(node.targets[0]):
            target = node.targets[0]
            read = self.visit(loaded(target))
            return like(node, ast.Expr(call_of("rtcf_assign", read, self.visit(node.value))))
        self.generic_visit(node)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | list[ast.stmt]:
        """`x += value`, `x[1:3] += value`, `x @= m`."""
        before, target = self._steady(node.target)
        if is_slice(target) or isinstance(node.op, ast.MatMult | ast.Pow):
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


def is_slice(node: ast.AST) -> bool:
    """Tell whether a target is a part of an array, not one element."""
    if not isinstance(node, ast.Subscript):
        return False
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    return any(isinstance(each, ast.Slice) or _is_ellipsis(each) for each in parts)


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
