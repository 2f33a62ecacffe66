"""Components in Python: a class with typed ports, parameters and state.

`rtcf-compile` makes an ordinary library of components of it, which needs no Python when it runs.
The same class runs in the interpreter, for tests.
"""

import sys
from types import ModuleType
from typing import Any

from rtcf.component.declaration import (
    Derived,
    Input,
    Output,
    Parameter,
    Queue,
    State,
    describe,
)
from rtcf.component.interpreter import Component, Fault
from rtcf.component.value_type import DeclarationError

__all__ = [
    "Component",
    "DeclarationError",
    "Derived",
    "Fault",
    "Input",
    "Output",
    "Parameter",
    "Queue",
    "State",
    "describe",
]


class _Callable(ModuleType):
    """The client library has a function rtcf.component(), whose name this module hides."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Return what a component is to be loaded as; see rtcf_shared.spec."""
        from rtcf_shared.spec import component

        return component(*arguments, **options)


sys.modules[__name__].__class__ = _Callable
