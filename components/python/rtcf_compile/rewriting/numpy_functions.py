"""Helpers for functions of NumPy with our own overloads: for numbers, vectors and matrices, without
BLAS, LAPACK and lists.

Each helper is registered with the functions that it replaces. In the interpreter it calls NumPy's
function, except where the order of sums or the C library determines the last place: there it
computes as the overload does.
"""

import ctypes
import ctypes.util
from collections.abc import Callable
from typing import Any

import numpy as np

from rtcf_compile.rewriting import helpers, operators
from rtcf_compile.rewriting.subscripts import Subscripts

Function = Callable[..., Any]

# Compare functions by identity: some are equal to others or cannot be hashed.
STANDS_FOR: list[tuple[Function, Function]] = []
# The helpers for methods such as `a.sum(axis=0)`, by name; the array is the first argument.
METHODS: dict[str, Function] = {}


# Texts, by arguments, and the values that stand for them in the helpers.
_MODES = ("valid", "same", "full")
WORDS: dict[str, dict[str, Any]] = {
    "side": {"left": None, "right": True},
    "kind": {"stable": None},
    "ord": {"fro": None, "f": None},
    "mode": {mode: number for number, mode in enumerate(_MODES)},
    "indexing": {"xy": None, "ij": True},
    "method": {"linear": None},
}


def _stands_for(*functions: Function, method: str = "") -> Callable[[Function], Function]:
    """Register a helper that replaces functions and a method of arrays."""

    def register(own: Function) -> Function:
        STANDS_FOR.extend((each, own) for each in functions)
        if method:
            METHODS[method] = own
        return own

    return register


# Making arrays.


@_stands_for(np.array, np.copy)
def rtcf_array(object: Any, dtype: Any = None) -> Any:
    """Return a new array from a number, an array, or rows of numbers and arrays."""
    return np.array(object, dtype)


@_stands_for(np.ascontiguousarray)
def rtcf_contiguous(a: Any) -> Any:
    """Return an array as it is if its elements lie in order, else a copy."""
    return np.ascontiguousarray(a)


@_stands_for(np.atleast_1d)
def rtcf_atleast_1d(ary: Any) -> Any:
    """Return an array as it is, or a number as a vector."""
    return np.atleast_1d(ary)


@_stands_for(np.atleast_2d)
def rtcf_atleast_2d(ary: Any) -> Any:
    """Return a matrix as it is, or a vector or a number as a row."""
    return np.atleast_2d(ary)


@_stands_for(np.asarray)
def rtcf_asarray(a: Any, dtype: Any = None) -> Any:
    """Return an array as it is, or a list as a new array."""
    return np.asarray(a, dtype)


@_stands_for(np.diag)
def rtcf_diag(v: Any, k: Any = 0) -> Any:
    """Return a matrix with a vector as its diagonal, or the diagonal of a matrix."""
    return np.array(np.diag(v, k))


@_stands_for(np.diagonal, method="diagonal")
def rtcf_diagonal(a: Any) -> Any:
    """Return the diagonal of a matrix."""
    return np.array(np.diagonal(a))


@_stands_for(np.meshgrid)
def rtcf_meshgrid(x1: Any, x2: Any, indexing: Any = None) -> Any:
    """Return matrices of the coordinates of a grid."""
    return tuple(np.meshgrid(x1, x2, indexing="ij" if indexing else "xy"))


@_stands_for(np.linspace)
def rtcf_linspace(start: Any, stop: Any, num: Any = 50, endpoint: Any = True) -> Any:
    """Return evenly spaced numbers."""
    return np.linspace(start, stop, num, endpoint)


@_stands_for(np.real)
def rtcf_real(val: Any) -> Any:
    """Return the real part of a number or array."""
    return np.real(val)


@_stands_for(np.imag)
def rtcf_imag(val: Any) -> Any:
    """Return the imaginary part of a number or array."""
    return np.imag(val)


# Shapes.


@_stands_for(np.reshape, method="reshape")
def rtcf_reshape(a: Any, newshape: Any) -> Any:
    """Return the elements of an array in another shape, a view where NumPy returns one."""
    return np.reshape(a, newshape)


def rtcf_new_axes(a: Any, axes: Any) -> Any:
    """Return an array with new axes: None in `axes`; 0 stands for ..., True for an old axis."""
    kinds = {None: None, True: slice(None), 0: ...}
    return np.asarray(a)[tuple(kinds[each] for each in axes)]


