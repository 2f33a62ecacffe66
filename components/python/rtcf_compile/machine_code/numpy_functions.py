"""The numba overloads of NumPy functions, for numbers, vectors and matrices; many also for arrays
of three dimensions.

Import this only to compile: it imports numba.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np import arrayobj
from numba.np.numpy_support import as_dtype

from rtcf_compile.machine_code.number_types import Operand, operand, together
from rtcf_compile.machine_code.operators import refuse_bools
from rtcf_compile.machine_code.overloads import compiled_as, conversions, plain, result_type, words
from rtcf_compile.rewriting import helpers, operators
from rtcf_compile.rewriting import numpy_functions as own
from rtcf_compile.rewriting.operators import is_narrow

_Numbers = types.Number | types.Boolean
_lower, _higher = operators.OF[np.minimum], operators.OF[np.maximum]
_minus = operators.OF[operator.sub]
_ALL = (1, 2, 3)  # dimensions of arrays
_LONG = 128  # up to this size, NumPy sums with eight accumulators; it halves longer arrays


def dtype_of(kind: Any) -> Any:
    """Return the NumPy type of a number, or of the elements of an array."""
    return as_dtype(types.unliteral(kind.dtype if isinstance(kind, types.Array) else kind))


def needs(kind: Any, what: str, dimensions: tuple[int, ...] = (1, 2)) -> None:
    """Reject values other than an array of these dimensions."""
    if isinstance(kind, types.Array) and kind.ndim in dimensions:
        return
    names: dict[tuple[int, ...], str] = {(1,): "a vector", (2,): "a matrix", _ALL: "an array"}
    wanted = names.get(dimensions, "a vector or a matrix")
    raise TypingError(f"RTCF:{what} of {words(kind)}:give it {wanted}")


# Making arrays.


def _leaves(kind: Any) -> tuple[tuple[int, ...], list[Any]]:
    """Return the shape of nested rows of numbers, and the types of the numbers."""
    if not isinstance(kind, types.BaseTuple):
        if not isinstance(kind, _Numbers):
            raise TypingError(f"RTCF:an array of {words(kind)}:use numbers")
        return (), [kind]
    found = [_leaves(each) for each in kind.types]
    shapes = {shape for shape, _ in found}
    if len(shapes) != 1:
        raise TypingError("RTCF:the rows of an array have different lengths:make them equal")
    return (len(found), *shapes.pop()), [each for _, types_of in found for each in types_of]


@intrinsic  # type: ignore[misc]
def _store(typing: Any, array: Any, values: Any) -> Any:
    """Set the elements of a new array from nested rows of numbers."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = arrayobj.make_array(array)(context, builder, arguments[0]).data
        place = 0

        def walk(value: Any, kind: Any) -> None:
            nonlocal place
            if isinstance(kind, types.BaseTuple):
                for number, each in enumerate(kind.types):
                    walk(builder.extract_value(value, number), each)
                return
            cast = context.cast(builder, value, kind, array.dtype)
            pointer = builder.gep(data, [ir.Constant(ir.IntType(64), place)])
            arrayobj.store_item(context, builder, array, cast, pointer)
            place += 1

        walk(arguments[1], values)
        return context.get_dummy_value()

    return types.none(array, values), generate


def _wanted(given: Any, dtype: Any) -> Any:
    """Return the element type: the given dtype, or the common type of the elements."""
    follows = np.result_type(*(dtype_of(each) for each in given))
    if isinstance(dtype, types.NoneType):
        return follows
    wanted = dtype_of(dtype.dtype if isinstance(dtype, types.DTypeSpec) else dtype.instance_type)
    if follows.kind == "f" and wanted.kind != "f":
        raise TypingError(f"RTCF:elements are {follows}, not {wanted}:round them first")
    return wanted


@compiled_as(own.rtcf_array)
def _array(object: Any, dtype: Any) -> Any:
    if isinstance(object, types.Array):
        wanted = _wanted([object], dtype)
        if object.ndim == 1:

            def vector(object: Any, dtype: Any) -> Any:
                result = np.empty(object.shape[0], wanted)
                for i in range(object.shape[0]):
                    result[i] = object[i]
                return result

            return vector
        if object.ndim == 3:

            def matrices(object: Any, dtype: Any) -> Any:
                result = np.empty(object.shape, wanted)
                for i in range(object.shape[0]):
                    for j in range(object.shape[1]):
                        for k in range(object.shape[2]):
                            result[i, j, k] = object[i, j, k]
                return result

            return matrices

        def matrix(object: Any, dtype: Any) -> Any:
            result = np.empty(object.shape, wanted)
            for i in range(object.shape[0]):
                for j in range(object.shape[1]):
                    result[i, j] = object[i, j]
            return result

        return matrix
    if isinstance(object, types.BaseTuple) and any(
        isinstance(each, types.Array) for each in object.types
    ):
        if not all(isinstance(each, types.Array | types.BaseTuple) for each in object.types):
            raise TypingError("RTCF:an array of arrays and numbers:use np.hstack")
        if not isinstance(dtype, types.NoneType):
            return lambda object, dtype: own.rtcf_array(own.rtcf_stack(object, 0), dtype)
        return lambda object, dtype: own.rtcf_stack(object, 0)
    shape, leaves = _leaves(object)
    if not 1 <= len(shape) <= 3 or 0 in shape:
        raise TypingError(f"RTCF:an array of {words(object)}:give it rows of numbers")
    wanted = _wanted(leaves, dtype)

    def made(object: Any, dtype: Any) -> Any:
        result = np.empty(shape, wanted)
        _store(result, object)
        return result

    return made


@compiled_as(own.rtcf_asarray)
def _asarray(a: Any, dtype: Any) -> Any:
    if isinstance(a, types.Array) and (
        isinstance(dtype, types.NoneType) or _wanted([a], dtype) == dtype_of(a)
    ):
        return lambda a, dtype: a
    return lambda a, dtype: own.rtcf_array(a, dtype)


@compiled_as(own.rtcf_atleast_1d, arrays=("ary",))
def _atleast_1d(ary: Any) -> Any:
    if isinstance(ary, _Numbers):
        return lambda ary: own.rtcf_array((ary,), None)
    needs(ary, "np.atleast_1d")
    return lambda ary: ary


@compiled_as(own.rtcf_atleast_2d, arrays=("ary",))
def _atleast_2d(ary: Any) -> Any:
    if isinstance(ary, _Numbers):
        return lambda ary: own.rtcf_array(((ary,),), None)
    needs(ary, "np.atleast_2d")
    if ary.ndim == 1:
        return lambda ary: own.rtcf_reshape(ary, (1, ary.shape[0]))
    return lambda ary: ary


@compiled_as(own.rtcf_meshgrid, arrays=("x1", "x2"))
def _meshgrid(x1: Any, x2: Any, indexing: Any) -> Any:
    needs(x1, "np.meshgrid", (1,))
    needs(x2, "np.meshgrid", (1,))
    if not isinstance(indexing, types.NoneType):

        def by_rows(x1: Any, x2: Any, indexing: Any) -> Any:
            shape = x1.shape[0], x2.shape[0]
            one, two = np.empty(shape, x1.dtype), np.empty(shape, x2.dtype)
            for i in range(shape[0]):
                for j in range(shape[1]):
                    one[i, j], two[i, j] = x1[i], x2[j]
            return one, two

        return by_rows

    def by_columns(x1: Any, x2: Any, indexing: Any) -> Any:
        shape = x2.shape[0], x1.shape[0]
        one, two = np.empty(shape, x1.dtype), np.empty(shape, x2.dtype)
        for i in range(shape[0]):
            for j in range(shape[1]):
                one[i, j], two[i, j] = x1[j], x2[i]
        return one, two

    return by_columns


@compiled_as(own.rtcf_diag, arrays=("v",))
def _diag(v: Any, k: Any) -> Any:
    needs(v, "np.diag")
    if v.ndim == 1:

        def matrix(v: Any, k: Any) -> Any:
            n = v.shape[0] + abs(k)
            result = np.zeros((n, n), v.dtype)
            for i in range(v.shape[0]):
                result[i + max(0, -k), i + max(0, k)] = v[i]
            return result

        return matrix

    def diagonal(v: Any, k: Any) -> Any:
        down, along = max(0, -k), max(0, k)
        result = np.empty(max(0, min(v.shape[0] - down, v.shape[1] - along)), v.dtype)
        for i in range(result.shape[0]):
            result[i] = v[i + down, i + along]
        return result

    return diagonal


@plain
def copied_vector(a: Any) -> Any:
    """Return the elements of a vector as a new vector."""
    result = np.empty(a.shape[0], a.dtype)
    for i in range(a.shape[0]):
        result[i] = a[i]
    return result


@compiled_as(own.rtcf_diagonal, arrays=("a",))
def _diagonal(a: Any) -> Any:
    needs(a, "np.diagonal", (2,))
    return lambda a: own.rtcf_diag(a, 0)


@compiled_as(own.rtcf_linspace, refused="fiu")
def _linspace(start: Any, stop: Any, num: Any, endpoint: Any) -> Any:
    def linspace(start: Any, stop: Any, num: Any, endpoint: Any) -> Any:
        if num < 0:
            raise ValueError("np.linspace of a negative number of elements")
        result = np.empty(num)
        parts = num - 1 if endpoint else num
        delta = stop * 1.0 - start * 1.0
        step = delta / parts if parts > 0 else 0.0
        for i in range(num):
            if parts > 0 and step == 0.0:
                result[i] = i / parts * delta + start
            elif parts > 0:
                result[i] = i * step + start
            else:
                result[i] = i * delta + start
        if endpoint and num > 1:
            result[num - 1] = stop
        return result

    return linspace


# Shapes.


