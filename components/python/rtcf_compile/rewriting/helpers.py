"""The functions that replace `@`, assignment, np.linalg and np.where, for small arrays.

Each has two implementations with the same operations in the same order: the function here runs in
the interpreter, its overload is compiled. Neither calls BLAS or LAPACK, which allocate and whose
order of sums depends on the machine. np.where is replaced because numba 0.57 and later allocate
lists for it.
"""

import ast
import builtins
import cmath
import dataclasses
import enum
import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from rtcf_compile.rewriting import operators
from rtcf_compile.source.records import Object

Array = np.ndarray[Any, Any]
_WHOLE = (int, np.integer)


def rtcf_matmul(a: Any, b: Any) -> Any:
    """Return a @ b; each sum runs from the first element to the last."""
    a, b = np.asarray(a), np.asarray(b)
    if not a.ndim or not b.ndim or a.shape[-1] != b.shape[0]:
        raise ValueError(f"@ of shapes {a.shape} and {b.shape}")
    dtype = np.promote_types(a.dtype, b.dtype)
    left = (a if a.ndim == 2 else a[None, :]).astype(dtype)
    right = (b if b.ndim == 2 else b[:, None]).astype(dtype)
    result = np.zeros((left.shape[0], right.shape[1]), dtype)
    for k in range(left.shape[1]):
        result = result + left[:, k, None] * right[None, k, :]
    if a.ndim == 1:
        result = result[0]
    if b.ndim == 1:
        result = result[..., 0]
    return result[()]


def rtcf_assign(target: Any, value: Any) -> None:
    """Set all elements of an array to a number or to an array that NumPy can broadcast.

    The two may share memory.
    """
    new = _elements(target, value)
    target[...] = new


def _elements(target: Any, value: Any) -> Any:
    """Return the value for the elements of an array; raise if they cannot store it."""
    new = np.asarray(value)
    order = "biufc"
    if new.dtype.kind in "fc" and order.index(new.dtype.kind) > order.index(target.dtype.kind):
        raise TypeError(f"elements are {target.dtype.name}, not {new.dtype.name}")
    if new.ndim == 0 and new.dtype.kind in "iu" and target.dtype.kind in "iu":
        return operators.as_element(new.item(), target.dtype)
    return new


def rtcf_get(base: Any, index: Any) -> Any:
    """Return base[index] of an array: an element, a view, or a copy of the elements selected by a
    mask or an array of ints. Of a tuple, return an element.
    """
    return base[index] if isinstance(base, np.ndarray) else base[index[0]]


def rtcf_set(base: Any, index: Any, value: Any) -> None:
    """Set base[index]: an element, a view, or the elements selected by a mask or an array of ints.

    The arrays may share memory, even where NumPy does not support it: the value for an array of
    ints is copied.
    """
    if isinstance(base, list):
        base[index[0]] = value
        return
    new = np.asarray(_elements(base, value))
    parts = index if isinstance(index, tuple) else (index,)
    if any(isinstance(each, np.ndarray) and each.dtype.kind in "iu" for each in parts):
        new = new.copy()
    base[index] = new


def _in_place(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    operate = operators.OF[operation]

    def change(target: Any, value: Any) -> Any:
        """Return the target after `target += value`; an array changes in place."""
        if not isinstance(target, np.ndarray):
            return operate(target, value)
        rtcf_assign(target, operate(target, value))
        return target

    change.__name__ = f"rtcf_in_place_{operation.__name__}"
    return change


# `x += y` of a variable, by node type.
IN_PLACE: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    node: _in_place(operation)
    for node, operation in {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
        ast.FloorDiv: operator.floordiv,
        ast.Mod: operator.mod,
    }.items()
}


def rtcf_changed(target: Any, value: Any) -> Any:
    """Return a value, or the target array after setting it to the value."""
    if not isinstance(target, np.ndarray):
        return value
    np.copyto(target, value, casting="same_kind")
    return target


def _of_lists(operation: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def of_lists(left: Any, right: Any) -> Any:
        """Return the result of an operation on an array and a list."""
        return operation(np.asarray(left), np.asarray(right))

    of_lists.__name__ = f"rtcf_of_lists_{operation.__name__}"
    return of_lists


# `x + [1.0, 2.0]`, by node type.
OF_LISTS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    node: _of_lists(operation)
    for node, operation in {
        ast.Add: operator.add,
        ast.Sub: operator.sub,
        ast.Mult: operator.mul,
        ast.Div: operator.truediv,
    }.items()
}


def _checked(function: Callable[[Any], Any], module: str = "math") -> Callable[[Any], Any]:
    def checked(value: Any) -> Any:
        return function(value)

    name = function.__name__
    checked.__name__ = f"rtcf_{module}_{name}"
    checked.__doc__ = f"Return {module}.{name}(value), which raises outside its domain."
    return checked


