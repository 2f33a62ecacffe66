"""The functions of the user: which they are, and their syntax trees."""

import ast
import copy
import inspect
import linecache
import sys
from dis import Instruction, Positions, get_instructions
from types import FunctionType
from typing import Any

from rtcf_compile.source import spelling
from rtcf_compile.source.mistake import Mistake

_opened: dict[FunctionType, ast.FunctionDef] = {}
_functions: dict[FunctionType, FunctionType] = {}


def parsed(function: FunctionType) -> ast.FunctionDef:
    """Return the syntax tree of a function in the file of its module, in one spelling."""
    if function in _opened:
        return copy.deepcopy(_opened[function])
    file = inspect.getsourcefile(function) or "?"
    if function.__name__ == "<lambda>" and (found := _lambda(function, file)) is not None:
        return found
    try:
        lines, begin = inspect.getsourcelines(function)
    except OSError:
        raise Mistake(
            file, 0, f"{function.__name__} has no source", "define it in a file"
        ) from None
    if lines[0][:1].isspace():
        # Parse a method inside a block, which keeps its column numbers.
        block = ast.parse("".join(["if True:\n", *lines])).body[0]
        tree, above = block.body[0], 2  # type: ignore[attr-defined]
    else:
        tree, above = ast.parse("".join(lines)).body[0], 1
    ast.increment_lineno(tree, begin - above)
    if not isinstance(tree, ast.FunctionDef):
        kind = "is async" if isinstance(tree, ast.AsyncFunctionDef) else "is a lambda"
        raise Mistake(file, begin, f"{function.__name__} {kind}", "write it with `def`")
    spelling.normalise(tree, function)
    return tree


def _lambda(function: FunctionType, file: str) -> ast.FunctionDef | None:
    """Return the tree of a lambda, or None if it cannot be told from others of its line."""
    places = [(each.lineno, each.col_offset) for each in map(_position, get_instructions(function))
              if each is not None and each.lineno and each.col_offset]  # fmt: skip
    module = ast.parse("".join(linecache.getlines(file)))
    lambdas = [each for each in ast.walk(module) if isinstance(each, ast.Lambda)]
    every = [each for each in lambdas if all(_is_in(place, each) for place in places)]
    if not every or not places:
        return None
    found = every[-1]  # the innermost: a node follows those around it
    body = [ast.copy_location(ast.Return(found.body), found.body)]
    tree = ast.FunctionDef("rtcf_lambda", found.args, body, [])
    ast.fix_missing_locations(ast.copy_location(tree, found))
    spelling.normalise(tree, function)
    return tree


def _position(each: Instruction) -> Positions | None:
    """Return the place of an instruction that stands for a part of the text."""
    return None if each.opname in ("RESUME", "COPY_FREE_VARS", "MAKE_CELL") else each.positions


def _is_in(place: tuple[int, int], node: ast.Lambda) -> bool:
    body = node.body
    return (
        (body.lineno, body.col_offset) <= place < (body.end_lineno or 0, body.end_col_offset or 0)
    )


def opened(value: Any) -> Any:
    """Return a function that refers to variables of the function around it, which has returned,
    as a function of the module with constants; other values as they are.
    """
    if not isinstance(value, FunctionType) or not value.__closure__ or not is_own(value):
        return value
    if hasattr(value, "__wrapped__") or value.__qualname__.count("<locals>") != 1:
        return value
    if value.__module__.partition(".")[0] == "rtcf_compile":
        return value
    if value not in _functions:
        try:
            names = {name: opened(cell.cell_contents) for name, cell in zip(
                value.__code__.co_freevars, value.__closure__, strict=True)}  # fmt: skip
            tree = parsed(value)
        except (ValueError, Mistake):
            return value
        if any(isinstance(each, ast.Nonlocal) for each in ast.walk(tree)):
            return value  # rejected
        module = ast.Module([copy.deepcopy(tree)], [])
        scope: dict[str, Any] = {}
        code = compile(module, value.__code__.co_filename, "exec", dont_inherit=True)
        exec(code, {**value.__globals__, **names}, scope)
        _functions[value] = scope[tree.name]
        _functions[value].__qualname__ = value.__qualname__
        _opened[_functions[value]] = tree
    return _functions[value]


def is_own(value: Any) -> bool:
    """Tell whether a value is a Python function of the user, which must be compiled too."""
    if not isinstance(value, FunctionType):
        return False
    return value.__module__ == "rtcf.linear" or is_of_user(value)


def is_of_user(value: Any) -> bool:
    """Tell whether a function or a class is in a module of the user."""
    module = sys.modules.get(value.__module__ or "")
    file = getattr(module, "__file__", None) or ""
    packages = ("/dist-packages/", "/site-packages/", "/lib/python3")
    return bool(file) and not any(each in file for each in packages)
