"""The numba overloads of objects of NamedTuples and dataclasses: see source/records.py."""

import operator
from typing import Any

from numba import types
from numba.core import imputils
from numba.core.errors import TypingError
from numba.core.typing.templates import AbstractTemplate, infer, signature
from numba.extending import intrinsic, lower_builtin, overload

from rtcf_compile.machine_code.object_types import (
    NamedTupleType,
    converted,
    fields_of,
    is_object,
    object_type,
)
from rtcf_compile.machine_code.overloads import compiled_as, unwrapped, words
from rtcf_compile.rewriting import helpers
from rtcf_compile.source.records import Meaning


@intrinsic
def _object_of(typing, values, record):  # type: ignore[no-untyped-def]
    """Return the object of a tuple of its fields."""
    made = object_type(record.marker, values.types)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        new = converted(context, builder, signature.args[0], made, arguments[0])
        return imputils.impl_ret_borrowed(context, builder, made, new)

    return made(values, record), generate


@compiled_as(helpers.rtcf_made, in_line=True)
def _made(values: Any, record: Any) -> Any:
    return lambda values, record: _object_of(values, record)


@compiled_as(helpers.rtcf_object, in_line=True)
def _object(value: Any, meaning: Any) -> Any:
    meant: Meaning = meaning.marker
    if not is_object(value):
        what = f"a {meant.kind} of {words(value)}, not of an object"
        raise TypingError(f"RTCF:{what}:give it an object of {meant.record.cls.__name__}")
    if value.record.meaning(meant.attribute) != meant.record.meaning(meant.attribute):
        own, other = value.record.cls.__name__, meant.record.cls.__name__
        what = f"an object of {own}, not of {other}"
        if value.record.has(meant.attribute):
            what = f"an object of {own}, whose {meant.attribute} is not that of {other}"
        remedy = "annotate the variable with its class, or write a function for each class"
        raise TypingError(f"RTCF:{what}:{remedy}")
    if meant.gives_fields:
        return lambda value, meaning: fields_of(value)
    return lambda value, meaning: value


@infer
class _Iteration(AbstractTemplate):  # type: ignore[misc]
    """A loop over a NamedTuple whose fields have one type."""

    key = "getiter"

    def generic(self, given: Any, named: Any) -> Any:
        """Return the types of the loop."""
        fields = types.BaseTuple.from_types(given[0].types) if is_object(given[0]) else None
        if isinstance(fields, types.UniTuple) and given[0].record.is_tuple:
            return signature(fields.iterator_type, given[0])
        return None


@lower_builtin("getiter", NamedTupleType)
def _iterated(context, builder, typed, arguments):  # type: ignore[no-untyped-def]
    fields = typed.return_type.container
    iterate = context.get_function("getiter", signature(typed.return_type, fields))
    return iterate(builder, [converted(context, builder, typed.args[0], fields, arguments[0])])


def _compared(operation: Any, name: str) -> None:
    @overload(operation)
    def choose(a, b):  # type: ignore[no-untyped-def]
        if not is_object(a) and not is_object(b):
            return None
        one, other = getattr(a, "record", None), getattr(b, "record", None)
        if (one is None or one.is_tuple) and (other is None or other.is_tuple):
            return None  # tuples
        is_known = one is not None and one is other and one.is_compared
        is_equality = operation in (operator.eq, operator.ne)
        if not is_known or not (is_equality or one.is_ordered):  # type: ignore[union-attr]
            remedy = "compare their fields"
            raise TypingError(f"RTCF:{words(a)} is compared with {words(b)} by {name}:{remedy}")
        return lambda a, b: operation(fields_of(a), fields_of(b))


_compared(operator.eq, "==")
_compared(operator.ne, "!=")
_compared(operator.lt, "<")
_compared(operator.le, "<=")
_compared(operator.gt, ">")
_compared(operator.ge, ">=")


@overload(operator.add)
def _joined(a, b):  # type: ignore[no-untyped-def]
    if not all(isinstance(each, types.BaseTuple) for each in (a, b)):
        return None
    if is_object(a):
        return lambda a, b: fields_of(a) + b
    return (lambda a, b: a + fields_of(b)) if is_object(b) else None


@overload(operator.getitem)
def _element(values, index):  # type: ignore[no-untyped-def]
    if not isinstance(values, NamedTupleType):
        return None
    return lambda values, index: fields_of(values)[index]


@overload(helpers.rtcf_truth)
def _truth(value):  # type: ignore[no-untyped-def]
    of = value.type if isinstance(value, types.Optional) else value
    if is_object(of) and not of.types:
        raise TypingError("RTCF:an object without fields is a condition:compare it")
    if is_object(of):
        return lambda value: value is not None
    if isinstance(of, types.BaseTuple) and of is not value:
        return lambda value: False if value is None else len(unwrapped(value)) > 0
    return lambda value: value


@overload(helpers.rtcf_identified)
def _identified(value):  # type: ignore[no-untyped-def]
    of = value.type if isinstance(value, types.Optional) else value
    if is_object(of) or isinstance(of, types.BaseTuple):
        raise TypingError(f"RTCF:the identity of {words(of)} is not known:compare it by ==")
    return lambda value: value
