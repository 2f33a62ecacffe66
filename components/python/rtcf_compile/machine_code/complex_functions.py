"""The numba overloads of cmath and of powers of complex numbers, with the exceptions of Python."""

import cmath
import math
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.errors import TypingError

from rtcf_compile.machine_code.overloads import compiled_as, plain, words
from rtcf_compile.rewriting import helpers


@plain
def _is_finite(z: Any) -> Any:
    return math.isfinite(z.real) and math.isfinite(z.imag)


# The arguments outside the domains of functions, as in CPython's cmathmodule.c.


@plain
def _never(z: Any) -> Any:
    return False


@plain
def _zero(z: Any) -> Any:
    return z.real == 0.0 and z.imag == 0.0


@plain
def _exp(z: Any) -> Any:
    return math.isinf(z.imag) and (math.isfinite(z.real) or z.real == math.inf)


@plain
def _cosh(z: Any) -> Any:
    return math.isinf(z.imag) and not math.isnan(z.real)


@plain
def _cos(z: Any) -> Any:
    return math.isinf(z.real) and not math.isnan(z.imag)


@plain
def _tanh(z: Any) -> Any:
    return math.isinf(z.imag) and math.isfinite(z.real)


@plain
def _tan(z: Any) -> Any:
    return math.isinf(z.real) and math.isfinite(z.imag)


@plain
def _atanh(z: Any) -> Any:
    return abs(z.real) == 1.0 and z.imag == 0.0


@plain
def _atan(z: Any) -> Any:
    return z.real == 0.0 and abs(z.imag) == 1.0


_OUTSIDE: dict[Callable[..., Any], Any] = {
    **{cmath.exp: _exp, cmath.log: _zero, cmath.log10: _zero, cmath.atan: _atan},
    **{cmath.cosh: _cosh, cmath.sinh: _cosh, cmath.cos: _cos, cmath.sin: _cos},
    **{cmath.tanh: _tanh, cmath.tan: _tan, cmath.atanh: _atanh},
}


def _checking(helper: Callable[..., Any], function: Callable[..., Any]) -> None:
    """Register the overload of a function of one complex number."""
    is_outside = _OUTSIDE.get(function, _never)

    @compiled_as(helper)
    def choose(value: Any) -> Any:
        if not isinstance(value, types.Number | types.Boolean):
            name = function.__name__
            raise TypingError(f"RTCF:cmath.{name} of {words(value)}:use np.{name} of an array")

        def checked(value: Any) -> Any:
            z = complex(value)
            if is_outside(z):
                raise ValueError("math domain error")
            result = function(z)
            if _is_finite(z) and not _is_finite(complex(result)):
                raise OverflowError("math range error")
            return result

        return checked


for _function, _helper in helpers.CMATH.items():
    _checking(_helper, _function)


@compiled_as(helpers.rtcf_cmath_rect)
def _rect(r: Any, phi: Any) -> Any:
    def rect(r: Any, phi: Any) -> Any:
        if math.isinf(phi) and r != 0.0 and not math.isnan(r):
            raise ValueError("math domain error")
        return cmath.rect(r, phi)

    return rect


@plain
def _whole_power(base: Any, count: Any) -> Any:
    result, square = 1.0 + 0.0j, base
    while count > 0:
        if count & 1:
            result = result * square
        count >>= 1
        if count > 0:
            square = square * square
    return result


@compiled_as(helpers.rtcf_complex_pow)
def _power(base: Any, exponent: Any) -> Any:
    def power(base: Any, exponent: Any) -> Any:
        a, b = complex(base), complex(exponent)
        if b.imag == 0.0 and b.real == math.floor(b.real) and abs(b.real) <= 100.0:
            result = _whole_power(a, int(abs(b.real)))
            if b.real < 0.0:
                if _zero(result):
                    raise ZeroDivisionError("0.0 to a negative or complex power")
                result = 1.0 / result
        elif _zero(a):
            if b.imag != 0.0 or b.real < 0.0:
                raise ZeroDivisionError("0.0 to a negative or complex power")
            result = 0.0j
        else:
            size, angle = abs(a), math.atan2(a.imag, a.real)
            length, phase = size**b.real, angle * b.real
            if b.imag != 0.0:
                length /= math.exp(angle * b.imag)
                phase += b.imag * math.log(size)
            result = complex(length * math.cos(phase), length * math.sin(phase))
        if _is_finite(a) and _is_finite(b) and not _is_finite(result):
            raise OverflowError("complex exponentiation")
        return result

    return power
