"""Different ways to write the same: replaced by one of them when a function is read.

An f-string in a log call becomes a format with arguments, an argument that is given only by its
name an ordinary one, and `x[...]` becomes `x[:]`. A name that is private to a class, `self.__x`,
becomes the name that Python uses, `self._Observer__x`.
"""

import ast
from types import FunctionType
from typing import Any

from rtcf.component.declaration import LOG_LEVELS


def normalise(tree: ast.AST, function: FunctionType) -> None:
    """Change the tree of a function in place."""
    _Spelling(_class_of(function)).visit(tree)


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


class _Spelling(ast.NodeTransformer):
    def __init__(self, owner: str) -> None:
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
        if isinstance(node.slice, ast.Constant) and node.slice.value is ...:
            node.slice = ast.copy_location(ast.Slice(None, None, None), node.slice)
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        called = node.func
        if (
            isinstance(called, ast.Attribute)
            and called.attr in LOG_LEVELS
            and len(node.args) == 1
            and isinstance(node.args[0], ast.JoinedStr)
        ):
            text, values = "", []
            for part in node.args[0].values:
                if isinstance(part, ast.Constant):
                    text += str(part.value).replace("{", "{{").replace("}", "}}")
                    continue
                assert isinstance(part, ast.FormattedValue)
                if part.conversion != -1 or not _is_constant(part.format_spec):
                    return node  # rejected as an f-string
                text += "{" + _specification(part.format_spec) + "}"
                values.append(part.value)
            node.args = [ast.copy_location(ast.Constant(text), node.args[0]), *values]
        return node


def _is_constant(specification: ast.expr | None) -> bool:
    parts = specification.values if isinstance(specification, ast.JoinedStr) else []
    return all(isinstance(each, ast.Constant) for each in parts)


def _specification(node: ast.expr | None) -> str:
    """Return `:.3f` of `{x:.3f}`."""
    if not isinstance(node, ast.JoinedStr):
        return ""
    return ":" + "".join(str(each.value) for each in node.values if isinstance(each, ast.Constant))
