"""The functions of a component class as they are compiled: rewritten, and bound to each other."""

import ast
import dataclasses
import enum
import inspect
from collections.abc import Callable
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from rtcf.component import Component, Fault
from rtcf.component.declaration import HOOKS, Description

from rtcf_compile.rewriting import helpers
from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.rewriting.products import Products
from rtcf_compile.rewriting.rewrite import Hook
from rtcf_compile.source.checks import check, resolve
from rtcf_compile.source.mistake import Mistake, at
from rtcf_compile.source.modules import Source, is_own, read

# What makes a compiled function of a Python one, and what stands for a log call.
Compiler = Callable[[FunctionType], Any]


class Functions:
    """Hooks, methods and module functions of a class, made when they are asked for."""

    def __init__(self, cls: type[Component], description: Description, compiler: Compiler) -> None:
        """Prepare those of a class."""
        self.description = description
        self.logs = Logs(description.name)
        self.lines: set[int] = set()
        self.used: set[str] = set()
        self._cls, self._compiler = cls, compiler
        self._methods = {
            name: value
            for base in reversed(cls.__mro__)
            if base is not Component and issubclass(base, Component)
            for name, value in vars(base).items()
            if inspect.isfunction(value) or isinstance(value, staticmethod | classmethod | property)
        }
        self._made: dict[FunctionType, Any] = {}
        self._hooks: dict[str, Hook] = {}
        self._making: list[FunctionType] = []

    def hooks(self) -> dict[str, FunctionType]:
        """Return the hooks that the class has, rewritten but not compiled."""
        if "update" not in self._methods:
            file = inspect.getsourcefile(self._cls) or "?"
            line = inspect.getsourcelines(self._cls)[1]
            raise Mistake(file, line, "has no update", "write `def update(self):`")
        found = {}
        for hook in HOOKS:
            if hook in self._methods:
                source = read(self._plain(hook))
                check(source)
                self._hook_form(source)
                found[hook] = self._method(source)
        if "prepare" in found:
            self._check_prepare("prepare", set())
        return found

    def _check_prepare(self, name: str, seen: set[str]) -> None:
        """Refuse what prepare and the methods that it calls cannot know."""
        seen.add(name)
        hook = self._hooks[name]
        for node in hook.touched.values():
            raise at(
                hook.source.file,
                node,
                "prepare runs beside the loop, with parameters alone",
                "compute it in update, or declare a Parameter",
            )
        for called in set(hook.called) - seen:
            self._check_prepare(called, seen)

    def file(self) -> str:
        """Return the file of the class."""
        return inspect.getsourcefile(self._cls) or "?"

    def _hook_form(self, source: Source) -> None:
        if len(source.tree.args.args) != 1:
            raise Mistake(
                source.file,
                source.tree.lineno,
                "a hook takes self alone",
                f"def {source.tree.name}(self):",
            )
        for node in ast.walk(source.tree):
            value = node.value if isinstance(node, ast.Return) else None
            if value is not None and getattr(value, "value", value) is not None:
                raise at(source.file, node, "a hook returns nothing", "write an Output")

    def _plain(self, name: str) -> FunctionType:
        value = self._methods[name]
        if isinstance(value, FunctionType):
            return value
        function: Any = getattr(value, "__func__", None) or getattr(value, "fget", None)
        source = read(function)
        raise Mistake(
            source.file,
            source.tree.lineno,
            f"{name} is a {type(value).__name__}",
            "write a plain method, or a function of the module",
        )

    def _method(self, source: Source) -> FunctionType:
        function = source.function
        check(source)
        if function in self._making:
            raise Mistake(
                source.file, source.tree.lineno, f"{function.__name__} calls itself", "use a loop"
            )
        self._making.append(function)
        names = set(self._methods) - set(HOOKS)
        hook = Hook(source, self.description, names, self.logs)
        tree = hook.function()
        self._hooks[source.tree.name] = hook
        self.used |= hook.used
        self.lines |= hook.lines
        scope = self._scope(source, hook.constants)
        for name in hook.called:
            scope[f"method_{name}"] = self._compiled_method(self._plain(name))
        for number, call in enumerate(self.logs.calls):
            scope[f"rtcf_log_{number}"] = _log(number, call.count)
        self._making.pop()
        return made(tree, scope, source)

    def _compiled_method(self, function: FunctionType) -> Any:
        if function not in self._made:
            self._made[function] = self._compiler(self._method(read(function)))
        return self._made[function]

    def _own_function(self, function: FunctionType) -> Any:
        if function in self._made:
            return self._made[function]
        source = read(function)
        if function in self._making:
            raise Mistake(
                source.file, source.tree.lineno, f"{function.__name__} calls itself", "use a loop"
            )
        self._making.append(function)
        check(source)
        products = Products(source)
        body: list[ast.stmt] = []
        for statement in source.tree.body:
            new = products.visit(statement)
            body.extend(new if isinstance(new, list) else [new])
        source.tree.body = body
        source.tree.returns = None
        for each in source.tree.args.args:
            each.annotation = None
        plain = made(source.tree, self._scope(source, products.constants), source)
        own = self._compiler(plain)
        self._making.pop()
        self._made[function] = own
        return own

    def _scope(self, source: Source, constants: dict[str, Any]) -> dict[str, Any]:
        scope = {**source.function.__globals__, **helpers.BY_NAME, **constants}
        scope["rtcf_fault"] = Fault
        for node in ast.walk(source.tree):
            if isinstance(node, ast.Name) and node.id in scope:
                value = scope[node.id]
                if is_own(value) and value not in helpers.BY_NAME.values():
                    scope[node.id] = self._own_function(value)
                else:
                    _constant(node, value, source)
            elif isinstance(node, ast.Attribute) and is_own(resolve(node, source)):
                what = "a function of another module"
                raise at(source.file, node, what, "import it by its name")
        return scope


def _constant(node: ast.Name, value: Any, source: Source) -> None:
    """Refuse a global that is no constant of a kind that can be compiled."""
    if source.function.__code__.co_varnames and node.id in source.function.__code__.co_varnames:
        return
    kinds: dict[type, str] = {
        dict: "a dict",
        list: "a list",
        set: "a set",
        bytearray: "a bytearray",
    }
    what = kinds.get(type(value))
    if what:
        raise at(source.file, node, f"is {what} of the module", "use a tuple or np.array(…)")
    if isinstance(value, np.ndarray) and value.dtype.kind not in "fiub":
        raise at(source.file, node, f"is an array of {value.dtype}", "use an array of numbers")
    known = (bool, int, float, str, tuple, np.ndarray, np.generic, type, ModuleType, type(None))
    if isinstance(value, known) or callable(value) or isinstance(value, enum.Enum):
        return
    if dataclasses.is_dataclass(value):
        return
    raise at(source.file, node, f"is of type {type(value).__name__}", "use numbers and arrays")


def made(tree: ast.FunctionDef, scope: dict[str, Any], source: Source) -> FunctionType:
    """Return a function of a rewritten tree, with the names that it sees."""
    module = ast.fix_missing_locations(ast.Module([tree], []))
    code = compile(module, source.file, "exec", dont_inherit=True)
    inner = next(each for each in code.co_consts if isinstance(each, CodeType))
    return FunctionType(inner, scope, tree.name, source.function.__defaults__)


def _log(number: int, count: int) -> Any:
    from rtcf_compile.rewriting.log_calls import log_call

    return log_call(number, count)
