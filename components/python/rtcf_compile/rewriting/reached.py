"""Finds the functions that the hooks of a class call, before any of them is rewritten."""

import ast
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import FunctionType

from rtcf.component.declaration import HOOKS

from rtcf_compile.rewriting.methods import Method, Methods, nested
from rtcf_compile.rewriting.references import is_super
from rtcf_compile.source.checks import resolve
from rtcf_compile.source.mistake import Mistakes
from rtcf_compile.source.modules import Source, read
from rtcf_compile.source.parsed import is_own


@dataclass(frozen=True)
class Reached:
    """A function that a hook calls, or a hook."""

    source: Source
    method: Method | None  # None for a function of a module


@dataclass
class ReachedFunctions:
    """Hooks, methods and functions of modules, callers first."""

    functions: list[Reached] = field(default_factory=list)
    mistakes: Mistakes = field(default_factory=Mistakes)

    @classmethod
    def of(cls, methods: Methods) -> "ReachedFunctions":
        """Read the functions of a class; collect errors of functions that cannot be read."""
        result = cls()
        hooks = (methods.find(hook) for hook in HOOKS)
        waiting: list[Method | FunctionType] = [each for each in hooks if each is not None]
        seen: set[FunctionType] = set()
        while waiting:
            called = waiting.pop(0)
            method = called if isinstance(called, Method) else None
            function = called.function if isinstance(called, Method) else called
            if function is None or function in seen:
                continue
            seen.add(function)
            with result.mistakes.collected():
                reached = Reached(read(function), method)
                result.functions.append(reached)
                waiting += _called(reached, methods)
        return result


def _called(reached: Reached, methods: Methods) -> Iterator[Method | FunctionType]:
    """Yield the methods and functions that a function refers to."""
    source, method = reached.source, reached.method
    arguments = source.tree.args.args
    has_self = method is not None and method.kind != "static method" and bool(arguments)
    own = arguments[0].arg if has_self else ""
    for node in (each for part in source.tree.body for each in ast.walk(part)):
        if not isinstance(node, ast.Attribute | ast.Name):
            continue
        found = None
        if isinstance(node, ast.Attribute):
            base = node.value
            if isinstance(base, ast.Name) and base.id == own:
                found = methods.find(node.attr)
            elif method is not None and is_super(base):
                found = methods.find(node.attr, behind=method.owner)
            elif isinstance(owner := resolve(base, source), type):
                found = methods.find_of(owner, node.attr)
        if found is not None:
            yield found
        elif is_own(value := resolve(node, source)):
            is_nested = value in source.lifted.values() and "<locals>" in value.__qualname__
            is_method = is_nested and method is not None and own
            yield nested(value, method.owner) if is_method and method is not None else value
