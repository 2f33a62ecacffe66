"""The functions of a component class, rewritten for compilation and bound to each other."""

import ast
import dataclasses
import enum
import inspect
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from rtcf.component import Component, Fault
from rtcf.component.declaration import HOOKS, REALTIME_HOOKS, Description

from rtcf_compile.rewriting import helpers, math_functions, numpy_functions, operators
from rtcf_compile.rewriting.common_rewriting import ARENA, CommonRewriting, is_number
from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.rewriting.methods import Method, Methods
from rtcf_compile.rewriting.reached import ReachedFunctions
from rtcf_compile.rewriting.references import References
from rtcf_compile.rewriting.rewrite import Hook
from rtcf_compile.source import progress
from rtcf_compile.source.checks import check, resolve
from rtcf_compile.source.mistake import Mistake, Mistakes, at, written
from rtcf_compile.source.modules import Source, read
from rtcf_compile.source.parsed import is_own, opened
from rtcf_compile.source.records import NAMED, Object, Unknown, alike, is_constant, record_of
from rtcf_compile.source.spelling import defaults_of

# The helpers that rewritten functions call, by name.
HELPERS = {**helpers.BY_NAME, **numpy_functions.BY_NAME, **math_functions.BY_NAME}
# Compiles a Python function.
Compiler = Callable[[FunctionType], Any]
# Attributes of rewritten functions: the name of the original function, such as `Observer.update`,
# and its code.
WRITTEN_NAME, WRITTEN_CODE = "rtcf_written_name", "rtcf_written_code"
# Attribute: the largest absolute ints of arguments, by their names.
INT_BOUNDS = "rtcf_int_bounds"


