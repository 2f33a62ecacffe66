"""Finds all type errors of a function: numba itself reports only the first."""

import functools
import operator
import re
from collections.abc import Iterator
from contextlib import contextmanager
from types import FunctionType
from typing import Any
from unittest import mock

from numba.core import typeinfer
from numba.core.errors import ForceLiteralArg

from rtcf_compile.machine_code import explain
from rtcf_compile.source.mistake import Mistake

_FOUND = "rtcf_found"
_CALLEE = re.compile(r"During: resolving callee type: (.*)")
_OWN = "type(CPUDispatcher("  # a function of the user: others are called by overloads
_UNKNOWN = "has no type"  # follows from another error
_propagate = typeinfer.TypeInferer.propagate


def _all(inferer: Any, raise_errors: bool = True) -> Any:
    """Infer types; on failure, keep all errors with the one that is raised."""
    errors = _propagate(inferer, raise_errors=False)
    if not errors or not raise_errors:
        return errors
    if literal := [each for each in errors if isinstance(each, ForceLiteralArg)]:
        raise functools.reduce(operator.or_, literal)
    vars(errors[0])[_FOUND] = errors
    raise errors[0]


@contextmanager
def kept() -> Iterator[None]:
    """Make numba keep all errors of a function with the one that it raises."""
    with mock.patch.object(typeinfer.TypeInferer, "propagate", _all):
        yield


def mistakes(error: Exception, function: FunctionType) -> list[Mistake]:
    """Return the errors of a function, without those of functions that it calls."""
    found: dict[tuple[str, str], Mistake] = {}
    places = set()
    for each in vars(error).get(_FOUND, [error]):
        callees = _CALLEE.findall(str(each))
        if callees and callees[-1].startswith(_OWN):
            continue
        mistake = explain.mistake(each, function)
        place = (mistake.file, mistake.line)
        if place in places or (found and mistake.what == _UNKNOWN):
            continue
        places.add(place)
        # A variable of two types is an error wherever it is set.
        is_joined = " in one place and " in mistake.what
        found.setdefault((mistake.what, "" if is_joined else str(place)), mistake)
    return list(found.values())
