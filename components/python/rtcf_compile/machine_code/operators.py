"""The numba overloads of operator functions. Import this only to compile: it imports numba."""

import functools
import operator
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core.errors import TypingError
from numba.extending import overload

from rtcf_compile.machine_code.number_types import Operand, operand, together
from rtcf_compile.machine_code.overloads import (
    compiled_as,
    conversion,
    conversions,
    is_any_enum,
    plain,
    plain_value,
    require_kind,
    words,
)
from rtcf_compile.rewriting import operators as own

_COMPARISONS = tuple(own.COMPARISONS.values())


def _operating(helper: Callable[..., Any], operation: Callable[..., Any]) -> None:
    """Register the overload of an operator on numbers and arrays."""
    shifts = operation in own.SHIFTS.values()

    @compiled_as(helper)
    def _operate(left: Any, right: Any) -> Any:
        one, other = operand(left), operand(right)
        if operation in own.DIVISIONS and is_any_enum(left, right):
            return lambda left, right: helper(plain_value(left), plain_value(right))
        if one is None or other is None:
            return lambda left, right: operation(left, right)
        if shifts and not all(each.dtype.kind in "iub" for each in (one, other)):
            sign = "<<" if operation is operator.lshift else ">>"
            raise TypingError(f"RTCF:{words(left)} {sign} {words(right)}:use ints")
        if operation not in _COMPARISONS:
            refuse_bools(operation, one, other)
        if not one.is_array and not other.is_array:
            together(operation, one, other, is_exact=True)
            return _of_numbers(operation, one, other)
        as_left, as_right = conversions(operation, left, right)
        if shifts:
            each = _shift_arrays(operation, _shift_type(one, other))
            return lambda left, right: each(as_left(left), as_right(right))
        return lambda left, right: operation(as_left(left), as_right(right))


def refuse_bools(operation: Callable[..., Any], one: Operand, other: Operand) -> None:
    """Reject arithmetic of arrays of bools, which NumPy computes as logic or rejects."""
    bits = (operator.and_, operator.or_, operator.xor, np.minimum, np.maximum)
    if one.is_bool and other.is_bool and (one.is_array or other.is_array) and operation not in bits:
        raise TypingError(
            "RTCF:arithmetic of bools is logic in NumPy:"
            "write a | b, a & b, a ^ b, or convert one to ints: a.astype(int)"
        )


def _of_numbers(operation: Callable[..., Any], one: Operand, other: Operand) -> Any:
    """Return the operator on single numbers; division by zero raises as in Python."""
    if operation in own.SHIFTS.values():
        return _shift_of_numbers(operation, one, other)
    if operation in own.EXTREMES or operation in _COMPARISONS:
        return lambda left, right: operation(left, right)
    to: Any
    if not one.is_narrow and not other.is_narrow:
        to = None
    else:
        result = np.promote_types(one.dtype, other.dtype)
        if operation is operator.truediv and result.kind not in "fc":
            result = np.dtype(np.float64)
        to = result.type
    if operation not in own.DIVISIONS:
        if to is None:
            return lambda left, right: operation(left, right)
        return lambda left, right: to(operation(to(left), to(right)))

    def divide(left: Any, right: Any) -> Any:
        if right == 0:
            raise ZeroDivisionError("division by zero")
        return operation(left, right)

    if to is None:
        return divide
    divided = plain(divide)
    return lambda left, right: to(divided(to(left), to(right)))


# Shifts. A shift by 64 or more removes all bits; NumPy arrays treat negative counts likewise.


@plain
def _left(value: Any, count: Any) -> Any:
    return value << count if 0 <= count < 64 else value & 0


@plain
def _right(value: Any, count: Any) -> Any:
    return value >> count if 0 <= count < 64 else value >> 63 >> 1


def _shift_type(one: Operand, other: Operand) -> np.dtype[Any]:
    """Return the type of the result of a shift."""
    meeting = together(operator.lshift, one, other)
    result = np.promote_types(meeting.left or one.dtype, meeting.right or other.dtype)
    if result.kind not in "iu":
        raise TypingError(f"RTCF:a shift of {one.words} by {other.words}:convert them with int(…)")
    return result


@functools.cache
def _shift_in(operation: Callable[..., Any], result: np.dtype[Any]) -> Any:
    shift = _left if operation is operator.lshift else _right
    to, wide = result.type, np.uint64 if result.kind == "u" else np.int64
    return plain(lambda value, count: to(shift(wide(value), np.int64(count))))


@functools.cache
def _shift_arrays(operation: Callable[..., Any], result: np.dtype[Any]) -> Any:
    shift = _shift_in(operation, result)

    def each(value: Any, count: Any) -> Any:
        return shift(value, count)

    each.__annotations__ = {}
    return numba.vectorize(each)


def _shift_of_numbers(operation: Callable[..., Any], one: Operand, other: Operand) -> Any:
    shift = _shift_in(operation, _shift_type(one, other))

    def checked(left: Any, right: Any) -> Any:
        if right < 0:
            raise ValueError("negative shift count")
        return shift(left, right)

    return checked


for _operation, _helper in own.OF.items():
    _operating(_helper, _operation)


def _changing_element(helper: Callable[..., Any], operation: Callable[..., Any]) -> None:
    """Register the overload of `x[i] += value`."""
    operate = own.OF[operation]

    @compiled_as(helper)
    def _change(element: Any, value: Any) -> Any:
        one, other = operand(element), operand(value)
        if one is None or other is None or one.is_array or other.is_array:
            require_kind(operation, element, value)
            return lambda element, value: operate(element, value)
        ints = one.dtype.kind in "iu" and other.dtype == np.int64
        if not one.is_narrow or not ints:
            return lambda element, value: operate(element, value)
        convert = conversion(one.dtype)
        return lambda element, value: operate(element, convert(value))


for _node, _helper in own.OF_ELEMENTS.items():
    _changing_element(_helper, own.BINARY[_node])


@compiled_as(own.rtcf_plain)
def _plain(value: Any) -> Any:
    if isinstance(value, types.Float):
        return lambda value: np.float64(value)
    if not isinstance(value, types.Integer):
        return lambda value: value
    if value != types.uint64:
        return lambda value: np.int64(value)

    def whole(value: Any) -> Any:
        if value > np.uint64(9223372036854775807):
            raise OverflowError("does not fit int64")
        return np.int64(value)

    return whole


@compiled_as(own.rtcf_negative)
def _negative(value: Any) -> Any:
    one = operand(value)
    if one is None or one.is_array or not one.is_narrow:
        return lambda value: -value
    to = one.dtype.type
    return lambda value: to(-value)


@compiled_as(own.rtcf_divmod)
def _divmod(left: Any, right: Any) -> Any:
    if isinstance(left, types.Array) or isinstance(right, types.Array):
        raise TypingError(f"RTCF:divmod of {words(left)} and {words(right)}:use // and %")

    def both(left: Any, right: Any) -> Any:
        if right == 0:
            raise ZeroDivisionError("division by zero")
        return left // right, left % right

    return both


# max and min of bools, which numba does not support.


@overload(max)
def _largest_of_bools(*values):  # type: ignore[no-untyped-def]
    if len(values) > 1 and all(isinstance(each, types.Boolean) for each in values):
        return lambda *values: True in values


@overload(min)
def _smallest_of_bools(*values):  # type: ignore[no-untyped-def]
    if len(values) > 1 and all(isinstance(each, types.Boolean) for each in values):
        return lambda *values: False not in values
