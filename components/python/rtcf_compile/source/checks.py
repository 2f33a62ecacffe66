"""What a hook and the functions that it calls may not contain, seen from their trees alone."""

import ast
import enum
import inspect
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np

from rtcf_compile.source.assigned import check_assigned
from rtcf_compile.source.mistake import Mistake, at
from rtcf_compile.source.modules import Source, is_own

_REFUSED: dict[type[ast.AST], tuple[str, str]] = {
    ast.ListComp: ("a list allocates", "use a loop that fills an array"),
    ast.Dict: ("a dict allocates", "use an enum.IntEnum and `if`, or an array by number"),
    ast.DictComp: ("a dict allocates", "use an array by number"),
    ast.Set: ("a set allocates", "compare one by one: x == 1 or x == 2"),
    ast.SetComp: ("a set allocates", "use a loop"),
    ast.GeneratorExp: ("a generator is no machine code", "use a loop"),
    ast.Yield: ("a generator is no machine code", "keep what goes on in a State"),
    ast.YieldFrom: ("a generator is no machine code", "keep what goes on in a State"),
    ast.Await: ("the cycle waits for nothing", "keep what is awaited in a State and look again"),
    ast.AsyncFunctionDef: ("the cycle waits for nothing", "use `def`"),
    ast.JoinedStr: ("text is not made in the cycle", 'log with arguments: self.info("x {}", x)'),
    ast.Global: ("a global variable is shared by all instances", "declare a State"),
    ast.Nonlocal: ("a variable of another function", "declare a State, or return the value"),
    ast.Try: ("nothing is caught in the cycle", "test for it with `if` before it happens"),
    ast.With: ("there is nothing to open or lock in the cycle", "leave `with` out"),
    ast.Import: ("an import is no machine code", "import at the head of the file"),
    ast.ImportFrom: ("an import is no machine code", "import at the head of the file"),
    ast.Lambda: ("a lambda is not compiled", "define a function in the module"),
    ast.FunctionDef: ("a function in a function", "define it in the module"),
    ast.ClassDef: ("a class in a hook", "define it in the module"),
    ast.Delete: ("nothing is deleted in the cycle", "set it to 0, or leave it"),
    ast.Starred: ("a * takes apart what has no fixed size", "write the elements"),
}
_BUILTINS: dict[str, tuple[str, str]] = {
    "print": ("printing calls the system", 'log: self.info("x {}", x)'),
    "open": ("a file is opened by the system", "read it in the module, when it is compiled"),
    "input": ("waits for a person", "use an Input or a Parameter"),
    "str": ("text is not made in the cycle", 'log with arguments: self.info("x {}", x)'),
    "repr": ("text is not made in the cycle", 'log with arguments: self.info("x {}", x)'),
    "format": ("text is not made in the cycle", 'log with arguments: self.info("x {}", x)'),
    "list": ("a list allocates", "use an array"),
    "dict": ("a dict allocates", "use an array by number"),
    "set": ("a set allocates", "use an array of bools"),
    "sorted": ("a list allocates", "use np.sort on an array"),
    "map": ("a generator is no machine code", "use a loop"),
    "filter": ("a generator is no machine code", "use a loop with `if`"),
    "getattr": ("names are fixed when compiled", "write self.name"),
    "setattr": ("names are fixed when compiled", "write self.name = …"),
    "hasattr": ("names are fixed when compiled", "declare it"),
    "isinstance": ("types are fixed when compiled", "declare ports of that type"),
    "eval": ("no Python runs in the cycle", "write the expression"),
    "exec": ("no Python runs in the cycle", "write the statements"),
    "type": ("types are fixed when compiled", "leave it out, or convert: float(x), int(x)"),
    "id": ("values have no identity in the cycle", "compare them: a == b"),
    "vars": ("names are fixed when compiled", "write self.name"),
    "dir": ("names are fixed when compiled", "write self.name"),
    "globals": ("names are fixed when compiled", "write the name"),
    "locals": ("names are fixed when compiled", "write the name"),
    "callable": ("types are fixed when compiled", "leave it out"),
    "hash": ("values have no hash in the cycle", "compare them: a == b"),
    "next": ("an iterator is no machine code", "use a loop, or an index"),
    "iter": ("an iterator is no machine code", "use a loop, or an index"),
    "complex": ("a complex number", "use two floats"),
    "bytes": ("bytes are not compiled", "use an array of np.uint8"),
    "bytearray": ("bytes are not compiled", "use an array of np.uint8"),
    "frozenset": ("a set allocates", "use an array of bools"),
}
_GROWS = {
    "append": "use an array of State and a count",
    "insert": "use an array of State and a count",
    "delete": "use an array of State and a count",
    "resize": "declare the largest size",
}
METHODS = {
    "append": ("grows", "use an array of State and a count"),
    "extend": ("grows", "use an array of State and a count"),
    "insert": ("grows", "use an array of State and a count"),
    "remove": ("shrinks", "use an array of State and a count"),
    "pop": ("shrinks", "use an array of State and a count"),
    "format": ("text is not made in the cycle", 'log with arguments: self.info("x {}", x)'),
    "tolist": ("a list allocates", "use the array"),
}
_MODULES = {
    "time": ("reads another clock than the loop's", "use self.time, self.dt or .age"),
    "datetime": ("reads another clock than the loop's", "use self.stamp"),
    "random": (
        "draws other numbers in a replay",
        "compute them from a seed in a State",
    ),
    "os": ("calls the system", "do it in the module, when it is compiled"),
    "sys": ("is the interpreter's", "read it in the module, when it is compiled"),
    "itertools": ("an iterator is no machine code", "write loops with range(…)"),
    "functools": ("is not compiled", "write the calls"),
    "collections": ("allocates", "use an array of State and a count"),
    "contextlib": ("there is nothing to open or lock in the cycle", "leave it out"),
    "json": ("is not compiled", "read files in the module, when it is compiled"),
    "copy": ("is not compiled", "copy an array by x.copy(), a message by ="),
    "scipy": ("is not compiled", "compute constants in the module, write the rest with NumPy"),
    "threading": ("the cycle has one thread", "keep it in a State"),
    "asyncio": ("the cycle waits for nothing", "keep it in a State"),
    "socket": ("calls the system", "use an Input or Output; a device is for C++"),
    "subprocess": ("calls the system", "do it outside the loop"),
    "logging": ("formats and writes", 'log by self.info("x {}", x)'),
    "rospy": ("is not real-time", "use an Input or Output: ROS is connected to ports"),
}
# Decorators that change nothing of a function, or only its calls.
_DECORATORS = ("property", "staticmethod", "override", "final")
# Packages whose functions are compiled, or refused one by one.
_COMPILED = ("builtins", "math", "numpy", "operator", "rtcf", "_operator")
_LARGEST, _SMALLEST = 2**63 - 1, -(2**63)


