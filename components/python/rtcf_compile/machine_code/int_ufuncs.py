"""Division of arrays of signed ints as NumPy has it, in the place of numba's.

- numba's remainder of the smallest int by -1 is an instruction that traps, which ends the process.
- numba's quotient of these is 0; NumPy's is the smallest int again.
- numba's np.fmod takes ints for unsigned ones.

Imported only where something is compiled.
"""

from typing import Any

import numpy as np
from numba.np import npyfuncs, ufunc_db

_SIGNED = [f"{each}{each}->{each}" for each in "bhilq"]


def _divisor(builder: Any, divisor: Any, is_other: Any) -> Any:
    """Return a divisor, 1 in the place of one that is treated on its own."""
    return builder.select(is_other, divisor.type(1), divisor)


def _is(builder: Any, value: Any, number: int) -> Any:
    return builder.icmp_signed("==", value, value.type(number))


def _quotient(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    value, divisor = arguments
    is_minus_one = _is(builder, divisor, -1)
    pair = value, _divisor(builder, divisor, is_minus_one)
    quotient = npyfuncs.np_int_sdiv_impl(context, builder, signature, pair)
    return builder.select(is_minus_one, builder.neg(value), quotient)


def _remainder(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    value, divisor = arguments
    pair = value, _divisor(builder, divisor, _is(builder, divisor, -1))
    return npyfuncs.np_int_srem_impl(context, builder, signature, pair)


def _fmod(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Return the remainder that has the sign of the value; 0 by 0."""
    value, divisor = arguments
    is_other = builder.or_(_is(builder, divisor, -1), _is(builder, divisor, 0))
    return builder.srem(value, _divisor(builder, divisor, is_other))


for _ufunc, _kernel in (
    (np.floor_divide, _quotient),
    (np.remainder, _remainder),
    (np.fmod, _fmod),
):
    _kernels = ufunc_db.get_ufunc_info(_ufunc)
    _kernels.update(dict.fromkeys(_SIGNED, _kernel))
