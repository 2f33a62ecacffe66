"""The numba overloads of NumPy functions of samples: convolution, derivatives, phases, quantiles.

Import this only to compile: it imports numba.
"""

from typing import Any

import numpy as np
from numba import types
from numba.core.errors import TypingError

from rtcf_compile.machine_code.numpy_functions import (
    as_floats,
    copied_vector,
    dtype_of,
    elementwise,
    needs,
)
from rtcf_compile.machine_code.overloads import compiled_as, plain, words
from rtcf_compile.rewriting import helpers
from rtcf_compile.rewriting import numpy_functions as own

_Numbers = types.Number | types.Boolean


# Convolution.


def _correlation(dtype: Any) -> Any:
    """Return the function for the sums of products of a vector and another that is not longer."""
    zero = dtype.type(0)

    def correlated(a: Any, v: Any, mode: Any) -> Any:
        n, m = a.shape[0], v.shape[0]
        if m == 0:
            raise ValueError("np.convolve or np.correlate of an empty vector")
        ahead, count = 0, n - m + 1
        if mode == 1:
            ahead, count = m // 2, n
        elif mode == 2:
            ahead, count = m - 1, n + m - 1
        result = np.empty(count, dtype)
        for j in range(count):
            total = zero
            for k in range(max(0, ahead - j), min(m, n + ahead - j)):
                total += a[j - ahead + k] * v[k]
            result[j] = total
        return result

    return plain(correlated)


@compiled_as(own.rtcf_convolve, arrays=("a", "v"), refused="bfiu")
def _convolve(a: Any, v: Any, mode: Any) -> Any:
    needs(a, "np.convolve", (1,))
    needs(v, "np.convolve", (1,))
    correlated = _correlation(np.promote_types(dtype_of(a), dtype_of(v)))

    def convolve(a: Any, v: Any, mode: Any) -> Any:
        if a.shape[0] < v.shape[0]:
            return correlated(v, a[::-1], mode)
        return correlated(a, v[::-1], mode)

    return convolve


@compiled_as(own.rtcf_correlate, arrays=("a", "v"), refused="bfiu")
def _correlate(a: Any, v: Any, mode: Any) -> Any:
    needs(a, "np.correlate", (1,))
    needs(v, "np.correlate", (1,))
    correlated = _correlation(np.promote_types(dtype_of(a), dtype_of(v)))

    def correlate(a: Any, v: Any, mode: Any) -> Any:
        if a.shape[0] >= v.shape[0]:
            return correlated(a, v, mode)
        return copied_vector(correlated(v, a, mode)[::-1])

    return correlate


# Derivatives.


@plain
def _even(f: Any, step: Any, edge_order: Any, result: Any) -> None:
    """Set the derivative of samples at even distances."""
    n = f.shape[0]
    for i in range(1, n - 1):
        result[i] = (f[i + 1] - f[i - 1]) / (2.0 * step)
    if edge_order == 1:
        result[0] = (f[1] - f[0]) / step
        result[n - 1] = (f[n - 1] - f[n - 2]) / step
        return
    a, b, c = -1.5 / step, 2.0 / step, -0.5 / step
    result[0] = a * f[0] + b * f[1] + c * f[2]
    a, b, c = 0.5 / step, -2.0 / step, 1.5 / step
    result[n - 1] = a * f[n - 3] + b * f[n - 2] + c * f[n - 1]


@plain
def _uneven(f: Any, steps: Any, edge_order: Any, result: Any) -> None:
    """Set the derivative of samples at these distances from each other."""
    n = f.shape[0]
    for i in range(1, n - 1):
        one, two = steps[i - 1], steps[i]
        a = -two / (one * (one + two))
        b = (two - one) / (one * two)
        c = one / (two * (one + two))
        result[i] = a * f[i - 1] + b * f[i] + c * f[i + 1]
    if edge_order == 1:
        result[0] = (f[1] - f[0]) / steps[0]
        result[n - 1] = (f[n - 1] - f[n - 2]) / steps[n - 2]
        return
    one, two = steps[0], steps[1]
    a = -(2.0 * one + two) / (one * (one + two))
    b = (one + two) / (one * two)
    c = -one / (two * (one + two))
    result[0] = a * f[0] + b * f[1] + c * f[2]
    one, two = steps[n - 3], steps[n - 2]
    a = two / (one * (one + two))
    b = -(two + one) / (one * two)
    c = (2.0 * two + one) / (two * (one + two))
    result[n - 1] = a * f[n - 3] + b * f[n - 2] + c * f[n - 1]


