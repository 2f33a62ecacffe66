"""The numba overloads of the helpers. Import this only to compile: it imports numba."""

import enum
import functools
import inspect
import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils, imputils
from numba.core.errors import TypingError
from numba.extending import intrinsic, lower_builtin, lower_cast, overload, register_jitable
from numba.np.numpy_support import as_dtype
from rtcf.component.value_type import number_of

from rtcf_compile.machine_code import backend
from rtcf_compile.machine_code.explain import NAMES, kind_of
from rtcf_compile.machine_code.number_types import Operand, operand, plain_of, together
from rtcf_compile.machine_code.object_types import NamedTupleType, fields_of, is_object
from rtcf_compile.machine_code.raised_values import note
from rtcf_compile.machine_code.sharing import in_one_block, overlaps, shares
from rtcf_compile.machine_code.tile import ROWS
from rtcf_compile.rewriting import helpers, numpy_functions, operators
from rtcf_compile.source.records import Arranged

_PART = "write z.real, z.imag or abs(z)"
# numba matches an overload by its parameter names and compiles the function that it returns.
OPTIONS: dict[str, Any] = {
    "boundscheck": False,
    "error_model": "numpy",
    **backend.NO_WRAPPERS,
}


def compiled_as(
    helper: Callable[..., Any],
    checked: bool = False,
    arrays: Sequence[str] = (),
    in_line: bool = False,
    refused: str = "",
) -> Callable[[Callable[..., Any]], None]:
    """Register a function that chooses the implementation of a helper by types.

    Annotations are removed, because numba rejects them.
    `checked`: check the indices in the implementation.
    `arrays`: names of arguments that may also be rows of numbers.
    `in_line`: always inline, so that temporaries become variables of the caller (stack.py).
    `refused`: kinds of narrow types, and b for bools, to reject as NumPy computes them differently.
    """

    def register(choose: Callable[..., Any]) -> None:
        choose.__annotations__ = {}
        names = list(inspect.signature(choose).parameters)

        @functools.wraps(choose)
        def typed(*types_of: Any, **named: Any) -> Any:
            changed = {}
            for name, kind in {**dict(zip(names, types_of, strict=False)), **named}.items():
                if isinstance(kind, types.Optional):
                    changed[name] = f"some({name})"
                elif name in arrays and isinstance(kind, types.BaseTuple):
                    changed[name] = f"array({name}, None)"
                elif refused:
                    refuse_narrow(helper, kind, refused)
            if changed:
                return _again(helper, names, changed)
            implementation = choose(*types_of, **named)
            if implementation is not None:
                implementation.__annotations__ = {}
            return implementation

        options = {**OPTIONS, "boundscheck": checked, "forceinline": in_line}
        overload(helper, jit_options=options)(typed)

    return register


def refuse_narrow(helper: Callable[..., Any], kind: Any, refused: str) -> None:
    """Reject narrow numbers of these kinds, and bools for b."""
    number = operand(kind)
    other = number is not None and (number.is_narrow or number.is_bool)
    if number is not None and other and number.dtype.kind in refused:
        remedy = "convert it: x.astype(float)" if number.is_array else plain_of(number)
        raise TypingError(f"RTCF:{NAMES.get(helper.__name__, 'this')} of {number.words}:{remedy}")


def _again(helper: Callable[..., Any], names: list[str], changed: dict[str, str]) -> Any:
    """Return a function that calls a helper with some arguments converted."""
    scope = {"helper": helper, "some": _some, "array": numpy_functions.rtcf_array}
    given = ", ".join(changed.get(name, name) for name in names)
    exec(f"def again({', '.join(names)}):\n    return helper({given})\n", scope)
    return scope["again"]


def _some(value: Any) -> Any:
    raise NotImplementedError


@intrinsic
def unwrapped(typing, value):  # type: ignore[no-untyped-def]
    """Return the value of an optional that is not None."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        new = context.cast(builder, arguments[0], value, value.type)
        return imputils.impl_ret_borrowed(context, builder, value.type, new)

    return value.type(value), generate


@overload(_some)
def _value_of(value):  # type: ignore[no-untyped-def]
    """Return the value of an optional; raise TypeError if it is None."""

    def some(value):  # type: ignore[no-untyped-def]
        if value is None:
            raise TypeError("None is not a number")
        return unwrapped(value)

    return some


@lower_cast(types.IntEnumMember, types.Float)
def _enum_to_float(context, builder, kind, wanted, value):  # type: ignore[no-untyped-def]
    return context.cast(builder, value, kind.dtype, wanted)


@intrinsic
def _member(typing, value, cls):  # type: ignore[no-untyped-def]
    """Return the member of an enum with a value."""
    is_int = issubclass(cls.instance_class, enum.IntEnum)
    kind = types.IntEnumMember if is_int else types.EnumMember
    result = kind(cls.instance_class, types.int64)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return context.cast(builder, arguments[0], value, types.int64)

    return result(value, cls), generate


@lower_builtin(operator.is_, types.Optional, types.IntEnumMember)
@lower_builtin(operator.is_, types.Optional, types.EnumMember)
def _maybe_is(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
    """`x is Mode.RUN` for an optional value."""
    optional, member = signature.args
    if optional.type != member:
        return context.get_constant(types.boolean, False)
    value = context.make_helper(builder, optional, value=arguments[0])
    same = builder.icmp_signed("==", value.data, arguments[1])
    return builder.and_(cgutils.as_bool_bit(builder, value.valid), same)


@compiled_as(helpers.rtcf_member)
def _member_of(value: Any, cls: Any) -> Any:
    return lambda value, cls: _member(value, cls)


@compiled_as(helpers.rtcf_enum)
def _enum(value: Any, cls: Any) -> Any:
    enumeration = cls.instance_class
    if isinstance(value, types.EnumMember):
        if value.instance_class is not enumeration:
            raise TypingError(
                f"RTCF:{value.instance_class.__name__} is not {enumeration.__name__}:"
                f"give it a {enumeration.__name__}"
            )
        return lambda value, cls: value
    if not isinstance(value, types.Integer):
        raise _no_member(value, enumeration)
    test = " or ".join(f"value == {number_of(each)}" for each in enumeration)
    text = f"""\
def checked(value, cls):
    if {test}:
        return member(value, cls)
    raise ValueError("not a valid {enumeration.__name__}")