@intrinsic  # type: ignore[misc]
def view_of(typing: Any, array: Any, shape: Any, strides: Any) -> Any:
    """Return a view of an array's memory with another shape and other strides."""
    layout = "C" if array.layout == "C" else "A"
    result = types.Array(array.dtype, shape.count, layout, not array.mutable, aligned=array.aligned)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        old = arrayobj.make_array(array)(context, builder, arguments[0])
        new = arrayobj.make_array(result)(context, builder)
        arrayobj.populate_array(
            new,
            data=old.data,
            shape=cgutils.unpack_tuple(builder, arguments[1]),
            strides=cgutils.unpack_tuple(builder, arguments[2]),
            itemsize=old.itemsize,
            meminfo=old.meminfo,
            parent=old.parent,
        )
        return arrayobj.impl_ret_borrowed(context, builder, result, new._getvalue())

    return result(array, shape, strides), generate


@plain
def _sizes(wanted: Any, count: Any) -> Any:
    """Return the size that replaces -1 in a shape; 0 if there is no -1."""
    known = 1
    open_ones = 0
    for each in wanted:
        if each < 0:
            open_ones += 1
        else:
            known *= each
    if open_ones > 1 or (open_ones == 1 and (known == 0 or count % known != 0)):
        raise ValueError("cannot reshape an array into that shape")
    if open_ones == 0 and known != count:
        raise ValueError("cannot reshape an array into that shape")
    return count // known if open_ones else 0


@compiled_as(own.rtcf_reshape, arrays=("a",))
def _reshape(a: Any, newshape: Any) -> Any:
    needs(a, "np.reshape", _ALL)
    if isinstance(newshape, types.Integer):
        return lambda a, newshape: own.rtcf_reshape(a, (newshape,))
    if not isinstance(newshape, types.UniTuple) or newshape.count > 3:
        raise TypingError(f"RTCF:np.reshape to {words(newshape)}:give one to three sizes")
    if a.layout == "C":

        def view(a: Any, newshape: Any) -> Any:
            shape = _filled(newshape, _sizes(newshape, a.size))
            return view_of(a, shape, _strides(shape, a.itemsize))

        return view
    if a.ndim == 3 or (a.ndim == 2 and newshape.count == 3):
        # NumPy returns a view for some strides, and a copy for others.
        raise TypingError(f"RTCF:np.reshape of a part of {words(a)}:copy it first: x.copy()")

    def reshape(a: Any, newshape: Any) -> Any:
        shape = _filled(newshape, _sizes(newshape, a.size))
        step = _only_step(a)
        if step != 0:
            return view_of(a, shape, _strides(shape, step))
        if _is_same(a, shape):
            return view_of(a, shape, _same_strides(a, shape))
        copy = own.rtcf_array(a, None)
        return view_of(any_layout(copy), shape, _strides(shape, a.itemsize))

    return reshape


@compiled_as(own.rtcf_new_axes)
def _new_axes(a: Any, axes: Any) -> Any:
    needs(a, "a new axis", _ALL)
    old = sum(isinstance(each, types.Boolean) for each in axes.types)
    if old > a.ndim:
        raise TypingError(f"RTCF:{old} indices of {words(a)}:write one for each dimension")
    # ... stands for the other old axes; without it, they are at the end.
    kinds = list(axes.types)
    if not any(isinstance(each, types.Integer) for each in kinds):
        kinds.append(types.int64)
    place, shape, strides = 0, "", ""
    for each in kinds:
        if isinstance(each, types.NoneType):
            shape, strides = f"{shape}1, ", f"{strides}0, "
            continue
        for _ in range(1 if isinstance(each, types.Boolean) else a.ndim - old):
            shape, strides = f"{shape}a.shape[{place}], ", f"{strides}a.strides[{place}], "
            place += 1
    scope = {"view_of": view_of}
    exec(f"def new_axes(a, axes):\n    return view_of(a, ({shape}), ({strides}))\n", scope)
    return scope["new_axes"]


def _filled(shape: Any, rest: Any) -> Any:
    raise NotImplementedError


@compiled_as(_filled)
def _filled_in(shape: Any, rest: Any) -> Any:
    if shape.count == 1:
        return lambda shape, rest: (rest if shape[0] < 0 else shape[0],)
    if shape.count == 3:
        return lambda shape, rest: (
            rest if shape[0] < 0 else shape[0],
            rest if shape[1] < 0 else shape[1],
            rest if shape[2] < 0 else shape[2],
        )
    return lambda shape, rest: (
        rest if shape[0] < 0 else shape[0],
        rest if shape[1] < 0 else shape[1],
    )


def _strides(shape: Any, step: Any) -> Any:
    raise NotImplementedError


@compiled_as(_strides)
def _strides_of(shape: Any, step: Any) -> Any:
    if shape.count == 1:
        return lambda shape, step: (step,)
    if shape.count == 3:
        return lambda shape, step: (step * shape[1] * shape[2], step * shape[2], step)
    return lambda shape, step: (step * shape[1], step)


def _only_step(a: Any) -> Any:
    raise NotImplementedError


@compiled_as(_only_step)
def _step_between(a: Any) -> Any:
    """Return the distance between elements, bytes, if it is the same for all, else 0."""
    if a.ndim == 1:
        return lambda a: a.strides[0] if a.shape[0] > 1 else a.itemsize

    def step(a: Any) -> Any:
        if a.size <= 1:
            return a.itemsize
        if a.shape[1] == 1:
            return a.strides[0]
        if a.shape[0] == 1 or a.strides[0] == a.shape[1] * a.strides[1]:
            return a.strides[1]
        return 0

    return step


def _is_same(a: Any, shape: Any) -> Any:
    raise NotImplementedError


@compiled_as(_is_same)
def _has_that_shape(a: Any, shape: Any) -> Any:
    if a.ndim == 2 and shape.count == 2:
        return lambda a, shape: a.shape == shape
    return lambda a, shape: False


def _same_strides(a: Any, shape: Any) -> Any:
    raise NotImplementedError


@compiled_as(_same_strides)
def _strides_as_before(a: Any, shape: Any) -> Any:
    if a.ndim == 2 and shape.count == 2:
        return lambda a, shape: a.strides
    return lambda a, shape: shape


@intrinsic  # type: ignore[misc]
def any_layout(typing: Any, array: Any) -> Any:
    """Return an array with the type for any layout."""
    result = types.Array(array.dtype, array.ndim, "A", not array.mutable, aligned=array.aligned)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return arrayobj.impl_ret_borrowed(context, builder, result, arguments[0])

    return result(array), generate


@compiled_as(own.rtcf_ravel, arrays=("a",))
def _ravel(a: Any) -> Any:
    needs(a, "np.ravel", _ALL)
    if a.ndim == 1:
        return lambda a: own.rtcf_contiguous(a)
    if a.ndim == 3:
        return lambda a: view_of(own.rtcf_contiguous(a), (a.size,), (a.itemsize,))
    return lambda a: own.rtcf_reshape(own.rtcf_contiguous(a), (a.size,))


@plain
def _is_contiguous(a: Any) -> Any:
    """Tell whether the elements lie in order, without gaps; axes of one element do not count."""
    size = a.itemsize
    for axis in range(a.ndim - 1, -1, -1):
        if a.shape[axis] != 1 and a.strides[axis] != size:
            return False
        size *= a.shape[axis]
    return True


@compiled_as(own.rtcf_contiguous, arrays=("a",))
def _contiguous(a: Any) -> Any:
    needs(a, "np.ascontiguousarray", _ALL)
    if a.layout == "C":
        return lambda a: a
    return lambda a: any_layout(a) if _is_contiguous(a) else any_layout(a.copy())


@compiled_as(own.rtcf_flatten, arrays=("a",))
def _flatten(a: Any) -> Any:
    needs(a, "flatten", _ALL)
    if a.ndim == 1:
        return lambda a: own.rtcf_array(a, None)
    if a.ndim == 3:
        return lambda a: own.rtcf_array(own.rtcf_ravel(a), None)

    def flatten(a: Any) -> Any:
        result = np.empty(a.size, a.dtype)
        for i in range(a.shape[0]):
            for j in range(a.shape[1]):
                result[i * a.shape[1] + j] = a[i, j]
        return result

    return flatten


def _joined(name: str, parts: Any, along: Any) -> Any:
    """Return a function that joins arrays.

    `along`: None joins vectors; 0 joins matrices below each other, 1 side by side, with vectors as
    rows or columns.
    """
    result = np.result_type(*(dtype_of(each) for each in parts))
    count = len(parts)
    # numba indexes a tuple of several types only by constants.
    lines = [f"def joined({name}):"]
    for k in range(count):
        lines.append(f"    p{k} = {name}[{k}]")
    vector = along is None
    if vector:
        lines.append(
            f"    result = np.empty({' + '.join(f'p{k}.shape[0]' for k in range(count))}, wanted)"
        )
    else:
        for k, each in enumerate(parts):
            if each.ndim == 1:
                size = f"p{k}.shape[0]"
                lines.append(f"    n{k}, m{k} = " + (f"1, {size}" if along == 0 else f"{size}, 1"))
            else:
                lines.append(f"    n{k}, m{k} = p{k}.shape")
        other = "m" if along == 0 else "n"
        if count > 1:
            differ = " or ".join(f"{other}{k} != {other}0" for k in range(1, count))
            lines += [f"    if {differ}:", '        raise ValueError("arrays to join do not fit")']
        grow = "n" if along == 0 else "m"
        total = " + ".join(f"{grow}{k}" for k in range(count))
        shape = f"({total}, m0)" if along == 0 else f"(n0, {total})"
        lines.append(f"    result = np.empty({shape}, wanted)")
    lines.append("    at = 0")
    for k, each in enumerate(parts):
        if vector:
            lines += [
                f"    for i in range(p{k}.shape[0]):",
                f"        result[at + i] = p{k}[i]",
                f"    at += p{k}.shape[0]",
            ]
            continue
        place = "at + i, j" if along == 0 else "i, at + j"
        element = ("j" if along == 0 else "i") if each.ndim == 1 else "i, j"
        lines += [
            f"    for i in range(n{k}):",
            f"        for j in range(m{k}):",
            f"            result[{place}] = p{k}[{element}]",
            f"    at += {'n' if along == 0 else 'm'}{k}",
        ]
    lines.append("    return result")
    return _function("\n".join(lines), "joined", {"np": np, "wanted": result})


