"""Helpers for functions of math with our own overloads: of several numbers, of ints, and those that
the C library computes differently. Other functions of one float are in helpers.py.

An int that does not fit int64 raises OverflowError.
"""

import math
from collections.abc import Callable
from typing import Any

from rtcf_compile.rewriting.helpers import rtcf_to_int

Function = Callable[..., Any]
# The ints to which results within int64 are limited, before Python computes them.
_LARGEST_FACTORIAL, _MOST_CHOSEN = 20, 64

STANDS_FOR: list[tuple[Function, Function]] = []
# Functions of any number of arguments. The helper takes them as a tuple.
OF_ALL_ARGUMENTS: dict[Function, Function] = {}


def _overflow() -> OverflowError:
    return OverflowError("does not fit int64")


def _stands_for(function: Function, takes_all: bool = False) -> Callable[[Function], Function]:
    def register(own: Function) -> Function:
        STANDS_FOR.append((function, own))
        if takes_all:
            OF_ALL_ARGUMENTS[function] = own
        return own

    return register


# Floats.


@_stands_for(math.hypot, takes_all=True)
def rtcf_math_hypot(coordinates: Any) -> float:
    """Return math.hypot(*coordinates)."""
    return math.hypot(*coordinates)


@_stands_for(math.dist)
def rtcf_math_dist(p: Any, q: Any) -> float:
    """Return math.dist(p, q)."""
    return math.dist(p, q)


@_stands_for(math.fsum)
def rtcf_math_fsum(seq: Any) -> float:
    """Return math.fsum(seq), the correctly rounded sum."""
    return math.fsum(seq)


@_stands_for(math.prod)
def rtcf_math_prod(iterable: Any, start: Any = 1) -> Any:
    """Return math.prod(iterable, start=start), from the first element to the last."""
    return math.prod(iterable, start=start)


@_stands_for(math.gamma)
def rtcf_math_gamma(x: Any) -> float:
    """Return math.gamma(x)."""
    return math.gamma(x)


@_stands_for(math.lgamma)
def rtcf_math_lgamma(x: Any) -> float:
    """Return math.lgamma(x)."""
    return math.lgamma(x)


@_stands_for(math.nextafter)
def rtcf_math_nextafter(x: Any, y: Any) -> float:
    """Return math.nextafter(x, y)."""
    return math.nextafter(x, y)


@_stands_for(math.ulp)
def rtcf_math_ulp(x: Any) -> float:
    """Return math.ulp(x)."""
    return math.ulp(x)


@_stands_for(math.frexp)
def rtcf_math_frexp(x: Any) -> Any:
    """Return math.frexp(x)."""
    return math.frexp(x)


@_stands_for(math.ldexp)
def rtcf_math_ldexp(x: Any, i: Any) -> float:
    """Return math.ldexp(x, i)."""
    return math.ldexp(x, i)


@_stands_for(math.modf)
def rtcf_math_modf(x: Any) -> Any:
    """Return math.modf(x)."""
    return math.modf(x)


@_stands_for(math.isclose)
def rtcf_math_isclose(a: Any, b: Any, rel_tol: Any = 1e-09, abs_tol: Any = 0.0) -> Any:
    """Tell whether two numbers are equal within tolerances."""
    return math.isclose(a, b, rel_tol=rel_tol, abs_tol=abs_tol)


# Ints.


@_stands_for(math.isqrt)
def rtcf_math_isqrt(n: Any) -> int:
    """Return math.isqrt(n)."""
    return math.isqrt(n)


@_stands_for(math.factorial)
def rtcf_math_factorial(x: Any) -> Any:
    """Return math.factorial(x) of an int."""
    if x > _LARGEST_FACTORIAL:
        raise _overflow()
    return math.factorial(x)


@_stands_for(math.comb)
def rtcf_math_comb(n: Any, k: Any) -> Any:
    """Return math.comb(n, k)."""
    if 0 <= k <= n and min(k, n - k) > _MOST_CHOSEN:
        raise _overflow()
    return rtcf_to_int(math.comb(n, k))


@_stands_for(math.perm)
def rtcf_math_perm(n: Any, k: Any = None) -> Any:
    """Return math.perm(n, k)."""
    if k is None:
        return rtcf_math_factorial(n)
    if _LARGEST_FACTORIAL < k <= n:
        raise _overflow()
    return rtcf_to_int(math.perm(n, k))


@_stands_for(math.gcd, takes_all=True)
def rtcf_math_gcd(integers: Any) -> Any:
    """Return math.gcd(*integers)."""
    return rtcf_to_int(math.gcd(*integers))


@_stands_for(math.lcm, takes_all=True)
def rtcf_math_lcm(integers: Any) -> Any:
    """Return math.lcm(*integers)."""
    return rtcf_to_int(math.lcm(*integers))


BY_NAME: dict[str, Function] = {each.__name__: each for _, each in STANDS_FOR}