# Functions of one number that raise ValueError outside their domain and OverflowError beyond the
# largest float. The C library returns NaN and infinity there.
_MATH: list[Callable[[float], float]] = [
    *(math.sqrt, math.exp, math.expm1, math.log, math.log1p, math.log2, math.log10),
    *(math.sin, math.cos, math.tan, math.asin, math.acos, math.atan),
    *(math.sinh, math.cosh, math.tanh, math.asinh, math.acosh, math.atanh),
    *(math.cbrt, math.exp2, math.erf, math.erfc),
]
MATH: dict[Callable[..., Any], Callable[[Any], float]] = {each: _checked(each) for each in _MATH}


_CMATH: list[Callable[[complex], Any]] = [
    *(cmath.sqrt, cmath.exp, cmath.log, cmath.log10),
    *(cmath.sin, cmath.cos, cmath.tan, cmath.asin, cmath.acos, cmath.atan),
    *(cmath.sinh, cmath.cosh, cmath.tanh, cmath.asinh, cmath.acosh, cmath.atanh),
]
CMATH: dict[Callable[..., Any], Callable[[Any], Any]] = {
    each: _checked(each, "cmath") for each in _CMATH
}


def rtcf_cmath_rect(r: Any, phi: Any) -> complex:
    """Return cmath.rect(r, phi), which raises outside its domain."""
    return cmath.rect(r, phi)


def rtcf_complex_pow(base: Any, exponent: Any) -> complex:
    """Return base ** exponent of complex numbers."""
    return complex(base) ** complex(exponent)


def rtcf_math_fmod(x: Any, y: Any) -> float:
    """Return math.fmod(x, y), which raises outside its domain."""
    return math.fmod(x, y)


def rtcf_math_remainder(x: Any, y: Any) -> float:
    """Return math.remainder(x, y), which raises outside its domain."""
    return math.remainder(x, y)


def rtcf_pow(base: Any, exponent: Any) -> Any:
    """Return base ** exponent; raise if the result is not a float, or not an int for two ints."""
    if isinstance(base, np.ndarray) or isinstance(exponent, np.ndarray):
        return operator.pow(*operators.alike(base, exponent))
    if isinstance(base, _WHOLE) and isinstance(exponent, _WHOLE):
        if exponent < 0:
            raise ValueError("an int to a negative power: make it a float")
        return base**exponent
    if isinstance(base, complex) or isinstance(exponent, complex):
        return rtcf_complex_pow(base, exponent)
    base, exponent = float(base), float(exponent)
    finite = math.isfinite(base) and math.isfinite(exponent)
    if finite and base < 0.0 and not exponent.is_integer():
        raise ValueError("a negative number to a fractional power")
    return base**exponent


def rtcf_negative_pow(base: Any, exponent: Any) -> Any:
    """Return base ** exponent for a constant exponent below 0: a float, even for an int."""
    if isinstance(base, np.ndarray):
        return base**exponent
    return rtcf_pow(base if isinstance(base, complex) else float(base), float(exponent))


def rtcf_math_pow(base: Any, exponent: Any) -> Any:
    """Return math.pow(base, exponent), which raises outside its domain."""
    return rtcf_pow(float(base), float(exponent))


def rtcf_to_int(value: Any) -> Any:
    """Return int(value), rounded towards 0; raise if it does not fit int64."""
    whole = int(value)
    if not -(2**63) <= whole < 2**63:
        raise OverflowError("does not fit int64")
    return whole


def rtcf_to_float(value: Any) -> Any:
    """Return float(value)."""
    return float(value)


def rtcf_floor(value: Any) -> Any:
    """Return math.floor(value); raise if it does not fit int64."""
    return rtcf_to_int(math.floor(value))


def rtcf_ceil(value: Any) -> Any:
    """Return math.ceil(value); raise if it does not fit int64."""
    return rtcf_to_int(math.ceil(value))


def rtcf_round(value: Any) -> Any:
    """Return round(value), halves to even; raise if it does not fit int64."""
    return rtcf_to_int(round(float(value)) if isinstance(value, float) else round(value))


def rtcf_round_to(value: Any, digits: Any) -> Any:
    """Return round(value, digits) of a float: the nearest decimal number, halves to even."""
    return round(float(value), digits)


def rtcf_one_index(value: Any) -> Any:
    """Return an index that is one number; raise for an array."""
    if np.ndim(value):
        raise TypeError("a new axis beside an array as an index")
    return value


def rtcf_index(value: Any) -> Any:
    """Return an argument of range() as an int."""
    return operator.index(value)


def rtcf_float(value: Any) -> Any:
    """Return a float or an int as a float."""
    return float(value)