"""
    scope: dict[str, Any] = {"member": _member}
    exec(text, scope)
    return scope["checked"]


def _no_member(value: Any, enumeration: Any) -> TypingError:
    name, first = enumeration.__name__, next(iter(enumeration))
    return TypingError(
        f"RTCF:{words(value)} is not a {name}:give it a member, such as {name}.{first.name}"
    )


@compiled_as(helpers.rtcf_stored_enum)
def _stored_enum(value: Any, cls: Any) -> Any:
    if not isinstance(value, types.EnumMember) and not issubclass(cls.instance_class, enum.IntEnum):
        raise _no_member(value, cls.instance_class)
    return lambda value, cls: helpers.rtcf_enum(value, cls)


@compiled_as(helpers.rtcf_is)
def _is(value: Any, constant: Any) -> Any:
    if isinstance(value, types.Boolean):
        return lambda value, constant: value == constant
    if isinstance(value, types.Integer):
        raise TypingError("RTCF:an int is compared with True or False by is:write ==")
    return lambda value, constant: False


@overload(helpers.rtcf_maybe)
def _maybe(value, is_known):  # type: ignore[no-untyped-def]
    def maybe(value, is_known):  # type: ignore[no-untyped-def]
        return value if is_known else None

    return maybe


@overload(helpers.rtcf_equal)
def _equal(a, b):  # type: ignore[no-untyped-def]
    none = [isinstance(each, types.NoneType) for each in (a, b)]
    if any(none):
        if all(none):
            return lambda a, b: True
        return lambda a, b: a is b
    if isinstance(a, types.Optional):
        return lambda a, b: b is None if a is None else helpers.rtcf_equal(unwrapped(a), b)
    if isinstance(b, types.Optional):
        return lambda a, b: False if b is None else helpers.rtcf_equal(a, unwrapped(b))
    if any(each is not None and each.is_narrow for each in (operand(a), operand(b))):
        equal = operators.OF[operator.eq]
        return lambda a, b: equal(a, b)
    return lambda a, b: a == b


@overload(helpers.rtcf_is_known)
def _is_known(value):  # type: ignore[no-untyped-def]
    if isinstance(value, types.Optional):
        return lambda value: value is not None
    known = not isinstance(value, types.NoneType)
    return lambda value: known


@overload(helpers.rtcf_or_old)
def _or_old(value, old):  # type: ignore[no-untyped-def]
    if isinstance(value, types.NoneType):
        return lambda value, old: old
    if not isinstance(value, types.Optional):
        return lambda value, old: value

    def either(value, old):  # type: ignore[no-untyped-def]
        if value is None:
            return old
        return unwrapped(value)

    return either


@intrinsic
def _without_sizes(typing, array):  # type: ignore[no-untyped-def]
    """Return an array of a record as a view, whose type has no sizes."""
    result = types.Array(array.dtype, array.ndim, "C", aligned=array.aligned)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return arguments[0]  # the record has no reference count

    return result(array), generate


@compiled_as(helpers.rtcf_view)
def _view(array: Any) -> Any:
    if isinstance(array, types.NestedArray):
        return lambda array: _without_sizes(array)
    return lambda array: array


@overload(helpers.rtcf_copied, jit_options={**OPTIONS, "forceinline": True})
def _copied(value):  # type: ignore[no-untyped-def]
    if isinstance(value, types.Array):
        return lambda value: value.copy()
    if isinstance(value, types.Optional) and (
        isinstance(value.type, types.Array | types.BaseTuple) or is_object(value.type)
    ):
        return lambda value: None if value is None else helpers.rtcf_copied(unwrapped(value))
    if is_object(value):
        record = Arranged.plain(value.record, value.small)
        return lambda value: helpers.rtcf_made(helpers.rtcf_copied(fields_of(value)), record)
    if not isinstance(value, types.BaseTuple):
        return lambda value: value
    parts = "".join(f"copied(value[{number}])," for number in range(len(value)))
    scope = {"copied": helpers.rtcf_copied}
    exec(f"def each(value):\n    return ({parts})\n", scope)
    return scope["each"]


@compiled_as(helpers.rtcf_array_of)
def _array_of(value: Any, count: Any) -> Any:
    if is_object(value):
        remedy = "make an array of each field"
        raise TypingError(f"RTCF:a list of objects of {value.record.cls.__name__}:{remedy}")
    if isinstance(value, types.BaseTuple):
        raise TypingError("RTCF:an array of tuples:write np.array([a, b]) for each row")
    if not isinstance(value, types.Array):
        number = operand(value)
        if number is None:
            raise TypingError(f"RTCF:an array of {words(value)}:use numbers or vectors")
        kind = number.dtype.type
        return lambda value, count: np.empty(count, kind)
    element = value.dtype
    if value.ndim == 1:
        return lambda value, count: np.empty((count, value.size), element)
    if value.ndim == 2:
        return lambda value, count: np.empty((count, value.shape[0], value.shape[1]), element)
    raise TypingError(f"RTCF:an array of {words(value)}:use numbers, vectors or matrices")


def _check_table(values: Any, key: Any) -> None:
    if not isinstance(key, types.Integer | types.Boolean | types.EnumMember):
        raise TypingError(f"RTCF:a key of a dict is {words(key)}:give it an int or an enum")
    numbers = types.Number | types.Boolean | types.IntEnumMember
    if not isinstance(values, types.UniTuple) or not (
        isinstance(values.dtype, numbers | types.BaseTuple) or is_object(values.dtype)
    ):
        raise TypingError("RTCF:the values of a dict are not of one type:use if and elif")


@compiled_as(helpers.rtcf_looked_up_or)
def _looked_up_or(keys: Any, values: Any, key: Any, default: Any) -> Any:
    _check_table(values, key)

    def look(keys: Any, values: Any, key: Any, default: Any) -> Any:
        number = helpers.rtcf_number(key)
        for place in range(len(keys)):
            if keys[place] == number:
                return values[place]
        return default

    return look


@compiled_as(helpers.rtcf_looked_up)
def _looked_up(keys: Any, values: Any, key: Any) -> Any:
    _check_table(values, key)

    def look(keys: Any, values: Any, key: Any) -> Any:
        number = helpers.rtcf_number(key)
        for place in range(len(keys)):
            if keys[place] == number:
                return values[place]
        raise KeyError("no such key")

    return look


@compiled_as(helpers.rtcf_store, arrays=("value",))
def _store(target: Any, value: Any) -> Any:
    if not isinstance(value, types.Array):
        return lambda target, value: helpers.rtcf_assign(target, value)
    if value.ndim != target.ndim:
        raise TypingError(
            f"RTCF:{words(target)} is set to {words(value)}:give it an array of the same shape"
        )

    def store(target: Any, value: Any) -> None:
        if target.shape != value.shape:
            note(target.size, value.size)
            raise ValueError(
                "\x1ean array of {} elements is set to one of another shape with {} elements"
            )
        helpers.rtcf_assign(target, value)

    return store


@compiled_as(helpers.rtcf_to_float)
def _to_float(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: float(value.value)
    if isinstance(value, types.Boolean):
        return lambda value: 1.0 if value else 0.0
    if isinstance(value, types.Float | types.Integer):
        return lambda value: np.float64(value)
    remedy = _PART if isinstance(value, types.Complex) else "give it a number"
    raise TypingError(f"RTCF:float of {words(value)}:{remedy}")


@compiled_as(helpers.rtcf_float)
def _float(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: float(value.value)
    if isinstance(value, types.Float | types.Integer):
        return lambda value: np.float64(value)
    remedy = _PART if isinstance(value, types.Complex) else "give it a float"
    raise TypingError(f"RTCF:a number is set to {words(value)}:{remedy}")


@compiled_as(helpers.rtcf_complex)
def _complex(value: Any) -> Any:
    if isinstance(value, types.Complex | types.Float | types.Integer):
        return lambda value: complex(value)
    raise TypingError(f"RTCF:a complex number is set to {words(value)}:give it a number")


@compiled_as(helpers.rtcf_number)
def _number(value: Any) -> Any:
    if isinstance(value, types.EnumMember):
        return lambda value: value.value
    return lambda value: helpers.rtcf_int(value)


@compiled_as(helpers.rtcf_int)
def _int(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: value.value
    if isinstance(value, types.Integer):
        return lambda value: value
    remedy = "write .value" if isinstance(value, types.EnumMember) else "convert it with int(…)"
    raise TypingError(f"RTCF:a whole number is set to {words(value)}:{remedy}")


@compiled_as(helpers.rtcf_bool)
def _bool(value: Any) -> Any:
    if isinstance(value, types.Boolean):
        return lambda value: value
    if isinstance(value, types.Integer):
        # numbers.py rejects it later; an operation that made an int of bools is reported first.
        return lambda value: value != 0
    raise TypingError(f"RTCF:a bool is set to {words(value)}:compare it: x != 0")


def plain(function: Any) -> Any:
    """Return a function that overloads can call, compiled with the same options."""
    function.__annotations__ = {}
    return register_jitable(**OPTIONS)(function)


@plain
def _require_fit(columns: Any, rows: Any) -> None:
    if columns != rows:
        note(columns, rows)
        raise ValueError("\x1e@ of sizes {} and {}, which do not fit")


@compiled_as(helpers.rtcf_matmul)
def _matmul(a: Any, b: Any) -> Any:
    if not isinstance(a, types.Array) or not isinstance(b, types.Array):
        raise TypingError(f"RTCF:@ of {words(a)} and {words(b)}:use * for numbers")
    if max(a.ndim, b.ndim) > 2:
        raise TypingError(f"RTCF:@ of {words(a)} and {words(b)}:use its matrices, x[i]")
    if not any(isinstance(each.dtype, types.Float | types.Complex) for each in (a, b)):
        raise TypingError(
            f"RTCF:@ of {words(a)} and {words(b)}:convert one to floats: x.astype(float)"
        )
    if (a.ndim, b.ndim) == (1, 1) or (a.dtype, b.dtype) != (types.float64, types.float64):
        dtype = np.promote_types(as_dtype(a.dtype), as_dtype(b.dtype))
        return _plain_product(a.ndim, b.ndim, dtype)
    if (a.ndim, b.ndim) == (2, 1):
        row = _row(a, "sum", "out")

        def times_vector(a: Any, b: Any) -> Any:
            rows, count = a.shape
            _require_fit(count, b.shape[0])
            result = np.empty(rows)
            row(b, 0, b.strides[0], a, a.strides[1], a.strides[0], count, result, 0, rows)
            return result

        return times_vector
    row = _row(b, "out", "sum")
    if (a.ndim, b.ndim) == (1, 2):

        def vector_times(a: Any, b: Any) -> Any:
            count, columns = b.shape
            _require_fit(a.shape[0], count)
            result = np.empty(columns)
            row(a, 0, a.strides[0], b, b.strides[0], b.strides[1], count, result, 0, columns)
            return result

        return vector_times

    def matrix(a: Any, b: Any) -> Any:
        count, columns = b.shape
        _require_fit(a.shape[1], count)
        result = np.empty((a.shape[0], columns))
        down, across = b.strides
        for i in range(a.shape[0]):
            row(a, i * a.strides[0], a.strides[1], b, down, across, count, result,
                8 * i * columns, columns)  # fmt: skip
        return result

    return matrix


@functools.cache
def _plain_product(left: int, right: int, dtype: np.dtype[Any]) -> Any:
    """Return a product for elements of any type, by the dimensions of both operands."""
    to = dtype.type

    def inner(a: Any, b: Any) -> Any:
        _require_fit(a.shape[0], b.shape[0])
        total = to(0)
        for k in range(a.shape[0]):
            total += to(a[k]) * to(b[k])
        return total

    def times_vector(a: Any, b: Any) -> Any:
        _require_fit(a.shape[1], b.shape[0])
        result = np.zeros(a.shape[0], dtype)
        for i in range(a.shape[0]):
            for k in range(a.shape[1]):
                result[i] += to(a[i, k]) * to(b[k])
        return result

    def vector_times(a: Any, b: Any) -> Any:
        _require_fit(a.shape[0], b.shape[0])
        result = np.zeros(b.shape[1], dtype)
        for k in range(a.shape[0]):
            for j in range(b.shape[1]):
                result[j] += to(a[k]) * to(b[k, j])
        return result

    def matrix(a: Any, b: Any) -> Any:
        _require_fit(a.shape[1], b.shape[0])
        result = np.zeros((a.shape[0], b.shape[1]), dtype)
        for i in range(a.shape[0]):
            for k in range(a.shape[1]):
                for j in range(b.shape[1]):
                    result[i, j] += to(a[i, k]) * to(b[k, j])
        return result

    return {
        (1, 1): inner,
        (2, 1): times_vector,
        (1, 2): vector_times,
        (2, 2): matrix,
    }[left, right]


def _row(matrix: Any, by_rows: str, by_columns: str) -> Any:
    """Return the function for a row of a product, by the memory layout of the matrix."""
    if matrix.layout == "A":
        return _row_of_any()
    return ROWS[by_rows if matrix.layout == "C" else by_columns]


@functools.cache
def _row_of_any() -> Any:
    """Return the same for a matrix whose strides are constants only after inlining."""
    along_out, along_sum, along_nothing = ROWS["out"], ROWS["sum"], ROWS[""]

    @plain
    def row(factors, first, step, matrix, down, across, count, out, place, width):  # type: ignore[no-untyped-def]
        if across == 8:
            along_out(factors, first, step, matrix, down, across, count, out, place, width)
        elif down == 8:
            along_sum(factors, first, step, matrix, down, across, count, out, place, width)
        else:
            along_nothing(factors, first, step, matrix, down, across, count, out, place, width)

    return row


def _refuse_loss(target: Any, new: Any) -> None:
    """Reject elements set to floats or complex numbers that they cannot store."""
    is_complex = isinstance(target.dtype, types.Complex)
    if (
        isinstance(new, types.Float)
        and not is_complex
        and not isinstance(target.dtype, types.Float)
    ):
        raise TypingError(f"RTCF:elements of {target.dtype} are set to {new}:round them first")
    if isinstance(new, types.Complex) and not is_complex:
        raise TypingError(f"RTCF:elements of {target.dtype} are set to {new}:{_PART}")


@compiled_as(helpers.rtcf_assign, in_line=True)
def _assign(target: Any, value: Any) -> Any:
    if not isinstance(target, types.Array):
        raise TypingError(f"RTCF:{words(target)} is not an array:set it with =")
    if not target.mutable:
        raise TypingError("RTCF:a constant of the module is set:declare a State, or copy it")
    new = value.dtype if isinstance(value, types.Array) else value
    _refuse_loss(target, new)
    if (convert := _fitted(target, value)) is not None:
        fill = plain(_filling(target.ndim))
        return lambda target, value: fill(target, convert(value))
    if isinstance(value, types.Number | types.Boolean):
        return _filling(target.ndim)
    if isinstance(value, types.BaseTuple):
        return lambda target, value: helpers.rtcf_assign(
            target, numpy_functions.rtcf_array(value, None)
        )
    if not isinstance(value, types.Array) or value.ndim > target.ndim:
        raise TypingError(
            f"RTCF:{words(target)} is set to {words(value)}:give it an array of the same shape"
        )
    copying = _copying(target.ndim, value.ndim)
    if target.ndim == 1:

        def along(target: Any, value: Any) -> None:
            is_apart = value.shape[0] == 1 or target.strides[0] * value.strides[0] < 0
            if is_apart and shares(target, value):
                copying(target, value.copy())
            elif _is_from_the_end(target, value):
                _copying_back(target, value)
            else:
                copying(target, value)

        return along

    def assign(target: Any, value: Any) -> None:
        if shares(target, value):
            copying(target, value.copy())
        else:
            copying(target, value)

    return assign


def _fitted(target: Any, value: Any) -> Any:
    """Return the function that checks that an int fits an array's ints; None if it always fits."""
    number = operand(value)
    if number is None or number.is_array or number.dtype.kind not in "iu":
        return None
    dtype = as_dtype(target.dtype)
    if dtype.kind not in "iu" or np.can_cast(number.dtype, dtype):
        return None
    return conversion(dtype)