@_stands_for(np.ravel, method="ravel")
def rtcf_ravel(a: Any) -> Any:
    """Return the elements of an array as a vector, a view where NumPy returns one."""
    return np.ravel(a)


@_stands_for(method="flatten")
def rtcf_flatten(a: Any) -> Any:
    """Return the elements of an array as a new vector."""
    return np.array(np.ravel(a))


@_stands_for(np.concatenate)
def rtcf_concatenate(arrays: Any, axis: Any = 0) -> Any:
    """Return arrays joined along an axis."""
    return np.concatenate(arrays, axis)


@_stands_for(np.hstack)
def rtcf_hstack(tup: Any) -> Any:
    """Return vectors joined, or matrices side by side."""
    return np.hstack(tup)


@_stands_for(np.vstack)
def rtcf_vstack(tup: Any) -> Any:
    """Return vectors and matrices below each other."""
    return np.vstack(tup)


@_stands_for(np.stack)
def rtcf_stack(arrays: Any, axis: Any = 0) -> Any:
    """Return vectors as the rows or columns of a matrix."""
    return np.stack(arrays, axis)


@_stands_for(np.column_stack)
def rtcf_column_stack(tup: Any) -> Any:
    """Return vectors, as columns, and matrices side by side."""
    return np.column_stack(tup)


@_stands_for(np.roll)
def rtcf_roll(a: Any, shift: Any, axis: Any = None) -> Any:
    """Return an array with its elements, or its rows or columns, shifted cyclically."""
    return np.roll(a, shift, axis)


@_stands_for(np.flip)
def rtcf_flip(m: Any, axis: Any = None) -> Any:
    """Return a view of an array in reverse order."""
    return np.flip(m, axis)


@_stands_for(np.append)
def rtcf_append(arr: Any, values: Any) -> Any:
    """Return a new vector: the elements of the first, then those of the second."""
    return np.append(arr, values)


@_stands_for(np.tile)
def rtcf_tile(A: Any, reps: Any) -> Any:
    """Return a new vector: a vector, repeated."""
    if np.ndim(A) != 1 or not isinstance(reps, int):
        raise ValueError("tile of other than a vector and an int")
    return np.tile(A, reps)


@_stands_for(np.repeat, method="repeat")
def rtcf_repeat(a: Any, repeats: Any) -> Any:
    """Return a new vector: each element of a vector, repeated."""
    if np.ndim(a) != 1 or not isinstance(repeats, int):
        raise ValueError("repeat of other than a vector and an int")
    return np.repeat(a, repeats)


@_stands_for(np.kron)
def rtcf_kron(a: Any, b: Any) -> Any:
    """Return the Kronecker product of two matrices."""
    if np.ndim(a) != 2 or np.ndim(b) != 2:
        raise ValueError("kron of other than two matrices")
    return np.kron(a, b)


@_stands_for(np.diff)
def rtcf_diff(a: Any, n: Any = 1, axis: Any = -1, prepend: Any = None, append: Any = None) -> Any:
    """Return the differences of consecutive elements, of order 1 or 2."""
    ends = {"prepend": prepend, "append": append}
    given = {name: value for name, value in ends.items() if value is not None}
    return np.diff(a, n, axis, **given)


# Reductions, along all axes or one.


def _sequential(a: Any) -> Any:
    """Return a contiguous array, because the overload sums in the order of elements."""
    return np.ascontiguousarray(a) if isinstance(a, np.ndarray) and a.ndim else a


@_stands_for(np.sum, method="sum")
def rtcf_sum(a: Any, axis: Any = None, keepdims: Any = None) -> Any:
    """Return the sum, by NumPy's pairwise summation."""
    return np.sum(_sequential(a), axis=axis, keepdims=bool(keepdims))


@_stands_for(np.prod, method="prod")
def rtcf_prod(a: Any, axis: Any = None) -> Any:
    """Return the product, from the first element to the last."""
    return np.prod(_sequential(a), axis=axis)


@_stands_for(np.mean, method="mean")
def rtcf_mean(a: Any, axis: Any = None, keepdims: Any = None) -> Any:
    """Return the mean."""
    return np.mean(_sequential(a), axis=axis, keepdims=bool(keepdims))


@_stands_for(np.var, method="var")
def rtcf_var(a: Any, axis: Any = None, ddof: Any = 0) -> Any:
    """Return the variance."""
    return np.var(_sequential(a), axis=axis, ddof=ddof)


