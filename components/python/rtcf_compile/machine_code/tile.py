"""Computes a row of a matrix product in tiles that stay in processor registers.

`out[j] = sum over k of factors[k] * matrix[k, j]`. A tile computes several adjacent j; each sum
runs from the first k to the last, as in a plain loop. LLVM cannot vectorise that loop, because it
must not reorder sums. Two adjacent j form a vector of two doubles, which every amd64 and arm64
processor supports.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_NUMBER = ir.DoubleType()
_PAIR = ir.VectorType(_NUMBER, 2)
_WIDEST = 8  # elements
_BYTE, _LANE, _SIZE = ir.IntType(8), ir.IntType(32), ir.IntType(64)


def _row_along(along: str) -> Any:
    def compute(
        typing: Any, factors: Any, first: Any, step: Any, matrix: Any, down: Any, across: Any,
        count: Any, out: Any, place: Any, width: Any,
    ) -> Any:  # fmt: skip
        whole = types.intp
        signature = types.void(
            factors, whole, whole, matrix, whole, whole, whole, out, whole, whole
        )

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            def data(array: int) -> Any:
                made = context.make_array(signature.args[array])
                address = made(context, builder, arguments[array]).data
                return builder.bitcast(address, _BYTE.as_pointer())

            first, step, down, across, count, place, width = (
                arguments[each] for each in (1, 2, 4, 5, 6, 8, 9)
            )
            row = builder.gep(data(0), [first], inbounds=True)
            matrix, out = data(3), builder.gep(data(7), [place], inbounds=True)

            def emit(size: int, j: Any) -> None:
                beside = _SIZE(8) if along == "out" else across
                _Tile(
                    builder, size, along, factors.layout == "C", row, step,
                    builder.gep(matrix, [builder.mul(j, beside)], inbounds=True), down, across,
                    count, builder.gep(out, [builder.mul(j, _SIZE(8))], inbounds=True),
                ).emit()  # fmt: skip

            whole_tiles = builder.and_(width, _SIZE(-_WIDEST))
            with cgutils.for_range_slice(builder, _SIZE(0), whole_tiles, _SIZE(_WIDEST)) as (j, _):
                emit(_WIDEST, j)
            size = _WIDEST // 2
            while size:
                left = builder.and_(width, _SIZE(size))
                with builder.if_then(builder.icmp_unsigned("!=", left, _SIZE(0))):
                    emit(size, builder.and_(width, _SIZE(-2 * size)))
                size //= 2
            return context.get_dummy_value()

        return signature, generate

    compute.__annotations__ = {}
    compute.__name__ = f"row_along_{along or 'nothing'}"
    return intrinsic(compute)


# Functions that compute a row of a product: (factors, its offset, its stride, matrix, its two
# strides, number of products in a sum, out, its offset, number of elements). Offsets and strides
# are in bytes. The key names the matrix elements that are adjacent in memory: "out", j and j + 1;
# "sum", k and k + 1; "", neither.
ROWS = {along: _row_along(along) for along in ("out", "sum", "")}


class _Tile:
    """Generates the instructions of one tile."""

    def __init__(
        self, builder: Any, width: int, along: str, adjacent: bool, factors: Any, step: Any,
        matrix: Any, down: Any, across: Any, count: Any, out: Any,
    ) -> None:  # fmt: skip
        self._builder, self._width, self._along = builder, width, along
        self._adjacent = adjacent  # the factors are adjacent in memory
        self._factors, self._step, self._count, self._out = factors, step, count, out
        self._matrix, self._down, self._across = matrix, down, across

    def emit(self) -> None:
        """Emit the sums, then the stores."""
        builder = self._builder
        pairs = self._width // 2 if self._along else 0
        kinds = [_PAIR] * pairs + [_NUMBER] * (self._width - 2 * pairs)
        sums = [cgutils.alloca_once(builder, kind) for kind in kinds]
        for place, kind in zip(sums, kinds, strict=True):
            builder.store(ir.Constant(kind, [0.0, 0.0] if kind is _PAIR else 0.0), place)
        if self._along == "sum":
            even = builder.and_(self._count, _SIZE(-2))
            with cgutils.for_range_slice(builder, _SIZE(0), even, _SIZE(2)) as (k, _):
                self._two_steps(k, sums, pairs)
            with builder.if_then(builder.icmp_unsigned("!=", even, self._count)):
                self._one_step(even, sums, pairs)
        else:
            with cgutils.for_range(builder, self._count) as loop:
                self._one_step(loop.index, sums, pairs)
        for number, (place, kind) in enumerate(zip(sums, kinds, strict=True)):
            first = 2 * number if number < pairs else pairs + number
            address = self._moved(self._out, _SIZE(8 * first))
            builder.store(builder.load(place), self._pointer(address, kind), align=8)

    def _one_step(self, k: Any, sums: list[Any], pairs: int) -> None:
        """Add the products of one k."""
        builder = self._builder
        factor = self._load(self._factor(k), _NUMBER)
        for number, place in enumerate(sums):
            if number >= pairs:
                value = self._load(self._element(k, pairs + number), _NUMBER)
                self._add(place, builder.fmul(factor, value))
                continue
            j = 2 * number
            if self._along == "out":
                value = self._load(self._element(k, j), _PAIR)
            else:
                value = self._pair(
                    *(self._load(self._element(k, each), _NUMBER) for each in (j, j + 1))
                )
            self._add(place, builder.fmul(self._pair(factor, factor), value))

    def _two_steps(self, k: Any, sums: list[Any], pairs: int) -> None:
        """Add the products of k and k + 1, which are adjacent in the matrix."""
        builder = self._builder
        both = self._two_factors(k)
        for number, place in enumerate(sums):
            rows = (2 * number, 2 * number + 1) if number < pairs else (pairs + number,)
            products = [
                builder.fmul(both, self._load(self._element(k, row), _PAIR)) for row in rows
            ]
            for step in (0, 1):
                if number < pairs:
                    chosen = ir.Constant(ir.VectorType(_LANE, 2), [step, step + 2])
                    self._add(place, builder.shuffle_vector(*products, chosen))
                else:
                    self._add(place, builder.extract_element(products[0], _LANE(step)))

    def _two_factors(self, k: Any) -> Any:
        if self._adjacent:
            return self._load(self._factor(k), _PAIR)
        following = self._builder.add(k, _SIZE(1))
        return self._pair(*(self._load(self._factor(each), _NUMBER) for each in (k, following)))

    def _pair(self, first: Any, second: Any) -> Any:
        pair = ir.Constant(_PAIR, ir.Undefined)
        for lane, value in enumerate((first, second)):
            pair = self._builder.insert_element(pair, value, _LANE(lane))
        return pair

    def _add(self, place: Any, product: Any) -> None:
        self._builder.store(self._builder.fadd(self._builder.load(place), product), place)

    def _factor(self, k: Any) -> Any:
        return self._moved(self._factors, self._builder.mul(k, self._step))

    def _element(self, k: Any, j: int) -> Any:
        builder = self._builder
        across = _SIZE(8) if self._along == "out" else self._across
        down = _SIZE(8) if self._along == "sum" else self._down
        offset = builder.add(builder.mul(k, down), builder.mul(across, _SIZE(j)))
        return self._moved(self._matrix, offset)

    def _load(self, address: Any, kind: Any) -> Any:
        return self._builder.load(self._pointer(address, kind), align=8)

    def _pointer(self, address: Any, kind: Any) -> Any:
        return self._builder.bitcast(address, kind.as_pointer())

    def _moved(self, address: Any, offset: Any) -> Any:
        return self._builder.gep(address, [offset], inbounds=True)