def check(source: Source) -> None:
    """Raise the first Mistake of a function."""
    tree, file = source.tree, source.file
    for each in tree.decorator_list:
        if ast.unparse(each).rpartition(".")[2] not in _DECORATORS:
            raise at(file, each, "a decorator is not compiled", "call the function")
    arguments = tree.args
    if arguments.vararg or arguments.kwarg:
        raise Mistake(file, tree.lineno, f"{tree.name} takes any number of arguments", "name them")
    if arguments.kwonlyargs:
        what = f"{tree.name} takes {arguments.kwonlyargs[0].arg} by its name alone"
        raise Mistake(file, tree.lineno, what, "leave the * out")
    for default in (*arguments.defaults, *arguments.kw_defaults):
        if isinstance(default, ast.List | ast.Dict | ast.Set):
            raise at(file, default, "a default is shared by all calls", "write a number or a tuple")
    known = _names(source)
    for node in _walk(tree):
        if type(node) in _REFUSED:
            raise at(file, node, *_REFUSED[type(node)])
        if isinstance(node, ast.Constant):
            _constant(node, file)
        if isinstance(node, ast.BinOp | ast.UnaryOp):
            _folded(node, file)
        if isinstance(node, ast.Call):
            _call(node, source)
        if isinstance(node, ast.Attribute):
            _module(node, source)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id not in known:
            raise at(file, node, f"{node.id} is not defined", "declare it, or mend its name")
        if isinstance(node, ast.Raise):
            _raised(node, file)
        if isinstance(node, ast.Slice):
            _slice(node, file)
        if isinstance(node, ast.Subscript):
            _indexed(node, source)
        if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "super":
            raise at(file, node.value, "super is a call", f"write super().{node.attr}")
        if isinstance(node, ast.While) and _endless(node):
            raise Mistake(file, node.lineno, "a loop without end", "bound it: for _ in range(…)")
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod) and _is_text(node.left):
            raise at(file, node, *_REFUSED[ast.JoinedStr])
    check_assigned(source)


