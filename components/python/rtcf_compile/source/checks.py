"""Rejects constructs that hooks and the functions that they call must not contain.

The checks read syntax trees only; types are not known here.
"""

import ast
import difflib
import enum
import inspect
import math
import operator
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

import numpy as np
from rtcf.component.declaration import Declarable
from rtcf.component.value_type import is_enum

from rtcf_compile.source.assigned import check_assigned
from rtcf_compile.source.mistake import Mistake, Mistakes, at, once
from rtcf_compile.source.modules import Source
from rtcf_compile.source.parsed import is_own, opened
from rtcf_compile.source.records import is_plain, why_not

_REFUSED: dict[type[ast.AST], tuple[str, str]] = {
    ast.ListComp: ("a list allocates memory", "write np.array([… for …])"),
    ast.Dict: (
        "a dict allocates memory",
        "use an enum.IntEnum and `if`, or an array indexed by an int",
    ),
    ast.DictComp: ("a dict allocates memory", "use an array indexed by an int"),
    ast.Set: ("a set allocates memory", "compare with each value: x == 1 or x == 2"),
    ast.SetComp: ("a set allocates memory", "use a loop"),
    ast.GeneratorExp: ("a generator cannot be compiled", "write np.array([… for …]), or a loop"),
    ast.Yield: ("a generator cannot be compiled", "keep the progress in a State"),
    ast.YieldFrom: ("a generator cannot be compiled", "keep the progress in a State"),
    ast.Await: ("the cycle cannot wait", "keep the request in a State and test it in each cycle"),
    ast.AsyncFunctionDef: ("the cycle cannot wait", "use `def`"),
    ast.JoinedStr: (
        "text cannot be built in the cycle",
        'log with arguments: self.info("x {}", x)',
    ),
    ast.Global: ("a global variable is shared by all instances", "declare a State"),
    ast.Nonlocal: ("nonlocal is not compiled", "declare a State, or return the value"),
    ast.Try: ("exceptions cannot be caught in the cycle", "test the condition with `if` first"),
    ast.With: ("the cycle cannot open or lock anything", "remove the `with`"),
    ast.Import: ("an import cannot be compiled", "import at the top of the file"),
    ast.ImportFrom: ("an import cannot be compiled", "import at the top of the file"),
    ast.Lambda: ("a function cannot be a value", "write name = lambda …, then call name(…)"),
    ast.ClassDef: ("a class in a hook is not compiled", "define it in the module"),
    ast.Delete: ("nothing can be deleted in the cycle", "set it to 0, or remove the del"),
    ast.Starred: ("* unpacks a value that has no fixed size", "write the elements"),
}
_BUILTINS: dict[str, tuple[str, str]] = {
    "print": ("printing calls the system", 'log instead: self.info("x {}", x)'),
    "open": ("opening a file calls the system", "read it at module level, at compile time"),
    "input": ("input() waits for the user", "use an Input or a Parameter"),
    "str": ("text cannot be built in the cycle", 'log with arguments: self.info("x {}", x)'),
    "repr": ("text cannot be built in the cycle", 'log with arguments: self.info("x {}", x)'),
    "format": ("text cannot be built in the cycle", 'log with arguments: self.info("x {}", x)'),
    "list": ("a list allocates memory", "use an array"),
    "dict": ("a dict allocates memory", "use an array indexed by an int"),
    "set": ("a set allocates memory", "use an array of bools"),
    "sorted": ("a list allocates memory", "use np.sort on an array"),
    "map": ("a generator cannot be compiled", "use a loop"),
    "filter": ("a generator cannot be compiled", "use a loop with `if`"),
    "getattr": ("names are fixed at compile time", "write self.name"),
    "setattr": ("names are fixed at compile time", "write self.name = …"),
    "hasattr": ("names are fixed at compile time", "declare it"),
    "isinstance": ("types are fixed at compile time", "declare ports of that type"),
    "eval": ("the cycle cannot run Python code", "write the expression"),
    "exec": ("the cycle cannot run Python code", "write the statements"),
    "type": ("types are fixed at compile time", "remove it, or convert: float(x), int(x)"),
    "id": ("values have no identity in the cycle", "compare them: a == b"),
    "vars": ("names are fixed at compile time", "write self.name"),
    "dir": ("names are fixed at compile time", "write self.name"),
    "globals": ("names are fixed at compile time", "write the name"),
    "locals": ("names are fixed at compile time", "write the name"),
    "callable": ("types are fixed at compile time", "remove it"),
    "hash": ("values have no hash in the cycle", "compare them: a == b"),
    "next": ("an iterator cannot be compiled", "use a loop, or an index"),
    "iter": ("an iterator cannot be compiled", "use a loop, or an index"),
    "bytes": ("bytes are not compiled", "use an array of np.uint8"),
    "bytearray": ("bytes are not compiled", "use an array of np.uint8"),
    "frozenset": ("a set allocates memory", "use an array of bools"),
}
_GROWS = {
    "insert": "use a State array and a count",
    "delete": "use a State array and a count",
    "resize": "declare the largest size",
}
METHODS = {
    "append": ("a list or an array cannot grow", "use a State array and a count"),
    "extend": ("a list or an array cannot grow", "use a State array and a count"),
    "insert": ("a list or an array cannot grow", "use a State array and a count"),
    "remove": ("a list or an array cannot shrink", "use a State array and a count"),
    "pop": ("a list or an array cannot shrink", "use a State array and a count"),
    "format": ("text cannot be built in the cycle", 'log with arguments: self.info("x {}", x)'),
    "tolist": ("a list allocates memory", "use the array"),
}
_MODULES = {
    "time": ("reads a clock other than the loop's", "use self.time, self.dt or .age"),
    "datetime": ("reads a clock other than the loop's", "use self.stamp"),
    "random": (
        "would draw different numbers in a replay",
        "compute them from a seed in a State",
    ),
    "os": ("calls the system", "call it at module level, at compile time"),
    "sys": ("belongs to the interpreter", "read it at module level, at compile time"),
    "itertools": ("an iterator cannot be compiled", "write loops with range(…)"),
    "functools": ("is not compiled", "write the calls"),
    "collections": ("allocates memory", "use a State array and a count"),
    "contextlib": ("the cycle cannot open or lock anything", "remove it"),
    "json": ("is not compiled", "read files at module level, at compile time"),
    "copy": ("is not compiled", "copy an array with x.copy(), a message with ="),
    "scipy": ("is not compiled", "compute constants at module level, write the rest with NumPy"),
    "threading": ("a component starts no threads", "compute it in update, a part in each cycle"),
    "multiprocessing": (
        "a component starts no processes",
        "compute it in update, a part in each cycle",
    ),
    "concurrent": ("a component starts no threads", "compute it in update, a part in each cycle"),
    "asyncio": ("the cycle cannot wait", "keep the progress in a State"),
    "socket": ("calls the system", "use an Input or an Output; write device access in C++"),
    "subprocess": ("calls the system", "do it outside the loop"),
    "logging": ("formats and writes text", 'log with self.info("x {}", x)'),
    "rospy": ("is not real-time", "use an Input or an Output, which rtcf connects to ROS"),
}
_FUNCTIONS = {
    "time.sleep": ("blocks the cycle", "keep the time of the next step in a State"),
}
# Functions that change an array, or return one that is sometimes a view.
_REJECTED = (
    *(np.asfortranarray, np.copyto, np.fill_diagonal, np.put, np.putmask),
    *(np.place, np.put_along_axis, operator.setitem, operator.delitem),
    *(getattr(operator, each) for each in dir(operator) if each.startswith("i") and each[1:] in (
        *("add", "sub", "mul", "truediv", "floordiv", "mod", "pow", "matmul", "and", "or", "xor"),
        *("lshift", "rshift", "concat"),
    )),
)  # fmt: skip
# Decorators that leave the body of a function as it is.
_DECORATORS = ("setter", "property", "staticmethod", "override", "final")
# Packages whose functions are compiled, or rejected individually.
_COMPILED = ("builtins", "cmath", "math", "numpy", "operator", "rtcf", "_operator")
_LARGEST, _SMALLEST = 2**63 - 1, -(2**63)


