"""A log call in compiled code: calls a function of the library with the arguments."""

from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from rtcf_compile.rewriting.logs import Logs

_SCALARS = {types.boolean: "bool", types.int64: "int64", types.float64: "float64"}
_PRESENT: list[Logs] = []


def logs_are(logs: Logs) -> None:
    """Set the log calls of the component that is compiled next."""
    _PRESENT[:] = [logs]


def log_call(number: int, count: int) -> Any:
    """Return the numba intrinsic for log call `number` with `count` arguments."""
    names = [f"argument_{i}" for i in range(count)]
    scope: dict[str, Any] = {"call": lambda *found: _typed(number, found)}
    exec(
        f"def rtcf_log(typing, {', '.join(['component', *names])}):\n"
        f"    return call({', '.join(['component', *names])})\n",
        scope,
    )
    return intrinsic(scope["rtcf_log"])


def _kind(given: Any) -> str:
    """Describe an argument that is not a number, in the plural."""
    kinds = {types.Array: "arrays", types.UnicodeType: "text", types.StringLiteral: "text"}
    kinds |= {types.Optional: "values that may be None", types.BaseTuple: "lists"}
    if hasattr(given, "record"):
        return "objects"
    return next((words for kind, words in kinds.items() if isinstance(given, kind)), "other values")


def _typed(number: int, given: tuple[Any, ...]) -> tuple[Any, Any]:
    logs = _PRESENT[0]
    passed = []
    for each in given[1:]:
        if isinstance(each, types.IntEnumMember):
            passed.append(types.int64)
        elif isinstance(each, types.Boolean):
            passed.append(types.boolean)
        elif isinstance(each, types.Integer):
            passed.append(types.int64)
        elif isinstance(each, types.Float):
            passed.append(types.float64)
        else:
            if isinstance(each, types.EnumMember):
                raise TypingError("RTCF:a log call stores numbers and bools:write .name, or .value")
            raise TypingError(
                f"RTCF:a log call stores numbers and bools, not {_kind(each)}:"
                "log each element, and write text into the constant text"
            )
    logs.calls[number].types = [_SCALARS[each] for each in passed]

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = [arguments[0]]
        for value, found, wanted in zip(arguments[1:], given[1:], passed, strict=True):
            cast = context.cast(builder, value, found, wanted)
            if wanted is types.boolean:
                cast = builder.zext(cast, ir.IntType(8))
            values.append(cast)
        function = ir.FunctionType(ir.VoidType(), [each.type for each in values])
        name = logs.symbol(number)
        # numba resolves symbols when it finalises its own copy, which is never called.
        llvm.add_symbol(name, 1)
        declared = builder.module.globals.get(name)
        if declared is None:
            declared = ir.Function(builder.module, function, name)
        builder.call(declared, values)
        return context.get_dummy_value()

    return types.none(types.int64, *given[1:]), generate