def resolve(node: ast.AST, source: Source) -> Any:
    """Return what a dotted name stands for in the module, or None."""
    if isinstance(node, ast.Name):
        scope = source.function.__globals__
        if node.id in source.function.__code__.co_varnames:
            return None
        if node.id in scope:
            return scope[node.id]
        builtins = scope.get("__builtins__", {})
        builtins = vars(builtins) if isinstance(builtins, ModuleType) else builtins
        return builtins.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value, source)
        return getattr(owner, node.attr, None) if owner is not None else None
    return None


def _walk(tree: ast.FunctionDef) -> Iterator[ast.AST]:
    """Yield the nodes of a body in order of the source; not annotations and docstrings."""
    body = tree.body
    if isinstance(body[0], ast.Expr) and _is_text(body[0].value):
        body = body[1:]
    waiting: list[ast.AST] = list(reversed(body))
    while waiting:
        node = waiting.pop()
        yield node
        children = list(ast.iter_child_nodes(node))
        if isinstance(node, ast.AnnAssign):
            children = [each for each in (node.target, node.value) if each is not None]
        waiting.extend(reversed(children))


def _names(source: Source) -> set[str]:
    function = source.function
    code = function.__code__
    builtins = function.__globals__.get("__builtins__", {})
    known = vars(builtins) if isinstance(builtins, ModuleType) else builtins
    return {*code.co_varnames, *code.co_cellvars, *function.__globals__, *known}


def _constant(node: ast.Constant, file: str) -> None:
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool):
        if not _SMALLEST <= value <= _LARGEST:
            raise at(
                file, node, "does not fit int64", "write it as a float, or keep it below 2**63"
            )
    elif isinstance(value, complex):
        raise at(file, node, "a complex number", "use two floats")
    elif isinstance(value, bytes):
        raise at(file, node, "bytes are not compiled", "use an array of np.uint8")


def _folded(node: ast.BinOp | ast.UnaryOp, file: str) -> None:
    """Refuse arithmetic of literals that ends beyond int64, as 2**63."""
    parts = list(ast.walk(node))
    arithmetic = (ast.BinOp, ast.UnaryOp, ast.Constant, ast.operator, ast.unaryop)
    if not all(isinstance(each, arithmetic) for each in parts):
        return
    numbers: list[Any] = [each.value for each in parts if isinstance(each, ast.Constant)]
    if not all(type(each) is int and abs(each) < 2**64 for each in numbers):
        return
    powers = [each for each in parts if isinstance(each, ast.Pow)]
    if len(powers) > 1 or (powers and max(numbers) > 1000 and len(numbers) > 1):
        value: Any = math.inf if powers and all(abs(each) > 1 for each in numbers) else 0
    else:
        try:
            value = eval(compile(ast.Expression(node), file, "eval"))
        except (ArithmeticError, ValueError, TypeError):
            return
    if isinstance(value, int | float) and not _SMALLEST <= value <= _LARGEST:
        raise at(file, node, "does not fit int64", "write it as a float, or keep it below 2**63")