# Functions without errors in their syntax trees.
_passed: set[FunctionType] = set()

# Statements that are rejected, but not what they contain.
_BLOCKS = (ast.Try, ast.With, ast.While)


def check(source: Source, members: Collection[str] = ()) -> None:
    """Raise Mistake for the errors in a function; `members`: the names in self."""
    if source.function in _passed:
        return
    mistakes = Mistakes()
    for part in (_decorators, _arguments, _defaults):
        with mistakes.collected():
            part(source)
    known = _names(source)
    rejected: list[ast.AST] = []
    undefined: set[str] = set()
    waiting: list[ast.AST] = list(reversed(_body(source.tree)))
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name) and node.id in undefined:
            continue
        try:
            _check(node, source, members, known)
        except Mistake as mistake:
            mistakes.add(mistake)
            rejected.append(node)
            if isinstance(node, ast.Name):
                undefined.add(node.id)
            inner = _children(node) if isinstance(node, _BLOCKS) else []
            waiting.extend(each for each in reversed(inner) if not isinstance(each, ast.withitem))
        else:
            waiting.extend(reversed(_children(node)))
    # Variables that a rejected statement sets would be reported, too.
    if not any(isinstance(each, ast.stmt) and not isinstance(each, ast.Raise) for each in rejected):
        with mistakes.collected():
            check_assigned(source, rejected)
    mistakes.report()
    _passed.add(source.function)