def rtcf_complex(value: Any) -> Any:
    """Return a number as a complex number."""
    return complex(value)


def rtcf_int(value: Any) -> Any:
    """Return an int or an enum of ints as an int."""
    return int(value)


def rtcf_number(value: Any) -> Any:
    """Return the number that stands for a member of an enum; ints as they are."""
    return int(value.value if isinstance(value, enum.Enum) else value)


def rtcf_bool(value: Any) -> Any:
    """Return a bool."""
    return bool(value)


def rtcf_items(values: Any, count: Any) -> Any:
    """Return the elements of a value that is unpacked into len(count) names."""
    values = tuple(values)
    if len(values) != len(count):
        raise ValueError("the number of values differs from the number of names")
    return values


def rtcf_view(array: Any) -> Any:
    """Return an array of the record."""
    return array


def rtcf_copied(value: Any) -> Any:
    """Return a value with its arrays copied; see references.py."""
    if isinstance(value, Object):
        return Object.of(value.record, map(rtcf_copied, value))
    if isinstance(value, tuple):
        parts = map(rtcf_copied, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {each.name for each in dataclasses.fields(value)}
        copied = {each: rtcf_copied(getattr(value, each)) for each in fields}
        return dataclasses.replace(value, **copied)
    return value.copy() if isinstance(value, np.ndarray) else value


def rtcf_made(fields: Any, record: Any) -> Any:
    """Return a new object; see objects.py."""
    return record.record.cls(*(fields[place] for place in record.places))


def rtcf_object(value: Any, meaning: Any) -> Any:
    """Return an object, or the tuple of its fields; see objects.py."""
    if isinstance(value, Object):
        return tuple(value) if meaning.gives_fields else value
    fields = meaning.record.fields
    return tuple(getattr(value, each) for each in fields) if meaning.gives_fields else value


def rtcf_truth(value: Any) -> Any:
    """Return a value that is a condition."""
    return value


def rtcf_same(a: Any, b: Any) -> Any:
    """Tell whether two values are the same."""
    return a is b


def rtcf_reversed(values: Any) -> Any:
    """Return a tuple or an array in reverse order."""
    return values[::-1]


def rtcf_array_of(value: Any, count: Any) -> Any:
    """Return a new array for this number of such values, which are numbers or vectors."""
    return np.empty((count, *np.shape(value)), np.asarray(value).dtype)


def rtcf_looked_up(keys: Any, values: Any, key: Any) -> Any:
    """Return an element of a dict of numbers."""
    for number in range(len(keys)):
        if keys[number] == rtcf_number(key):
            return values[number]
    raise KeyError("no such key")


def rtcf_looked_up_or(keys: Any, values: Any, key: Any, default: Any) -> Any:
    """Return an element of a dict of numbers, or a default."""
    for number in range(len(keys)):
        if keys[number] == rtcf_number(key):
            return values[number]
    return default


def rtcf_store(target: Any, value: Any) -> None:
    """Set all elements of a member to a number or to an array of its shape."""
    if np.shape(value) not in (target.shape, ()):
        raise ValueError(
            f"an array of shape {target.shape} is set to one of shape {np.shape(value)}"
        )
    rtcf_assign(target, value)


def rtcf_maybe(value: Any, is_known: Any) -> Any:
    """Return a value, or None if it is not known."""
    return value if is_known else None


def rtcf_is_known(value: Any) -> Any:
    """Tell whether a value is not None."""
    return value is not None


def rtcf_or_old(value: Any, old: Any) -> Any:
    """Return a value, or the old one for None."""
    return old if value is None else value


def rtcf_equal(a: Any, b: Any) -> Any:
    """Return a == b; None differs from every number."""
    return a == b


def rtcf_enum(value: Any, cls: Any) -> Any:
    """Return the member of an enum with a value; ValueError if there is none."""
    return cls(value)


def rtcf_stored_enum(value: Any, cls: Any) -> Any:
    """Return a member of an enum, which a member of the component is set to; or of an int that
    equals it.
    """
    if not isinstance(value, cls) and not issubclass(cls, enum.IntEnum):
        raise TypeError(f"{value!r} is not a {cls.__name__}")
    return cls(value)


def rtcf_member(value: Any, cls: Any) -> Any:
    """Return the member of an enum with a value that is known to exist."""
    return cls(value)


def rtcf_is(value: Any, constant: Any) -> Any:
    """Tell whether a value is True, or False."""
    return value is constant or (isinstance(value, np.bool_) and bool(value) == constant)


def rtcf_front(ring: Any, oldest: Any, count: Any) -> Any:
    """Return the oldest message of a queue."""
    if count == 0:
        raise IndexError("front of an empty queue")
    return ring[oldest]


def rtcf_age(now: Any, written: Any, oldest: Any, count: Any) -> Any:
    """Return the age of the oldest message of a queue, ns; -1 for an empty queue."""
    return max(0, now - written[oldest]) if count else -1


def rtcf_after(place: Any, size: Any) -> Any:
    """Return the next index in a ring."""
    return (place + 1) % size


def rtcf_where(condition: Any, x: Any, y: Any) -> Any:
    """Return x where the condition is true, else y; all are arrays of one shape, or numbers."""
    shapes = {np.shape(each) for each in (condition, x, y)} - {()}
    if len(shapes) > 1:
        raise ValueError(f"np.where of shapes {sorted(shapes)}")
    return np.where(condition, *operators.alike(x, y))[()]


def rtcf_solve(a: Any, b: Any) -> Any:
    """Return x of a x = b, by Gaussian elimination with row pivots."""
    matrix, x = np.array(a, np.float64), np.array(b, np.float64)
    n = matrix.shape[0]
    if matrix.ndim != 2 or matrix.shape[1] != n or x.shape[0] != n:
        raise ValueError(f"solve of shapes {matrix.shape} and {x.shape}")
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(matrix[k:, k])))
        if matrix[pivot, k] == 0.0:
            raise ValueError("solve: the matrix is singular")
        matrix[[k, pivot]], x[[k, pivot]] = matrix[[pivot, k]], x[[pivot, k]]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            matrix[i, k + 1 :] = matrix[i, k + 1 :] - factor * matrix[k, k + 1 :]
            x[i] = x[i] - factor * x[k]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] = x[i] - matrix[i, k] * x[k]
        x[i] = x[i] / matrix[i, i]
    return x


