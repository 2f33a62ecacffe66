"""The numba overloads of functions of math, with the algorithms of CPython's mathmodule.c.

Import this only to compile: it imports numba.
"""

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.numpy_support import as_dtype

from rtcf_compile.machine_code.overloads import compiled_as, plain, words
from rtcf_compile.rewriting import math_functions as own
from rtcf_compile.rewriting import operators

_Numbers = types.Number | types.Boolean
_LARGEST = 2**63 - 1
_SMALLEST_NORMAL = 2.2250738585072014e-308
_nextafter = types.ExternalFunction("nextafter", types.float64(types.float64, types.float64))
_ldexp = types.ExternalFunction("ldexp", types.float64(types.float64, types.int32))


def _float(kind: Any, name: str) -> None:
    """Reject values other than a number."""
    if not isinstance(kind, _Numbers):
        raise TypingError(f"RTCF:math.{name} of {words(kind)}:give it a number")


def _int(kind: Any, name: str) -> None:
    """Reject values other than an int."""
    if not isinstance(kind, types.Integer | types.Boolean):
        raise TypingError(f"RTCF:math.{name} of {words(kind)}:give it an int: int(…)")


def _sequence(kind: Any, name: str) -> None:
    """Reject values other than a vector or a tuple of numbers."""
    is_vector = isinstance(kind, types.Array) and kind.ndim == 1
    is_tuple = isinstance(kind, types.BaseTuple) and all(
        isinstance(each, _Numbers) for each in kind.types
    )
    if not is_vector and not is_tuple:
        raise TypingError(f"RTCF:math.{name} of {words(kind)}:give it a vector or a tuple")


def _floats(values: Any) -> Any:
    raise NotImplementedError


@compiled_as(_floats)
def _as_floats(values: Any) -> Any:
    """Return a new vector of floats from a vector or a tuple."""
    if isinstance(values, types.BaseTuple):
        # numba indexes a tuple of several types only by constants.
        lines = [f"    result[{k}] = np.float64(values[{k}])" for k in range(values.count)]
        text = "\n".join(["def floats(values):", f"    result = np.empty({values.count})", *lines])
        scope: dict[str, Any] = {"np": np}
        exec(f"{text}\n    return result\n", scope)
        return scope["floats"]

    def floats(values: Any) -> Any:
        result = np.empty(values.shape[0])
        for k in range(values.shape[0]):
            result[k] = np.float64(values[k])
        return result

    return floats


# Parts of floats.