def _decorators(source: Source) -> None:
    for each in source.tree.decorator_list:
        if ast.unparse(each).rpartition(".")[2] not in _DECORATORS:
            raise at(source.file, each, "a decorator is not compiled", "remove the decorator")


def _arguments(source: Source) -> None:
    file, tree = source.file, source.tree
    arguments = tree.args
    if arguments.vararg or arguments.kwarg:
        raise Mistake(file, tree.lineno, f"{tree.name} takes any number of arguments", "name each")
    if arguments.kwonlyargs:
        what = f"{tree.name} takes {arguments.kwonlyargs[0].arg} only as a keyword"
        raise Mistake(file, tree.lineno, what, "give it a default, or remove the *")


def _defaults(source: Source) -> None:
    for default in (*source.tree.args.defaults, *source.tree.args.kw_defaults):
        if isinstance(default, ast.List | ast.Dict | ast.Set):
            raise at(
                source.file,
                default,
                "a mutable default is shared by all calls",
                "write a number or a tuple",
            )


def _check(node: ast.AST, source: Source, members: Collection[str], known: Collection[str]) -> None:
    """Raise Mistake for the error of a node, without its parts."""
    file = source.file
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
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and not (
        node.id in known or node.id.startswith("rtcf_")
    ):  # fmt: skip
        raise once(_undefined(node, source, members, known))
    if isinstance(node, ast.Assign | ast.AnnAssign | ast.NamedExpr) and node.value is not None:
        _kept(node.value, source)
    if isinstance(node, ast.Expr) and isinstance(node.value, ast.ListComp):
        raise at(file, node, "a list that is not used", "write a loop: for … in …:")
    if isinstance(node, ast.Compare):
        _compared(node, file)
    if isinstance(node, ast.Raise):
        _raised(node, file)
    if isinstance(node, ast.Slice):
        _slice(node, file)
    if isinstance(node, ast.Subscript):
        _indexed(node, source)
    if isinstance(node, ast.Attribute) and getattr(node.value, "id", "") == "super":
        raise at(file, node.value, "super must be called", f"write super().{node.attr}")
    if isinstance(node, ast.While) and _endless(node):
        raise Mistake(file, node.lineno, "an endless loop", "bound it: for _ in range(…)")
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod) and _is_text(node.left):
        raise at(file, node, *_REFUSED[ast.JoinedStr])