class Functions:
    """Hooks, methods and module functions of a class, rewritten on demand."""

    def __init__(
        self,
        cls: type[Component],
        description: Description,
        compiler: Compiler,
        narrow: Collection[CodeType] = (),
    ) -> None:
        """Prepare the functions of a class; `mistakes` collects their errors.

        `narrow`: the code of functions that compute with narrow numbers, see operators.py.
        """
        self._narrow = narrow
        self.description = description
        self.logs = Logs(description.name)
        self.lines: set[int] = set()
        self.used: set[str] = set()
        self._cls, self._compiler = cls, compiler
        self._methods = Methods(cls)
        self._made: dict[FunctionType, Any] = {}
        self._hooks: dict[FunctionType, Hook] = {}
        self._making: list[FunctionType] = []
        self.mistakes = Mistakes()
        # Functions with errors in their syntax trees.
        self._rejected: set[FunctionType] = set()
        self._references: References | None = None
        # The functions that each function calls, and the arrays that are too large for the arena.
        self._calls: dict[FunctionType, set[FunctionType]] = {}
        self._large: dict[FunctionType, Mistake] = {}
        # File, line, text and name of calls that may need functions that the loop does not have.
        self.other_calls: list[tuple[str, int, str, str]] = []

    def hooks(self) -> dict[str, FunctionType]:
        """Return the hooks of the class, rewritten but not compiled.

        Raise Mistake with all errors in the hooks and in the functions that they call.
        """
        reached = ReachedFunctions.of(self._methods)
        self._check_class()
        self.mistakes.add(*reached.mistakes.found)
        self._check(reached)
        found = {}
        if not self.mistakes.found:
            with self.mistakes.collected():
                self._references = References(self.description, self._methods)
        for hook in HOOKS:
            method = self._methods.find(hook)
            if method is None or method.function in self._rejected:
                continue
            with self.mistakes.collected():
                source = read(self._plain(method))
                rewritten = self._method(source, method, is_hook=True)
                if rewritten is not None:
                    found[hook] = rewritten
                if hook == "prepare":
                    self._check_prepare(source.function, set())
                elif hook in REALTIME_HOOKS:
                    self._check_large(source.function, set())
        if self.mistakes.found:
            self._look_further(reached)
        if not self._rejected:
            self.mistakes.one_per_line()
        self.mistakes.report()
        return found

    def _check_class(self) -> None:
        file, line = self.file(), inspect.getsourcelines(self._cls)[1]
        if dataclasses.is_dataclass(self._cls):
            remedy = "remove the decorator"
            self.mistakes.add(Mistake(file, line, "a component is no dataclass", remedy))
            return
        if self._methods.find("update") is None:
            self.mistakes.add(Mistake(file, line, "has no update", "write `def update(self):`"))
        elif (own := self._methods.find("__init__")) is not None and own.function is not None:
            with self.mistakes.collected():
                source = read(own.function)
                raise Mistake(
                    source.file,
                    source.tree.lineno,
                    "__init__ is not compiled",
                    "give members initial values, or set them in start",
                )

    def _check(self, reached: ReachedFunctions) -> None:
        """Check the syntax trees of all functions."""
        names = {*self.description.members, *self.description.constants, *self._methods.names()}
        hooks = [self._methods.find(hook) for hook in HOOKS]
        for each in reached.functions:
            before = len(self.mistakes.found)
            with self.mistakes.collected():
                check(each.source, names)
            if each.method is not None and each.method in hooks:
                self._hook_form(each.source)
            if len(self.mistakes.found) > before:
                self._rejected.add(each.source.function)

    def _look_further(self, reached: ReachedFunctions) -> None:
        """Rewrite the functions that only functions with errors call, to find their errors."""
        for each in reached.functions:
            function = each.source.function
            if function in self._rejected or function in self._made or function in self._hooks:
                continue
            if each.method is not None and each.method.kind == "nested function":
                continue  # its arguments may be messages, which only its calls tell
            if each.method is None or each.method.kind == "static method":
                self._own_function(function)
            else:
                self._compiled_method(each.method)

    def _check_prepare(self, function: FunctionType, seen: set[FunctionType]) -> None:
        """Reject members that prepare, and the methods that it calls, cannot read."""
        seen.add(function)
        hook = self._hooks[function]
        for node in hook.touched.values():
            self.mistakes.add(
                at(
                    hook.source.file,
                    node,
                    "prepare runs beside the loop and reads only parameters",
                    "compute it in update, or declare a Parameter",
                )
            )
        for called in self._calls.get(function, set()) & set(self._hooks) - seen:
            self._check_prepare(called, seen)

    def _check_large(self, function: FunctionType, seen: set[FunctionType]) -> None:
        """Reject arrays that are larger than the arena."""
        seen.add(function)
        if function in self._large:
            self.mistakes.add(self._large[function])
        for called in self._calls.get(function, set()) - seen:
            self._check_large(called, seen)

    def line(self) -> int:
        """Return the line of update."""
        method = self._methods.find("update")
        function = method.function if method else None
        return function.__code__.co_firstlineno if function else 0

    def file(self) -> str:
        """Return the file of the class."""
        return inspect.getsourcefile(self._cls) or "?"

    def _hook_form(self, source: Source) -> None:
        if len(source.tree.args.args) != 1:
            self.mistakes.add(
                Mistake(
                    source.file,
                    source.tree.lineno,
                    "a hook takes only self",
                    f"write def {source.tree.name}(self):",
                )
            )
        for node in _own_nodes(source.tree):
            value = node.value if isinstance(node, ast.Return) else None
            if value is not None and getattr(value, "value", value) is not None:
                self.mistakes.add(
                    at(source.file, node, "a hook returns nothing", "write an Output")
                )

    def _plain(self, method: Method) -> FunctionType:
        if method.function is not None:
            return method.function
        file = inspect.getsourcefile(method.owner) or "?"
        what = f"{method.name} is a {method.kind}"
        raise Mistake(file, method.line, what, method.remedy)

    def _method(self, source: Source, method: Method, is_hook: bool = False) -> FunctionType | None:
        """Return a rewritten method; None if it has errors, which are collected."""
        function = source.function
        progress.note(source.file, source.tree.lineno)
        check(source)
        # Noted lines refer to one file: for a base's hook in another file, note the class's line.
        is_here = source.file == self.file()
        line = 0 if is_here or not is_hook else inspect.getsourcelines(self._cls)[1]
        with self._rewriting(function, source):
            hook = Hook(
                source, self.description, self._methods, method.owner, self.logs,
                operator_functions(function, self._narrow), is_here, line,
            )  # fmt: skip
            tree = hook.function()
            self.mistakes.add(*hook.mistakes.found)
            self._hooks[function] = hook
            self.used |= hook.used
            self.lines |= hook.lines
            self._note_calls(hook)
            scope = self._scope(source, tree, hook.constants)
            for called in hook.called.values():
                if called.kind == "static method":
                    scope[called.symbol] = self._own_function(self._plain(called))
                else:
                    scope[called.symbol] = self._compiled_method(called)
            for number, call in enumerate(self.logs.calls):
                scope[f"rtcf_log_{number}"] = _log(number, call.count)
        if self.mistakes.found:
            return None
        return self._with_bounds(made(tree, scope, source), source)

    def _with_bounds(self, function: FunctionType, source: Source) -> FunctionType:
        """Attach the largest absolute ints of the arguments that are constants in all calls."""
        bounds = self._references.constants.items() if self._references else ()
        code = source.function.__code__
        vars(function)[INT_BOUNDS] = {
            name: bound for (of, name), bound in bounds if of is code and bound is not None
        }
        return function

    @contextmanager
    def _rewriting(self, function: FunctionType, source: Source) -> Iterator[None]:
        """Rewrite a function in the context, with its copies marked."""
        if function in self._making:
            raise Mistake(
                source.file, source.tree.lineno, f"{_written(function)} calls itself", "use a loop"
            )
        self._making.append(function)
        try:
            if self._references is not None:
                self._references.mark(source)
            yield
        finally:
            self._making.pop()

    def _note(self, function: FunctionType) -> None:
        """Record that the current function calls another."""
        if self._making:
            self._calls.setdefault(self._making[-1], set()).add(function)

    def _note_calls(self, rewriting: CommonRewriting) -> None:
        file = rewriting.source.file
        for node in rewriting.others:
            self.other_calls.append(
                (file, node.lineno, written(file, node), written(file, node.func))
            )
        self._note_large(rewriting)

    def _note_large(self, rewriting: CommonRewriting) -> None:
        for node in rewriting.large:
            self._large[rewriting.source.function] = at(
                rewriting.source.file,
                node,
                f"is larger than the memory for temporary arrays, {ARENA // 1024} KiB",
                "declare a State, or make it smaller",
            )

    def _compiled_method(self, method: Method) -> Any:
        """Return the compiler of a method; None if the method has errors, which are collected."""
        with self.mistakes.collected():
            function = self._plain(method)
            self._note(function)
            if function not in self._made and function not in self._rejected:
                source = read(function)
                _find_messages(source.tree, method)
                rewritten = self._method(source, method)
                self._made[function] = rewritten and self._compiler(rewritten)
            return self._made.get(function)
        return None

    def _own_function(self, function: FunctionType) -> Any:
        """Return the compiler of a function; None if it has errors, which are collected."""
        self._note(function)
        if function in self._made or function in self._rejected:
            return self._made.get(function)
        with self.mistakes.collected():
            source = read(function)
            progress.note(source.file, source.tree.lineno)
            check(source)
            with self._rewriting(function, source):
                rewriting = CommonRewriting(source, operator_functions(function, self._narrow))
                source.tree.body = rewriting.statements(source.tree.body)
                drop_types(source.tree)
                self.mistakes.add(*rewriting.mistakes.found)
                self._note_calls(rewriting)
                scope = self._scope(source, source.tree, rewriting.constants)
                if not self.mistakes.found:
                    plain = made(source.tree, scope, source)
                    self._made[function] = self._compiler(self._with_bounds(plain, source))
        return self._made.setdefault(function, None)

    def _scope(
        self, source: Source, tree: ast.FunctionDef, constants: dict[str, Any]
    ) -> dict[str, Any]:
        scope = {
            **source.function.__globals__,
            **source.lifted,
            **HELPERS,
            **NAMED,
            **{name: frozen(value) for name, value in constants.items()},
        }
        scope["rtcf_fault"] = Fault
        variables = source.variables
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id in scope and node.id not in variables:
                value = scope[node.id] = frozen(opened(scope[node.id]))
                if is_own(value) and node.id not in HELPERS:
                    scope[node.id] = self._own_function(value)
                else:
                    with self.mistakes.collected():
                        _constant(node, value, source)
            elif isinstance(node, ast.Attribute) and is_own(resolve(node, source)):
                what = "a function of another module"
                self.mistakes.add(at(source.file, node, what, "import the function by name"))
        return scope


