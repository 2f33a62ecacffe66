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
    file = inspect.getsourcefile(function.__code__) or "?"
    if function.__name__ == "<lambda>" and (found := _lambda(function, file)) is not None:
        return found
    try:
        lines, begin = inspect.getsourcelines(function.__code__)  # not the wrapped function
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


def without_defaults(tree: ast.FunctionDef) -> ast.FunctionDef:
    """Return a function whose defaults are not computed again; they are set later."""
    new = copy.deepcopy(tree)
    new.args.defaults = [ast.copy_location(ast.Constant(None), each) for each in new.args.defaults]
    new.decorator_list = []
    return new


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
    if value.__code__.co_qualname.count("<locals>") != 1:
        return value
    if value.__module__.partition(".")[0] == "rtcf_compile":
        return value
    if value not in _functions:
        try:
            names = {name: opened(cell.cell_contents) for name, cell in zip(
                value.__code__.co_freevars, value.__closure__, strict=True)}  # fmt: skip
            tree = parsed(value)
            tree.decorator_list = []  # applied
        except (ValueError, Mistake):
            return value
        if any(isinstance(each, ast.Nonlocal) for each in ast.walk(tree)):
            return value  # rejected
        module = ast.Module([without_defaults(tree)], [])
        scope: dict[str, Any] = {}
        code = compile(module, value.__code__.co_filename, "exec", dont_inherit=True)
        exec(code, {**value.__globals__, **names}, scope)
        made = _functions[value] = scope[tree.name]
        made.__qualname__ = value.__qualname__
        made.__defaults__ = spelling.defaults_of(value)
        # Code objects of one text are equal, but those of two closures differ in their variables.
        name = f"{value.__name__}.{len(_functions)}"
        made.__code__ = made.__code__.replace(co_name=name)
        _opened[made] = tree
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