def _undefined(
    node: ast.Name, source: Source, members: Collection[str], known: Collection[str]
) -> Mistake:
    name, tree = node.id, source.tree
    if name in source.function.__code__.co_freevars:
        around = decorator_of(source.function)
        remedy = f"define {tree.name} in the module, or remove the decorator if {around} is one"
        return at(source.file, node, f"{name} is a variable of {around}", remedy)
    given = ", ".join(["self", *(each.arg for each in tree.args.args)])
    if name == "self":
        remedy = f"write def {tree.name}({given}):"
        if any(ast.unparse(each) == "staticmethod" for each in tree.decorator_list):
            remedy = f"remove @staticmethod, and {remedy}"
        return at(source.file, node, f"{tree.name} has no self", remedy)
    remedy = "define it, or correct its name"
    if name in ("i", "j"):
        remedy = "define it, or write 1j for the imaginary unit"
    if name in members:
        remedy = f"write self.{name}"
    elif near := difflib.get_close_matches(name, [*members, *known], 1, 0.75):
        found = f"self.{near[0]}" if near[0] in members else near[0]
        remedy = f"correct its name ({found}), or define it"
    return at(source.file, node, f"{name} is not defined", remedy)


def resolve(node: ast.AST, source: Source) -> Any:
    """Return the object that a dotted name refers to in the module, or None."""
    if isinstance(node, ast.Name):
        scope = source.function.__globals__
        if node.id in source.lifted:
            return source.lifted[node.id]
        if node.id in source.variables:
            return None
        if node.id in scope:
            return opened(scope[node.id])
        builtins = scope.get("__builtins__", {})
        builtins = vars(builtins) if isinstance(builtins, ModuleType) else builtins
        return builtins.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = resolve(node.value, source)
        return opened(getattr(owner, node.attr, None)) if owner is not None else None
    return None


def _body(tree: ast.FunctionDef) -> list[ast.stmt]:
    """Return the statements of a function without its docstring."""
    body = tree.body
    return body[1:] if isinstance(body[0], ast.Expr) and _is_text(body[0].value) else body


def _children(node: ast.AST) -> list[ast.AST]:
    """Return the parts of a node in source order, without annotations."""
    if isinstance(node, ast.AnnAssign):
        return [each for each in (node.target, node.value) if each is not None]
    return list(ast.iter_child_nodes(node))


def _names(source: Source) -> set[str]:
    scope = source.function.__globals__
    builtins = scope.get("__builtins__", {})
    known = vars(builtins) if isinstance(builtins, ModuleType) else builtins
    return {*source.variables, *source.lifted, *scope, *known}


def _constant(node: ast.Constant, file: str) -> None:
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool):
        if not _SMALLEST <= value <= _LARGEST:
            raise at(
                file, node, "does not fit int64", "write it as a float, or keep it below 2**63"
            )
    elif isinstance(value, bytes):
        raise at(file, node, "bytes are not compiled", "use an array of np.uint8")


def _folded(node: ast.BinOp | ast.UnaryOp, file: str) -> None:
    """Reject arithmetic of literals whose result exceeds int64, such as 2**63."""
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
        raise at(file, node, f"np.{name} changes the size of an array", _GROWS[name])
    if isinstance(called, ast.Attribute) and isinstance(resolve(called.value, source), list):
        name = ast.unparse(called.value)
        raise at(file, node, f"{name} is a constant of the module", "declare a State, or copy it")
    if isinstance(called, ast.Attribute) and target is None and called.attr in METHODS:
        # A declared queue has its own pop(). The rewriter, which knows declarations, checks it.
        may_be_queue = called.attr == "pop" and isinstance(called.value, ast.Attribute)
        if not may_be_queue:
            raise at(file, node, *METHODS[called.attr])
    if any(keyword.arg is None for keyword in node.keywords):
        raise at(file, node, "** unpacks a dict", "write the arguments")