def _written(function: FunctionType) -> str:
    """Return the name of a function in the source; that of a copy differs."""
    return function.__qualname__.rpartition(".")[2]


def _find_messages(tree: ast.FunctionDef, method: Method) -> None:
    """Let a nested function find messages that it would take as arguments."""
    names = {name for name, _ in method.messages}
    tree.args.args = [each for each in tree.args.args if each.arg not in names]
    for name, text in method.messages:
        found = ast.parse(f"{name} = {text}").body[0]
        for each in ast.walk(found):
            ast.copy_location(each, tree)
        tree.body.insert(0, found)


def _own_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a function without those of functions in it."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield node
            yield from _own_nodes(node)


def check_syntax(cls: type[Component]) -> None:
    """Raise Mistake for the errors in syntax trees of a class, whose declarations are wrong."""
    methods, mistakes = Methods(cls), Mistakes()
    declared = {name for each in cls.__mro__ for name in inspect.get_annotations(each)}
    reached = ReachedFunctions.of(methods)
    mistakes.add(*reached.mistakes.found)
    for each in reached.functions:
        with mistakes.collected():
            check(each.source, declared | methods.names())
    mistakes.report()


def operator_functions(
    function: FunctionType, narrow: Collection[CodeType]
) -> frozenset[type[ast.AST]]:
    """Return the operators that become calls of functions in a function."""
    return operators.NARROW if function.__code__ in narrow else operators.ALWAYS