def _derive(f: Any, spacing: Any, edge_order: Any, result: Any) -> None:
    raise NotImplementedError


@compiled_as(_derive, arrays=("spacing",))
def _derive_vector(f: Any, spacing: Any, edge_order: Any, result: Any) -> Any:
    if isinstance(spacing, _Numbers):

        def by_step(f: Any, spacing: Any, edge_order: Any, result: Any) -> None:
            _require_size(f.shape[0], edge_order)
            _even(f, spacing * 1.0, edge_order, result)

        return by_step
    needs(spacing, "np.gradient along", (1,))

    def by_places(f: Any, spacing: Any, edge_order: Any, result: Any) -> None:
        if spacing.shape[0] != f.shape[0]:
            raise ValueError("np.gradient: coordinates and values of different sizes")
        _require_size(f.shape[0], edge_order)
        places = as_floats(spacing)
        steps = places[1:] - places[:-1]
        is_even = True
        for i in range(steps.shape[0]):
            is_even = is_even and steps[i] == steps[0]
        if is_even:
            _even(f, steps[0], edge_order, result)
        else:
            _uneven(f, steps, edge_order, result)

    return by_places


@plain
def _require_size(size: Any, edge_order: Any) -> None:
    if edge_order != 1 and edge_order != 2:
        raise ValueError("np.gradient: edge_order is 1 or 2")
    if size < edge_order + 1:
        raise ValueError("np.gradient of too few elements")


def _gradient_along(f: Any, spacing: Any, axis: Any, edge_order: Any) -> Any:
    raise NotImplementedError


