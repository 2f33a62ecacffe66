"""Result types of operators on two numbers, as in both NumPy 1 and NumPy 2.

NumPy 1 converts a single number of any type to the type of an array if its value fits. NumPy 2 does
so only for Python numbers, but also with single NumPy numbers. Operations whose result types differ
between the two are rejected.
"""

import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import types
from numba.core.errors import TypingError
from numba.np.numpy_support import as_dtype

from rtcf_compile.rewriting.operators import COMPARISONS, is_narrow

_ORDER = {"b": 0, "u": 1, "i": 1, "f": 2, "c": 3}
_COMPARISONS = tuple(COMPARISONS.values())
_PYTHONS = {"i": "int", "u": "int", "f": "float", "b": "bool", "c": "complex"}


@dataclass(frozen=True)
class Operand:
    """A number, or an array of numbers."""

    dtype: np.dtype[Any]
    is_array: bool

    @property
    def is_narrow(self) -> bool:
        """Tell whether its type differs from the types of Python numbers."""
        return is_narrow(self.dtype)

    @property
    def is_bool(self) -> bool:
        """Tell whether it is a bool or an array of bools."""
        return self.dtype.kind == "b"

    @property
    def words(self) -> str:
        """Describe it for messages."""
        if not self.is_array and not self.is_narrow:
            kinds = {"b": "a bool", "i": "an int", "f": "a float", "c": "a complex number"}
            return kinds[self.dtype.kind]
        return f"an array of {self.dtype.name}" if self.is_array else f"a single {self.dtype.name}"


def operand(kind: Any) -> Operand | None:
    """Return the operand of a numba type; None if it is not a number."""
    kind = types.unliteral(kind)
    if isinstance(kind, types.Optional):
        kind = kind.type
    element = kind.dtype if isinstance(kind, types.Array) else kind
    if not isinstance(element, types.Integer | types.Float | types.Boolean | types.Complex):
        return None
    return Operand(as_dtype(element), isinstance(kind, types.Array))


@dataclass(frozen=True)
class Meeting:
    """The types to which two operands are converted; None: no conversion.

    `weak`: the operand, 0 or 1, that must be a Python number: with a NumPy number, NumPy 1 and
    NumPy 2 differ.
    """

    left: np.dtype[Any] | None = None
    right: np.dtype[Any] | None = None
    weak: int | None = None


def together(
    operation: Callable[..., Any], left: Operand, right: Operand, is_exact: bool = False
) -> Meeting:
    """Return the types to which an operation converts its operands.

    Raise TypingError if NumPy 1 and NumPy 2 differ. `is_exact`: the wider operand is a constant
    that both types represent.
    """
    if left.is_array != right.is_array:
        return _with_array(operation, left, right)
    if left.is_array or left.is_narrow == right.is_narrow:
        return _of_types(left, right)
    narrow, wide = (left, right) if left.is_narrow else (right, left)
    if operation in _COMPARISONS and (narrow.dtype.kind != "f" or is_exact):
        return Meeting()
    if _result(operation, _weak(narrow.dtype, wide.dtype), narrow.dtype) != _result(
        operation, wide.dtype, narrow.dtype
    ):
        _differ(narrow, wide)
    return Meeting()


def _with_array(operation: Callable[..., Any], left: Operand, right: Operand) -> Meeting:
    array, number = (left, right) if left.is_array else (right, left)
    if operation in _COMPARISONS and "f" not in (array.dtype.kind, number.dtype.kind):
        return Meeting()  # no conversion
    as_python, as_numpy = (
        _result(operation, each, array.dtype)
        for each in (_weak(array.dtype, number.dtype), number.dtype)
    )
    if number.is_narrow:
        # NumPy 1 ignores the type of a single NumPy number that is not of a higher kind.
        if as_python != as_numpy and _order(number) <= _order(array):
            _differ(array, number)
        return _of_types(left, right)
    to: np.dtype[Any] | None = None
    if array.is_narrow and not number.is_bool and _order(number) <= _order(array):
        is_quotient = operation is operator.truediv and array.dtype.kind != "f"
        to = np.dtype(np.float64) if is_quotient else array.dtype
    place = 1 if left.is_array else 0
    weak = place if as_python != as_numpy else None
    return Meeting(None, to, weak) if left.is_array else Meeting(to, None, weak)


def _of_types(left: Operand, right: Operand) -> Meeting:
    """Return the conversions for two NumPy types. numba would keep float32 with any int."""
    if np.promote_types(left.dtype, right.dtype) != np.float64:
        return Meeting()
    to = np.dtype(np.float64)
    return Meeting(
        to if left.dtype == np.float32 else None, to if right.dtype == np.float32 else None
    )


def _order(each: Operand) -> int:
    return _ORDER[each.dtype.kind]


def _weak(of: np.dtype[Any], number: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of a Python number in an operation with a NumPy type."""
    return of if _ORDER[number.kind] <= _ORDER[of.kind] else number


def _result(
    operation: Callable[..., Any], one: np.dtype[Any], other: np.dtype[Any]
) -> np.dtype[Any]:
    result = np.promote_types(one, other)
    if operation is operator.truediv and result.kind not in "fc":
        return np.dtype(np.float64)
    return result


def _differ(one: Operand, other: Operand) -> None:
    plain = one if not one.is_array else other
    raise TypingError(
        f"RTCF:{one.words} and {other.words} give different results in NumPy 1 and NumPy 2:"
        f"{plain_of(plain)}"
    )


def plain_of(each: Operand) -> str:
    """Return the remedy for a single number: convert it."""
    return f"convert the number: {_PYTHONS[each.dtype.kind]}(…)"
