"""Functions that replace operators where numba's or NumPy's operator is not sufficient: shifts,
division of single numbers by zero, and arrays of narrow numbers (elements other than 64 bits or
bools).

A Python number takes the type of a narrow array, as in NumPy 1 and NumPy 2 for numbers that fit.
For an int that does not fit, NumPy 1 widens the array; NumPy 2 raises, and so do these functions.
"""

import ast
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

Function = Callable[..., Any]
WIDE = frozenset(np.dtype(each) for each in (np.bool_, np.int64, np.float64, np.complex128))
# A longer shift leaves no bit of an int64. The limit keeps Python ints small.
_LONGEST_SHIFT = 4096
DIVISIONS = (operator.truediv, operator.floordiv, operator.mod)
_COMPARISONS: tuple[Function, ...] = (
    *(operator.lt, operator.le, operator.gt, operator.ge),
    *(operator.eq, operator.ne),
)


def is_narrow(dtype: np.dtype[Any]) -> bool:
    """Tell whether a type is narrow: other than the types of Python numbers."""
    return dtype not in WIDE


def fits(number: Any, dtype: np.dtype[Any]) -> bool:
    """Tell whether a number fits an int type."""
    limits = np.iinfo(dtype)
    return bool(limits.min <= number <= limits.max)


def as_element(number: Any, dtype: np.dtype[Any]) -> Any:
    """Return a number as an element of an array; OverflowError if it does not fit an int type."""
    if dtype.kind in "iu" and not fits(number, dtype):
        raise OverflowError(f"a number does not fit {dtype.name}")
    return dtype.type(number)


def _alike(number: Any, array: Any, operation: Function | None) -> Any:
    """Return a Python number converted to the element type of a narrow array."""
    if type(number) not in (int, float) or not isinstance(array, np.ndarray):
        return number
    if not is_narrow(array.dtype) or (type(number) is float and array.dtype.kind not in "fc"):
        return number
    if array.dtype.kind in "iu" and operation in _COMPARISONS:
        return number  # compare without conversion
    if array.dtype.kind in "iu" and operation is operator.truediv:
        return float(number)
    return as_element(number, array.dtype)


def alike(left: Any, right: Any, operation: Function | None = None) -> tuple[Any, Any]:
    """Return two operands converted as in NumPy 1 and NumPy 2."""
    return _alike(left, right, operation), _alike(right, left, operation)


def _operated(operation: Function) -> Function:
    def operate(left: Any, right: Any) -> Any:
        single = not isinstance(left, np.ndarray) and not isinstance(right, np.ndarray)
        if single and operation in DIVISIONS and right == 0:
            raise ZeroDivisionError("division by zero")
        return operation(*alike(left, right, operation))

    operate.__name__ = f"rtcf_op_{operation.__name__.strip('_')}"
    operate.__doc__ = f"Return operator.{operation.__name__} of two values."
    return operate


def _shifted(operation: Function) -> Function:
    def shift(value: Any, count: Any) -> Any:
        if isinstance(value, np.ndarray) or isinstance(count, np.ndarray):
            return operation(*alike(value, count, operation))
        if count < 0:
            raise ValueError("negative shift count")
        return operation(value, min(count, _LONGEST_SHIFT) if type(count) is int else count)

    shift.__name__ = f"rtcf_op_{operation.__name__}"
    shift.__doc__ = f"Return operator.{operation.__name__} of ints."
    return shift


def _stored(operation: Function) -> Function:
    def change(element: Any, value: Any) -> Any:
        kind = getattr(element, "dtype", np.dtype(float))
        if isinstance(element, np.integer) and is_narrow(kind) and type(value) is int:
            value = as_element(value, kind)
        return operation(element, value)

    change.__name__ = f"rtcf_element_{operation.__name__.strip('_')}"
    change.__doc__ = "Return the new element for `x[i] += value`."
    return change


def _extreme(function: Function) -> Function:
    def extreme(left: Any, right: Any) -> Any:
        return function(*alike(left, right, function))

    extreme.__name__ = f"rtcf_op_{function.__name__}"
    extreme.__doc__ = f"Return np.{function.__name__} of two values."
    return extreme


# The operators by node type.
BINARY: dict[type[ast.operator], Function] = {
    **{ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul},
    **{ast.Div: operator.truediv, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod},
    **{ast.BitAnd: operator.and_, ast.BitOr: operator.or_, ast.BitXor: operator.xor},
}
SHIFTS: dict[type[ast.operator], Function] = {
    ast.LShift: operator.lshift,
    ast.RShift: operator.rshift,
}
COMPARISONS: dict[type[ast.cmpop], Function] = {
    **{ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge},
    **{ast.Eq: operator.eq, ast.NotEq: operator.ne},
}
EXTREMES: tuple[Function, ...] = (np.minimum, np.maximum)
_OPERATORS: tuple[Function, ...] = (*BINARY.values(), *_COMPARISONS)
# The functions that replace operators.
OF: dict[Function, Function] = {
    **{each: _operated(each) for each in _OPERATORS},
    **{each: _shifted(each) for each in SHIFTS.values()},
    **{each: _extreme(each) for each in EXTREMES},
}
# The nodes of operators that become functions: always; with narrow numbers; and in the comparison,
# where single numbers must divide as in compiled code.
ALWAYS: frozenset[type[ast.AST]] = frozenset(SHIFTS)
NARROW: frozenset[type[ast.AST]] = frozenset((*BINARY, *SHIFTS, *COMPARISONS, ast.USub))
COMPARED: frozenset[type[ast.AST]] = frozenset(
    node for node, operation in BINARY.items() if operation in DIVISIONS
)
# `x[i] += value` of an element. A result that does not fit wraps around when it is stored.
OF_ELEMENTS: dict[type[ast.operator], Function] = {
    node: _stored(operation) for node, operation in BINARY.items() if operation not in DIVISIONS
}
# NumPy functions that act as operators.
UFUNCS: dict[Function, Function] = {
    **{np.add: operator.add, np.subtract: operator.sub, np.multiply: operator.mul},
    **{np.true_divide: operator.truediv, np.floor_divide: operator.floordiv},
    **{np.remainder: operator.mod, np.less: operator.lt, np.less_equal: operator.le},
    **{np.greater: operator.gt, np.greater_equal: operator.ge, np.equal: operator.eq},
    **{np.not_equal: operator.ne, np.bitwise_and: operator.and_, np.bitwise_or: operator.or_},
    **{np.bitwise_xor: operator.xor, np.minimum: np.minimum, np.maximum: np.maximum},
}
SHIFT_UFUNCS: dict[Function, Function] = {
    np.left_shift: operator.lshift,
    np.right_shift: operator.rshift,
}


def rtcf_plain(value: Any) -> Any:
    """Return a number of the record as a Python number."""
    return value


def rtcf_negative(value: Any) -> Any:
    """Return -value."""
    return -value


def rtcf_divmod(left: Any, right: Any) -> Any:
    """Return divmod(left, right) of single numbers."""
    if not isinstance(left, np.ndarray) and not isinstance(right, np.ndarray) and right == 0:
        raise ZeroDivisionError("division by zero")
    return divmod(left, right)


_ALL: tuple[Function, ...] = (
    *OF.values(),
    *OF_ELEMENTS.values(),
    *(rtcf_plain, rtcf_negative, rtcf_divmod),
)
BY_NAME: dict[str, Function] = {each.__name__: each for each in _ALL}