def _call(node: ast.Call, source: Source) -> None:
    file, called = source.file, node.func
    own = source.function.__globals__
    if isinstance(called, ast.Name) and called.id in _BUILTINS and called.id not in own:
        raise at(file, node, *_BUILTINS[called.id])
    target = resolve(called, source)
    name = getattr(target, "__name__", "")
    if target is not None:
        _called(node, target, source)
    if name in _GROWS and getattr(np, name, None) is target:
        raise at(file, node, f"np.{name} makes an array that grows", _GROWS[name])
    if isinstance(called, ast.Attribute) and isinstance(resolve(called.value, source), list):
        name = ast.unparse(called.value)
        raise at(file, node, f"{name} is a constant of the module", "declare a State, or copy it")
    if isinstance(called, ast.Attribute) and target is None and called.attr in METHODS:
        # What is declared as a queue has a pop() of its own: seen where declarations are known.
        may_be_queue = called.attr == "pop" and isinstance(called.value, ast.Attribute)
        if not may_be_queue:
            raise at(file, node, *METHODS[called.attr])
    if any(keyword.arg is None for keyword in node.keywords):
        raise at(file, node, "** takes a dict apart", "write the arguments")


def _called(node: ast.Call, target: Any, source: Source) -> None:
    """Refuse a call of an object that is no function, or of a function that is not compiled."""
    file, name = source.file, ast.unparse(node.func)
    if not callable(target):
        raise at(file, node, f"{name} is no function", f"write {name}[0] for an element")
    if is_own(target):
        check_arguments(node, target, source.file)
        return
    if isinstance(target, type):
        if hasattr(target, "_md5sum"):
            way_out = "set the fields of an Output: self.port.value.x = 1.0"
            raise at(file, node, "a message is made by an Output alone", way_out)
        if issubclass(target, enum.Enum) and not issubclass(target, enum.IntEnum):
            raise at(file, node, f"{name} is no enum of ints", "derive it from enum.IntEnum")
    root = (getattr(target, "__module__", None) or "numpy").partition(".")[0]
    if target in (max, min) and not node.args:
        raise at(file, node, f"{name} of nothing", "give it values")
    if isinstance(target, BuiltinFunctionType) and root in ("math", "builtins"):
        with suppress(ValueError):  # some have no signature
            check_arguments(node, target, source.file)
    if root in _MODULES:
        raise at(file, node, *_MODULES[root])
    if isinstance(target, type):
        known = issubclass(target, np.generic | BaseException | enum.Enum)
        if not known and root not in ("builtins", "numpy"):
            what = f"an object of {target.__name__} is not compiled"
            raise at(file, node, what, "keep its values in State members, write its methods here")
    elif isinstance(target, FunctionType | BuiltinFunctionType) and root not in _COMPILED:
        raise at(file, node, f"{name} is not compiled", "write it with NumPy, or call it above")


def check_arguments(
    node: ast.Call, function: Callable[..., Any], file: str, given: int = 0
) -> None:
    """Refuse a call whose arguments a function does not take; `given` are not in the source."""
    if any(isinstance(each, ast.Starred) for each in node.args):
        return
    named = [each.arg for each in node.keywords]
    if None in named:
        return
    signature = inspect.signature(function)
    if any(each.kind is each.KEYWORD_ONLY for each in signature.parameters.values()):
        return  # refused where it is defined
    try:
        signature.bind(*[None] * (given + len(node.args)), **dict.fromkeys(map(str, named)))
    except TypeError:
        takes = [
            each.replace(kind=each.POSITIONAL_OR_KEYWORD)
            if each.kind is each.POSITIONAL_ONLY
            else each
            for each in signature.parameters.values()
        ][given:]
        name, words = ast.unparse(node.func), ", ".join(map(str, takes))
        what = f"{name} takes {words}" if words else f"{name} takes no argument"
        raise at(file, node, what, f"write {name}({words})") from None


