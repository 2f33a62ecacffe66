"""The methods of a component class in Python's resolution order, with bases and mixins."""

import functools
import inspect
from dataclasses import dataclass
from types import FunctionType
from typing import Any

from rtcf.component import Component


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
        return None


def _method(name: str, owner: type, place: int, value: Any) -> Method | None:
    if inspect.isfunction(value):
        return Method(name, owner, place, "method", value)
    if isinstance(value, staticmethod) and inspect.isfunction(value.__func__):
        return Method(name, owner, place, "static method", value.__func__)
    if isinstance(value, property) and inspect.isfunction(value.fget):
        return Method(name, owner, place, "property", value.fget)
    if isinstance(value, staticmethod | classmethod | property | functools.cached_property):
        return Method(name, owner, place, type(value).__name__, None)
    if hasattr(value, "__wrapped__"):
        decorator = type(value).__name__.strip("_").removesuffix("_wrapper")
        return Method(name, owner, place, f"function with a decorator ({decorator})", None)
    return None
