"""A row of a product of matrices in pieces that stay in the processor's registers.

`out[j] = sum over k of factors[k] * matrix[k, j]`, for some neighbouring j at a time, each sum from
the first k to the last, as a plain loop has it: LLVM does not make vectors of that loop, as it may
not change the order of a sum. Two neighbouring j are one vector, which every processor of amd64 and
of arm64 has.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_NUMBER = ir.DoubleType()
_PAIR = ir.VectorType(_NUMBER, 2)
_BYTE = ir.IntType(8)
_SIZE = ir.IntType(64)


def tile(width: int, along: str) -> Any:
    """Return a function that computes `width` elements of a row: (factors, its offset, its stride,
    matrix, its offset, its two strides, number of products in a sum, out, its offset). Offsets and
    strides are bytes.

    `along` says where neighbours in memory are: "out", elements j and j + 1; "sum", elements k and
    k + 1; "", neither.
    """

    def compute(
        typing: Any, factors: Any, first: Any, step: Any, matrix: Any, corner: Any, down: Any,
        across: Any, count: Any, out: Any, place: Any,
    ) -> Any:  # fmt: skip
        whole = types.intp
        signature = types.void(
            factors, whole, whole, matrix, whole, whole, whole, whole, out, whole
        )

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            def begin(array: int) -> Any:
                made = context.make_array(signature.args[array])
                data = made(context, builder, arguments[array]).data
                data = builder.bitcast(data, _BYTE.as_pointer())
                return builder.gep(data, [arguments[array + 1]], inbounds=True)

            step, down, across, count = (arguments[each] for each in (2, 5, 6, 7))
            _Tile(
                builder, width, along, begin(0), step, begin(3), down, across, count, begin(8)
            ).emit()
            return context.get_dummy_value()

        return signature, generate

    compute.__annotations__ = {}
    compute.__name__ = f"tile_{width}_{along or 'apart'}"
    return intrinsic(compute)


class _Tile:
    """The instructions of one tile."""

    def __init__(
        self, builder: Any, width: int, along: str, factors: Any, step: Any, matrix: Any,
        down: Any, across: Any, count: Any, out: Any,
    ) -> None:  # fmt: skip
        self._builder, self._width, self._along = builder, width, along
        self._factors, self._step, self._count, self._out = factors, step, count, out
        self._matrix, self._down, self._across = matrix, down, across

    def emit(self) -> None:
        """Sum up, then store."""
        builder = self._builder
        pairs = self._width // 2 if self._along else 0
        kinds = [_PAIR] * pairs + [_NUMBER] * (self._width - 2 * pairs)
        sums = [cgutils.alloca_once(builder, kind) for kind in kinds]
        for place, kind in zip(sums, kinds, strict=True):
            builder.store(ir.Constant(kind, [0.0, 0.0] if kind is _PAIR else 0.0), place)
        if self._along == "sum":
            # Two rows and two columns at a time.
            even = builder.and_(self._count, ir.Constant(_SIZE, -2))
            with cgutils.for_range_slice(
                builder, ir.Constant(_SIZE, 0), even, ir.Constant(_SIZE, 2)
            ) as (k, _):
                self._two_steps(k, sums, pairs)
            odd = builder.icmp_unsigned("!=", even, self._count)
            with builder.if_then(odd):
                self._one_step(even, sums, pairs)
        else:
            with cgutils.for_range(builder, self._count) as loop:
                self._one_step(loop.index, sums, pairs)
        for number, (place, kind) in enumerate(zip(sums, kinds, strict=True)):
            first = 2 * number if number < pairs else pairs + number
            address = self._moved(self._out, ir.Constant(_SIZE, 8 * first))
            builder.store(builder.load(place), self._pointer(address, kind), align=8)

    def _one_step(self, k: Any, sums: list[Any], pairs: int) -> None:
        """Add the products of one k."""
        builder = self._builder
        factor = self._number(self._factor(k))
        both = self._both(factor)
        for number, place in enumerate(sums):
            if number < pairs:
                value = self._pair(k, 2 * number)
                self._add(place, builder.fmul(both, value))
            else:
                value = self._number(self._element(k, pairs + number))
                self._add(place, builder.fmul(factor, value))

    def _two_steps(self, k: Any, sums: list[Any], pairs: int) -> None:
        """Add the products of k and k + 1, which are neighbours in the matrix."""
        builder = self._builder
        following = builder.add(k, ir.Constant(_SIZE, 1))
        factors = [self._number(self._factor(each)) for each in (k, following)]
        both = [self._both(each) for each in factors]
        for number, place in enumerate(sums):
            if number >= pairs:
                for each, factor in zip((k, following), factors, strict=True):
                    value = self._number(self._element(each, pairs + number))
                    self._add(place, builder.fmul(factor, value))
                continue
            upper, lower = (
                builder.load(self._pointer(self._element(k, 2 * number + row), _PAIR), align=8)
                for row in (0, 1)
            )
            for column, factor in enumerate(both):
                chosen = ir.Constant(ir.VectorType(ir.IntType(32), 2), [column, column + 2])
                value = builder.shuffle_vector(upper, lower, chosen)
                self._add(place, builder.fmul(factor, value))

    def _pair(self, k: Any, j: int) -> Any:
        """Return elements j and j + 1 of one k."""
        builder = self._builder
        if self._along == "out":
            return builder.load(self._pointer(self._element(k, j), _PAIR), align=8)
        pair = ir.Constant(_PAIR, ir.Undefined)
        for lane in (0, 1):
            value = self._number(self._element(k, j + lane))
            pair = builder.insert_element(pair, value, ir.Constant(ir.IntType(32), lane))
        return pair

    def _both(self, factor: Any) -> Any:
        pair = ir.Constant(_PAIR, ir.Undefined)
        for lane in (0, 1):
            pair = self._builder.insert_element(pair, factor, ir.Constant(ir.IntType(32), lane))
        return pair

    def _add(self, place: Any, product: Any) -> None:
        self._builder.store(self._builder.fadd(self._builder.load(place), product), place)

    def _factor(self, k: Any) -> Any:
        return self._moved(self._factors, self._builder.mul(k, self._step))

    def _element(self, k: Any, j: int) -> Any:
        builder = self._builder
        across = (
            ir.Constant(_SIZE, 8 * j)
            if self._along == "out"
            else builder.mul(self._across, ir.Constant(_SIZE, j))
        )
        along_sum = self._along == "sum"
        down = builder.mul(k, ir.Constant(_SIZE, 8) if along_sum else self._down)
        return self._moved(self._matrix, builder.add(down, across))

    def _number(self, address: Any) -> Any:
        return self._builder.load(self._pointer(address, _NUMBER), align=8)

    def _pointer(self, address: Any, kind: Any) -> Any:
        return self._builder.bitcast(address, kind.as_pointer())

    def _moved(self, address: Any, offset: Any) -> Any:
        return self._builder.gep(address, [offset], inbounds=True)
