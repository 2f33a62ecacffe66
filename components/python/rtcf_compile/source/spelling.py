"""Different ways to write the same: replaced by one of them when a function is read.

A text with values in a log call, such as an f-string, becomes a format with arguments; such a fault
becomes a log call and a fault. An argument that is given only by its name becomes an ordinary one,
and `x[...]` becomes `x[:]`. A name that is private to a class, `self.__x`, becomes the name that
Python uses, `self._Observer__x`. A constant slice becomes its numbers, `len(Axis)` of an enum a
number, and an assignment to a property a call of its setter.
"""

import ast
import copy
import enum
import inspect
import re
import string
from collections.abc import Collection
from operator import index
from types import FunctionType
from typing import Any

from rtcf.component import Component
from rtcf.component.declaration import LOG_LEVELS

from rtcf_compile.source.scopes import everywhere


def normalise(tree: ast.AST, function: FunctionType) -> None:
    """Change the tree of a function in place."""
    owner = _class_of(function)
    cls = function.__globals__.get(owner)
    # A method of the user hides a level.
    levels = [each for each in ("error", "fatal", "warn")
              if getattr(cls, each, None) is getattr(Component, each)]  # fmt: skip
    _Spelling(owner, levels[0] if levels else "error", cls, function, tree).visit(tree)


def _class_of(function: FunctionType) -> str:
    """Return the name of the class around a function in the source; empty if there is none."""
    owner = function.__qualname__.rpartition(".")[0].rpartition(".")[2]
    return "" if owner == "<locals>" else owner


def defaults_of(function: FunctionType) -> tuple[Any, ...] | None:
    """Return the defaults of a function whose arguments are all ordinary ones."""
    by_name = function.__kwdefaults__ or {}
    return (*(function.__defaults__ or ()), *by_name.values()) or None


# The fields of nodes with names that may be private to a class.
_NAMES: dict[type[ast.AST], str] = {
    **{ast.Name: "id", ast.Attribute: "attr", ast.arg: "arg", ast.keyword: "arg"},
    **{ast.MatchAs: "name", ast.MatchStar: "name"},
}


# Prefix of the names of setters of properties.
SETTER = "rtcf_set_"


