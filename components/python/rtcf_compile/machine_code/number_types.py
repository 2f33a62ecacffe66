"""Types of numbers where an operator meets two, as both releases of NumPy have them.

NumPy 1 gives a single number with an array the array's type if it fits, whatever type it has. NumPy
2 does so for Python's own numbers alone, there also with single numbers of NumPy. What differs
between the two is refused.
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

_ORDER = {"b": 0, "u": 1, "i": 1, "f": 2}
_COMPARISONS = tuple(COMPARISONS.values())
_PYTHONS = {"i": "int", "u": "int", "f": "float", "b": "bool"}


@dataclass(frozen=True)
class Operand:
    """A number, or an array of numbers."""

    dtype: np.dtype[Any]
    is_array: bool

    @property
    def is_narrow(self) -> bool:
        """Tell whether it has another type than numbers of Python."""
        return is_narrow(self.dtype)

    @property
    def is_bool(self) -> bool:
        """Tell whether it is a bool, or an array of them."""
        return self.dtype.kind == "b"

    @property
    def words(self) -> str:
        """Return it in words."""
        if not self.is_array and not self.is_narrow:
            return {"b": "a bool", "i": "an int", "f": "a float"}[self.dtype.kind]
        return f"an array of {self.dtype.name}" if self.is_array else f"a single {self.dtype.name}"


def operand(kind: Any) -> Operand | None:
    """Return numba's type as an operand; None for other values than numbers."""
    kind = types.unliteral(kind)
    if isinstance(kind, types.Optional):
        kind = kind.type
    element = kind.dtype if isinstance(kind, types.Array) else kind
    if not isinstance(element, types.Integer | types.Float | types.Boolean):
        return None
    return Operand(as_dtype(element), isinstance(kind, types.Array))


@dataclass(frozen=True)
class Meeting:
    """What two operands are converted to, None for what stays as it is.

    `weak`: the one that has to be a number of Python, 0 or 1, as otherwise the releases differ.
    """

    left: np.dtype[Any] | None = None
    right: np.dtype[Any] | None = None
    weak: int | None = None


def together(
    operation: Callable[..., Any], left: Operand, right: Operand, is_exact: bool = False
) -> Meeting:
    """Return what an operation converts its operands to; raise TypingError where that differs
    between the releases of NumPy. `is_exact`: the wide one is a constant, which both types have.
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
        return Meeting()  # as they are
    as_python, as_numpy = (
        _result(operation, each, array.dtype)
        for each in (_weak(array.dtype, number.dtype), number.dtype)
    )
    if number.is_narrow:
        # In the older release the type of a NumPy number only counts if its kind is higher.
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
    """Return what two types of NumPy's make. For numba float32 has all ints."""
    if np.promote_types(left.dtype, right.dtype) != np.float64:
        return Meeting()
    to = np.dtype(np.float64)
    return Meeting(
        to if left.dtype == np.float32 else None, to if right.dtype == np.float32 else None
    )


def _order(each: Operand) -> int:
    return _ORDER[each.dtype.kind]


def _weak(of: np.dtype[Any], number: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type that a number of Python has beside another one of NumPy."""
    return of if _ORDER[number.kind] <= _ORDER[of.kind] else number


def _result(
    operation: Callable[..., Any], one: np.dtype[Any], other: np.dtype[Any]
) -> np.dtype[Any]:
    result = np.promote_types(one, other)
    if operation is operator.truediv and result.kind != "f":
        return np.dtype(np.float64)
    return result


def _differ(one: Operand, other: Operand) -> None:
    plain = one if not one.is_array else other
    raise TypingError(
        f"RTCF:{one.words} and {other.words} make other numbers in NumPy 1 than in NumPy 2:"
        f"{plain_of(plain)}"
    )


def plain_of(each: Operand) -> str:
    """Return the way out for a single number."""
    return f"convert the number: {_PYTHONS[each.dtype.kind]}(…)"