@_stands_for(np.std, method="std")
def rtcf_std(a: Any, axis: Any = None, ddof: Any = 0) -> Any:
    """Return the standard deviation."""
    return np.std(_sequential(a), axis=axis, ddof=ddof)


@_stands_for(np.max, np.amax, method="max")
def rtcf_max(a: Any, axis: Any = None, keepdims: Any = None) -> Any:
    """Return the largest element; NaN if one is NaN."""
    return np.max(a, axis=axis, keepdims=bool(keepdims))


@_stands_for(np.min, np.amin, method="min")
def rtcf_min(a: Any, axis: Any = None, keepdims: Any = None) -> Any:
    """Return the smallest element; NaN if one is NaN."""
    return np.min(a, axis=axis, keepdims=bool(keepdims))


@_stands_for(np.ptp, method="ptp")
def rtcf_ptp(a: Any, axis: Any = None) -> Any:
    """Return the largest element minus the smallest."""
    return np.ptp(a, axis=axis)


@_stands_for(np.argmax, method="argmax")
def rtcf_argmax(a: Any, axis: Any = None) -> Any:
    """Return the index of the largest element, or of the first NaN."""
    return np.argmax(a, axis=axis)


@_stands_for(np.argmin, method="argmin")
def rtcf_argmin(a: Any, axis: Any = None) -> Any:
    """Return the index of the smallest element, or of the first NaN."""
    return np.argmin(a, axis=axis)


@_stands_for(np.any, method="any")
def rtcf_any(a: Any, axis: Any = None) -> Any:
    """Tell whether any element is not 0."""
    return np.any(a, axis=axis)


@_stands_for(np.all, method="all")
def rtcf_all(a: Any, axis: Any = None) -> Any:
    """Tell whether all elements are not 0."""
    return np.all(a, axis=axis)


@_stands_for(np.count_nonzero)
def rtcf_count_nonzero(a: Any, axis: Any = None) -> Any:
    """Return the number of elements that are not 0."""
    return np.count_nonzero(a, axis)


@_stands_for(np.median)
def rtcf_median(a: Any, axis: Any = None) -> Any:
    """Return the median; NaN if an element is NaN."""
    return np.median(a, axis)


@_stands_for(np.percentile)
def rtcf_percentile(a: Any, q: Any, axis: Any = None, method: Any = None) -> Any:
    """Return percentiles, interpolated linearly; NaN if an element is NaN."""
    return np.percentile(a, q, axis)


@_stands_for(np.quantile)
def rtcf_quantile(a: Any, q: Any, axis: Any = None, method: Any = None) -> Any:
    """Return quantiles, interpolated linearly; NaN if an element is NaN."""
    return np.quantile(a, q, axis)


@_stands_for(np.trace, method="trace")
def rtcf_trace(a: Any, offset: Any = 0) -> Any:
    """Return the sum of a diagonal of a matrix, by NumPy's pairwise summation."""
    return np.trace(a, offset)


@_stands_for(np.cumsum, method="cumsum")
def rtcf_cumsum(a: Any, axis: Any = None) -> Any:
    """Return the cumulative sums."""
    return np.cumsum(a, axis=axis)


@_stands_for(np.cumprod, method="cumprod")
def rtcf_cumprod(a: Any, axis: Any = None) -> Any:
    """Return the cumulative products."""
    return np.cumprod(a, axis=axis)


# Order.


@_stands_for(np.sort)
def rtcf_sort(a: Any, axis: Any = -1) -> Any:
    """Return a sorted copy, NaN last."""
    return np.sort(a, axis)


@_stands_for(method="sort")
def rtcf_sort_in_place(a: Any, axis: Any = -1) -> None:
    """Sort an array, NaN last."""
    a.sort(axis)


@_stands_for(method="fill")
def rtcf_fill(a: Any, value: Any) -> None:
    """Set all elements of an array."""
    helpers.rtcf_assign(a, value)


@_stands_for(np.argsort, method="argsort")
def rtcf_argsort(a: Any, kind: Any) -> Any:
    """Return the indices that sort a vector; the sort is stable."""
    return np.argsort(a, kind="stable")


@_stands_for(np.searchsorted, method="searchsorted")
def rtcf_searchsorted(a: Any, v: Any, side: Any = None) -> Any:
    """Return the insertion indices of a number or a vector in a sorted vector."""
    return np.searchsorted(a, v, "right" if side else "left")