def _called(node: ast.Call, target: Any, source: Source) -> None:
    """Reject a call of an object that is not a function, or of a function that is not compiled."""
    file, name = source.file, ast.unparse(node.func)
    if not callable(target):
        raise at(file, node, f"{name} is not a function", f"write {name}[0] for an element")
    if is_own(target):
        check_arguments(node, target, source.file)
        return
    inner: Any = getattr(target, "__wrapped__", getattr(target, "py_func", None))
    if is_own(inner):
        what = f"{name} has a decorator ({decorator_of(target)}), which is not compiled"
        raise at(file, node, what, f"remove it from def {inner.__name__}")
    if isinstance(target, type):
        if issubclass(target, Declarable):
            what = f"{name} declares a member, which a hook cannot do"
            raise at(file, node, what, f"write `name: {name}[float]` in the class")
        if hasattr(target, "_md5sum"):
            remedy = "set the fields of an Output: self.port.value.x = 1.0"
            raise at(file, node, "only an Output makes messages", remedy)
        if issubclass(target, enum.Enum) and not is_enum(target):
            raise at(file, node, f"{name} is not an enum of ints", "derive it from enum.IntEnum")
    root = (getattr(target, "__module__", None) or "numpy").partition(".")[0]
    if target in (max, min) and any(each.arg == "key" for each in node.keywords):
        raise at(file, node, f"{name} takes no key", f"use np.arg{name}, or a loop")
    if target in (max, min) and not node.args:
        raise at(file, node, f"{name} needs arguments", "give it values")
    if isinstance(target, BuiltinFunctionType) and root in ("math", "builtins"):
        with suppress(ValueError):  # some builtins have no signature
            check_arguments(node, target, source.file)
    if any(target is each for each in _REJECTED):
        raise at(file, node, f"{name} is not compiled", "write it as an assignment: x[:] = …")
    if (full := f"{root}.{getattr(target, '__name__', '')}") in _FUNCTIONS:
        raise at(file, node, *_FUNCTIONS[full])
    if root in _MODULES:
        raise at(file, node, *_MODULES[root])
    if isinstance(target, type):
        known = issubclass(target, np.generic | BaseException | enum.Enum)
        if not known and root not in ("builtins", "numpy"):
            what = f"an object of {target.__name__} is not compiled"
            if is_plain(target) and (reason := why_not(target)):
                why, _, remedy = reason.partition(": ")
                raise at(file, node, f"{what}, because {why}", remedy)
            raise at(file, node, what, "keep its values in State members, define its methods here")
    elif isinstance(target, FunctionType | BuiltinFunctionType) and root not in _COMPILED:
        raise at(
            file, node, f"{name} is not compiled", "write it with NumPy, or call it at module level"
        )


def decorator_of(target: Any) -> str:
    """Return the name of the decorator that made an object, if its class has it, or a function that
    another one returned.
    """
    if isinstance(target, FunctionType):
        return target.__code__.co_qualname.partition(".<locals>")[0]
    module, kind = type(target).__module__.partition(".")[0], type(target).__name__
    return "jit" if module == "numba" else kind.strip("_").removesuffix("_wrapper")


def check_arguments(
    node: ast.Call, function: Callable[..., Any], file: str, given: int = 0
) -> None:
    """Reject a call whose arguments do not match a function.

    `given`: the number of leading arguments that are not in the source.
    """
    if any(isinstance(each, ast.Starred) for each in node.args):
        return
    named = [each.arg for each in node.keywords]
    if None in named:
        return
    signature = inspect.signature(function)
    try:
        signature.bind(*[None] * (given + len(node.args)), **dict.fromkeys(map(str, named)))
    except TypeError:
        takes = [
            each.replace(kind=each.POSITIONAL_OR_KEYWORD)
            if each.kind is each.POSITIONAL_ONLY
            else each
            for each in signature.parameters.values()
        ][given:]
        if given and next(iter(signature.parameters), "self") != "self":
            own: Any = function
            name, words = (
                own.__name__,
                ", ".join(map(str, ("self", *signature.parameters.values()))),
            )
            raise Mistake(
                own.__code__.co_filename,
                own.__code__.co_firstlineno,
                f"the first parameter of {name} is not self",
                f"write def {name}({words}):",
            ) from None
        name, words = ast.unparse(node.func), ", ".join(map(str, takes))
        what = f"{name} takes {words}" if words else f"{name} takes no arguments"
        raise at(file, node, what, f"write {name}({words})") from None


