"""Components in Python: classes with typed ports, parameters and state.

`rtcf-compile` compiles them to an ordinary library of components, which runs without Python. For
tests, the same class runs in the interpreter.
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
    """Makes the module callable: it hides the function rtcf.component() of the client library."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Return the specification of a component to load; see rtcf_shared.spec."""
        from rtcf_shared.spec import component

        return component(*arguments, **options)


sys.modules[__name__].__class__ = _Callable