@functools.cache
def conversion(dtype: np.dtype[Any]) -> Any:
    """Return the function that converts a number to an element of such an array: see as_element."""
    to = dtype.type
    if dtype.kind not in "iu":
        return plain(lambda number: to(number))
    limits = np.iinfo(dtype)
    low, high = limits.min, min(limits.max, 2**63 - 1)  # the limits within int64
    text = f"a number does not fit {dtype.name}"

    def convert(number: Any) -> Any:
        if number < low or number > high:
            raise OverflowError(text)
        return to(number)

    return plain(convert)


@plain
def _same(value: Any) -> Any:
    return value


def conversions(operation: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return the functions that convert the operands of an operation."""
    one, other = operand(x), operand(y)
    if one is None or other is None:
        return _same, _same
    meeting = together(operation, one, other)
    return _conversion(one, meeting.left), _conversion(other, meeting.right)


def _conversion(given: Operand, to: np.dtype[Any] | None) -> Any:
    if to is None:
        return _same
    return _array_conversion(to) if given.is_array else conversion(to)


@functools.cache
def _array_conversion(dtype: np.dtype[Any]) -> Any:
    return plain(lambda array: numpy_functions.rtcf_array(array, dtype.type))


def result_type(operation: Any, x: Any, y: Any) -> np.dtype[Any]:
    """Return the element type of the result of an operation."""
    one, other = operand(x), operand(y)
    assert one is not None and other is not None
    meeting = together(operation, one, other)
    result = np.promote_types(meeting.left or one.dtype, meeting.right or other.dtype)
    is_quotient = operation is operator.truediv and result.kind != "f"
    return np.dtype(np.float64) if is_quotient else result


@plain
def _is_from_the_end(target: Any, value: Any) -> Any:
    """Tell whether NumPy copies a vector from the last element to the first.

    It does so if it would otherwise overwrite elements before it reads them. It decides by
    addresses only, not by strides.
    """
    n = target.shape[0]
    if n == 0 or value.shape[0] != n or not in_one_block(target, value):
        return False
    # The difference of two addresses in one record is a compile-time constant.
    ahead = np.int64(target.ctypes.data) - np.int64(value.ctypes.data)
    step_to, step_at = target.strides[0], value.strides[0]
    if step_to >= 0:
        return 0 < ahead < n * step_at
    return not 0 < ahead + (n - 1) * (step_to - step_at) < -n * step_at


@plain
def _copying_back(target: Any, value: Any) -> None:
    for i in range(target.shape[0] - 1, -1, -1):
        target[i] = value[i]


def _filling(dimensions: int) -> Any:
    if dimensions == 1:

        def fill(target: Any, value: Any) -> None:
            for i in range(target.shape[0]):
                target[i] = value

        return fill

    def fill_all(target: Any, value: Any) -> None:
        for i in range(target.shape[0]):
            for j in range(target.shape[1]):
                target[i, j] = value

    if dimensions == 2:
        return fill_all
    fill_matrix = plain(fill_all)

    def fill_matrices(target: Any, value: Any) -> None:
        for i in range(target.shape[0]):
            fill_matrix(target[i], value)

    return fill_matrices


def _copying(of_target: int, of_value: int) -> Any:
    """Return the function that copies elements in order, broadcasting as NumPy does."""

    def vector(target: Any, value: Any) -> None:
        step = 0 if value.shape[0] == 1 else 1
        if step and target.shape[0] != value.shape[0]:
            note(target.shape[0], value.shape[0])
            raise ValueError("\x1ean array of size {} is set to one of size {}")
        for i in range(target.shape[0]):
            target[i] = value[i * step]

    def rows(target: Any, value: Any) -> None:
        step = 0 if value.shape[0] == 1 else 1
        if step and target.shape[1] != value.shape[0]:
            note(target.shape[1], value.shape[0])
            raise ValueError("\x1ean array of size {} is set to one of size {}")
        for i in range(target.shape[0]):
            for j in range(target.shape[1]):
                target[i, j] = value[j * step]

    def matrix(target: Any, value: Any) -> None:
        down = 0 if value.shape[0] == 1 else 1
        along = 0 if value.shape[1] == 1 else 1
        if (down and target.shape[0] != value.shape[0]) or (
            along and target.shape[1] != value.shape[1]
        ):
            raise ValueError("an array is set to one of another shape")
        for i in range(target.shape[0]):
            for j in range(target.shape[1]):
                target[i, j] = value[i * down, j * along]

    if of_target == 3:
        return plain(_copying_matrices(of_value))
    chosen = {(1, 1): vector, (2, 1): rows, (2, 2): matrix}[of_target, of_value]
    return plain(chosen)


def _copying_matrices(of_value: int) -> Any:
    """Return the function that copies to an array of three dimensions, matrix by matrix."""
    copying = _copying(2, min(of_value, 2))

    def same(target: Any, value: Any) -> None:
        for i in range(target.shape[0]):
            copying(target[i], value)

    def each(target: Any, value: Any) -> None:
        step = 0 if value.shape[0] == 1 else 1
        if step and target.shape[0] != value.shape[0]:
            raise ValueError("an array is set to one of another shape")
        for i in range(target.shape[0]):
            copying(target[i], value[i * step])

    return each if of_value == 3 else same


@compiled_as(helpers.rtcf_get, checked=True)
def _get(base: Any, index: Any) -> Any:
    if any(isinstance(each, types.IntEnumMember) for each in index.types):
        return _by_values("base, index", "helpers.rtcf_get(base, ({}))", index)
    if isinstance(base, NamedTupleType):
        return lambda base, index: helpers.rtcf_get(fields_of(base), index)
    if isinstance(base, types.BaseTuple) and index.count != 1:
        raise TypingError("RTCF:a list or tuple takes one index:use x[i][k] for rows")
    if isinstance(base, types.UniTuple) and isinstance(index[0], types.Integer):
        size = base.count

        def element(base: Any, index: Any) -> Any:
            if index[0] < -size or index[0] >= size:
                note(index[0], size)
                raise IndexError("\x1eindex {} is out of bounds for size {}")
            return base[index[0]]

        return element
    if not isinstance(base, types.Array):
        return lambda base, index: base[index[0]]
    kinds = _kinds(base, index)
    if kinds == ("array",):
        return lambda base, index: _gathered(base, index[0])
    if kinds == ("array", "slice"):
        return lambda base, index: _gathered(base[:, index[1]], index[0])
    if kinds == ("mask",):
        where_true = _where_true if base.ndim == 2 else _where_true_of_matrices
        return lambda base, index: where_true(base, index[0])
    if kinds == ("int", "array"):
        return lambda base, index: _gathered(base[index[0]], index[1])
    if kinds == ("array", "int"):
        return lambda base, index: _gathered(base[:, index[1]], index[0])
    if kinds == ("slice", "array"):

        def columns(base: Any, index: Any) -> Any:
            part = base[index[0]]
            places = _places(index[1], base.shape[1])
            result = np.empty((part.shape[0], places.shape[0]), base.dtype)
            for i in range(part.shape[0]):
                for k in range(places.shape[0]):
                    result[i, k] = part[i, places[k]]
            return result

        return columns
    if kinds == ("array", "array"):

        def pairs(base: Any, index: Any) -> Any:
            rows, columns = _places(index[0], base.shape[0]), _places(index[1], base.shape[1])
            down, along = _steps(rows, columns)
            result = np.empty(rows.shape[0] if down else columns.shape[0], base.dtype)
            for k in range(result.shape[0]):
                result[k] = base[rows[k * down], columns[k * along]]
            return result

        return pairs
    return lambda base, index: base[index]


@compiled_as(helpers.rtcf_set, checked=True)
def _set(base: Any, index: Any, value: Any) -> Any:
    if any(isinstance(each, types.IntEnumMember) for each in index.types):
        return _by_values("base, index, value", "helpers.rtcf_set(base, ({}), value)", index)
    if isinstance(value, types.IntEnumMember):
        return lambda base, index, value: helpers.rtcf_set(base, index, value.value)
    if not isinstance(base, types.Array):
        raise TypingError(f"RTCF:elements of {words(base)} cannot be set:use an array")
    if not base.mutable:
        raise TypingError("RTCF:a constant of the module is set:declare a State, or copy it")
    new = value.dtype if isinstance(value, types.Array) else value
    _refuse_loss(base, new)
    kinds = _kinds(base, index)
    if "array" in kinds or "mask" in kinds:
        return _selected(kinds, value)
    if "slice" in kinds or len(kinds) < base.ndim:
        return lambda base, index, value: helpers.rtcf_assign(base[index], value)
    if not isinstance(value, types.Number | types.Boolean):
        raise TypingError(f"RTCF:an element is set to {words(value)}:give it a number")
    if (convert := _fitted(base, value)) is not None:

        def fitted(base: Any, index: Any, value: Any) -> None:
            base[index] = convert(value)

        return fitted

    def element(base: Any, index: Any, value: Any) -> None:
        base[index] = value

    return element


def _by_values(parameters: str, call: str, index: Any) -> Any:
    """Return a function that calls a helper with an index whose enums are converted to ints."""
    parts = "".join(
        f"index[{k}].value, " if isinstance(each, types.IntEnumMember) else f"index[{k}], "
        for k, each in enumerate(index.types)
    )
    scope: dict[str, Any] = {"helpers": helpers}
    exec(f"def again({parameters}):\n    return {call.format(parts)}\n", scope)
    return scope["again"]


def _kinds(base: Any, index: Any) -> tuple[str, ...]:
    """Return the kinds of the parts of an index: int, slice, array, or mask of all elements (two or
    three dimensions).
    """
    kinds: list[str] = []
    for each in index.types:
        if isinstance(each, types.Array):
            if not isinstance(each.dtype, types.Integer | types.Boolean):
                raise TypingError(f"RTCF:an index is {words(each)}:use ints or bools")
            whole = each.ndim == base.ndim and isinstance(each.dtype, types.Boolean)
            selects = each.ndim == 1 and base.ndim < 3
            kinds.append("array" if selects else "mask" if whole else "")
        elif isinstance(each, types.Integer):
            kinds.append("int")
        elif isinstance(each, types.SliceType | types.EllipsisType):
            kinds.append("slice")
        else:
            kinds.append("")
    rest = any(isinstance(each, types.EllipsisType) for each in index.types)
    several = len(kinds) > 1 and ("mask" in kinds or (rest and "array" in kinds))
    if len(kinds) > base.ndim or "" in kinds or several:
        given = ", ".join(words(each) for each in index.types)
        use = "ints, slices and arrays" if base.ndim < 3 else "ints, slices and a whole mask"
        raise TypingError(f"RTCF:{words(base)} cannot be indexed by {given}:use {use}")
    return tuple(kinds)


def _selected(kinds: tuple[str, ...], value: Any) -> Any:
    """Return the function that sets the elements selected by a mask or an array of ints."""
    if isinstance(value, types.BaseTuple):
        return lambda base, index, value: helpers.rtcf_set(
            base, index, numpy_functions.rtcf_array(value, None)
        )
    if not isinstance(value, types.Array | types.Number | types.Boolean):
        raise TypingError(f"RTCF:elements are set to {words(value)}:give them numbers")
    if kinds == ("array",):
        return lambda base, index, value: _scatter(
            base, _places(index[0], base.shape[0]), _apart(base, value)
        )
    if kinds == ("mask",):
        return lambda base, index, value: _masked(base, index[0], _apart(base, value))
    if kinds == ("int", "array"):
        return lambda base, index, value: helpers.rtcf_set(base[index[0]], (index[1],), value)
    if kinds in (("array", "int"), ("array", "slice")):
        return lambda base, index, value: helpers.rtcf_set(base[:, index[1]], (index[0],), value)
    if kinds == ("slice", "array"):
        return lambda base, index, value: _scatter_columns(
            base[index[0]], _places(index[1], base.shape[1]), _apart(base, value)
        )
    return lambda base, index, value: _scatter_pairs(
        base,
        _places(index[0], base.shape[0]),
        _places(index[1], base.shape[1]),
        _apart(base, value),
    )


def _gathered(base: Any, index: Any) -> Any:
    raise NotImplementedError


@compiled_as(_gathered)
def _gather(base: Any, index: Any) -> Any:
    """Copy selected elements of a vector, or rows of a matrix."""
    if base.ndim == 1:

        def elements(base: Any, index: Any) -> Any:
            places = _places(index, base.shape[0])
            result = np.empty(places.shape[0], base.dtype)
            for k in range(places.shape[0]):
                result[k] = base[places[k]]
            return result

        return elements

    def rows(base: Any, index: Any) -> Any:
        places = _places(index, base.shape[0])
        result = np.empty((places.shape[0], base.shape[1]), base.dtype)
        for k in range(places.shape[0]):
            for j in range(base.shape[1]):
                result[k, j] = base[places[k], j]
        return result

    return rows


@plain
def _where_true(base: Any, mask: Any) -> Any:
    """Return the elements of a matrix selected by a mask of the same shape, row by row."""
    if mask.shape != base.shape:
        raise IndexError("the mask and the array have different shapes")
    result = np.empty(_count(mask), base.dtype)
    k = 0
    for i in range(mask.shape[0]):
        for j in range(mask.shape[1]):
            if mask[i, j]:
                result[k] = base[i, j]
                k += 1
    return result


@plain
def _where_true_of_matrices(base: Any, mask: Any) -> Any:
    """The same for an array of three dimensions."""
    if mask.shape != base.shape:
        raise IndexError("the mask and the array have different shapes")
    count = 0
    for i in range(mask.shape[0]):
        count += _count(mask[i])
    result = np.empty(count, base.dtype)
    k = 0
    for place in np.ndindex(mask.shape):
        if mask[place]:
            result[k] = base[place]
            k += 1
    return result


@plain
def _count(mask: Any) -> Any:
    count = 0
    for i in range(mask.shape[0]):
        for j in range(mask.shape[1]):
            if mask[i, j]:
                count += 1
    return count


@plain
def _steps(rows: Any, columns: Any) -> Any:
    """Return the steps through two index arrays: 0 for an array of one element, else 1."""
    down = 0 if rows.shape[0] == 1 else 1
    along = 0 if columns.shape[0] == 1 else 1
    if down and along and rows.shape[0] != columns.shape[0]:
        raise IndexError("indices have different sizes")
    return down, along


def _places(index: Any, size: Any) -> Any:
    raise NotImplementedError


@compiled_as(_places)
def _places_of(index: Any, size: Any) -> Any:
    """Return the positions that an index selects; raise IndexError if one is out of range."""
    if isinstance(index.dtype, types.Boolean):

        def true_ones(index: Any, size: Any) -> Any:
            if index.shape[0] != size:
                note(index.shape[0], size)
                raise IndexError("\x1ea mask of {} elements for an array of size {}")
            count = 0
            for i in range(size):
                if index[i]:
                    count += 1
            places = np.empty(count, np.int64)
            count = 0
            for i in range(size):
                if index[i]:
                    places[count] = i
                    count += 1
            return places

        return true_ones

    def numbers(index: Any, size: Any) -> Any:
        places = np.empty(index.shape[0], np.int64)
        for k in range(index.shape[0]):
            place = np.int64(index[k])
            if place < 0:
                place += size
            if place < 0 or place >= size:
                note(index[k], size)
                raise IndexError("\x1eindex {} is out of bounds for size {}")
            places[k] = place
        return places

    return numbers


def _apart(base: Any, value: Any) -> Any:
    raise NotImplementedError


@compiled_as(_apart)
def _apart_from(base: Any, value: Any) -> Any:
    """Return the value, copied if it may share memory with the base."""
    if not isinstance(value, types.Array):
        return lambda base, value: value
    # A copy is contiguous, which numba treats as a different type.
    if value.layout != "C" or not value.mutable:
        return lambda base, value: value.copy()
    return lambda base, value: value.copy() if overlaps(base, value) else value


def _scatter(base: Any, places: Any, value: Any) -> Any:
    raise NotImplementedError


@compiled_as(_scatter)
def _scattered(base: Any, places: Any, value: Any) -> Any:
    """Set selected elements of a vector, or rows of a matrix."""
    if not isinstance(value, types.Array):
        if base.ndim == 1:

            def fill(base: Any, places: Any, value: Any) -> None:
                for k in range(places.shape[0]):
                    base[places[k]] = value

            return fill

        def fill_rows(base: Any, places: Any, value: Any) -> None:
            for k in range(places.shape[0]):
                for j in range(base.shape[1]):
                    base[places[k], j] = value

        return fill_rows
    if value.ndim > base.ndim:
        raise TypingError(f"RTCF:parts of {words(base)} are set to {words(value)}:make sizes fit")
    if base.ndim == 1:

        def elements(base: Any, places: Any, value: Any) -> None:
            step = _step(value, places.shape[0])
            for k in range(places.shape[0]):
                base[places[k]] = value[k * step]

        return elements
    if value.ndim == 1:

        def same_rows(base: Any, places: Any, value: Any) -> None:
            step = _step(value, base.shape[1])
            for k in range(places.shape[0]):
                for j in range(base.shape[1]):
                    base[places[k], j] = value[j * step]

        return same_rows

    def rows(base: Any, places: Any, value: Any) -> None:
        down = 0 if value.shape[0] == 1 else 1
        along = 0 if value.shape[1] == 1 else 1
        if (down and value.shape[0] != places.shape[0]) or (
            along and value.shape[1] != base.shape[1]
        ):
            raise ValueError("rows of an array are set to an array of another shape")
        for k in range(places.shape[0]):
            for j in range(base.shape[1]):
                base[places[k], j] = value[k * down, j * along]

    return rows


def _scatter_columns(base: Any, places: Any, value: Any) -> Any:
    raise NotImplementedError


@compiled_as(_scatter_columns)
def _scattered_columns(base: Any, places: Any, value: Any) -> Any:
    if not isinstance(value, types.Array):

        def fill(base: Any, places: Any, value: Any) -> None:
            for i in range(base.shape[0]):
                for k in range(places.shape[0]):
                    base[i, places[k]] = value

        return fill
    if value.ndim == 1:

        def same_columns(base: Any, places: Any, value: Any) -> None:
            step = _step(value, places.shape[0])
            for i in range(base.shape[0]):
                for k in range(places.shape[0]):
                    base[i, places[k]] = value[k * step]

        return same_columns

    def columns(base: Any, places: Any, value: Any) -> None:
        down = 0 if value.shape[0] == 1 else 1
        along = 0 if value.shape[1] == 1 else 1
        if (down and value.shape[0] != base.shape[0]) or (
            along and value.shape[1] != places.shape[0]
        ):
            raise ValueError("columns of an array are set to an array of another shape")
        for i in range(base.shape[0]):
            for k in range(places.shape[0]):
                base[i, places[k]] = value[i * down, k * along]

    return columns


def _scatter_pairs(base: Any, rows: Any, columns: Any, value: Any) -> Any:
    raise NotImplementedError


@compiled_as(_scatter_pairs)
def _scattered_pairs(base: Any, rows: Any, columns: Any, value: Any) -> Any:
    if isinstance(value, types.Array) and value.ndim > 1:
        raise TypingError(f"RTCF:elements are set to {words(value)}:give them a vector")

    def pairs(base: Any, rows: Any, columns: Any, value: Any) -> None:
        down, along = _steps(rows, columns)
        count = rows.shape[0] if down else columns.shape[0]
        step = _step(value, count)
        for k in range(count):
            base[rows[k * down], columns[k * along]] = _item(value, k * step)

    return pairs


def _masked(base: Any, mask: Any, value: Any) -> Any:
    raise NotImplementedError


@compiled_as(_masked)
def _set_where(base: Any, mask: Any, value: Any) -> Any:
    """Set the elements of a matrix selected by a mask of the same shape, row by row."""
    if isinstance(value, types.Array) and value.ndim > 1:
        raise TypingError(f"RTCF:elements are set to {words(value)}:give them a vector")

    def where(base: Any, mask: Any, value: Any) -> None:
        if mask.shape != base.shape:
            raise IndexError("the mask and the array have different shapes")
        step = _step(value, _count(mask))
        k = 0
        for i in range(mask.shape[0]):
            for j in range(mask.shape[1]):
                if mask[i, j]:
                    base[i, j] = _item(value, k)
                    k += step

    def where_in_matrices(base: Any, mask: Any, value: Any) -> None:
        if mask.shape != base.shape:
            raise IndexError("the mask and the array have different shapes")
        count = 0
        for i in range(mask.shape[0]):
            count += _count(mask[i])
        step = _step(value, count)
        k = 0
        for place in np.ndindex(mask.shape):
            if mask[place]:
                base[place] = _item(value, k)
                k += step

    return where if base.ndim == 2 else where_in_matrices


def _step(value: Any, count: Any) -> Any:
    raise NotImplementedError


@compiled_as(_step)
def _step_of(value: Any, count: Any) -> Any:
    """Return the step through the values: 0 to repeat a single value, else 1."""
    if not isinstance(value, types.Array):
        return lambda value, count: 0

    def step(value: Any, count: Any) -> Any:
        if value.shape[0] == 1:
            return 0
        if value.shape[0] != count:
            raise ValueError("parts of an array are set to another number of values")
        return 1

    return step


def _item(value: Any, place: Any) -> Any:
    raise NotImplementedError


@compiled_as(_item)
def _item_of(value: Any, place: Any) -> Any:
    if isinstance(value, types.Array):
        return lambda value, place: value[place]
    return lambda value, place: value


def is_any_enum(*kinds: Any) -> bool:
    """Tell whether one of some types is that of an enum's members."""
    return any(isinstance(each, types.IntEnumMember) for each in kinds)


def plain_value(value: Any) -> Any:
    """Return the int of an enum's member, other values as they are. Compiled only."""
    raise NotImplementedError


@compiled_as(plain_value)
def _plain_value(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: value.value
    return lambda value: value


def _changing(helper: Any, operation: Any) -> None:
    """Register `target += value` for one operation."""

    @compiled_as(helper)
    def _change(target: Any, value: Any) -> Any:
        if operation in operators.DIVISIONS and is_any_enum(target, value):
            return lambda target, value: helper(plain_value(target), plain_value(value))
        numbers = operand(target), operand(value)
        plainly = None in numbers or not any(each.is_narrow for each in numbers if each)
        # With OPTIONS, dividing a single number by zero gives infinity; our own helper raises.
        is_division = operation in operators.DIVISIONS and not isinstance(target, types.Array)
        is_own = not plainly or (is_division and None not in numbers)
        operate = operators.OF[operation] if is_own else operation
        if not isinstance(target, types.Array):
            return lambda target, value: operate(target, value)
        require_kind(operation, target, value)

        def change(target: Any, value: Any) -> Any:
            helpers.rtcf_assign(target, operate(target, value))
            return target

        return change


def require_kind(operation: Any, target: Any, value: Any) -> None:
    """Reject an in-place operation with values of another kind, as NumPy does."""
    if operand(value) is None or not isinstance(target, types.Array):
        return
    if isinstance(target.dtype, types.Float):
        return
    result = result_type(operation, target, value)
    if not np.can_cast(result, as_dtype(target.dtype), "same_kind"):
        raise TypingError(
            f"RTCF:elements of {target.dtype} would become {result}:"
            f"convert the other operand: ….astype(np.{target.dtype})"
        )


def _with_lists(helper: Any, operation: Any) -> None:
    """Register an operation of an array and a list."""

    @compiled_as(helper)
    def _operate(left: Any, right: Any) -> Any:
        if isinstance(left, types.Array) and isinstance(right, types.BaseTuple):
            return lambda left, right: operation(left, numpy_functions.rtcf_array(right, None))
        if isinstance(left, types.BaseTuple) and isinstance(right, types.Array):
            return lambda left, right: operation(numpy_functions.rtcf_array(left, None), right)
        raise TypingError("RTCF:arithmetic on lists without an array:use np.array([…])")


for _helper in helpers.OF_LISTS.values():
    _with_lists(_helper, getattr(operator, _helper.__name__.removeprefix("rtcf_of_lists_")))
for _helper in helpers.IN_PLACE.values():
    _changing(_helper, getattr(operator, _helper.__name__.removeprefix("rtcf_in_place_")))


@compiled_as(helpers.rtcf_changed)
def _changed(target: Any, value: Any) -> Any:
    if not isinstance(target, types.Array):
        return lambda target, value: value
    require_kind(operator.or_, target, value)

    def changed(target: Any, value: Any) -> Any:
        helpers.rtcf_assign(target, value)
        return target

    return changed


def _checking(helper: Any, function: Any) -> None:
    """Register a math function of one number that raises as in CPython.

    A NaN from a number is a domain error. So is infinity from a finite number, unless the function
    grows that large (OverflowError).
    """
    name = function.__name__
    grows = function in (math.exp, math.exp2, math.expm1, math.sinh, math.cosh)
    arrays = f"; np.{name} takes arrays" if hasattr(np, name) else ""
    if function in (math.log2, math.cbrt, math.exp2):  # not supported by numba
        function = types.ExternalFunction(name, types.float64(types.float64))

    @compiled_as(helper)
    def _check(value: Any) -> Any:
        if not isinstance(value, types.Number | types.Boolean):
            raise TypingError(f"RTCF:math.{name} of {words(value)}:give it a number{arrays}")

        def checked(value: Any) -> Any:
            result = function(np.float64(value))
            if math.isnan(result) and not math.isnan(value):
                raise ValueError("math domain error")
            if math.isinf(result) and not math.isinf(value):
                if grows:
                    raise OverflowError("math range error")
                raise ValueError("math domain error")
            return result

        return checked


for _function, _checked_function in helpers.MATH.items():
    _checking(_checked_function, _function)


@compiled_as(helpers.rtcf_math_fmod)
def _fmod(x: Any, y: Any) -> Any:
    def fmod(x: Any, y: Any) -> Any:
        result = np.fmod(np.float64(x), np.float64(y))
        if math.isnan(result) and not (math.isnan(x) or math.isnan(y)):
            raise ValueError("math domain error")
        return result

    return fmod


@compiled_as(helpers.rtcf_math_remainder)
def _remainder(x: Any, y: Any) -> Any:
    def remainder(x: Any, y: Any) -> Any:
        # As in CPython: all differences are exact.
        x, y = np.float64(x), np.float64(y)
        if math.isnan(x) or math.isnan(y):
            return x + y
        if math.isinf(x) or y == 0.0:
            raise ValueError("math domain error")
        if math.isinf(y):
            return x
        far, size = abs(x), abs(y)
        rest = np.fmod(far, size)
        other = size - rest
        if rest < other:
            result = rest
        elif rest > other:
            result = -other
        else:
            result = rest - 2.0 * np.fmod(0.5 * (far - rest), size)
        return math.copysign(1.0, x) * result

    return remainder


@compiled_as(helpers.rtcf_round_to)
def _round_to(value: Any, digits: Any) -> Any:
    if not isinstance(value, types.Float):
        raise TypingError(f"RTCF:round of {words(value)} to digits:give it a float")

    def rounded(value: Any, digits: Any) -> Any:
        x = np.float64(value)
        scale = 10.0**digits
        high = x * scale
        # The nearest float to a decimal number is x itself from here on.
        if not abs(high) < 2.0**53:
            return x
        # x * scale is high + low exactly (Dekker, 1971).
        split = 134217729.0
        a = x * split
        a = a - (a - x)
        b = scale * split
        b = b - (b - scale)
        low = ((a * b - high) + a * (scale - b) + (x - a) * b) + (x - a) * (scale - b)
        whole = np.rint(high)
        far = (high - whole) + low
        if far > 0.5 or (far == 0.5 and whole % 2.0 != 0.0):
            whole += 1.0
        elif far < -0.5 or (far == -0.5 and whole % 2.0 != 0.0):
            whole -= 1.0
        return math.copysign(abs(whole / scale), x)

    return rounded


@overload(bool)
def _bool_of_enum(value):  # type: ignore[no-untyped-def]
    if isinstance(value, types.IntEnumMember):
        return lambda value: value.value != 0
    return None


@compiled_as(helpers.rtcf_pow)
def _pow(base: Any, exponent: Any) -> Any:
    numbers = types.Number | types.Boolean
    as_base, as_exponent = conversions(operator.pow, base, exponent)
    if not isinstance(base, numbers) or not isinstance(exponent, numbers):
        power_of = plain(_power_of_arrays(base, exponent))
        return lambda base, exponent: power_of(as_base(base), as_exponent(exponent))
    if isinstance(base, types.Complex) or isinstance(exponent, types.Complex):
        return lambda base, exponent: helpers.rtcf_complex_pow(base, exponent)
    for each in (base, exponent):
        refuse_narrow(helpers.rtcf_pow, each, "f")
    if not isinstance(base, types.Float) and not isinstance(exponent, types.Float):

        def whole(base: Any, exponent: Any) -> Any:
            if exponent < 0:
                raise ValueError("an int to a negative power: make it a float")
            return base**exponent

        return whole

    def power(base: Any, exponent: Any) -> Any:
        x, y = float(base), float(exponent)
        finite = math.isfinite(x) and math.isfinite(y)
        if finite and x == 0.0 and y < 0.0:
            raise ZeroDivisionError("0.0 to a negative power")
        if finite and x < 0.0 and y != np.floor(y):
            raise ValueError("a negative number to a fractional power")
        result = x**y
        if finite and math.isinf(result):
            raise OverflowError("a power is too large")
        return result

    return power


def _power_of_arrays(base: Any, exponent: Any) -> Any:
    """Return the power function of arrays: of floats, where 0 ** -1 is infinite, or of ints."""
    kinds = [getattr(each, "dtype", each) for each in (base, exponent)]
    if isinstance(kinds[0], types.Float) and isinstance(exponent, types.Float):

        def by_number(base: Any, exponent: Any) -> Any:
            # NumPy computes these with other functions.
            if exponent == 0.5:
                return np.sqrt(base)
            if exponent == -1.0:
                return np.reciprocal(base)
            return base**exponent

        return by_number
    if isinstance(kinds[1], types.Float):
        return lambda base, exponent: base**exponent
    if isinstance(kinds[0], types.Float):
        return lambda base, exponent: base ** (exponent * 1.0)

    if not isinstance(exponent, types.Array):

        def of_all(base: Any, exponent: Any) -> Any:
            if exponent < 0:
                raise ValueError("ints to a negative power: make them floats")
            return base**exponent

        return of_all

    def of_each(base: Any, exponent: Any) -> Any:
        if np.any(exponent < 0):
            raise ValueError("ints to a negative power: make them floats")
        return base**exponent

    return of_each


@compiled_as(helpers.rtcf_negative_pow)
def _negative_pow(base: Any, exponent: Any) -> Any:
    if isinstance(base, types.Number | types.Boolean) and not isinstance(base, types.Complex):
        return lambda base, exponent: helpers.rtcf_pow(float(base), float(exponent))
    return lambda base, exponent: helpers.rtcf_pow(base, exponent)


@compiled_as(helpers.rtcf_math_pow)
def _math_pow(base: Any, exponent: Any) -> Any:
    return lambda base, exponent: helpers.rtcf_pow(np.float64(base), np.float64(exponent))


@compiled_as(helpers.rtcf_to_int)
def _to_int(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: value.value
    if isinstance(value, types.Integer):
        return lambda value: operators.rtcf_plain(value)
    if not isinstance(value, types.Float | types.Boolean):
        raise TypingError(f"RTCF:int of {words(value)}:give it a number")

    def to_int(value: Any) -> Any:
        if math.isnan(value):
            raise ValueError("cannot convert float NaN to integer")
        if not -9223372036854775808.0 <= value < 9223372036854775808.0:
            raise OverflowError("does not fit int64")
        return int(value)

    return to_int


@compiled_as(helpers.rtcf_floor)
def _floor(value: Any) -> Any:
    return lambda value: helpers.rtcf_to_int(np.floor(value))


@compiled_as(helpers.rtcf_ceil)
def _ceil(value: Any) -> Any:
    return lambda value: helpers.rtcf_to_int(np.ceil(value))


@compiled_as(helpers.rtcf_round)
def _round(value: Any) -> Any:
    if isinstance(value, types.Integer | types.Boolean):
        return lambda value: helpers.rtcf_to_int(value)
    return lambda value: helpers.rtcf_to_int(np.rint(value))


@compiled_as(helpers.rtcf_one_index)
def _one_index(value: Any) -> Any:
    if isinstance(value, types.Integer | types.IntEnumMember):
        return lambda value: value
    raise TypingError(f"RTCF:a new axis beside {words(value)} as an index:index first, then add it")


@compiled_as(helpers.rtcf_index)
def _index(value: Any) -> Any:
    if isinstance(value, types.IntEnumMember):
        return lambda value: value.value
    if isinstance(value, types.Integer | types.Boolean):
        return lambda value: value
    raise TypingError(f"RTCF:range of {words(value)}:use //, or convert it: int(…)")


@compiled_as(helpers.rtcf_items)
def _items(values: Any, count: Any) -> Any:
    n = count.count
    if isinstance(values, types.BaseTuple):
        if values.count != n:
            raise TypingError(f"RTCF:{values.count} values for {n} names:use as many names")
        return lambda values, count: values
    if not isinstance(values, types.Array):
        raise TypingError(
            f"RTCF:{words(values)} is unpacked into {n} names:use a vector or a tuple"
        )
    elements = ", ".join(f"values[{k}]" for k in range(n))
    text = f"""\
def items(values, count):
    if values.shape[0] != {n}:
        note(values.shape[0], {n})
        raise ValueError("\x1e{{}} values for {{}} names")
    return ({elements},)
"""
    scope: dict[str, Any] = {"note": note}
    exec(text, scope)
    return scope["items"]


@compiled_as(helpers.rtcf_front)
def _front(ring: Any, oldest: Any, count: Any) -> Any:
    def front(ring: Any, oldest: Any, count: Any) -> Any:
        if count == 0:
            raise IndexError("front of an empty queue")
        return operators.rtcf_plain(ring[oldest])

    return front


@compiled_as(helpers.rtcf_age)
def _age(now: Any, written: Any, oldest: Any, count: Any) -> Any:
    return lambda now, written, oldest, count: (
        -1 if count == 0 else max(np.int64(0), now - written[oldest])
    )


@compiled_as(helpers.rtcf_after)
def _after(place: Any, size: Any) -> Any:
    return lambda place, size: 0 if place + 1 == size else place + 1


@compiled_as(helpers.rtcf_where)
def _where(condition: Any, x: Any, y: Any) -> Any:
    given = (condition, x, y)
    dimensions = {each.ndim for each in given if isinstance(each, types.Array)}
    if len(dimensions) > 1 or not all(
        isinstance(each, types.Array | types.Number | types.Boolean) for each in given
    ):
        kinds = ", ".join(words(each) for each in given)
        raise TypingError(f"RTCF:np.where of {kinds}:give it numbers and arrays of one shape")
    as_x, as_y = conversions(np.where, x, y)
    if not dimensions:
        return lambda condition, x, y: x if condition else y
    dtype = result_type(np.where, x, y)

    @plain
    def chosen(condition: Any, x: Any, y: Any) -> Any:
        shape = _shape(condition, x, y)
        if not (_fits(condition, shape) and _fits(x, shape) and _fits(y, shape)):
            raise ValueError("np.where of shapes that do not fit")
        result = np.empty(shape, dtype)
        for place in np.ndindex(shape):
            if _element(condition, place):
                result[place] = _element(x, place)
            else:
                result[place] = _element(y, place)
        return result

    return lambda condition, x, y: chosen(condition, as_x(x), as_y(y))


def _shape(condition: Any, x: Any, y: Any) -> Any:
    raise NotImplementedError


@compiled_as(_shape)
def _shape_of_the_first_array(condition: Any, x: Any, y: Any) -> Any:
    if isinstance(condition, types.Array):
        return lambda condition, x, y: condition.shape
    if isinstance(x, types.Array):
        return lambda condition, x, y: x.shape
    return lambda condition, x, y: y.shape


def _fits(value: Any, shape: Any) -> Any:
    raise NotImplementedError


@compiled_as(_fits)
def _has_shape(value: Any, shape: Any) -> Any:
    if isinstance(value, types.Array):
        return lambda value, shape: value.shape == shape
    return lambda value, shape: True


def _element(value: Any, place: Any) -> Any:
    raise NotImplementedError


@compiled_as(_element)
def _element_or_number(value: Any, place: Any) -> Any:
    if isinstance(value, types.Array):
        return lambda value, place: value[place]
    return lambda value, place: value


@compiled_as(helpers.rtcf_solve, refused="f")
def _solve(a: Any, b: Any) -> Any:
    _require_matrix("np.linalg.solve", a)
    if isinstance(b, types.Array) and b.ndim > 2:
        raise TypingError(f"RTCF:np.linalg.solve for {words(b)}:give it a vector or a matrix")
    if b.ndim == 1:

        def vector(a: Any, b: Any) -> Any:
            x = np.empty((b.shape[0], 1))
            for i in range(b.shape[0]):
                x[i, 0] = b[i]
            return _eliminated(a, x)[:, 0].copy()

        return vector
    return lambda a, b: _eliminated(a, b)


def _require_matrix(name: str, a: Any) -> None:
    if isinstance(a, types.Array) and a.ndim > 2:
        raise TypingError(f"RTCF:{name} of {words(a)}:give it a matrix")


def _eliminated(a: Any, b: Any) -> Any:
    raise NotImplementedError


@compiled_as(_eliminated)
def _eliminate(a: Any, b: Any) -> Any:
    def eliminate(a: Any, b: Any) -> Any:
        n = a.shape[0]
        if a.shape[1] != n or b.shape[0] != n:
            note(n, b.shape[0])
            raise ValueError("\x1esolve of sizes {} and {}, which do not fit")
        width = b.shape[1]
        matrix, x = np.empty((n, n)), np.empty((n, width))
        for i in range(n):
            for j in range(n):
                matrix[i, j] = a[i, j]
            for j in range(width):
                x[i, j] = b[i, j]
        for k in range(n):
            pivot = k
            for i in range(k + 1, n):
                if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                    pivot = i
            if matrix[pivot, k] == 0.0:
                raise ValueError("solve: the matrix is singular")
            if pivot != k:
                for j in range(n):
                    matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
                for j in range(width):
                    x[k, j], x[pivot, j] = x[pivot, j], x[k, j]
            for i in range(k + 1, n):
                factor = matrix[i, k] / matrix[k, k]
                for j in range(k + 1, n):
                    matrix[i, j] = matrix[i, j] - factor * matrix[k, j]
                for j in range(width):
                    x[i, j] = x[i, j] - factor * x[k, j]
        for i in range(n - 1, -1, -1):
            for j in range(width):
                for k in range(i + 1, n):
                    x[i, j] = x[i, j] - matrix[i, k] * x[k, j]
                x[i, j] = x[i, j] / matrix[i, i]
        return x

    return eliminate


@compiled_as(helpers.rtcf_inv, refused="f")
def _inv(a: Any) -> Any:
    _require_matrix("np.linalg.inv", a)
    return lambda a: _eliminated(a, np.eye(a.shape[0]))


@compiled_as(helpers.rtcf_cholesky, refused="f")
def _cholesky(a: Any) -> Any:
    _require_matrix("np.linalg.cholesky", a)

    def cholesky(a: Any) -> Any:
        n = a.shape[0]
        if a.shape[1] != n:
            raise ValueError("cholesky of a matrix that is not square")
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

    return cholesky


def words(value: Any) -> str:
    """Describe a type of numba in the terms of NumPy."""
    if isinstance(value, types.Array):
        of = {1: "a vector", 2: "a matrix"}
        return f"{of.get(value.ndim, f'an array of {value.ndim} dimensions')} of {value.dtype}"
    if isinstance(value, types.Boolean):
        return "a bool"
    if isinstance(value, types.Float):
        return "a float"
    if isinstance(value, types.Integer):
        return "an int"
    if is_object(value):
        return f"a {value.record.cls.__name__}"
    if isinstance(value, types.BaseTuple):
        return "a list or tuple"
    if isinstance(value, types.IntEnumMember):
        return f"a {value.instance_class.__name__}"
    if isinstance(value, types.EnumMember):
        return f"an enum {value.instance_class.__name__}"
    if isinstance(value, types.Optional):
        return f"{words(value.type)} or None"
    return kind_of(str(value))