# Element-wise functions.


@_stands_for(np.clip, method="clip")
def rtcf_clip(a: Any, a_min: Any = None, a_max: Any = None) -> Any:
    """Return numbers clipped to bounds; None: no bound. A NaN bound gives NaN, as in NumPy 2;
    NumPy 1 ignores a single NaN bound.
    """
    if a_min is None and a_max is None:
        return np.clip(a, a_min, a_max)
    raised = a if a_min is None else operators.OF[np.maximum](a, a_min)
    return raised if a_max is None else operators.OF[np.minimum](raised, a_max)


@_stands_for(np.select)
def rtcf_select(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    """Return, by elements, the choice of the first condition that is true."""
    return np.select(list(condlist), list(choicelist), default)


@_stands_for(any)
def rtcf_is_any(values: Any) -> Any:
    """Tell whether any of the values is true."""
    return bool(np.any(np.ravel(values)))


@_stands_for(all)
def rtcf_is_all(values: Any) -> Any:
    """Tell whether all of the values are true."""
    return bool(np.all(np.ravel(values)))


@_stands_for(method="astype")
def rtcf_astype(a: Any, dtype: Any) -> Any:
    """Return an array with elements of another type; floats are rounded towards 0 to ints."""
    return a.astype(dtype)


@_stands_for(abs)
def rtcf_abs(x: Any) -> Any:
    """Return abs(x) of a number or of the elements of an array."""
    return abs(x)


@_stands_for(np.isclose)
def rtcf_isclose(
    a: Any, b: Any, rtol: Any = 1e-05, atol: Any = 1e-08, equal_nan: Any = False
) -> Any:
    """Return which numbers are equal within tolerances."""
    return np.isclose(a, b, rtol, atol, equal_nan)


@_stands_for(np.allclose)
def rtcf_allclose(
    a: Any, b: Any, rtol: Any = 1e-05, atol: Any = 1e-08, equal_nan: Any = False
) -> Any:
    """Tell whether all numbers are equal within tolerances."""
    return np.allclose(a, b, rtol, atol, equal_nan)


@_stands_for(np.array_equal)
def rtcf_array_equal(a1: Any, a2: Any, equal_nan: Any = None) -> Any:
    """Tell whether two arrays have the same shape and elements."""
    return np.array_equal(a1, a2, bool(equal_nan))


@_stands_for(np.round, np.around, method="round")
def rtcf_np_round(a: Any, decimals: Any = 0) -> Any:
    """Return numbers rounded to a number of decimals, halves to even."""
    return np.round(a, decimals)


@_stands_for(np.nan_to_num)
def rtcf_nan_to_num(
    x: Any, copy: Any = True, nan: Any = 0.0, posinf: Any = None, neginf: Any = None
) -> Any:
    """Return numbers with NaN and infinity replaced."""
    return np.nan_to_num(x, nan=nan, posinf=posinf, neginf=neginf)


@_stands_for(np.interp)
def rtcf_interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None) -> Any:
    """Return linearly interpolated values of a function given by points."""
    return np.interp(x, xp, fp, left, right)


@_stands_for(np.heaviside)
def rtcf_heaviside(x1: Any, x2: Any) -> Any:
    """Return 0 for numbers below 0, 1 for those above 0, and x2 for 0."""
    return np.heaviside(*operators.alike(x1, x2))


@_stands_for(np.sinc)
def rtcf_sinc(x: Any) -> Any:
    """Return sin(pi x) / (pi x)."""
    return np.sinc(x)


@_stands_for(np.unwrap)
def rtcf_unwrap(
    p: Any, discont: Any = None, axis: Any = -1, period: Any = 6.283185307179586
) -> Any:
    """Return phases without jumps of a period."""
    return np.unwrap(p, discont, axis, period=period)


@_stands_for(np.gradient)
def rtcf_gradient(f: Any, spacing: Any, axis: Any = None, edge_order: Any = 1) -> Any:
    """Return the derivative by central differences; `spacing`: a tuple of steps or coordinates, one
    per axis, or empty.
    """
    return np.gradient(f, *spacing, axis=axis, edge_order=edge_order)


@_stands_for(np.convolve)
def rtcf_convolve(a: Any, v: Any, mode: Any = 2) -> Any:
    """Return the convolution of two vectors; each sum runs from its first product to the last."""
    a, v = np.asarray(a), np.asarray(v)
    if len(v) > len(a):
        a, v = v, a
    return _correlated(a, v[::-1], mode)