@compiled_as(_gradient_along)
def _gradient_along_axis(f: Any, spacing: Any, axis: Any, edge_order: Any) -> Any:
    if f.ndim == 1:

        def of_vector(f: Any, spacing: Any, axis: Any, edge_order: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            result = np.empty(f.shape[0])
            _derive(as_floats(f), spacing, edge_order, result)
            return result

        return of_vector

    def of_matrix(f: Any, spacing: Any, axis: Any, edge_order: Any) -> Any:
        values = as_floats(f)
        result = np.empty(f.shape)
        if axis == 1 or axis == -1:
            for i in range(f.shape[0]):
                _derive(values[i], spacing, edge_order, result[i])
        elif axis == 0 or axis == -2:
            for j in range(f.shape[1]):
                _derive(values[:, j], spacing, edge_order, result[:, j])
        else:
            raise ValueError("axis is out of bounds")
        return result

    return of_matrix


@compiled_as(own.rtcf_gradient, arrays=("f",), refused="bfiu")
def _gradient(f: Any, spacing: Any, axis: Any, edge_order: Any) -> Any:
    needs(f, "np.gradient")
    is_all = isinstance(axis, types.NoneType)
    axes = f.ndim if is_all else 1
    steps = ("1.0",) * axes
    if spacing.count:
        is_one = spacing.count == 1 and isinstance(spacing[0], _Numbers)
        if spacing.count != axes and not is_one:
            what = f"np.gradient of {words(f)} with {spacing.count} arguments"
            raise TypingError(f"RTCF:{what}:give it one step, or one per axis")
        steps = tuple(f"spacing[{0 if is_one else k}]" for k in range(axes))
    along = [str(k) if is_all else "axis" for k in range(axes)]
    parts = [
        f"along(f, {step}, {axis_of}, edge_order)"
        for step, axis_of in zip(steps, along, strict=True)
    ]
    scope: dict[str, Any] = {"along": _gradient_along}
    text = parts[0] if len(parts) == 1 else f"({', '.join(parts)})"
    exec(f"def gradient(f, spacing, axis, edge_order):\n    return {text}\n", scope)
    return scope["gradient"]


# Phases.


@plain
def _unwrap_vector(p: Any, discont: Any, period: Any, result: Any) -> None:
    high = period / 2.0
    total = 0.0
    for i in range(p.shape[0]):
        if i == 0:
            result[0] = p[0]
            continue
        far = p[i] - p[i - 1]
        turned = np.remainder(far + high, period) - high
        if turned == -high and far > 0.0:
            turned = high
        correction = 0.0 if abs(far) < discont else turned - far
        total = correction if i == 1 else total + correction
        result[i] = p[i] + total


@compiled_as(own.rtcf_unwrap, arrays=("p",), refused="bfiu")
def _unwrap(p: Any, discont: Any, axis: Any, period: Any) -> Any:
    needs(p, "np.unwrap")
    if dtype_of(p).kind != "f" and not isinstance(period, types.Float):
        raise TypingError("RTCF:np.unwrap of ints with a period of ints:write the period as float")
    if isinstance(discont, types.NoneType):
        return lambda p, discont, axis, period: own.rtcf_unwrap(p, period / 2.0, axis, period)

    def unwrap(p: Any, discont: Any, axis: Any, period: Any) -> Any:
        result = np.empty(p.shape)
        _along_axis(as_floats(p), discont, axis, period * 1.0, result)
        return result

    return unwrap


def _along_axis(p: Any, discont: Any, axis: Any, period: Any, result: Any) -> None:
    raise NotImplementedError


@compiled_as(_along_axis)
def _unwrap_along_axis(p: Any, discont: Any, axis: Any, period: Any, result: Any) -> Any:
    if p.ndim == 1:

        def of_vector(p: Any, discont: Any, axis: Any, period: Any, result: Any) -> None:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            _unwrap_vector(p, discont, period, result)

        return of_vector

    def of_matrix(p: Any, discont: Any, axis: Any, period: Any, result: Any) -> None:
        if axis == 1 or axis == -1:
            for i in range(p.shape[0]):
                _unwrap_vector(p[i], discont, period, result[i])
        elif axis == 0 or axis == -2:
            for j in range(p.shape[1]):
                _unwrap_vector(p[:, j], discont, period, result[:, j])
        else:
            raise ValueError("axis is out of bounds")

    return of_matrix


# Functions of elements.


def _step(x1: Any, x2: Any) -> Any:
    if x1 == 0.0:
        return x2
    return x1 if x1 != x1 else 1.0 if x1 > 0.0 else 0.0


def _sinc_of(x: Any) -> Any:
    y = np.pi * (x if x != 0.0 else 1e-20)
    return np.sin(y) / y


_step_each, _sinc_each = elementwise(_step), elementwise(_sinc_of)


@compiled_as(own.rtcf_heaviside, arrays=("x1", "x2"), refused="bfiu")
def _heaviside(x1: Any, x2: Any) -> Any:
    return lambda x1, x2: _step_each(x1 * 1.0, x2 * 1.0)


@compiled_as(own.rtcf_sinc, arrays=("x",), refused="bfiu")
def _sinc(x: Any) -> Any:
    return lambda x: _sinc_each(x * 1.0)


@compiled_as(own.rtcf_select)
def _select(condlist: Any, choicelist: Any, default: Any) -> Any:
    for each in (condlist, choicelist):
        if not isinstance(each, types.BaseTuple) or not each.count:
            raise TypingError(f"RTCF:np.select of {words(each)}:give it a list of arrays")
    if condlist.count != choicelist.count:
        what = f"{condlist.count} conditions for {choicelist.count} choices"
        raise TypingError(f"RTCF:np.select of {what}:give it as many choices")
    for each in condlist.types:
        if dtype_of(each).kind != "b":
            raise TypingError(f"RTCF:a condition is {words(each)}:compare it: x > 0.0")
    if not any(isinstance(each, types.Array) for each in (*condlist.types, *choicelist.types)):
        raise TypingError("RTCF:np.select of numbers:write x if y else z")
    text = "default"
    for k in range(condlist.count - 1, -1, -1):
        is_row = isinstance(choicelist[k], types.BaseTuple)
        choice = f"array(choicelist[{k}], None)" if is_row else f"choicelist[{k}]"
        text = f"where(condlist[{k}], {choice}, {text})"
    scope: dict[str, Any] = {"where": helpers.rtcf_where, "array": own.rtcf_array}
    exec(f"def select(condlist, choicelist, default):\n    return {text}\n", scope)
    return scope["select"]


# Quantiles.


@plain
def _of_sorted(ordered: Any, q: Any) -> Any:
    """Return the quantile of a sorted vector."""
    n = ordered.shape[0]
    if not 0.0 <= q <= 1.0:
        raise ValueError("quantiles must be in the range 0 to 1, percentiles 0 to 100")
    if n == 0:
        raise IndexError("a quantile of an empty array")
    if ordered[n - 1] != ordered[n - 1]:
        return np.nan
    place = (n - 1) * q
    before = np.floor(place)
    low, high = int(before), int(before) + 1
    share = place - before
    if place >= n - 1:
        low, high, share = n - 1, n - 1, place + 1.0
    far = ordered[high] - ordered[low]
    if share >= 0.5:
        return ordered[high] - far * (1.0 - share)
    return ordered[low] + far * share


@compiled_as(own.rtcf_percentile, arrays=("a", "q"), refused="bfiu")
def _percentile(a: Any, q: Any, axis: Any, method: Any) -> Any:
    return lambda a, q, axis, method: own.rtcf_quantile(a, q / 100.0, axis, method)


def _quantile_of(ordered: Any, q: Any) -> Any:
    raise NotImplementedError


@compiled_as(_quantile_of)
def _quantile_of_sorted(ordered: Any, q: Any) -> Any:
    if isinstance(q, types.Float):
        return lambda ordered, q: _of_sorted(ordered, q)
    to = dtype_of(ordered).type

    def whole(ordered: Any, q: Any) -> Any:
        n = ordered.shape[0]
        if q != 0 and q != 1:
            raise ValueError("quantiles must be in the range 0 to 1")
        is_nan = ordered[n - 1] != ordered[n - 1]
        return to(ordered[n - 1] if is_nan or q == 1 else ordered[0])

    return whole


@compiled_as(own.rtcf_quantile, arrays=("a", "q"), refused="bfiu")
def _quantile(a: Any, q: Any, axis: Any, method: Any) -> Any:
    needs(a, "np.quantile")
    if isinstance(q, _Numbers):
        if isinstance(axis, types.NoneType):
            return lambda a, q, axis, method: _quantile_of(own.rtcf_sort(own.rtcf_ravel(a), -1), q)
        return lambda a, q, axis, method: _quantile_along(own.rtcf_sort(a, axis), q, axis)
    needs(q, "np.quantile at", (1,))
    if not isinstance(axis, types.NoneType):
        what = "np.quantile or np.percentile of several quantiles along an axis"
        raise TypingError(f"RTCF:{what}:call it for each quantile")
    dtype = _result_of(a, q)

    def each(a: Any, q: Any, axis: Any, method: Any) -> Any:
        ordered = own.rtcf_sort(own.rtcf_ravel(a), -1)
        result = np.empty(q.shape[0], dtype)
        for k in range(q.shape[0]):
            result[k] = _quantile_of(ordered, q[k])
        return result

    return each


def _result_of(a: Any, q: Any) -> Any:
    """Return the element type of quantiles: of whole numbers, they are elements."""
    return np.dtype(np.float64) if dtype_of(q).kind == "f" else dtype_of(a)


def _quantile_along(ordered: Any, q: Any, axis: Any) -> Any:
    raise NotImplementedError


@compiled_as(_quantile_along)
def _quantile_along_axis(ordered: Any, q: Any, axis: Any) -> Any:
    dtype = _result_of(ordered, q)
    if ordered.ndim == 1:

        def of_vector(ordered: Any, q: Any, axis: Any) -> Any:
            if axis != 0 and axis != -1:
                raise ValueError("axis is out of bounds")
            return _quantile_of(ordered, q)

        return of_vector

    def of_matrix(ordered: Any, q: Any, axis: Any) -> Any:
        if axis == 1 or axis == -1:
            result = np.empty(ordered.shape[0], dtype)
            for i in range(ordered.shape[0]):
                result[i] = _quantile_of(ordered[i], q)
        elif axis == 0 or axis == -2:
            result = np.empty(ordered.shape[1], dtype)
            for j in range(ordered.shape[1]):
                result[j] = _quantile_of(ordered[:, j], q)
        else:
            raise ValueError("axis is out of bounds")
        return result

    return of_matrix
