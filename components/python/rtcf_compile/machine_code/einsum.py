"""The numba overload of np.einsum. Import this only to compile: it imports numba."""

from typing import Any

import numpy as np
from numba import types
from numba.core.errors import TypingError

from rtcf_compile.machine_code.numpy_functions import any_layout, dtype_of, view_of
from rtcf_compile.machine_code.overloads import compiled_as, refuse_narrow, words
from rtcf_compile.rewriting import helpers
from rtcf_compile.rewriting import numpy_functions as own
from rtcf_compile.rewriting.subscripts import Subscripts

_DIFFER = "np.einsum: the sizes of the operands do not fit"


@compiled_as(own.rtcf_einsum)
def _einsum(text: Any, operands: Any) -> Any:
    if not isinstance(text, types.StringLiteral):
        return None  # numba asks again with the value of the text
    subscripts = Subscripts(text.literal_value)
    if any(isinstance(each, types.BaseTuple) for each in operands.types):
        return _with_arrays(operands)
    for names, each in zip(subscripts.operands, operands.types, strict=True):
        dimensions = each.ndim if isinstance(each, types.Array) else 0
        if not isinstance(each, types.Array | types.Number) or dimensions != len(names):
            what = f"np.einsum of {words(each)} with the subscripts {names or 'none'}"
            raise TypingError(f"RTCF:{what}:write one subscript per dimension")
    if subscripts.is_view:
        return _view(subscripts)
    for each in operands.types:
        refuse_narrow(own.rtcf_einsum, each, "bfiu")
    dtype = np.result_type(*(dtype_of(each) for each in operands.types))
    if dtype == np.float64 and (product := _product(subscripts, operands)):
        return product
    return _loops(subscripts, operands, dtype)


def _with_arrays(operands: Any) -> Any:
    """Return a function that converts rows of numbers to arrays and calls the helper again."""
    parts = [
        f"array(operands[{k}], None)" if isinstance(each, types.BaseTuple) else f"operands[{k}]"
        for k, each in enumerate(operands.types)
    ]
    scope: dict[str, Any] = {"array": own.rtcf_array, "einsum": own.rtcf_einsum}
    exec(f"def again(text, operands):\n    return einsum(text, ({', '.join(parts)},))\n", scope)
    return scope["again"]


def _view(subscripts: Subscripts) -> Any:
    (names,) = subscripts.operands
    if names == subscripts.result:
        return lambda text, operands: operands[0]
    if len(subscripts.result) == 2:
        return lambda text, operands: operands[0].T

    def diagonal(text: Any, operands: Any) -> Any:
        a = any_layout(operands[0])
        if a.shape[0] != a.shape[1]:
            raise ValueError("np.einsum: the diagonal of a matrix that is not square")
        return view_of(a, (a.shape[0],), (a.strides[0] + a.strides[1],))

    return diagonal


def _product(subscripts: Subscripts, operands: Any) -> Any:
    """Return the function for a product of two vectors or matrices; None if it is no such product.

    Both sum in the same order, but the product is faster.
    """
    if len(operands) != 2 or len(subscripts.summed) != 1:
        return None
    left, right = subscripts.operands
    over = subscripts.summed
    if not all(names.count(over) == 1 == max(map(names.count, names)) for names in (left, right)):
        return None
    if not all(isinstance(each, types.Array) for each in operands.types):
        return None
    one = "operands[0]" if left[-1] == over else "operands[0].T"
    other = "operands[1]" if right[0] == over else "operands[1].T"
    rows, columns = left.replace(over, ""), right.replace(over, "")
    if subscripts.result == rows + columns:
        text = f"product({one}, {other})"
    elif subscripts.result == columns + rows:
        text = f"product({other}.T, {one}.T)"
    else:
        return None
    sizes = f"operands[0].shape[{left.index(over)}] != operands[1].shape[{right.index(over)}]"
    check = f"    if {sizes}:\n        raise ValueError(differ)\n"
    scope: dict[str, Any] = {"product": helpers.rtcf_matmul, "differ": _DIFFER}
    exec(f"def multiplied(text, operands):\n{check}    return {text}\n", scope)
    return scope["multiplied"]


def _loops(subscripts: Subscripts, operands: Any, dtype: Any) -> Any:
    """Return the function that computes each element of the result by loops over the others."""
    lines = ["def sums(text, operands):"]
    differ: list[str] = []
    sizes: dict[str, str] = {}
    factors = []
    for k, names in enumerate(subscripts.operands):
        lines.append(f"    o{k} = operands[{k}]")
        for axis, name in enumerate(names):
            size = f"o{k}.shape[{axis}]"
            if name in sizes:
                differ.append(f"{size} != {sizes[name]}")
            sizes.setdefault(name, size)
        index = ", ".join(f"i_{name}" for name in names)
        factors.append(f"to(o{k}[{index}])" if names else f"to(o{k})")
    if differ:
        lines += [f"    if {' or '.join(differ)}:", "        raise ValueError(differ)"]
    shape = ", ".join(sizes[name] for name in subscripts.result)
    if subscripts.result:
        lines.append(f"    result = np.empty(({shape},), dtype)")
    indent = "    "
    for name in subscripts.result:
        lines.append(f"{indent}for i_{name} in range({sizes[name]}):")
        indent += "    "
    lines.append(f"{indent}total = to(0)")
    inside = indent
    for name in subscripts.summed:
        lines.append(f"{inside}for i_{name} in range({sizes[name]}):")
        inside += "    "
    lines.append(f"{inside}total += {' * '.join(factors)}")
    if subscripts.result:
        place = ", ".join(f"i_{name}" for name in subscripts.result)
        lines.append(f"{indent}result[{place}] = total")
    lines.append(f"    return {'result' if subscripts.result else 'total'}")
    scope: dict[str, Any] = {
        **{"np": np, "dtype": dtype, "to": dtype.type},
        "differ": _DIFFER,
    }
    exec("\n".join(lines), scope)
    return scope["sums"]
