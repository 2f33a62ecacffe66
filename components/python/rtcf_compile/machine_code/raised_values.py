"""The two numbers in the text of an exception, such as an index and a size.

An exception of compiled code is constant bytes. Its text has placeholders {} for the numbers. The
code stores the numbers in a variable of the module just before it raises, so there is no cost
without an exception. The entry of the hook copies them to the record (port_access.py) for the
runtime.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rtcf_compile.machine_code.raises import WITH_VALUES

NAME = "rtcf_raised_values"
_OUT_OF_BOUNDS = f"{WITH_VALUES}index {{}} is out of bounds for size {{}}"


def _store(builder: Any, *values: Any) -> None:
    word = ir.IntType(64)
    module = builder.module
    place = module.globals.get(NAME) or ir.GlobalVariable(module, ir.ArrayType(word, 2), NAME)
    for number, value in enumerate(values):
        indices = [ir.Constant(ir.IntType(32), each) for each in (0, number)]
        builder.store(value, builder.gep(place, indices))


@intrinsic
def note(typing, first, second):  # type: ignore[no-untyped-def]
    """Store the numbers of the exception that the next statement raises."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        kinds = zip(arguments, signature.args, strict=True)
        _store(builder, *(context.cast(builder, each, kind, types.int64) for each, kind in kinds))
        return context.get_dummy_value()

    return types.none(first, second), generate


def check_bounds(context: Any, builder: Any, ind: Any, dimlen: Any, axis: Any = None) -> None:
    """Raise IndexError with index and size; replaces numba's cgutils.do_boundscheck.

    numba has already added the size to a negative index.
    """
    with cgutils.if_unlikely(builder, builder.icmp_signed(">=", ind, dimlen)):
        _raise(context, builder, ind, dimlen)
    with cgutils.if_unlikely(builder, builder.icmp_signed("<", ind, ind.type(0))):
        _raise(context, builder, builder.sub(ind, dimlen), dimlen)


def _raise(context: Any, builder: Any, index: Any, size: Any) -> None:
    _store(builder, index, size)
    context.call_conv.return_user_exc(builder, IndexError, (_OUT_OF_BOUNDS,))
