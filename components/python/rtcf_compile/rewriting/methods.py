"""The methods of a component class in Python's resolution order, with bases and mixins."""

import ast
import functools
import inspect
import textwrap
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from rtcf.component import Component

from rtcf_compile.source.checks import decorator_of
from rtcf_compile.source.parsed import is_of_user
from rtcf_compile.source.spelling import SETTER

_DECORATED = "function with a decorator"


@dataclass(frozen=True)
class Method:
    """A method, static method or property of a class; other kinds have no function."""

    name: str
    owner: type
    place: int  # index of the owner in the resolution order
    kind: str
    function: FunctionType | None
    # Arguments of a nested function that stand for messages, with the messages as written.
    messages: tuple[tuple[str, str], ...] = ()

    @property
    def symbol(self) -> str:
        """Return the name of its compiled function in other functions."""
        return f"{self.kind.split()[0]}_{self.place}_{self.name}"

    @property
    def remedy(self) -> str:
        """Return what to do about a kind that has no function."""
        if self.kind.startswith(_DECORATED):
            return f"remove the decorator from def {self.name}"
        if self.kind == "cached_property":
            return "write @property"
        return "write a method, a static method or a property with `def`"

    @property
    def line(self) -> int:
        """Return the line at which the method begins in the source of its class."""
        lines, begin = inspect.getsourcelines(self.owner)
        for each in ast.walk(ast.parse(textwrap.dedent("".join(lines)))):
            if isinstance(each, ast.FunctionDef) and each.name == self.name:
                first = min([each.lineno, *(one.lineno for one in each.decorator_list)])
                return begin + first - 1
        return begin


def nested(
    function: FunctionType, owner: type, messages: tuple[tuple[str, str], ...] = ()
) -> Method:
    """Return a function that was nested in a method and takes its self."""
    return Method(function.__name__, owner, 0, "nested function", function, messages)


class Methods:
    """The methods of one component class."""

    def __init__(self, cls: type[Component]) -> None:
        """Read the methods of a class and its bases."""
        self._classes = [
            each
            for each in cls.__mro__
            if each is not object and not each.__module__.startswith(("rtcf.component", "typing"))
        ]

    def find(self, name: str, behind: type | None = None) -> Method | None:
        """Return the method self.name, or super().name in the class `behind`; None if missing."""
        begin = 0 if behind is None else self._classes.index(behind) + 1
        return self._first(name, begin)

    def find_of(self, owner: Any, name: str) -> Method | None:
        """Return the method Owner.name of a base, or None for other classes."""
        if owner not in self._classes:
            return None
        return self._first(name, self._classes.index(owner))

    def names(self) -> set[str]:
        """Return the names of all methods."""
        return {name for each in self._classes for name in vars(each) if self.find(name)}

    def _first(self, name: str, begin: int) -> Method | None:
        for place, each in enumerate(self._classes[begin:], begin):
            if name in vars(each):
                return _method(name, each, place, vars(each)[name])
            of = vars(each).get(name.removeprefix(SETTER))
            if isinstance(of, property) and inspect.isfunction(of.fset):
                return Method(name, each, place, "method", of.fset)
        return None


def _method(name: str, owner: type, place: int, value: Any) -> Method | None:
    of = value.__func__ if isinstance(value, staticmethod) else value
    of = of.fget if isinstance(of, property) else of
    if _is_of_decorator(of, owner):
        return Method(name, owner, place, f"{_DECORATED} ({decorator_of(of)})", None)
    if inspect.isfunction(value):
        return Method(name, owner, place, "method", value)
    if isinstance(value, staticmethod) and inspect.isfunction(value.__func__):
        return Method(name, owner, place, "static method", value.__func__)
    if isinstance(value, property) and inspect.isfunction(value.fget):
        return Method(name, owner, place, "property", value.fget)
    if isinstance(value, staticmethod | classmethod | property | functools.cached_property):
        return Method(name, owner, place, type(value).__name__, None)
    return None


def _is_of_decorator(value: Any, owner: type) -> bool:
    """Tell whether an attribute of a class is what a decorator made of a method: a function of
    another function, or an object that can be called. A decorator that uses functools.wraps gives
    the method's own source.
    """
    if inspect.isfunction(value):
        is_own = value.__code__.co_qualname.startswith(f"{owner.__qualname__}.")
        is_inner = "<locals>" in value.__code__.co_qualname
        return not is_own and is_inner and bool(value.__code__.co_freevars)
    others = (staticmethod, classmethod, property, functools.cached_property, type)
    if isinstance(value, others):
        return False
    return hasattr(value, "__wrapped__") or (callable(value) and is_of_user(type(value)))