class _Spelling(ast.NodeTransformer):
    def __init__(
        self, owner: str, level: str, cls: Any, function: FunctionType, tree: ast.AST
    ) -> None:
        self._level, self._cls = level, cls
        self._globals, self._bound = function.__globals__, everywhere(tree)
        arguments = tree.args.args if isinstance(tree, ast.FunctionDef) else []
        self._first = arguments[0].arg if arguments and isinstance(cls, type) else ""
        self._prefix = f"_{owner.lstrip('_')}" if owner.strip("_") else ""

    def visit(self, node: ast.AST) -> Any:
        field = _NAMES.get(type(node), "")
        name = getattr(node, field, None) or ""
        if self._prefix and name.startswith("__") and not name.endswith("__"):
            setattr(node, field, self._prefix + name)
        return super().visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        given = node.args
        if None in given.kw_defaults and (given.defaults or any(given.kw_defaults)):
            return node  # rejected: an argument without a default would follow one with a default
        given.args += given.kwonlyargs
        given.defaults += [each for each in given.kw_defaults if each is not None]
        given.kwonlyargs, given.kw_defaults = [], []
        return node

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        place = node.slice
        if isinstance(place, ast.Constant) and place.value is ...:
            node.slice = ast.copy_location(ast.Slice(None, None, None), place)
        elif isinstance(place, ast.Tuple):
            place.elts = [self._sliced(each) for each in place.elts]
        else:
            node.slice = self._sliced(place)
        return node

    def _sliced(self, node: ast.expr) -> ast.expr:
        """Return the slice for the name of a constant one; other indices as they are."""
        value = self._constant(node)
        if not isinstance(value, slice):
            return node
        numbers = (value.start, value.stop, value.step)
        parts = [None if each is None else ast.Constant(index(each)) for each in numbers]
        return ast.fix_missing_locations(ast.copy_location(ast.Slice(*parts), node))

    def _constant(self, node: ast.expr) -> Any:
        """Return the value of a name of the module, or of an attribute of a class; else None."""
        if isinstance(node, ast.Name):
            return None if node.id in self._bound else self._globals.get(node.id)
        if not isinstance(node, ast.Attribute) or not isinstance(node.value, ast.Name):
            return None
        of = self._cls if self._is_self(node.value) else self._constant(node.value)
        return inspect.getattr_static(of, node.attr, None) if isinstance(of, type) else None

    def _is_self(self, node: ast.AST) -> bool:
        return isinstance(node, ast.Name) and node.id == self._first

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        self.generic_visit(node)
        target, *others = node.targets
        return node if others or not self._has_setter(target) else self._set(target, node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        if not self._has_setter(node.target):
            return node
        # The value may be an array, which then changes in place.
        name = f"rtcf_old_{node.lineno}_{node.col_offset}"
        old = copy.copy(node.target)
        old.ctx = ast.Load()
        read = ast.Assign([ast.Name(name, ast.Store())], old)
        change = ast.AugAssign(ast.Name(name, ast.Store()), node.op, node.value)
        call = self._set(node.target, ast.copy_location(ast.Name(name, ast.Load()), node))
        statements: list[ast.stmt] = [read, change]
        for each in statements:
            ast.fix_missing_locations(ast.copy_location(each, node))
        return [*statements, call]

    def _has_setter(self, node: ast.expr) -> bool:
        if not isinstance(node, ast.Attribute) or not self._is_self(node.value):
            return False
        found = inspect.getattr_static(self._cls, node.attr, None)
        return isinstance(found, property) and found.fset is not None

    def _set(self, target: ast.expr, value: ast.expr) -> ast.stmt:
        assert isinstance(target, ast.Attribute)
        setter = ast.Attribute(target.value, SETTER + target.attr, ast.Load())
        call = ast.copy_location(ast.Expr(ast.Call(setter, [value], [])), target)
        return ast.fix_missing_locations(call)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        if self._is_len(node) and isinstance(of := self._constant(node.args[0]), enum.EnumMeta):
            return ast.copy_location(ast.Constant(len(of)), node)
        if not _is_of_levels(node.func, LOG_LEVELS) or len(node.args) != 1:
            return node
        if isinstance(node.args[0], ast.Constant) or (found := _text(node.args[0])) is None:
            return node  # rejected unless it is a text
        text, values = found
        node.args = [ast.copy_location(ast.Constant(text), node.args[0]), *values]
        return node

    def _is_len(self, node: ast.Call) -> bool:
        of = node.func
        is_len = isinstance(of, ast.Name) and of.id == "len" and "len" not in self._bound
        return is_len and "len" not in self._globals and len(node.args) == 1 and not node.keywords

    def visit_Expr(self, node: ast.Expr) -> ast.AST | list[ast.stmt]:
        self.generic_visit(node)
        call = node.value
        if not isinstance(call, ast.Call) or not _is_of_levels(call.func, ("fault",)):
            return node
        of = call.args[0] if len(call.args) == 1 and not call.keywords else None
        found = None if of is None or isinstance(of, ast.Constant) else _text(of)
        if found is None or of is None:
            return node
        text, values = found
        assert isinstance(call.func, ast.Attribute)
        error = ast.Attribute(call.func.value, self._level, ast.Load())
        log = ast.Call(error, [ast.Constant(text), *values], [])
        call.args = [ast.copy_location(ast.Constant(_without_values(text)), of)]
        before = ast.fix_missing_locations(ast.copy_location(ast.Expr(log), node))
        return [before, node]


def _is_of_levels(node: ast.expr, names: Collection[str]) -> bool:
    return isinstance(node, ast.Attribute) and node.attr in names


_PERCENT = re.compile(r"%(?:%|([-+ #0]*)(\d*)(\.\d+)?([diouxXeEfFgGs]))")


def _text(node: ast.expr) -> tuple[str, list[ast.expr]] | None:
    """Return the format and the values of a text that is built from others, or None."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return _escaped(node.value), []
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = _text(node.left), _text(node.right)
        if left is None and right is None:
            return None
        left, right = left or _maybe_text(node.left), right or _maybe_text(node.right)
        return None if left is None or right is None else (left[0] + right[0], left[1] + right[1])
    if isinstance(node, ast.JoinedStr):
        return _of_parts(node)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod):
        return _of_percent(node)
    if not isinstance(node, ast.Call) or node.keywords:
        return None
    if isinstance(node.func, ast.Name) and node.func.id == "str" and len(node.args) == 1:
        return "{}", list(node.args)
    if isinstance(node.func, ast.Attribute) and node.func.attr == "format":
        of = node.func.value
        if isinstance(of, ast.Constant) and isinstance(of.value, str):
            return of.value, list(node.args)
    return None


def _maybe_text(node: ast.expr) -> tuple[str, list[ast.expr]] | None:
    """Return the format `{!s}` and the value of a possible text, or None."""
    is_known = isinstance(node, ast.Name | ast.Subscript)
    is_name = isinstance(node, ast.Attribute) and node.attr == "name"
    return ("{!s}", [node]) if is_known or is_name else None


def _escaped(text: str) -> str:
    return text.replace("{", "{{").replace("}", "}}")


def _of_parts(node: ast.JoinedStr) -> tuple[str, list[ast.expr]] | None:
    """Return the format and the values of an f-string."""
    text, values = "", []
    for part in node.values:
        if isinstance(part, ast.Constant):
            text += _escaped(str(part.value))
            continue
        assert isinstance(part, ast.FormattedValue)
        if part.conversion != -1 or not _is_constant(part.format_spec):
            return None
        text += "{" + _specification(part.format_spec) + "}"
        values.append(part.value)
    return text, values


def _of_percent(node: ast.BinOp) -> tuple[str, list[ast.expr]] | None:
    """Return the format and the values of `"%d of %d" % (k, n)`."""
    of, given = node.left, node.right
    values = given.elts if isinstance(given, ast.Tuple) else [given]
    if not isinstance(of, ast.Constant) or not isinstance(of.value, str):
        return None
    text, place, count = "", 0, 0
    for found in _PERCENT.finditer(of.value):
        between = of.value[place : found.start()]
        if "%" in between:
            return None
        text += _escaped(between) + ("%" if found[0] == "%%" else _placeholder(*found.groups()))
        count += found[0] != "%%"
        place = found.end()
    rest = of.value[place:]
    if "%" in rest or count != len(values):
        return None
    return text + _escaped(rest), list(values)


def _placeholder(flags: str, width: str, precision: str | None, kind: str) -> str:
    """Return `{:5.1f}` for `%5.1f`."""
    sign = next((each for each in "+ " if each in flags), "")
    align = "" if not width else "<" if "-" in flags else ">" if kind == "s" else ""
    zeros = "0" if "0" in flags and "-" not in flags and width and kind != "s" else ""
    form = {"i": "d", "u": "d", "s": ""}.get(kind, kind)
    hashed = "#" if "#" in flags else ""
    found = f"{align}{sign}{hashed}{zeros}{width}{precision or ''}{form}"
    return f"{{:{found}}}" if found else "{}"


def _without_values(text: str) -> str:
    """Return a format with … for each value."""
    parts = string.Formatter().parse(text)
    return "".join(before + ("" if name is None else "…") for before, name, _, _ in parts)


def _is_constant(specification: ast.expr | None) -> bool:
    parts = specification.values if isinstance(specification, ast.JoinedStr) else []
    return all(isinstance(each, ast.Constant) for each in parts)


def _specification(node: ast.expr | None) -> str:
    """Return `:.3f` of `{x:.3f}`."""
    if not isinstance(node, ast.JoinedStr):
        return ""
    return ":" + "".join(str(each.value) for each in node.values if isinstance(each, ast.Constant))
