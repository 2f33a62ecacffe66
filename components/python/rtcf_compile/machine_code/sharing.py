"""Tests whether two arrays share elements. LLVM folds the tests for members of a record."""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_SIZE = ir.IntType(64)


def _shares(typing: Any, target: Any, value: Any) -> Any:
    comparable = target.ndim == value.ndim and target.dtype == value.dtype
    return _compared(target, value, comparable)


def _overlaps(typing: Any, target: Any, value: Any) -> Any:
    return _compared(target, value, False)


def _in_one_block(typing: Any, target: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        arrays = (
            context.make_array(kind)(context, builder, array)
            for kind, array in zip(signature.args, arguments, strict=True)
        )
        owners = (builder.bitcast(each.meminfo, cgutils.voidptr_t) for each in arrays)
        return builder.icmp_unsigned("==", *owners)

    return types.boolean(target, value), generate


def _compared(target: Any, value: Any, but_same: bool) -> Any:
    """Return the signature and the code generator of the test.

    `but_same`: the test is false if both arrays have all elements at the same addresses.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        one, other = (
            context.make_array(kind)(context, builder, array)
            for kind, array in zip(signature.args, arguments, strict=True)
        )
        # Arrays in different blocks, or in a block and a record, do not overlap.
        owners = (builder.bitcast(each.meminfo, cgutils.voidptr_t) for each in (one, other))
        conditions = [builder.icmp_unsigned("==", *owners)]
        conditions += [builder.icmp_signed("!=", each.nitems, _SIZE(0)) for each in (one, other)]
        begin, there = (builder.ptrtoint(each.data, _SIZE) for each in (one, other))
        distance = builder.sub(there, begin)
        low, high = _ends(context, builder, target, one)
        first, last = _ends(context, builder, value, other)
        conditions.append(builder.icmp_signed("<=", low, builder.add(distance, last)))
        conditions.append(builder.icmp_signed("<=", builder.add(distance, first), high))
        if but_same:
            same = builder.icmp_signed("==", distance, _SIZE(0))
            for name in ("strides", "shape"):
                pairs = zip(*(_numbers(builder, each, name) for each in (one, other)), strict=True)
                for pair in pairs:
                    same = builder.and_(same, builder.icmp_signed("==", *pair))
            conditions.append(builder.not_(same))
        result = conditions[0]
        for each in conditions[1:]:
            result = builder.and_(result, each)
        return result

    return types.boolean(target, value), generate


def _ends(context: Any, builder: Any, kind: Any, array: Any) -> tuple[Any, Any]:
    """Return the offsets of the first and last byte of an array from its first element."""
    item = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    low, high = _SIZE(0), _SIZE(item - 1)
    strides, shape = _numbers(builder, array, "strides"), _numbers(builder, array, "shape")
    for stride, size in zip(strides, shape, strict=True):
        span = builder.mul(builder.sub(size, _SIZE(1)), stride)
        backwards = builder.icmp_signed("<", span, _SIZE(0))
        low = builder.add(low, builder.select(backwards, span, _SIZE(0)))
        high = builder.add(high, builder.select(backwards, _SIZE(0), span))
    return low, high


def _numbers(builder: Any, array: Any, name: str) -> Any:
    return cgutils.unpack_tuple(builder, getattr(array, name))


for _each in (_shares, _overlaps, _in_one_block):
    _each.__annotations__ = {}
# Tells whether a value may overlap the target other than element by element.
shares: Any = intrinsic(_shares)
# Tells whether a value may overlap the target.
overlaps: Any = intrinsic(_overlaps)
# Tells whether two arrays may lie in one block: a record, or a block of the arena.
in_one_block: Any = intrinsic(_in_one_block)