def drop_types(tree: ast.FunctionDef) -> None:
    """Drop annotations and decorators, which have no meaning in a rewritten function."""
    tree.returns = None
    tree.decorator_list = []
    for each in tree.args.args:
        each.annotation = None


def frozen(value: Any) -> Any:
    """Return a constant with lists converted to tuples whose numbers have one type.

    numba refers to an array by its address in this process, unless its elements are adjacent.
    """
    if isinstance(value, np.ndarray) and not value.flags.forc:
        return value.copy(order="C")
    if isinstance(value, Object):
        return value
    if (record := record_of(type(value))) is not None:
        if set(getattr(value, "__dict__", ())) - set(record.fields):
            return Unknown(type(value))  # it has attributes that its class does not have
        fields = [getattr(value, each) for each in record.fields]
        return Object.of(
            record, [frozen(each) if is_constant(each) else Unknown(type(each)) for each in fields]
        )
    if type(value) is tuple:
        kept = (tuple, list, np.ndarray)
        return alike(
            tuple(
                frozen(each) if isinstance(each, kept) or record_of(type(each)) else each
                for each in value
            )
        )
    if not isinstance(value, list):
        return value
    elements = tuple(frozen(each) for each in value)
    if {type(each) for each in elements} == {int, float}:
        return tuple(float(each) for each in elements)
    return alike(elements)


def _constant(node: ast.Name, value: Any, source: Source) -> None:
    """Reject a global whose type cannot be compiled as a constant."""
    kinds: dict[type, str] = {
        dict: "a dict",
        set: "a set",
        bytearray: "a bytearray",
    }
    what = kinds.get(type(value))
    if what:
        raise at(source.file, node, f"is {what} of the module", "use a tuple or np.array(…)")
    if isinstance(value, np.ndarray) and not is_number(value.dtype):
        raise at(source.file, node, f"is an array of {value.dtype}", "use an array of numbers")
    known = (
        bool,
        int,
        float,
        complex,
        str,
        tuple,
        np.ndarray,
        np.generic,
        type,
        ModuleType,
        type(None),
    )
    if isinstance(value, known) or callable(value) or isinstance(value, enum.Enum):
        return
    if dataclasses.is_dataclass(value):
        return
    raise at(source.file, node, f"is of type {type(value).__name__}", "use numbers and arrays")


def made(tree: ast.FunctionDef, scope: dict[str, Any], source: Source) -> FunctionType:
    """Return the function of a rewritten tree; `scope`: its globals."""
    module = ast.fix_missing_locations(ast.Module([tree], []))
    code = compile(module, source.file, "exec", dont_inherit=True)
    inner = next(each for each in code.co_consts if isinstance(each, CodeType))
    defaults = defaults_of(source.function) if tree.name == source.tree.name else None
    defaults = tuple(map(frozen, defaults)) if defaults else defaults
    function = FunctionType(inner, scope, tree.name, defaults)
    vars(function)[WRITTEN_NAME] = source.function.__qualname__.rpartition("<locals>.")[2]
    vars(function)[WRITTEN_CODE] = source.function.__code__
    return function


def _log(number: int, count: int) -> Any:
    from rtcf_compile.rewriting.log_calls import log_call

    return log_call(number, count)