def _kept(node: ast.expr, source: Source) -> None:
    """Reject functions of Python and NumPy as values: compiled, they would lose their checks."""
    for each in node.elts if isinstance(node, ast.Tuple | ast.List) else [node]:
        value = resolve(each, source)
        root = (getattr(value, "__module__", None) or "").partition(".")[0]
        if isinstance(value, BuiltinFunctionType | np.ufunc) or (
            isinstance(value, type) and root == "builtins"
        ):
            what = f"{ast.unparse(each)} is kept as a value"
            raise at(source.file, each, what, "call it where it is needed")


def _compared(node: ast.Compare, file: str) -> None:
    """Reject comparisons with texts, which no value of a component equals."""
    for each in (node.left, *node.comparators):
        if _is_text(each) and all(isinstance(of, ast.Eq | ast.NotEq) for of in node.ops):
            remedy = "compare with a member of its enum: self.mode == Mode.RUN"
            raise at(file, node, "is compared with a text, which differs from all values", remedy)


def _raised(node: ast.Raise, file: str) -> None:
    """Reject an exception with more than a constant text."""
    made = node.exc
    if made is None or isinstance(made, ast.Name):
        return
    if not isinstance(made, ast.Call):
        raise at(file, node, "is not an exception", 'write raise ValueError("constant text")')
    plain = all(_is_text(each) for each in made.args) and len(made.args) < 2
    if any(isinstance(each, ast.JoinedStr) for each in made.args):
        return  # rejected as an f-string
    if not plain or made.keywords:
        remedy = "log the values before it with self.error(…)"
        raise at(file, node, "an exception takes one constant text", remedy)


def _slice(node: ast.Slice, file: str) -> None:
    """Reject a slice that NumPy rejects: a step of 0, a bound that is not an int."""
    for each in (node.lower, node.upper, node.step):
        value = each.operand if isinstance(each, ast.UnaryOp) else each
        if isinstance(value, ast.Constant) and not isinstance(value.value, int | None):
            raise at(file, node, "a bound is not an int", "use ints: x[0:2]")
    if isinstance(node.step, ast.Constant) and node.step.value == 0:
        raise at(file, node, "the step is 0", "use a step of 1 or more, or -1")


def check_index(node: ast.Subscript, shape: Sequence[int], name: str, file: str) -> None:
    """Reject constant indices beyond the size of an array or a list."""
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    words = {1: ("elements",), 2: ("rows", "columns")}.get(
        len(shape), tuple(f"elements along axis {axis}" for axis in range(len(shape)))
    )
    for part, size, word in zip(parts, shape, words, strict=False):
        try:
            index = ast.literal_eval(part)
        except (ValueError, TypeError, SyntaxError):
            return
        if type(index) is int and not -size <= index < size:
            what = f"index {index}, but {name} has {size} {word}"
            raise at(file, node, what, f"use 0 to {size - 1}, or -1 for the last")


def _indexed(node: ast.Subscript, source: Source) -> None:
    """Reject constant indices out of range of module constants, and indices of enums."""
    owner = resolve(node.value, source)
    if isinstance(owner, list | tuple):
        if isinstance(node.slice, ast.Tuple):
            what = f"{ast.unparse(node.value)} is not an array"
            raise at(source.file, node, what, "make it an array with np.array(…), or use x[i][k]")
        check_index(node, (len(owner),), ast.unparse(node.value), source.file)
    elif isinstance(owner, np.ndarray) and owner.ndim in (1, 2, 3):
        check_index(node, owner.shape, ast.unparse(node.value), source.file)
    if isinstance(owner, type) and issubclass(owner, enum.Enum):
        first = next(iter(owner.__members__), "X")
        what = f"a name of {owner.__name__} is fixed at compile time"
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
        raise at(source.file, node, f"{owner.__name__} has no {node.attr}", "correct the name")


def _endless(node: ast.While) -> bool:
    constant = isinstance(node.test, ast.Constant) and bool(node.test.value)
    return constant and not any(isinstance(each, ast.Break | ast.Return) for each in ast.walk(node))


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)