def _raised(node: ast.Raise, file: str) -> None:
    """Refuse an exception with more than a constant text."""
    made = node.exc
    if made is None or isinstance(made, ast.Name):
        return
    if not isinstance(made, ast.Call):
        raise at(file, node, "is no exception", 'write raise ValueError("constant text")')
    plain = all(_is_text(each) for each in made.args) and len(made.args) < 2
    if any(isinstance(each, ast.JoinedStr) for each in made.args):
        return  # refused as text
    if not plain or made.keywords:
        way_out = "log the values before it by self.error(…)"
        raise at(file, node, "an exception has one constant text", way_out)


def _slice(node: ast.Slice, file: str) -> None:
    """Refuse a slice that NumPy refuses: a step of 0, a bound that is no int."""
    for each in (node.lower, node.upper, node.step):
        value = each.operand if isinstance(each, ast.UnaryOp) else each
        if isinstance(value, ast.Constant) and not isinstance(value.value, int | None):
            raise at(file, node, "a bound is no int", "use ints: x[0:2]")
    if isinstance(node.step, ast.Constant) and node.step.value == 0:
        raise at(file, node, "a step of 0", "use a step of 1 or more, or of -1")


def check_index(node: ast.Subscript, shape: Sequence[int], name: str, file: str) -> None:
    """Refuse constant indices beyond the sizes of an array or a list."""
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    words = ("elements",) if len(shape) == 1 else ("rows", "columns")
    for part, size, word in zip(parts, shape, words, strict=False):
        try:
            index = ast.literal_eval(part)
        except (ValueError, TypeError, SyntaxError):
            return
        if type(index) is int and not -size <= index < size:
            what = f"index {index}, but {name} has {size} {word}"
            raise at(file, node, what, f"use 0 to {size - 1}, or -1 for the last")


def _indexed(node: ast.Subscript, source: Source) -> None:
    """Refuse constant indices of constants, and of enums, that are not there."""
    owner = resolve(node.value, source)
    if isinstance(owner, list | tuple):
        if isinstance(node.slice, ast.Tuple):
            what = f"{ast.unparse(node.value)} is no array"
            raise at(source.file, node, what, "make it one by np.array(…), or use x[i][k]")
        check_index(node, (len(owner),), ast.unparse(node.value), source.file)
    elif isinstance(owner, np.ndarray) and owner.ndim in (1, 2):
        check_index(node, owner.shape, ast.unparse(node.value), source.file)
    if isinstance(owner, type) and issubclass(owner, enum.Enum):
        first = next(iter(owner.__members__), "X")
        what = f"a name of {owner.__name__} is fixed when compiled"
        raise at(source.file, node, what, f"write {owner.__name__}.{first}")


def _module(node: ast.Attribute, source: Source) -> None:
    owner = resolve(node.value, source)
    if isinstance(owner, type) and issubclass(owner, enum.Enum) and not hasattr(owner, node.attr):
        has = ", ".join(each.name for each in owner)
        raise at(source.file, node, f"{owner.__name__} has no {node.attr}", f"use one of {has}")
    if not isinstance(owner, ModuleType):
        return
    name = owner.__name__.partition(".")[0]
    if owner.__name__.startswith("numpy.random"):
        name = "random"
    if name in _MODULES:
        raise at(source.file, node, *_MODULES[name])
    if owner in (np, math) and not hasattr(owner, node.attr):
        raise at(source.file, node, f"{owner.__name__} has no {node.attr}", "mend the name")


def _endless(node: ast.While) -> bool:
    constant = isinstance(node.test, ast.Constant) and bool(node.test.value)
    return constant and not any(isinstance(each, ast.Break | ast.Return) for each in ast.walk(node))


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