@_stands_for(np.correlate)
def rtcf_correlate(a: Any, v: Any, mode: Any = 0) -> Any:
    """Return the cross-correlation of two vectors; each sum runs from its first product to the
    last.
    """
    a, v = np.asarray(a), np.asarray(v)
    return _correlated(a, v, mode) if len(a) >= len(v) else _correlated(v, a, mode)[::-1]


def _correlated(a: Any, v: Any, mode: int) -> Any:
    """Return the sums of products of a vector and another that is not longer."""
    n, m = len(a), len(v)
    if not m:
        raise ValueError("an empty vector")
    ahead, count = ((0, n - m + 1), (m // 2, n), (m - 1, n + m - 1))[mode]
    result = np.zeros(count, np.promote_types(a.dtype, v.dtype))
    for j in range(count):
        for k in range(m):
            if 0 <= j - ahead + k < n:
                result[j] += a[j - ahead + k] * v[k]
    return result


@_stands_for(np.polyval)
def rtcf_polyval(p: Any, x: Any) -> Any:
    """Return the values of a polynomial; the coefficient of the highest power is first."""
    return np.polyval(p, x)


_TRAPEZOID = [getattr(np, name) for name in ("trapezoid", "trapz") if hasattr(np, name)]


@_stands_for(*_TRAPEZOID)
def rtcf_trapz(y: Any, x: Any = None, dx: Any = 1.0) -> Any:
    """Return the integral by the trapezoidal rule."""
    return _TRAPEZOID[0](y, x, dx)


# Matrices and vectors.


@_stands_for(np.outer)
def rtcf_outer(a: Any, b: Any) -> Any:
    """Return the outer product of two vectors."""
    return np.outer(a, b)


@_stands_for(np.cross)
def rtcf_cross(a: Any, b: Any) -> Any:
    """Return the cross product of two vectors of three elements, or of the rows of matrices."""
    if {np.shape(a)[-1:], np.shape(b)[-1:]} != {(3,)}:
        raise ValueError(f"cross of shapes {np.shape(a)} and {np.shape(b)}")
    return np.cross(a, b)


@_stands_for(np.einsum)
def rtcf_einsum(text: Any, operands: Any) -> Any:
    """Return a sum of products; each sum runs from its first product to the last."""
    subscripts = Subscripts(text)
    if subscripts.is_view:
        return np.einsum(text, *operands)
    operands = [np.asarray(each) for each in operands]
    sizes: dict[str, int] = {}
    for names, operand in zip(subscripts.operands, operands, strict=True):
        if operand.ndim != len(names):
            raise ValueError(f"einsum {text}: an operand of shape {operand.shape}")
        for name, size in zip(names, operand.shape, strict=True):
            if sizes.setdefault(name, size) != size:
                raise ValueError(f"einsum {text}: sizes {sizes[name]} and {size} of {name}")
    result: Any = np.zeros([sizes[name] for name in subscripts.result], np.result_type(*operands))
    for place in np.ndindex(*(sizes[name] for name in subscripts.summed)):
        at = dict(zip(subscripts.summed, place, strict=True))
        parts = [
            operand[tuple(at.get(name, slice(None)) for name in names)]
            for names, operand in zip(subscripts.operands, operands, strict=True)
        ]
        left = ",".join(
            "".join(name for name in names if name not in at) for names in subscripts.operands
        )
        result = result + np.einsum(f"{left}->{subscripts.result}", *parts)
    return result[()]


@_stands_for(np.inner, np.vdot)
def rtcf_inner(a: Any, b: Any) -> Any:
    """Return the inner product of two vectors, summed from the first element to the last."""
    if np.ndim(a) != 1 or np.ndim(b) != 1:
        raise ValueError(f"inner of shapes {np.shape(a)} and {np.shape(b)}")
    return helpers.rtcf_matmul(a, b)


@_stands_for(np.linalg.norm)
def rtcf_norm(x: Any, ord: Any = None, axis: Any = None, keepdims: Any = None) -> Any:
    """Return a norm; squares are summed from the first element to the last."""
    x = np.asarray(x)
    if axis is None and (ord is None or (x.ndim == 1 and ord == 2)):
        row = np.ravel(x).astype(np.float64)
        norm = np.sqrt(helpers.rtcf_matmul(row, row))
        return np.full((1,) * x.ndim, norm) if keepdims else norm
    if axis is None and x.ndim == 2 and ord in (2, -2):
        raise ValueError("this norm of a matrix needs a singular value decomposition")
    return np.linalg.norm(_sequential(x), ord, axis, bool(keepdims))


@_stands_for(np.linalg.det)
def rtcf_det(a: Any) -> Any:
    """Return the determinant, by Gaussian elimination with row pivots."""
    matrix = np.array(a, np.float64)
    n = matrix.shape[0]
    if matrix.ndim != 2 or matrix.shape[1] != n:
        raise ValueError(f"det of shape {matrix.shape}")
    result = 1.0
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(matrix[k:, k])))
        if matrix[pivot, k] == 0.0:
            return 0.0
        if pivot != k:
            matrix[[k, pivot]] = matrix[[pivot, k]]
            result = -result
        result = result * matrix[k, k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            matrix[i, k + 1 :] = matrix[i, k + 1 :] - factor * matrix[k, k + 1 :]
    return float(result)


@_stands_for(np.linalg.matrix_power)
def rtcf_matrix_power(a: Any, n: Any) -> Any:
    """Return a power of a matrix, with NumPy's order of products."""
    a = np.array(a, np.float64)
    if a.ndim != 2 or a.shape[0] != a.shape[1]:
        raise ValueError(f"matrix_power of shape {a.shape}")
    if n < 0:
        a, n = helpers.rtcf_inv(a), -n
    if n == 0:
        return np.eye(len(a))
    if n == 3:
        return helpers.rtcf_matmul(helpers.rtcf_matmul(a, a), a)
    result, square = None, None
    while n > 0:
        square = a if square is None else helpers.rtcf_matmul(square, square)
        n, bit = divmod(n, 2)
        if bit:
            result = square if result is None else helpers.rtcf_matmul(result, square)
    return np.array(result)


def rtcf_whole_pow(base: Any, exponent: Any) -> Any:
    """Return base ** exponent for a constant int above 0, by repeated squaring."""
    if exponent == 1:
        return helpers.rtcf_copied(base)
    result = None
    while exponent > 0:
        if exponent % 2:
            result = base if result is None else result * base
        exponent //= 2
        if exponent:
            base = base * base
    return result


# The C library computes these in the loop; call it here too, for the same last place.

_LIBM = ctypes.CDLL(ctypes.util.find_library("m") or "libm.so.6")


def _of_the_c_library(function: Function, name: str) -> Function:
    count = 2 if name in ("atan2", "hypot", "pow") else 1
    by_type = {}
    for suffix, c_type, dtype in (
        ("", ctypes.c_double, np.float64),
        ("f", ctypes.c_float, np.float32),
    ):
        c_function = _LIBM[name + suffix]
        c_function.argtypes, c_function.restype = [c_type] * count, c_type
        by_type[np.dtype(dtype)] = np.vectorize(c_function, otypes=[dtype])

    def call(*arguments: Any) -> Any:
        if any(np.size(each) == 0 for each in arguments):
            return function(*arguments)
        dtype = np.result_type(np.float32, *(np.asarray(each).dtype for each in arguments))
        if dtype.kind == "c":
            return function(*arguments)
        return by_type[dtype](*arguments)[()]

    if count == 2:

        def binary(x: Any, y: Any) -> Any:
            return call(*operators.alike(x, y))

        return binary

    def unary(x: Any) -> Any:
        return call(x)

    return unary


# The names of functions in the C library, by their names in NumPy.
LIBM = {
    **{name: name for name in ("sin", "cos", "tan", "exp", "exp2", "expm1", "cbrt", "hypot")},
    **{name: name for name in ("log", "log2", "log10", "log1p", "sinh", "cosh", "tanh")},
    **{f"arc{name}": f"a{name}" for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "tan2")},
}
BY_LIBM: dict[Function, str] = {}
for _name, _c_name in LIBM.items():
    _own = _of_the_c_library(getattr(np, _name), _c_name)
    _own.__name__ = f"rtcf_np_{_name}"
    BY_LIBM[_own] = _name
    STANDS_FOR.append((getattr(np, _name), _own))

_ALL: list[Function] = [own for _, own in STANDS_FOR]
_ALL += [*METHODS.values(), rtcf_whole_pow, rtcf_new_axes]
BY_NAME: dict[str, Function] = {each.__name__: each for each in _ALL}