def rtcf_inv(a: Any) -> Any:
    """Return the inverse, by solving for each unit vector."""
    return rtcf_solve(a, np.eye(len(a)))


def rtcf_cholesky(a: Any) -> Any:
    """Return the lower triangle L of a = L L'."""
    a = np.asarray(a)
    n = a.shape[0]
    if a.ndim != 2 or a.shape[1] != n:
        raise ValueError(f"cholesky of shape {a.shape}")
    result = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total = total - result[i, k] * result[j, k]
            if i != j:
                result[i, j] = total / result[j, j]
            elif total <= 0.0:
                raise ValueError("cholesky: the matrix is not positive definite")
            else:
                result[i, i] = np.sqrt(total)
    return result


# The helpers that replace functions.
INSTEAD: dict[Callable[..., Any], Callable[..., Any]] = {
    np.linalg.solve: rtcf_solve,
    np.linalg.inv: rtcf_inv,
    np.linalg.cholesky: rtcf_cholesky,
    np.dot: rtcf_matmul,
    np.matmul: rtcf_matmul,
    np.where: rtcf_where,
    math.fmod: rtcf_math_fmod,
    math.pow: rtcf_math_pow,
    cmath.rect: rtcf_cmath_rect,
    **CMATH,
    math.remainder: rtcf_math_remainder,
    math.floor: rtcf_floor,
    math.ceil: rtcf_ceil,
    math.trunc: rtcf_to_int,
    builtins.int: rtcf_to_int,
    builtins.float: rtcf_to_float,
    builtins.pow: rtcf_pow,
    builtins.divmod: operators.rtcf_divmod,
    **{each: operators.OF[of] for each, of in operators.SHIFT_UFUNCS.items()},
    **MATH,
}
BY_NAME = {
    each.__name__: each
    for each in (
        *(
            rtcf_matmul,
            rtcf_assign,
            rtcf_get,
            rtcf_set,
            rtcf_float,
            rtcf_int,
            rtcf_number,
            rtcf_bool,
            rtcf_complex,
        ),
        *(
            rtcf_equal,
            rtcf_view,
            rtcf_copied,
            rtcf_looked_up,
            rtcf_looked_up_or,
            rtcf_object,
            rtcf_made,
            rtcf_same,
            rtcf_reversed,
            rtcf_truth,
            rtcf_array_of,
            rtcf_store,
            rtcf_maybe,
            rtcf_is_known,
            rtcf_or_old,
            rtcf_enum,
            rtcf_stored_enum,
            rtcf_member,
            rtcf_is,
        ),
        *(
            rtcf_items,
            rtcf_front,
            rtcf_age,
            rtcf_after,
            rtcf_pow,
            rtcf_round,
            rtcf_index,
            rtcf_one_index,
        ),
        rtcf_round_to,
        *(rtcf_negative_pow, rtcf_changed, rtcf_complex_pow),
        *IN_PLACE.values(),
        *OF_LISTS.values(),
        *INSTEAD.values(),
        *operators.BY_NAME.values(),
    )
}
