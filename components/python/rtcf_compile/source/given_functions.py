"""Functions as arguments, such as in rk4(f, x, dt): the function that takes others is copied for
those that it is given, and the copy calls them by name (Chin and Darlington, "A Higher-Order
Removal Method", 1996).
"""

import ast
import inspect
import sys
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from rtcf_compile.source.parsed import is_own


class Given(NamedTuple):
    """A function that is given to another."""

    name: str  # for names of copies
    key: Any  # of the copy
    of_module: Any = None  # function of a module
    method: str = ""  # self.method
    nested: str = ""  # nested function


def owner_of(function: FunctionType) -> type | None:
    """Return the class of a module with this method, or None."""
    module = sys.modules.get(function.__module__ or "")
    owner = vars(module).get(function.__qualname__.partition(".")[0]) if module else None
    return owner if isinstance(owner, type) else None


def method_of(owner: type | None, name: str) -> Any:
    """Return a method, or staticmethod, that no class below its own replaces, or None."""
    if owner is None:
        return None
    of = inspect.getattr_static(owner, name, None)
    if any(inspect.getattr_static(each, name, None) is not of for each in _below(owner)):
        return None
    is_method = isinstance(of, FunctionType | staticmethod) and is_own(getattr(of, "__func__", of))
    return of if is_method else None


def _below(owner: type) -> set[type]:
    direct = set(owner.__subclasses__())
    return direct.union(*map(_below, direct))


def is_function(value: Any) -> bool:
    """Tell whether a value of a module is a function that a component may call."""
    return is_own(value) or isinstance(value, np.ufunc) or inspect.isbuiltin(value)


def is_plain(function: FunctionType, tree: ast.FunctionDef) -> bool:
    """Tell whether a function means the same outside of its class or of the function around it."""
    return (
        all(ast.unparse(each) == "staticmethod" for each in tree.decorator_list)
        and not function.__code__.co_freevars
        and not any(isinstance(each, ast.Name) and each.id == "super" for each in ast.walk(tree))
    )


def calls(tree: ast.FunctionDef, name: str) -> bool:
    """Tell whether a function calls its argument."""
    return any(
        isinstance(each, ast.Call) and isinstance(each.func, ast.Name) and each.func.id == name
        for each in ast.walk(tree)
    )


def arguments(call: ast.Call, names: list[str]) -> dict[str, ast.expr] | None:
    """Return the arguments of a call by name, or None for one that does not fit."""
    if len(call.args) > len(names) or any(isinstance(each, ast.Starred) for each in call.args):
        return None
    found = dict(zip(names, call.args, strict=False))
    for each in call.keywords:
        if each.arg is None or each.arg in found or each.arg not in names:
            return None
        found[each.arg] = each.value
    return found


def without(
    tree: ast.FunctionDef, names: set[str], values: tuple[Any, ...] | None
) -> tuple[Any, ...] | None:
    """Drop arguments, and their defaults, from a function; return the values of those left."""
    every = [each.arg for each in (*tree.args.posonlyargs, *tree.args.args)]
    nodes = dict(zip(every[::-1], tree.args.defaults[::-1], strict=False))
    known = dict(zip(every[::-1], (values or ())[::-1], strict=False))
    tree.args.posonlyargs = [each for each in tree.args.posonlyargs if each.arg not in names]
    tree.args.args = [each for each in tree.args.args if each.arg not in names]
    left = [each for each in every if each in nodes and each not in names]
    tree.args.defaults = [nodes[each] for each in left]
    return tuple(known[each] for each in left) or None