def _function(text: str, name: str, scope: dict[str, Any]) -> Any:
    exec(text, scope)
    return scope[name]


def _arrays_of(name: str, given: Any, what: str, helper: str, numbers: bool, rest: str = "") -> Any:
    """Return None if a tuple has only arrays, else a function that converts its rows and numbers to
    arrays and calls the helper again.
    """
    if isinstance(given, types.Array) and given.ndim > 1:
        raise TypingError(f"RTCF:{what} of one matrix:give it several arrays")
    if not isinstance(given, types.BaseTuple) or not given.count:
        raise TypingError(f"RTCF:{what} of {words(given)}:give it a tuple of arrays")
    if all(isinstance(each, types.Array) and each.ndim in (1, 2) for each in given.types):
        return None
    parts = []
    for k, each in enumerate(given.types):
        if isinstance(each, types.Array) and each.ndim in (1, 2):
            parts.append(f"{name}[{k}]")
        elif isinstance(each, types.BaseTuple):
            parts.append(f"array({name}[{k}], None)")
        elif isinstance(each, _Numbers) and numbers:
            parts.append(f"array(({name}[{k}],), None)")
        else:
            raise TypingError(f"RTCF:{what} of {words(each)}:give it vectors or matrices")
    more = "".join(f", {each}" for each in rest.split(", ") if each)
    text = f"def again({name}{more}):\n    return helper(({', '.join(parts)},){more})\n"
    scope = {"array": own.rtcf_array, "helper": getattr(own, helper)}
    return _function(text, "again", scope)