@intrinsic  # type: ignore[misc]
def _bits(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.int64(types.float64), generate


@plain
def _parts(x: Any) -> Any:
    """Return the mantissa and the exponent of a float."""
    if x == 0.0 or not math.isfinite(x):
        return x, 0
    shift = 0
    if abs(x) < _SMALLEST_NORMAL:
        x *= 18014398509481984.0
        shift = 54
    exponent = ((_bits(x) >> 52) & 2047) - 1022
    return _ldexp(x, np.int32(-exponent)), exponent - shift


@compiled_as(own.rtcf_math_nextafter)
def _next(x: Any, y: Any) -> Any:
    _float(x, "nextafter")
    _float(y, "nextafter")
    return lambda x, y: _nextafter(np.float64(x), np.float64(y))


@compiled_as(own.rtcf_math_ulp)
def _ulp(x: Any) -> Any:
    _float(x, "ulp")

    def ulp(x: Any) -> Any:
        far = abs(np.float64(x))
        if not math.isfinite(far):
            return far
        above = _nextafter(far, np.inf)
        return above - far if math.isfinite(above) else far - _nextafter(far, 0.0)

    return ulp


@compiled_as(own.rtcf_math_frexp)
def _frexp(x: Any) -> Any:
    _float(x, "frexp")
    return lambda x: _parts(np.float64(x))


@compiled_as(own.rtcf_math_ldexp)
def _scaled(x: Any, i: Any) -> Any:
    _float(x, "ldexp")
    _int(i, "ldexp")

    def ldexp(x: Any, i: Any) -> Any:
        # The result is 0 or infinite beyond these.
        power = -5000 if i < -5000 else 5000 if i > 5000 else i
        result = _ldexp(np.float64(x), np.int32(power))
        if math.isinf(result) and not math.isinf(x):
            raise OverflowError("math range error")
        return result

    return ldexp


@compiled_as(own.rtcf_math_modf)
def _modf(x: Any) -> Any:
    _float(x, "modf")

    def modf(x: Any) -> Any:
        x = np.float64(x)
        whole = np.trunc(x)
        rest = 0.0 if math.isinf(x) else x - whole
        return math.copysign(rest, x), whole

    return modf


@compiled_as(own.rtcf_math_isclose)
def _isclose(a: Any, b: Any, rel_tol: Any, abs_tol: Any) -> Any:
    def isclose(a: Any, b: Any, rel_tol: Any, abs_tol: Any) -> Any:
        x, y = np.float64(a), np.float64(b)
        if rel_tol < 0.0 or abs_tol < 0.0:
            raise ValueError("tolerances must be non-negative")
        if x == y:
            return True
        if math.isinf(x) or math.isinf(y):
            return False
        far = abs(y - x)
        return far <= abs(rel_tol * y) or far <= abs(rel_tol * x) or far <= abs_tol

    return isclose


# Norms.


@plain
def _low_of_square(x: Any, square: Any) -> Any:
    """Return x * x - square exactly (Dekker, 1971)."""
    split = 134217729.0 * x
    high = split - (split - x)
    low = x - high
    return ((high * high - square) + 2.0 * (high * low)) + low * low


@plain
def _norm(values: Any, exponent: Any) -> Any:
    """Return the root of the sum of the squares of finite numbers below 2**exponent."""
    # All sums and products are exact, except the sums of their rests.
    scale = _ldexp(1.0, np.int32(-exponent))
    total, low, rest = 1.0, 0.0, 0.0
    for k in range(values.shape[0]):
        x = values[k] * scale
        square = x * x
        low += _low_of_square(x, square)
        before = total
        total += square
        rest += square - (total - before)
    root = np.sqrt(total - 1.0 + (low + rest))
    square = root * root
    low -= _low_of_square(root, square)
    before = total
    total -= square
    rest += -square - (total - before)
    far = total - 1.0 + (low + rest)
    return (root + far / (2.0 * root)) / scale


@plain
def _length(values: Any) -> Any:
    """Return the root of the sum of the squares of numbers; changes the vector."""
    largest, found_nan = 0.0, False
    for k in range(values.shape[0]):
        values[k] = abs(values[k])
        if values[k] != values[k]:
            found_nan = True
        elif values[k] > largest:
            largest = values[k]
    if largest == np.inf:
        return largest
    if found_nan:
        return np.nan
    if largest == 0.0 or values.shape[0] <= 1:
        return largest
    exponent = _parts(largest)[1]
    if exponent >= -1023:
        return _norm(values, exponent)
    for k in range(values.shape[0]):
        values[k] /= _SMALLEST_NORMAL
    return _SMALLEST_NORMAL * _norm(values, _parts(largest / _SMALLEST_NORMAL)[1])


@compiled_as(own.rtcf_math_hypot)
def _hypot(coordinates: Any) -> Any:
    for each in coordinates.types:
        _float(each, "hypot")
    return lambda coordinates: _length(_floats(coordinates))


@compiled_as(own.rtcf_math_dist)
def _dist(p: Any, q: Any) -> Any:
    _sequence(p, "dist")
    _sequence(q, "dist")

    def dist(p: Any, q: Any) -> Any:
        far, there = _floats(p), _floats(q)
        if far.shape[0] != there.shape[0]:
            raise ValueError("both points must have the same number of dimensions")
        for k in range(far.shape[0]):
            far[k] -= there[k]
        return _length(far)

    return dist


# Sums and products.


@compiled_as(own.rtcf_math_fsum)
def _fsum(seq: Any) -> Any:
    _sequence(seq, "fsum")
    return lambda seq: _rounded_sum(_floats(seq))


@plain
def _rounded_sum(values: Any) -> Any:
    """Return the correctly rounded sum of a vector (Shewchuk, 1997)."""
    # The sum of the partials is exact. There are no more of them than numbers added.
    partials = np.empty(values.shape[0])
    n = 0
    special, infinite = 0.0, 0.0
    for k in range(values.shape[0]):
        x = values[k]
        i = 0
        for j in range(n):
            y = partials[j]
            if abs(x) < abs(y):
                x, y = y, x
            high = x + y
            low = y - (high - x)
            if low != 0.0:
                partials[i] = low
                i += 1
            x = high
        n = i
        if x == 0.0:
            continue
        if math.isfinite(x):
            partials[n] = x
            n += 1
            continue
        if math.isfinite(values[k]):
            raise OverflowError("intermediate overflow in fsum")
        if math.isinf(values[k]):
            infinite += values[k]
        special += values[k]
        n = 0
    if special != 0.0:
        if math.isnan(infinite):
            raise ValueError("-inf + inf in fsum")
        return special
    total, low = 0.0, 0.0
    if n > 0:
        n -= 1
        total = partials[n]
    while n > 0 and low == 0.0:
        n -= 1
        x, y = total, partials[n]
        total = x + y
        low = y - (total - x)
    # Round halves to even over several partials.
    if n > 0 and low * partials[n - 1] != 0.0 and (low < 0.0) == (partials[n - 1] < 0.0):
        y = low * 2.0
        x = total + y
        if y == x - total:
            total = x
    return total


@compiled_as(own.rtcf_math_prod)
def _prod(iterable: Any, start: Any) -> Any:
    _sequence(iterable, "prod")
    _float(start, "prod")
    if isinstance(iterable, types.Array):
        if operators.is_narrow(as_dtype(iterable.dtype)):
            what = f"math.prod of {words(iterable)}"
            raise TypingError(f"RTCF:{what}:use np.prod")

        def of_vector(iterable: Any, start: Any) -> Any:
            result = start * _one(iterable)
            for k in range(iterable.shape[0]):
                result = result * iterable[k]
            return result

        return of_vector
    factors = "".join(f" * iterable[{k}]" for k in range(iterable.count))
    scope: dict[str, Any] = {}
    exec(f"def prod(iterable, start):\n    return start{factors}\n", scope)
    return scope["prod"]


def _one(values: Any) -> Any:
    raise NotImplementedError


@compiled_as(_one)
def _one_of(values: Any) -> Any:
    """Return 1 in the type of the elements; an int for bools."""
    if isinstance(values.dtype, types.Float):
        return lambda values: 1.0
    return lambda values: 1


# Gamma function (Lanczos).

_PI, _LOG_PI = math.pi, 1.1447298858494002
_G, _G_MINUS_HALF = 6.02468004077673, 5.52468004077673
_NUMERATOR = (
    *(23531376880.41076, 42919803642.6491, 35711959237.35567, 17921034426.03721),
    *(6039542586.352028, 1439720407.3117216, 248874557.86205417, 31426415.585400194),
    *(2876370.6289353725, 186056.26539522348, 8071.672002365816, 210.82427775157936),
    2.5066282746310002,
)
_DENOMINATOR = (
    *(0.0, 39916800.0, 120543840.0, 150917976.0, 105258076.0, 45995730.0, 13339535.0),
    *(2637558.0, 357423.0, 32670.0, 1925.0, 66.0, 1.0),
)
_WHOLE = tuple(float(math.factorial(k)) for k in range(23))


@plain
def _lanczos_sum(x: Any) -> Any:
    above, below = 0.0, 0.0
    if x < 5.0:
        for k in range(12, -1, -1):
            above = above * x + _NUMERATOR[k]
            below = below * x + _DENOMINATOR[k]
    else:
        for k in range(13):
            above = above / x + _NUMERATOR[k]
            below = below / x + _DENOMINATOR[k]
    return above / below


@plain
def _sin_of_pi(x: Any) -> Any:
    """Return sin(pi x)."""
    y = np.fmod(abs(x), 2.0)
    turns = np.floor(2.0 * y)
    if 2.0 * y - turns >= 0.5:
        turns += 1.0
    if turns == 0.0:
        r = math.sin(_PI * y)
    elif turns == 1.0:
        r = math.cos(_PI * (y - 0.5))
    elif turns == 2.0:
        r = math.sin(_PI * (1.0 - y))
    elif turns == 3.0:
        r = -math.cos(_PI * (y - 1.5))
    else:
        r = math.sin(_PI * (y - 2.0))
    return math.copysign(1.0, x) * r


@plain
def _gamma_of(x: Any) -> Any:
    """Return the gamma function of a finite number other than 0."""
    far = abs(x)
    if far < 1e-20:
        return 1.0 / x
    if far > 200.0:
        return 0.0 / _sin_of_pi(x) if x < 0.0 else np.inf
    y = far + _G_MINUS_HALF
    more, less = max(far, _G_MINUS_HALF), min(far, _G_MINUS_HALF)
    z = ((y - more) - less) * _G / y
    if x < 0.0:
        r = -_PI / _sin_of_pi(far) / far * math.exp(y) / _lanczos_sum(far)
        r -= z * r
        if far < 140.0:
            return r / y ** (far - 0.5)
        root = y ** (far / 2.0 - 0.25)
        return r / root / root
    r = _lanczos_sum(far) / math.exp(y)
    r += z * r
    if far < 140.0:
        return r * y ** (far - 0.5)
    root = y ** (far / 2.0 - 0.25)
    return r * root * root


@compiled_as(own.rtcf_math_gamma)
def _gamma(x: Any) -> Any:
    _float(x, "gamma")

    def gamma(x: Any) -> Any:
        x = np.float64(x)
        if not math.isfinite(x):
            if x < 0.0:
                raise ValueError("math domain error")
            return x
        is_whole = x == np.floor(x)
        if is_whole and x <= 0.0:
            raise ValueError("math domain error")
        if is_whole and x <= 23.0:
            return _WHOLE[int(x) - 1]
        result = _gamma_of(x)
        if math.isinf(result):
            raise OverflowError("math range error")
        return result

    return gamma


@compiled_as(own.rtcf_math_lgamma)
def _lgamma(x: Any) -> Any:
    _float(x, "lgamma")

    def lgamma(x: Any) -> Any:
        x = np.float64(x)
        if not math.isfinite(x):
            return abs(x)
        if x == np.floor(x) and x <= 2.0:
            if x <= 0.0:
                raise ValueError("math domain error")
            return 0.0
        far = abs(x)
        if far < 1e-20:
            return -math.log(far)
        result = math.log(_lanczos_sum(far)) - _G
        result += (far - 0.5) * (math.log(far + _G - 0.5) - 1.0)
        if x < 0.0:
            result = _LOG_PI - math.log(abs(_sin_of_pi(far))) - math.log(far) - result
        if math.isinf(result):
            raise OverflowError("math range error")
        return result

    return lgamma


# Ints.


@compiled_as(own.rtcf_math_isqrt)
def _isqrt(n: Any) -> Any:
    _int(n, "isqrt")

    def isqrt(n: Any) -> Any:
        n = np.int64(operators.rtcf_plain(n))
        if n < 0:
            raise ValueError("isqrt() argument must be nonnegative")
        root = min(np.int64(np.sqrt(np.float64(n))), np.int64(3037000499))
        if root * root > n:
            root -= 1
        elif root < 3037000499 and (root + 1) * (root + 1) <= n:
            root += 1
        return root

    return isqrt


@plain
def _product(first: Any, second: Any) -> Any:
    """Return the product of two ints, the second above 0; raise if it does not fit int64."""
    if first > _LARGEST // second:
        raise OverflowError("does not fit int64")
    return first * second


@plain
def _common(a: Any, b: Any) -> Any:
    """Return the greatest common divisor of two ints from 0."""
    while b != 0:
        a, b = b, a % b
    return a


@compiled_as(own.rtcf_math_factorial)
def _factorial(x: Any) -> Any:
    _int(x, "factorial")

    def factorial(x: Any) -> Any:
        n = np.int64(operators.rtcf_plain(x))
        if n < 0:
            raise ValueError("factorial() not defined for negative values")
        if n > 20:
            raise OverflowError("does not fit int64")
        result = 1
        for k in range(2, n + 1):
            result *= k
        return result

    return factorial


@compiled_as(own.rtcf_math_comb)
def _comb(n: Any, k: Any) -> Any:
    _int(n, "comb")
    _int(k, "comb")

    def comb(n: Any, k: Any) -> Any:
        n, k = np.int64(operators.rtcf_plain(n)), np.int64(operators.rtcf_plain(k))
        if n < 0:
            raise ValueError("n must be a non-negative integer")
        if k < 0:
            raise ValueError("k must be a non-negative integer")
        if k > n:
            return 0
        k = min(k, n - k)
        result = 1
        # Each step multiplies by at least 1.
        for i in range(k):
            divisor = np.int64(i + 1)
            common = _common(result, divisor)
            result = _product(result // common, (n - i) // (divisor // common))
        return result

    return comb


@compiled_as(own.rtcf_math_perm)
def _perm(n: Any, k: Any) -> Any:
    _int(n, "perm")
    if isinstance(k, types.NoneType):
        return lambda n, k: own.rtcf_math_factorial(n)
    _int(k, "perm")

    def perm(n: Any, k: Any) -> Any:
        n, k = np.int64(operators.rtcf_plain(n)), np.int64(operators.rtcf_plain(k))
        if n < 0:
            raise ValueError("n must be a non-negative integer")
        if k < 0:
            raise ValueError("k must be a non-negative integer")
        if k > n:
            return 0
        result = 1
        for i in range(k):
            result = _product(result, n - i)
        return result

    return perm


def _magnitudes(integers: Any) -> Any:
    raise NotImplementedError


@compiled_as(_magnitudes)
def _magnitudes_of(integers: Any) -> Any:
    """Return the absolute values of a tuple of ints."""
    text = f"def magnitudes(integers):\n    result = np.empty({integers.count}, np.uint64)\n"
    text += "".join(
        f"    result[{k}] = magnitude(np.int64(plain(integers[{k}])))\n"
        for k in range(integers.count)
    )
    scope: dict[str, Any] = {
        **{"np": np, "magnitude": _magnitude, "plain": operators.rtcf_plain},
    }
    exec(f"{text}    return result\n", scope)
    return scope["magnitudes"]


@plain
def _magnitude(n: Any) -> Any:
    return np.uint64(n) if n >= 0 else np.uint64(-(n + 1)) + np.uint64(1)


@compiled_as(own.rtcf_math_gcd)
def _gcd(integers: Any) -> Any:
    for each in integers.types:
        _int(each, "gcd")

    def gcd(integers: Any) -> Any:
        values = _magnitudes(integers)
        result = np.uint64(0)
        for k in range(values.shape[0]):
            result = _common(result, values[k])
        return operators.rtcf_plain(result)

    return gcd


@compiled_as(own.rtcf_math_lcm)
def _lcm(integers: Any) -> Any:
    for each in integers.types:
        _int(each, "lcm")

    def lcm(integers: Any) -> Any:
        values = _magnitudes(integers)
        for k in range(values.shape[0]):
            if values[k] == 0:
                return 0
        result = np.uint64(1)
        for k in range(values.shape[0]):
            factor = values[k] // _common(result, values[k])
            if result > np.uint64(_LARGEST) // factor:
                raise OverflowError("does not fit int64")
            result = result * factor
        return operators.rtcf_plain(result)

    return lcm