@compiled_as(own.rtcf_concatenate)
def _concatenate(arrays: Any, axis: Any) -> Any:
    again = _arrays_of("arrays", arrays, "np.concatenate", "rtcf_concatenate", False, "axis")
    if again is not None:
        return again
    dimensions = {each.ndim for each in arrays.types}
    if len(dimensions) != 1:
        raise TypingError("RTCF:np.concatenate of vectors and matrices:use np.vstack or np.hstack")
    if dimensions == {1}:
        vectors = plain(_joined("arrays", arrays.types, None))

        def one_axis(arrays: Any, axis: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("np.concatenate: axis is out of bounds")
            return vectors(arrays)

        return one_axis
    below = plain(_joined("arrays", arrays.types, 0))
    beside = plain(_joined("arrays", arrays.types, 1))

    def concatenate(arrays: Any, axis: Any) -> Any:
        if axis == 0 or axis == -2:
            return below(arrays)
        if axis != 1 and axis != -1:
            raise ValueError("np.concatenate: axis is out of bounds")
        return beside(arrays)

    return concatenate


@compiled_as(own.rtcf_hstack)
def _hstack(tup: Any) -> Any:
    again = _arrays_of("tup", tup, "np.hstack", "rtcf_hstack", True)
    if again is not None:
        return again
    dimensions = {each.ndim for each in tup.types}
    if len(dimensions) != 1:
        raise TypingError("RTCF:np.hstack of vectors and matrices:use np.column_stack")
    return _joined("tup", tup.types, None if dimensions == {1} else 1)


@compiled_as(own.rtcf_vstack)
def _vstack(tup: Any) -> Any:
    again = _arrays_of("tup", tup, "np.vstack", "rtcf_vstack", True)
    return _joined("tup", tup.types, 0) if again is None else again


@compiled_as(own.rtcf_column_stack)
def _column_stack(tup: Any) -> Any:
    again = _arrays_of("tup", tup, "np.column_stack", "rtcf_column_stack", True)
    return _joined("tup", tup.types, 1) if again is None else again


@compiled_as(own.rtcf_stack)
def _stack(arrays: Any, axis: Any) -> Any:
    again = _arrays_of("arrays", arrays, "np.stack", "rtcf_stack", False, "axis")
    if again is not None:
        return again
    if all(each.ndim == 2 for each in arrays.types):
        return _stacked_matrices(arrays.types)
    if any(each.ndim != 1 for each in arrays.types):
        raise TypingError("RTCF:np.stack of vectors and matrices:give all the same dimensions")
    below = plain(_joined("arrays", arrays.types, 0))
    beside = plain(_joined("arrays", arrays.types, 1))

    def stack(arrays: Any, axis: Any) -> Any:
        if axis == 0 or axis == -2:
            return below(arrays)
        if axis != 1 and axis != -1:
            raise ValueError("np.stack: axis is out of bounds")
        return beside(arrays)

    return stack


def _stacked_matrices(parts: Any) -> Any:
    """Return the function that makes an array of three dimensions from matrices."""
    result = np.result_type(*(dtype_of(each) for each in parts))
    count = len(parts)
    places = {0: "{k}", 1: ":, {k}", 2: ":, :, {k}"}
    shapes = {0: f"({count}, n, m)", 1: f"(n, {count}, m)", 2: f"(n, m, {count})"}
    lines = ["def stacked(arrays, axis):", "    n, m = arrays[0].shape"]
    for k in range(1, count):
        lines += [
            f"    if arrays[{k}].shape != arrays[0].shape:",
            '        raise ValueError("arrays to join do not fit")',
        ]
    for axis in range(3):
        lines += [
            f"    if axis == {axis} or axis == {axis - 3}:",
            f"        result = np.empty({shapes[axis]}, wanted)",
            *(f"        assign(result[{places[axis].format(k=k)}], arrays[{k}])"
              for k in range(count)),
            "        return result",
        ]  # fmt: skip
    lines.append('    raise ValueError("np.stack: axis is out of bounds")')
    scope = {"np": np, "wanted": result, "assign": helpers.rtcf_assign}
    return _function("\n".join(lines), "stacked", scope)


@compiled_as(own.rtcf_roll, arrays=("a",))
def _roll(a: Any, shift: Any, axis: Any) -> Any:
    needs(a, "np.roll")
    if not isinstance(shift, types.Integer | types.Boolean):
        raise TypingError(f"RTCF:np.roll by {words(shift)}:give it an int")
    if a.ndim == 1 and not isinstance(axis, types.NoneType):

        def one_axis(a: Any, shift: Any, axis: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            return own.rtcf_roll(a, shift, None)

        return one_axis
    if a.ndim == 1:

        def roll(a: Any, shift: Any, axis: Any) -> Any:
            n = a.shape[0]
            result = np.empty(n, a.dtype)
            for i in range(n):
                result[(i + shift) % n] = a[i]
            return result

        return roll
    if isinstance(axis, types.NoneType):
        return lambda a, shift, axis: own.rtcf_reshape(
            own.rtcf_roll(own.rtcf_ravel(a), shift, None), a.shape
        )

    def along(a: Any, shift: Any, axis: Any) -> Any:
        if not -2 <= axis <= 1:
            raise ValueError("axis is out of bounds")
        by_rows = axis == 0 or axis == -2
        n, m = a.shape
        result = np.empty(a.shape, a.dtype)
        for i in range(n):
            for j in range(m):
                if by_rows:
                    result[(i + shift) % n, j] = a[i, j]
                else:
                    result[i, (j + shift) % m] = a[i, j]
        return result

    return along


@compiled_as(own.rtcf_flip, arrays=("m",))
def _flip(m: Any, axis: Any) -> Any:
    needs(m, "np.flip", _ALL)
    is_all = isinstance(axis, types.NoneType)
    if m.ndim == 1:
        if is_all:
            return lambda m, axis: m[::-1]

        def one_axis(m: Any, axis: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            return m[::-1]

        return one_axis
    if is_all:
        if m.ndim == 3:
            return lambda m, axis: m[::-1, ::-1, ::-1]
        return lambda m, axis: m[::-1, ::-1]
    if m.ndim == 3:
        raise TypingError("RTCF:np.flip of three dimensions along an axis:write x[:, ::-1]")

    def flip(m: Any, axis: Any) -> Any:
        if axis == 0 or axis == -2:
            return m[::-1, :]
        if axis != 1 and axis != -1:
            raise ValueError("axis is out of bounds")
        return m[:, ::-1]

    return flip


@compiled_as(own.rtcf_append, arrays=("arr", "values"))
def _append(arr: Any, values: Any) -> Any:
    needs(arr, "np.append", (1,))
    dtype = np.result_type(dtype_of(arr), dtype_of(values))
    if not isinstance(values, types.Array):

        def appended(arr: Any, values: Any) -> Any:
            n = arr.shape[0]
            result = np.empty(n + 1, dtype)
            for i in range(n):
                result[i] = arr[i]
            result[n] = values
            return result

        return appended
    needs(values, "np.append", (1,))
    return lambda arr, values: own.rtcf_concatenate((arr, values), 0)


@compiled_as(own.rtcf_tile, arrays=("A",))
def _tile(A: Any, reps: Any) -> Any:
    needs(A, "np.tile", (1,))
    if not isinstance(reps, types.Integer):
        raise TypingError(f"RTCF:np.tile by {words(reps)}:give it an int")

    def tile(A: Any, reps: Any) -> Any:
        n = A.shape[0]
        result = np.empty(n * max(reps, 0), A.dtype)
        for i in range(result.shape[0]):
            result[i] = A[i % n]
        return result

    return tile


@compiled_as(own.rtcf_repeat, arrays=("a",))
def _repeat(a: Any, repeats: Any) -> Any:
    needs(a, "np.repeat", (1,))
    if not isinstance(repeats, types.Integer):
        raise TypingError(f"RTCF:np.repeat by {words(repeats)}:give it an int")

    def repeat(a: Any, repeats: Any) -> Any:
        if repeats < 0:
            raise ValueError("repeats may not contain negative values.")
        result = np.empty(a.shape[0] * repeats, a.dtype)
        for i in range(result.shape[0]):
            result[i] = a[i // repeats]
        return result

    return repeat


@compiled_as(own.rtcf_kron, arrays=("a", "b"))
def _kron(a: Any, b: Any) -> Any:
    needs(a, "np.kron", (2,))
    needs(b, "np.kron", (2,))
    dtype = np.result_type(dtype_of(a), dtype_of(b))

    def kron(a: Any, b: Any) -> Any:
        rows, columns = b.shape
        result = np.empty((a.shape[0] * rows, a.shape[1] * columns), dtype)
        for i in range(result.shape[0]):
            for j in range(result.shape[1]):
                result[i, j] = a[i // rows, j // columns] * b[i % rows, j % columns]
        return result

    return kron


@compiled_as(own.rtcf_diff, arrays=("a", "prepend", "append"), refused="b")
def _diff(a: Any, n: Any, axis: Any, prepend: Any, append: Any) -> Any:
    needs(a, "np.diff", _ALL)
    ends = [each for each in (prepend, append) if not isinstance(each, types.NoneType)]
    if ends and a.ndim > 1:
        raise TypingError("RTCF:np.diff of a matrix with prepend or append:use np.hstack before")
    if ends:
        given = (("prepend", prepend), ("a", a), ("append", append))
        parts = [
            f"array(({name},), None)" if isinstance(each, _Numbers) else name
            for name, each in given
            if not isinstance(each, types.NoneType)
        ]
        text = f"diff(joined(({', '.join(parts)}), 0), n, axis, None, None)"
        scope = {"array": own.rtcf_array, "joined": own.rtcf_concatenate, "diff": own.rtcf_diff}
        return _function(
            f"def again(a, n, axis, prepend, append):\n    return {text}\n", "again", scope
        )
    if a.ndim == 1:

        def vector(a: Any, n: Any, axis: Any, prepend: Any, append: Any) -> Any:
            _require_order(n)
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            result = a[1:] - a[:-1]
            for _ in range(n - 1):
                result = result[1:] - result[:-1]
            return result

        return vector

    if a.ndim == 3:

        def block(a: Any, n: Any, axis: Any, prepend: Any, append: Any) -> Any:
            if n != 1 or (axis != 2 and axis != -1):
                raise ValueError("np.diff of three dimensions: once, along the last axis")
            return a[:, :, 1:] - a[:, :, :-1]

        return block

    def matrix(a: Any, n: Any, axis: Any, prepend: Any, append: Any) -> Any:
        _require_order(n)
        if axis == 0 or axis == -2:
            result = a[1:] - a[:-1]
            for _ in range(n - 1):
                result = result[1:] - result[:-1]
            return result
        if axis != 1 and axis != -1:
            raise ValueError("axis is out of bounds")
        result = a[:, 1:] - a[:, :-1]
        for _ in range(n - 1):
            result = result[:, 1:] - result[:, :-1]
        return result

    return matrix


@plain
def _require_order(n: Any) -> None:
    if n < 1:
        raise ValueError("np.diff: the order is 1 or more")


@compiled_as(own.rtcf_real)
def _real(val: Any) -> Any:
    return lambda val: val.real


@compiled_as(own.rtcf_imag)
def _imag(val: Any) -> Any:
    return lambda val: val.imag


# Reductions.


@plain
def _pairwise(a: Any, begin: Any, n: Any, result: Any) -> Any:
    """Return the sum of up to 128 elements of a vector, in NumPy's order."""
    if n < 8:
        for i in range(n):
            result += a[begin + i]
        return result
    r0, r1, r2, r3 = a[begin], a[begin + 1], a[begin + 2], a[begin + 3]
    r4, r5, r6, r7 = a[begin + 4], a[begin + 5], a[begin + 6], a[begin + 7]
    i = 8
    while i < n - n % 8:
        r0 += a[begin + i]
        r1 += a[begin + i + 1]
        r2 += a[begin + i + 2]
        r3 += a[begin + i + 3]
        r4 += a[begin + i + 4]
        r5 += a[begin + i + 5]
        r6 += a[begin + i + 6]
        r7 += a[begin + i + 7]
        i += 8
    total = ((r0 + r1) + (r2 + r3)) + ((r4 + r5) + (r6 + r7))
    while i < n:
        total += a[begin + i]
        i += 1
    return total


@plain
def _halves(a: Any, begin: Any, n: Any, zero: Any) -> Any:
    """Return the sum of a longer vector: halve it repeatedly and add the halves, as NumPy does."""
    if n <= _LONG:
        return _pairwise(a, begin, n, zero)
    # Stacks of parts and of sums, with depths, replace the recursion of NumPy.
    sums = np.empty(64, a.dtype)
    begins, sizes, depths = np.empty(64, np.int64), np.empty(64, np.int64), np.empty(64, np.int64)
    done_at = np.empty(64, np.int64)
    waiting, done = 1, 0
    begins[0], sizes[0], depths[0] = begin, n, 0
    while waiting > 0:
        waiting -= 1
        here, size, depth = begins[waiting], sizes[waiting], depths[waiting]
        if size > _LONG:
            half = size // 2
            half -= half % 8
            begins[waiting], sizes[waiting], depths[waiting] = here + half, size - half, depth + 1
            waiting += 1
            begins[waiting], sizes[waiting], depths[waiting] = here, half, depth + 1
            waiting += 1
            continue
        total = _pairwise(a, here, size, zero)
        # This is the second half if the sum of the first half has the same depth.
        while done > 0 and done_at[done - 1] == depth:
            done -= 1
            total = sums[done] + total
            depth -= 1
        sums[done], done_at[done] = total, depth
        done += 1
    return sums[0]


@plain
def _complex_sum(a: Any) -> Any:
    """Return the sum of a vector; of up to 64 elements in NumPy's order."""
    n, result = a.shape[0], 0.0j
    if n < 4:
        for i in range(n):
            result += a[i]
        return result
    r0, r1, r2, r3 = a[0], a[1], a[2], a[3]
    for i in range(4, n - n % 4, 4):
        r0 += a[i]
        r1 += a[i + 1]
        r2 += a[i + 2]
        r3 += a[i + 3]
    result += (r0 + r1) + (r2 + r3)
    for i in range(n - n % 4, n):
        result += a[i]
    return result


def _summed(a: Any) -> Any:
    """Return the sum of a vector."""
    raise NotImplementedError


@compiled_as(_summed)
def _sum_of(a: Any) -> Any:
    if isinstance(a.dtype, types.Complex):
        return lambda a: _complex_sum(a)
    if isinstance(a.dtype, types.Float):
        zero = dtype_of(a).type(0)
        return lambda a: zero + _halves(a, 0, a.shape[0], zero)

    def unsigned(a: Any) -> Any:
        result = np.uint64(0)
        for i in range(a.shape[0]):
            result += np.uint64(a[i])
        return result

    def wide(a: Any) -> Any:
        result = np.int64(0)
        for i in range(a.shape[0]):
            result += np.int64(a[i])
        return result

    return unsigned if dtype_of(a).kind == "u" else wide


@plain
def _summed_in_order(a: Any) -> Any:
    """Return the sum of a matrix column, which NumPy adds row by row."""
    if a.shape[0] == 0:
        return _summed(a)
    result = a[0] + _summed(a[:0])
    for i in range(1, a.shape[0]):
        result += a[i]
    return result


@plain
def _largest(a: Any) -> Any:
    return a[_place_of_largest(a)]


@plain
def _smallest(a: Any) -> Any:
    return a[_place_of_smallest(a)]


@plain
def _place_of_largest(a: Any) -> Any:
    if a.shape[0] == 0:
        raise ValueError("the largest element of an empty array")
    place = 0
    for i in range(a.shape[0]):
        if a[i] != a[i]:
            return i
        if a[i] > a[place]:
            place = i
    return place


@plain
def _place_of_smallest(a: Any) -> Any:
    if a.shape[0] == 0:
        raise ValueError("the smallest element of an empty array")
    place = 0
    for i in range(a.shape[0]):
        if a[i] != a[i]:
            return i
        if a[i] < a[place]:
            place = i
    return place


@plain
def _is_any(a: Any) -> Any:
    found = False
    for i in range(a.shape[0]):
        if a[i]:
            found = True
    return found


@plain
def _is_all(a: Any) -> Any:
    found = True
    for i in range(a.shape[0]):
        if not a[i]:
            found = False
    return found


def _multiplied(a: Any) -> Any:
    raise NotImplementedError


@compiled_as(_multiplied)
def _product_of(a: Any) -> Any:
    kind = dtype_of(a)
    wide = kind if kind.kind == "f" else np.dtype(np.uint64 if kind.kind == "u" else np.int64)
    one = wide.type(1)
    convert = wide.type

    def product(a: Any) -> Any:
        result = one
        for i in range(a.shape[0]):
            result = convert(result * convert(a[i]))
        return result

    return product


def _reduction(
    helper: Any, name: str, whole: Any, column: Any = None, result: Any = None, keeps: bool = False
) -> None:
    """Register a reduction of an array, or along one axis.

    `whole`: reduces a vector. `column`: reduces along an axis other than the last (default:
    `whole`).
    `result`: returns the element type of the result for that of the array.
    """
    column = column or whole

    def choose(a: Any, axis: Any, keepdims: Any) -> Any:
        if isinstance(axis, types.Float | types.Array):
            remedy = "use max(a, b) of numbers, np.maximum(a, b) of arrays"
            raise TypingError(f"RTCF:{name} with {words(axis)} as its axis:{remedy}")
        if isinstance(a, _Numbers):
            return lambda a, axis, keepdims: whole(own.rtcf_array((a,), None))
        needs(a, name, _ALL)
        if isinstance(axis, types.BaseTuple):
            raise TypingError(f"RTCF:{name} along several axes:leave axis out")
        dtype = dtype_of(a) if result is None else result(dtype_of(a))
        stays = not isinstance(keepdims, types.NoneType)
        if a.ndim == 1:
            if stays:
                return lambda a, axis, keepdims: own.rtcf_array((whole(a),), None)
            if isinstance(axis, types.NoneType):
                return lambda a, axis, keepdims: whole(a)

            def one_axis(a: Any, axis: Any, keepdims: Any) -> Any:
                if axis != 0 and axis != -1:
                    raise ValueError("axis is out of bounds")
                return whole(a)

            return one_axis
        if isinstance(axis, types.NoneType):
            if stays and a.ndim == 3:
                return lambda a, axis, keepdims: own.rtcf_array(
                    (((whole(own.rtcf_ravel(a)),),),), None
                )
            if stays:
                return lambda a, axis, keepdims: own.rtcf_array(
                    ((whole(own.rtcf_ravel(a)),),), None
                )
            return lambda a, axis, keepdims: whole(own.rtcf_ravel(a))
        if a.ndim == 3:
            return _along_three(whole, column, dtype, stays)

        def along(a: Any, axis: Any, keepdims: Any) -> Any:
            if axis == 1 or axis == -1:
                found = np.empty(a.shape[0], dtype)
                for i in range(a.shape[0]):
                    found[i] = whole(a[i])
            elif axis == 0 or axis == -2:
                found = np.empty(a.shape[1], dtype)
                for j in range(a.shape[1]):
                    if a.shape[1] == 1:
                        found[j] = whole(a[:, j])
                    else:
                        found[j] = column(a[:, j])
            else:
                raise ValueError("axis is out of bounds")
            return found

        if not stays:
            return along
        plainly = plain(along)

        def kept(a: Any, axis: Any, keepdims: Any) -> Any:
            found = plainly(a, axis, None)
            if axis == 1 or axis == -1:
                return own.rtcf_reshape(found, (found.shape[0], 1))
            return own.rtcf_reshape(found, (1, found.shape[0]))

        return kept

    if keeps:
        compiled_as(helper, arrays=("a",))(choose)
        return

    def without(a: Any, axis: Any) -> Any:
        chosen = choose(a, axis, types.none)
        return _with_two(plain(chosen))

    compiled_as(helper, arrays=("a",))(without)


def _along_three(whole: Any, column: Any, dtype: Any, stays: bool) -> Any:
    """Return the reduction of an array of three dimensions along an axis."""

    def along(a: Any, axis: Any, keepdims: Any) -> Any:
        # NumPy reduces the last axis of more than one element as a vector.
        if axis == 2 or axis == -1:
            found = np.empty((a.shape[0], a.shape[1]), dtype)
            for i in range(a.shape[0]):
                for j in range(a.shape[1]):
                    found[i, j] = whole(a[i, j])
        elif axis == 1 or axis == -2:
            found = np.empty((a.shape[0], a.shape[2]), dtype)
            for i in range(a.shape[0]):
                for k in range(a.shape[2]):
                    if a.shape[2] == 1:
                        found[i, k] = whole(a[i, :, k])
                    else:
                        found[i, k] = column(a[i, :, k])
        elif axis == 0 or axis == -3:
            found = np.empty((a.shape[1], a.shape[2]), dtype)
            for j in range(a.shape[1]):
                for k in range(a.shape[2]):
                    if a.shape[1] * a.shape[2] == 1:
                        found[j, k] = whole(a[:, j, k])
                    else:
                        found[j, k] = column(a[:, j, k])
        else:
            raise ValueError("axis is out of bounds")
        return found

    if not stays:
        return along
    plainly = plain(along)

    def kept(a: Any, axis: Any, keepdims: Any) -> Any:
        found = plainly(a, axis, None)
        n, m = found.shape
        if axis == 2 or axis == -1:
            return own.rtcf_reshape(found, (n, m, 1))
        if axis == 1 or axis == -2:
            return own.rtcf_reshape(found, (n, 1, m))
        return own.rtcf_reshape(found, (1, n, m))

    return kept


def _with_two(function: Any) -> Any:
    return lambda a, axis: function(a, axis, None)


def _wide(dtype: Any) -> Any:
    """Return the type of a sum."""
    if dtype.kind in "fc":
        return dtype
    return np.dtype(np.uint64) if dtype.kind == "u" else np.dtype(np.int64)


_reduction(own.rtcf_sum, "np.sum", _summed, _summed_in_order, _wide, keeps=True)
_reduction(own.rtcf_max, "np.max", _largest, keeps=True)
_reduction(own.rtcf_min, "np.min", _smallest, keeps=True)
_reduction(own.rtcf_prod, "np.prod", _multiplied, result=_wide)
_reduction(own.rtcf_argmax, "np.argmax", _place_of_largest, result=lambda _: np.dtype(np.int64))
_reduction(own.rtcf_argmin, "np.argmin", _place_of_smallest, result=lambda _: np.dtype(np.int64))
_reduction(own.rtcf_any, "np.any", _is_any, result=lambda _: np.dtype(np.bool_))
_reduction(own.rtcf_all, "np.all", _is_all, result=lambda _: np.dtype(np.bool_))


@compiled_as(own.rtcf_ptp, arrays=("a",))
def _ptp(a: Any, axis: Any) -> Any:
    needs(a, "np.ptp", _ALL)
    if dtype_of(a).kind == "b":
        raise TypingError("RTCF:np.ptp of bools:convert them: x.astype(int)")
    return lambda a, axis: _minus(own.rtcf_max(a, axis, None), own.rtcf_min(a, axis, None))


def as_floats(a: Any) -> Any:
    """Return an array as floats, as it is if possible."""
    raise NotImplementedError


@compiled_as(as_floats)
def _floats_of(a: Any) -> Any:
    if isinstance(a.dtype, types.Float | types.Complex):
        return lambda a: a
    return lambda a: own.rtcf_array(a, np.float64)


def _elements(a: Any, axis: Any) -> Any:
    raise NotImplementedError


@compiled_as(_elements)
def _elements_along(a: Any, axis: Any) -> Any:
    """Return the number of elements in one mean."""
    if isinstance(axis, types.NoneType):
        return lambda a, axis: a.size
    return lambda a, axis: a.shape[axis]


@compiled_as(own.rtcf_mean, arrays=("a",))
def _mean(a: Any, axis: Any, keepdims: Any) -> Any:
    if isinstance(a, _Numbers):
        return lambda a, axis, keepdims: helpers.rtcf_to_float(a)
    needs(a, "np.mean", _ALL)
    return lambda a, axis, keepdims: _divided(
        own.rtcf_sum(as_floats(a), axis, keepdims), _elements(a, axis)
    )


def _divided(total: Any, count: Any) -> Any:
    raise NotImplementedError


@compiled_as(_divided)
def _divided_by(total: Any, count: Any) -> Any:
    """Divide a sum, or sums, by a number of elements; floats keep their size."""
    if dtype_of(total) != np.float32:
        return lambda total, count: total / count
    # Rounding the quotient of 64 bits gives the correct quotient of 32 bits.
    if isinstance(total, types.Array):
        return lambda total, count: own.rtcf_array(total / count, np.float32)
    return lambda total, count: np.float32(total / count)


@compiled_as(own.rtcf_var, arrays=("a",))
def _var(a: Any, axis: Any, ddof: Any) -> Any:
    needs(a, "np.var", _ALL)

    def var(a: Any, axis: Any, ddof: Any) -> Any:
        values = as_floats(a)
        mean = _kept_mean(values, axis)
        far = values - mean
        return _divided(own.rtcf_sum(far * far, axis, None), max(_elements(a, axis) - ddof, 0))

    return var


def _kept_mean(a: Any, axis: Any) -> Any:
    raise NotImplementedError


@compiled_as(_kept_mean)
def _mean_to_subtract(a: Any, axis: Any) -> Any:
    if isinstance(axis, types.NoneType) or a.ndim == 1:
        return lambda a, axis: own.rtcf_mean(a, axis, None)
    return lambda a, axis: own.rtcf_mean(a, axis, True)


@compiled_as(own.rtcf_std, arrays=("a",))
def _std(a: Any, axis: Any, ddof: Any) -> Any:
    return lambda a, axis, ddof: np.sqrt(own.rtcf_var(a, axis, ddof))


@compiled_as(own.rtcf_count_nonzero, arrays=("a",))
def _count_nonzero(a: Any, axis: Any) -> Any:
    needs(a, "np.count_nonzero", _ALL)
    if not isinstance(axis, types.NoneType):
        return lambda a, axis: own.rtcf_sum(a != 0, axis, None)

    def count(a: Any, axis: Any) -> Any:
        found = 0
        row = own.rtcf_ravel(a)
        for i in range(row.shape[0]):
            if row[i]:
                found += 1
        return found

    return count


@compiled_as(own.rtcf_median, arrays=("a",))
def _median(a: Any, axis: Any) -> Any:
    needs(a, "np.median", _ALL if isinstance(axis, types.NoneType) else (1, 2))
    to = np.float32 if dtype_of(a) == np.float32 else np.float64

    @plain
    def of_vector(a: Any) -> Any:
        ordered = own.rtcf_sort(as_floats(a), -1)
        n = ordered.shape[0]
        if n == 0 or ordered[n - 1] != ordered[n - 1]:
            return to(np.nan)
        if n % 2:
            return to(ordered[n // 2] + 0.0)
        return to((ordered[n // 2 - 1] + ordered[n // 2]) / 2.0)

    if isinstance(axis, types.NoneType):
        return lambda a, axis: of_vector(own.rtcf_ravel(a))
    if a.ndim == 1:

        def one_axis(a: Any, axis: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            return of_vector(a)

        return one_axis

    def along(a: Any, axis: Any) -> Any:
        if axis == 1 or axis == -1:
            found = np.empty(a.shape[0], to)
            for i in range(a.shape[0]):
                found[i] = of_vector(a[i])
        elif axis == 0 or axis == -2:
            found = np.empty(a.shape[1], to)
            for j in range(a.shape[1]):
                found[j] = of_vector(a[:, j])
        else:
            raise ValueError("axis is out of bounds")
        return found

    return along


@compiled_as(own.rtcf_trace, arrays=("a",))
def _trace(a: Any, offset: Any) -> Any:
    needs(a, "np.trace", (2,))
    return lambda a, offset: own.rtcf_sum(own.rtcf_diag(a, offset), None, None)


def _running(helper: Any, name: str, step: Any) -> None:
    """Register a cumulative sum or product."""

    @compiled_as(helper, arrays=("a",))
    def _run(a: Any, axis: Any) -> Any:
        needs(a, name, _ALL if isinstance(axis, types.NoneType) else (1, 2))
        dtype = _wide(dtype_of(a))

        def vector(a: Any) -> Any:
            result = np.empty(a.shape[0], dtype)
            for i in range(a.shape[0]):
                result[i] = a[i] if i == 0 else step(result[i - 1], a[i])
            return result

        of_a_vector = plain(vector)
        if isinstance(axis, types.NoneType) or a.ndim == 1:
            return lambda a, axis: of_a_vector(own.rtcf_ravel(a))

        def along(a: Any, axis: Any) -> Any:
            result = np.empty(a.shape, dtype)
            if axis == 1 or axis == -1:
                for i in range(a.shape[0]):
                    helpers.rtcf_assign(result[i], of_a_vector(a[i]))
            elif axis == 0 or axis == -2:
                for j in range(a.shape[1]):
                    helpers.rtcf_assign(result[:, j], of_a_vector(a[:, j]))
            else:
                raise ValueError("axis is out of bounds")
            return result

        return along


@plain
def _added(x: Any, y: Any) -> Any:
    return x + y


@plain
def _times(x: Any, y: Any) -> Any:
    return x * y


_running(own.rtcf_cumsum, "np.cumsum", _added)
_running(own.rtcf_cumprod, "np.cumprod", _times)


# Order.


@plain
def _before(x: Any, y: Any) -> Any:
    """Tell whether one number sorts before another; NaN sorts last."""
    return x < y or (y != y and x == x)


@plain
def _merge(values: Any, spare: Any, begin: Any, middle: Any, end: Any) -> None:
    i, j = begin, middle
    for k in range(begin, end):
        if i < middle and (j >= end or not _before(values[j], values[i])):
            spare[k] = values[i]
            i += 1
        else:
            spare[k] = values[j]
            j += 1
    for k in range(begin, end):
        values[k] = spare[k]


@plain
def _sort_vector(values: Any) -> None:
    """Sort a vector: insertion sort of runs of eight, then merge sort."""
    n = values.shape[0]
    for begin in range(0, n, 8):
        for i in range(begin + 1, min(begin + 8, n)):
            value = values[i]
            j = i
            while j > begin and _before(value, values[j - 1]):
                values[j] = values[j - 1]
                j -= 1
            values[j] = value
    if n <= 8:
        return
    spare = np.empty(n, values.dtype)
    run = 8
    while run < n:
        for begin in range(0, n - run, 2 * run):
            _merge(values, spare, begin, begin + run, min(begin + 2 * run, n))
        run *= 2


@compiled_as(own.rtcf_sort_in_place)
def _sort_in_place(a: Any, axis: Any) -> Any:
    needs(a, "sort")
    if not a.mutable:
        raise TypingError("RTCF:a constant of the module is sorted:copy it first")
    if a.ndim == 1:
        return lambda a, axis: _sort_vector(a)

    def sort(a: Any, axis: Any) -> None:
        if axis == 0 or axis == -2:
            for j in range(a.shape[1]):
                _sort_vector(a[:, j])
        else:
            for i in range(a.shape[0]):
                _sort_vector(a[i])

    return sort


@compiled_as(own.rtcf_sort, arrays=("a",))
def _sort(a: Any, axis: Any) -> Any:
    needs(a, "np.sort", _ALL if isinstance(axis, types.NoneType) else (1, 2))
    if isinstance(axis, types.NoneType):
        return lambda a, axis: own.rtcf_sort(own.rtcf_flatten(a), -1)

    def sort(a: Any, axis: Any) -> Any:
        result = own.rtcf_array(a, None)
        own.rtcf_sort_in_place(result, axis)
        return result

    return sort


@compiled_as(own.rtcf_fill)
def _fill(a: Any, value: Any) -> Any:
    return lambda a, value: helpers.rtcf_assign(a, value)


@compiled_as(own.rtcf_argsort, arrays=("a",))
def _argsort(a: Any, kind: Any) -> Any:
    needs(a, "np.argsort", (1,))

    def argsort(a: Any, kind: Any) -> Any:
        n = a.shape[0]
        places, spare = np.empty(n, np.int64), np.empty(n, np.int64)
        for i in range(n):
            places[i] = i
        run = 1
        while run < n:
            for begin in range(0, n - run, 2 * run):
                middle, end = begin + run, min(begin + 2 * run, n)
                i, j = begin, middle
                for k in range(begin, end):
                    if i < middle and (j >= end or not _before(a[places[j]], a[places[i]])):
                        spare[k] = places[i]
                        i += 1
                    else:
                        spare[k] = places[j]
                        j += 1
                for k in range(begin, end):
                    places[k] = spare[k]
            run *= 2
        return places

    return argsort


@plain
def _first_not_below(a: Any, v: Any) -> Any:
    low, high = 0, a.shape[0]
    while low < high:
        middle = low + (high - low) // 2
        if _before(a[middle], v):
            low = middle + 1
        else:
            high = middle
    return low


@plain
def _first_above(a: Any, v: Any) -> Any:
    low, high = 0, a.shape[0]
    while low < high:
        middle = low + (high - low) // 2
        if _before(v, a[middle]):
            high = middle
        else:
            low = middle + 1
    return low


@compiled_as(own.rtcf_searchsorted, arrays=("a", "v"))
def _searchsorted(a: Any, v: Any, side: Any) -> Any:
    needs(a, "np.searchsorted", (1,))
    search = _first_not_below if isinstance(side, types.NoneType) else _first_above
    if isinstance(v, _Numbers):
        return lambda a, v, side: search(a, v)
    needs(v, "np.searchsorted", (1,))

    def each(a: Any, v: Any, side: Any) -> Any:
        result = np.empty(v.shape[0], np.int64)
        for i in range(v.shape[0]):
            result[i] = search(a, v[i])
        return result

    return each


# Element-wise functions.


def _clip_number(a: Any, a_min: Any, a_max: Any) -> Any:
    # Two comparisons are enough if no bound is NaN; a NaN number stays NaN.
    if a_min <= a_max:
        raised = a_min if a_min > a else a
        return a_max if a_max < raised else raised
    return np.minimum(np.maximum(a, a_min), a_max)


_clip_elements = numba.vectorize(_clip_number)


@compiled_as(own.rtcf_clip, arrays=("a", "a_min", "a_max"))
def _clip(a: Any, a_min: Any, a_max: Any) -> Any:
    low, high = (not isinstance(each, types.NoneType) for each in (a_min, a_max))
    numbers = [operand(each) for each in (a, a_min, a_max)]
    if any(each is not None and each.is_narrow for each in numbers):
        return _clip_narrow(a, a_min, a_max)
    if all(isinstance(each, types.Float) for each in (a, a_min, a_max)):
        return _clip_number
    if low and high and all(dtype_of(each) == np.float64 for each in (a, a_min, a_max)):
        return lambda a, a_min, a_max: _clip_elements(a, a_min, a_max)
    if low and high:
        return lambda a, a_min, a_max: np.minimum(np.maximum(a, a_min), a_max)
    if low:
        return lambda a, a_min, a_max: np.maximum(a, a_min)
    if high:
        return lambda a, a_min, a_max: np.minimum(a, a_max)
    raise TypingError("RTCF:np.clip without bounds:give it a bound")


def _clip_narrow(a: Any, a_min: Any, a_max: Any) -> Any:
    """Return the function that clips narrow numbers, in one type as NumPy does."""
    low, high = (not isinstance(each, types.NoneType) for each in (a_min, a_max))
    if low and high and result_type(np.clip, a, a_min) != result_type(np.clip, a, a_max):
        raise TypingError("RTCF:bounds of different types:convert one: x.astype(float)")
    if not low:
        return lambda a, a_min, a_max: _lower(a, a_max)
    if not high:
        return lambda a, a_min, a_max: _higher(a, a_min)
    return lambda a, a_min, a_max: _lower(_higher(a, a_min), a_max)


@compiled_as(own.rtcf_is_any, arrays=("values",))
def _any_of_values(values: Any) -> Any:
    needs(values, "any", (1,))
    return lambda values: own.rtcf_any(values, None)


@compiled_as(own.rtcf_is_all, arrays=("values",))
def _all_of_values(values: Any) -> Any:
    needs(values, "all", (1,))
    return lambda values: own.rtcf_all(values, None)


@compiled_as(own.rtcf_astype)
def _astype(a: Any, dtype: Any) -> Any:
    needs(a, "astype", _ALL)
    wanted = dtype_of(dtype.dtype if isinstance(dtype, types.DTypeSpec) else dtype.instance_type)
    if wanted.kind == "b":
        return lambda a, dtype: a != 0
    if not (dtype_of(a).kind == "f" and wanted.kind in "iu"):
        return lambda a, dtype: own.rtcf_array(a, dtype)
    if wanted != np.dtype(np.int64):
        raise TypingError(f"RTCF:floats cannot become {wanted}:convert them to int64 first")

    def whole(a: Any, dtype: Any) -> Any:
        row = own.rtcf_ravel(a)
        result = np.empty(row.shape[0], np.int64)
        for i in range(row.shape[0]):
            # A float beyond int64 becomes the value that the processor gives.
            if -9223372036854775808.0 <= row[i] < 9223372036854775808.0:
                result[i] = int(row[i])
            else:
                result[i] = np.int64(-9223372036854775808)
        return own.rtcf_reshape(result, a.shape)

    return whole


@compiled_as(own.rtcf_abs)
def _abs(x: Any) -> Any:
    if isinstance(x, types.Array):
        return lambda x: np.abs(x)
    number = operand(x)
    if number is not None and number.is_narrow:
        to = number.dtype.type
        return lambda x: to(abs(x))
    return lambda x: abs(x)


def elementwise(function: Callable[..., Any]) -> Any:
    """Return a function of numbers that also takes arrays."""
    function.__annotations__ = {}
    return numba.vectorize(function)


def _about(a: Any, b: Any, rtol: Any, atol: Any, equal_nan: Any) -> Any:
    if math.isfinite(a) and math.isfinite(b):
        return abs(a - b) <= atol + rtol * abs(b)
    return a == b or (equal_nan and a != a and b != b)


_isclose_each = elementwise(_about)


@compiled_as(own.rtcf_isclose, arrays=("a", "b"), refused="fiu")
def _isclose(a: Any, b: Any, rtol: Any, atol: Any, equal_nan: Any) -> Any:
    return lambda a, b, rtol, atol, equal_nan: _isclose_each(
        a * 1.0, b * 1.0, rtol, atol, equal_nan
    )


@compiled_as(own.rtcf_allclose, arrays=("a", "b"), refused="fiu")
def _allclose(a: Any, b: Any, rtol: Any, atol: Any, equal_nan: Any) -> Any:
    return lambda a, b, rtol, atol, equal_nan: own.rtcf_all(
        own.rtcf_isclose(a, b, rtol, atol, equal_nan), None
    )


@compiled_as(own.rtcf_array_equal, arrays=("a1", "a2"))
def _array_equal(a1: Any, a2: Any, equal_nan: Any) -> Any:
    needs(a1, "np.array_equal", _ALL)
    needs(a2, "np.array_equal", _ALL)
    if a1.ndim != a2.ndim:
        return lambda a1, a2, equal_nan: False
    has_nan = all(dtype_of(each).kind == "f" for each in (a1, a2))
    if has_nan and not isinstance(equal_nan, types.NoneType):

        def equal_or_nan(a1: Any, a2: Any, equal_nan: Any) -> Any:
            if a1.shape != a2.shape:
                return False
            both = (a1 != a1) & (a2 != a2)
            return own.rtcf_all((a1 == a2) | both, None)

        return equal_or_nan

    def equal(a1: Any, a2: Any, equal_nan: Any) -> Any:
        if a1.shape != a2.shape:
            return False
        return own.rtcf_all(a1 == a2, None)

    return equal


@compiled_as(own.rtcf_np_round, arrays=("a",))
def _np_round(a: Any, decimals: Any) -> Any:
    if not isinstance(a.dtype if isinstance(a, types.Array) else a, types.Float):
        raise TypingError(f"RTCF:np.round of {words(a)}:give it floats")
    to = dtype_of(a).type

    def rounded(a: Any, decimals: Any) -> Any:
        if decimals == 0:
            return np.rint(a) * to(1.0)
        scale = to(10.0 ** abs(decimals))
        if decimals > 0:
            return np.rint(a * scale) / scale
        return np.rint(a / scale) * scale

    return rounded


def _replaced(x: Any, nan: Any, posinf: Any, neginf: Any) -> Any:
    if x != x:
        return nan
    if math.isinf(x):
        return posinf if x > 0.0 else neginf
    return x


_nan_to_num_each = elementwise(_replaced)


@compiled_as(own.rtcf_nan_to_num, arrays=("x",), refused="fiu")
def _nan_to_num(x: Any, copy: Any, nan: Any, posinf: Any, neginf: Any) -> Any:
    top = np.finfo(np.float64).max
    up, down = (isinstance(each, types.NoneType) for each in (posinf, neginf))
    if up and down:
        return lambda x, copy, nan, posinf, neginf: _nan_to_num_each(x, nan, top, -top)
    if up:
        return lambda x, copy, nan, posinf, neginf: _nan_to_num_each(x, nan, top, neginf)
    if down:
        return lambda x, copy, nan, posinf, neginf: _nan_to_num_each(x, nan, posinf, -top)
    return lambda x, copy, nan, posinf, neginf: _nan_to_num_each(x, nan, posinf, neginf)


@plain
def _interval(x: Any, xp: Any, guess: Any) -> Any:
    """Return the interval that contains a number, found as NumPy does.

    The result is -1 before the first point, and the number of points after the last one.
    """
    n = xp.shape[0]
    if x > xp[n - 1]:
        return n
    if x < xp[0]:
        return -1
    if n <= 4:
        i = 1
        while i < n and x >= xp[i]:
            i += 1
        return i - 1
    guess = max(1, min(guess, n - 3))
    low, high = 0, n
    if x < xp[guess]:
        if x < xp[guess - 1]:
            high = guess - 1
            if guess > 8 and x >= xp[guess - 8]:
                low = guess - 8
        else:
            return guess - 1
    else:
        if x < xp[guess + 1]:
            return guess
        if x < xp[guess + 2]:
            return guess + 1
        low = guess + 2
        if guess < n - 8 - 1 and x < xp[guess + 8]:
            high = guess + 8
    while low < high:
        middle = low + (high - low) // 2
        if x >= xp[middle]:
            low = middle + 1
        else:
            high = middle
    return low - 1


@plain
def _between(x: Any, xp: Any, fp: Any, left: Any, right: Any, j: Any) -> Any:
    """Return the interpolated value at x in interval j."""
    n = xp.shape[0]
    if x != x:
        return x
    if n == 1:
        return left if x < xp[0] else right if x > xp[0] else fp[0] * 1.0
    if j == -1:
        return left
    if j == n:
        return right
    if j == n - 1 or xp[j] == x:
        return fp[j] * 1.0
    slope = (fp[j + 1] - fp[j]) / (xp[j + 1] - xp[j])
    result = slope * (x - xp[j]) + fp[j]
    if result != result:
        result = slope * (x - xp[j + 1]) + fp[j + 1]
        if result != result and fp[j] == fp[j + 1]:
            result = fp[j] * 1.0
    return result


@plain
def _interpolated(x: Any, xp: Any, fp: Any, left: Any, right: Any) -> Any:
    if xp.shape[0] == 0 or xp.shape[0] != fp.shape[0]:
        raise ValueError("np.interp: xp and fp need the same number of points, at least one")
    x = x * 1.0
    return _between(x, xp, fp, left, right, _interval(x, xp, 0))


def _or_end(value: Any, fp: Any, place: Any) -> Any:
    raise NotImplementedError


@compiled_as(_or_end)
def _value_or_end(value: Any, fp: Any, place: Any) -> Any:
    if isinstance(value, types.NoneType):
        return lambda value, fp, place: fp[place] * 1.0 if fp.shape[0] else 0.0
    return lambda value, fp, place: value * 1.0


@compiled_as(own.rtcf_interp, arrays=("x", "xp", "fp"))
def _interp(x: Any, xp: Any, fp: Any, left: Any, right: Any) -> Any:
    needs(xp, "np.interp", (1,))
    needs(fp, "np.interp", (1,))
    if any(is_narrow(dtype_of(each)) for each in (xp, fp)):
        return lambda x, xp, fp, left, right: own.rtcf_interp(
            x, own.rtcf_asarray(xp, np.float64), own.rtcf_asarray(fp, np.float64), left, right
        )
    if isinstance(x, _Numbers):
        return lambda x, xp, fp, left, right: _interpolated(
            x, xp, fp, _or_end(left, fp, 0), _or_end(right, fp, -1)
        )
    needs(x, "np.interp", (1,))

    def each(x: Any, xp: Any, fp: Any, left: Any, right: Any) -> Any:
        if xp.shape[0] == 0 or xp.shape[0] != fp.shape[0]:
            raise ValueError("np.interp: xp and fp need the same number of points, at least one")
        low, high = _or_end(left, fp, 0), _or_end(right, fp, -1)
        result = np.empty(x.shape[0])
        j = 0
        for i in range(x.shape[0]):
            value = x[i] * 1.0
            if value == value:
                j = _interval(value, xp, j)
            result[i] = _between(value, xp, fp, low, high, j)
        return result

    return each


@compiled_as(own.rtcf_polyval, arrays=("p", "x"), refused="fiu")
def _polyval(p: Any, x: Any) -> Any:
    needs(p, "np.polyval", (1,))

    def number(p: Any, x: Any) -> Any:
        result = 0.0
        for i in range(p.shape[0]):
            result = result * x + p[i]
        return result

    if isinstance(x, _Numbers):
        return number
    needs(x, "np.polyval", (1,))
    of_one = plain(number)

    def each(p: Any, x: Any) -> Any:
        result = np.empty(x.shape[0])
        for i in range(x.shape[0]):
            result[i] = of_one(p, x[i])
        return result

    return each


@compiled_as(own.rtcf_trapz, arrays=("y", "x"), refused="fiu")
def _trapz(y: Any, x: Any, dx: Any) -> Any:
    needs(y, "np.trapz", (1,))
    if isinstance(x, types.NoneType):
        return lambda y, x, dx: own.rtcf_sum(dx * (y[1:] + y[:-1]) / 2.0, None, None)
    needs(x, "np.trapz", (1,))
    return lambda y, x, dx: own.rtcf_sum((x[1:] - x[:-1]) * (y[1:] + y[:-1]) / 2.0, None, None)


# Matrices and vectors.


@compiled_as(own.rtcf_outer, arrays=("a", "b"))
def _outer(a: Any, b: Any) -> Any:
    needs(a, "np.outer")
    needs(b, "np.outer")
    if a.ndim == 2 or b.ndim == 2:
        return lambda a, b: own.rtcf_outer(own.rtcf_ravel(a), own.rtcf_ravel(b))
    dtype = np.result_type(dtype_of(a), dtype_of(b))

    def outer(a: Any, b: Any) -> Any:
        result = np.empty((a.shape[0], b.shape[0]), dtype)
        for i in range(a.shape[0]):
            for j in range(b.shape[0]):
                result[i, j] = a[i] * b[j]
        return result

    return outer


@plain
def _cross_of(a: Any, b: Any, result: Any) -> None:
    result[0] = a[1] * b[2] - a[2] * b[1]
    result[1] = a[2] * b[0] - a[0] * b[2]
    result[2] = a[0] * b[1] - a[1] * b[0]


@compiled_as(own.rtcf_cross, arrays=("a", "b"), refused="biu")
def _cross(a: Any, b: Any) -> Any:
    needs(a, "np.cross")
    needs(b, "np.cross")
    dtype = np.promote_types(dtype_of(a), dtype_of(b))
    if a.ndim == b.ndim == 1:

        def cross(a: Any, b: Any) -> Any:
            if a.shape[0] != 3 or b.shape[0] != 3:
                raise ValueError("np.cross takes vectors of three elements")
            result = np.empty(3, dtype)
            _cross_of(a, b, result)
            return result

        return cross
    if a.ndim == 1:
        return lambda a, b: own.rtcf_cross(own.rtcf_reshape(a, (1, a.shape[0])), b)
    if b.ndim == 1:
        return lambda a, b: own.rtcf_cross(a, own.rtcf_reshape(b, (1, b.shape[0])))

    def rows(a: Any, b: Any) -> Any:
        if a.shape[1] != 3 or b.shape[1] != 3:
            raise ValueError("np.cross takes rows of three elements")
        down, along = 0 if a.shape[0] == 1 else 1, 0 if b.shape[0] == 1 else 1
        if down and along and a.shape[0] != b.shape[0]:
            raise ValueError("np.cross of different numbers of rows")
        result = np.empty((a.shape[0] if down else b.shape[0], 3), dtype)
        for i in range(result.shape[0]):
            _cross_of(a[i * down], b[i * along], result[i])
        return result

    return rows


@compiled_as(own.rtcf_inner, arrays=("a", "b"))
def _inner(a: Any, b: Any) -> Any:
    needs(a, "np.inner", (1,))
    needs(b, "np.inner", (1,))
    return lambda a, b: helpers.rtcf_matmul(a, b)


@compiled_as(own.rtcf_norm, arrays=("x",), refused="f")
def _norm(x: Any, ord: Any, axis: Any, keepdims: Any) -> Any:
    needs(x, "np.linalg.norm", _ALL)
    default, is_all = (isinstance(each, types.NoneType) for each in (ord, axis))
    if is_all and (default or x.ndim == 1) and not isinstance(keepdims, types.NoneType):
        ones = (1,) * x.ndim
        return lambda x, ord, axis, keepdims: own.rtcf_reshape(
            own.rtcf_array((own.rtcf_norm(x, ord, None, None),), None), ones
        )
    if is_all and default:

        def of_all(x: Any, ord: Any, axis: Any, keepdims: Any) -> Any:
            total = 0.0
            row = own.rtcf_ravel(x)
            for i in range(row.shape[0]):
                total += float(row[i]) * float(row[i])
            return np.sqrt(total)

        return of_all
    if is_all and x.ndim == 1:
        along = plain(_norm_along())

        def of_vector(x: Any, ord: Any, axis: Any, keepdims: Any) -> Any:
            if ord == 2:
                return np.sqrt(helpers.rtcf_matmul(x * 1.0, x * 1.0))
            return along(x, ord, None, None)

        return of_vector
    if is_all:
        return _norm_of_matrix(ord, keepdims)
    if default:
        return lambda x, ord, axis, keepdims: np.sqrt(own.rtcf_sum(x * 1.0 * x, axis, keepdims))
    return _norm_along()


def _norm_along() -> Any:
    """Return the function for the norm of a vector, or of each row or column of a matrix."""

    def along(x: Any, ord: Any, axis: Any, keepdims: Any) -> Any:
        x = x * 1.0
        if ord == 2:
            return np.sqrt(own.rtcf_sum(x * x, axis, keepdims))
        if ord == 1:
            return own.rtcf_sum(np.abs(x), axis, keepdims)
        if ord == np.inf:
            return own.rtcf_max(np.abs(x), axis, keepdims)
        if ord == -np.inf:
            return own.rtcf_min(np.abs(x), axis, keepdims)
        if ord == 0:
            return own.rtcf_sum(own.rtcf_array(x != 0.0, np.float64), axis, keepdims)
        return own.rtcf_sum(helpers.rtcf_pow(np.abs(x), ord * 1.0), axis, keepdims) ** (1.0 / ord)

    return along


def _norm_of_matrix(ord: Any, keepdims: Any) -> Any:
    """Return the function for a norm of a matrix; None for an int whose value is not known."""
    if isinstance(ord, types.Integer):
        if not isinstance(ord, types.IntegerLiteral):
            return None  # numba asks again with the value of a constant
        if ord.literal_value not in (1, -1):
            what = f"np.linalg.norm of a matrix with ord={ord.literal_value} needs singular values"
            raise TypingError(f"RTCF:{what}, which LAPACK computes:use the Frobenius norm")
    if not isinstance(keepdims, types.NoneType):
        raise TypingError("RTCF:np.linalg.norm of a matrix with ord and keepdims:remove keepdims")

    def norm(x: Any, ord: Any, axis: Any, keepdims: Any) -> Any:
        far = np.abs(x * 1.0)
        if ord == 1:
            return own.rtcf_max(own.rtcf_sum(far, 0, None), None, None)
        if ord == -1:
            return own.rtcf_min(own.rtcf_sum(far, 0, None), None, None)
        if ord == np.inf:
            return own.rtcf_max(own.rtcf_sum(far, 1, None), None, None)
        if ord == -np.inf:
            return own.rtcf_min(own.rtcf_sum(far, 1, None), None, None)
        raise ValueError("np.linalg.norm of a matrix: ord is 1, -1, np.inf or -np.inf")

    return norm


@compiled_as(own.rtcf_det, arrays=("a",), refused="f")
def _det(a: Any) -> Any:
    needs(a, "np.linalg.det", (2,))

    def det(a: Any) -> Any:
        n = a.shape[0]
        if a.shape[1] != n:
            raise ValueError("det of a matrix that is not square")
        matrix = own.rtcf_array(a, np.float64)
        result = 1.0
        for k in range(n):
            pivot = k
            for i in range(k + 1, n):
                if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                    pivot = i
            if matrix[pivot, k] == 0.0:
                return 0.0
            if pivot != k:
                for j in range(n):
                    matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
                result = -result
            result = result * matrix[k, k]
            for i in range(k + 1, n):
                factor = matrix[i, k] / matrix[k, k]
                for j in range(k + 1, n):
                    matrix[i, j] = matrix[i, j] - factor * matrix[k, j]
        return result

    return det


@compiled_as(own.rtcf_matrix_power, arrays=("a",), refused="fiu")
def _matrix_power(a: Any, n: Any) -> Any:
    needs(a, "np.linalg.matrix_power", (2,))

    def power(a: Any, n: Any) -> Any:
        size = a.shape[0]
        if a.shape[1] != size:
            raise ValueError("matrix_power of a matrix that is not square")
        square = helpers.rtcf_inv(a) if n < 0 else own.rtcf_array(a, np.float64)
        n = abs(n)
        if n == 0:
            return np.eye(size)
        if n == 3:
            return helpers.rtcf_matmul(helpers.rtcf_matmul(square, square), square)
        while n % 2 == 0:
            square = helpers.rtcf_matmul(square, square)
            n //= 2
        result = square
        n //= 2
        while n > 0:
            square = helpers.rtcf_matmul(square, square)
            if n % 2:
                result = helpers.rtcf_matmul(result, square)
            n //= 2
        return result

    return power


@compiled_as(own.rtcf_whole_pow)
def _whole_pow(base: Any, exponent: Any) -> Any:
    number = operand(base)
    if number is not None:
        refuse_bools(operator.pow, number, number)
        together(operator.pow, number, Operand(np.dtype(np.int64), False))

    def power(base: Any, exponent: Any) -> Any:
        square = base
        while exponent % 2 == 0 and exponent > 0:
            square = square * square
            exponent //= 2
        result = helpers.rtcf_copied(square) if exponent == 1 else square
        exponent //= 2
        while exponent > 0:
            square = square * square
            if exponent % 2:
                result = result * square
            exponent //= 2
        return result

    return power


# Functions of the C library that stand for NumPy functions.


def _by_libm(helper: Any, name: str) -> None:
    function = getattr(np, name)
    if function.nin == 2:

        @compiled_as(helper, arrays=("x", "y"), refused="biu")
        def _binary(x: Any, y: Any) -> Any:
            as_x, as_y = conversions(function, x, y)
            return lambda x, y: function(as_x(x), as_y(y))

        return

    @compiled_as(helper, arrays=("x",), refused="biu")
    def _unary(x: Any) -> Any:
        return lambda x: function(x)


for _helper, _name in own.BY_LIBM.items():
    _by_libm(_helper, _name)
