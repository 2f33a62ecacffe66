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
from rtcf_compile.machine_code.overloads import OPTIONS, compiled_as, unwrapped, words
from rtcf_compile.rewriting import helpers
from rtcf_compile.source.records import Arranged, Meaning


@intrinsic
def _object_of(typing, values, record):  # type: ignore[no-untyped-def]
    """Return the object of a tuple of its fields, which are in the order of the text."""
    arranged: Arranged = record.marker
    given = types.BaseTuple.from_types([values.types[place] for place in arranged.places])
    made = object_type(arranged.record, given.types, arranged.small)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        parts = [builder.extract_value(arguments[0], place) for place in arranged.places]
        fields = context.make_tuple(builder, given, parts)
        new = converted(context, builder, given, made, fields)
        return imputils.impl_ret_borrowed(context, builder, made, new)

    return made(values, record), generate


@compiled_as(helpers.rtcf_made, in_line=True)
def _made(values: Any, record: Any) -> Any:
    for each in values.types:
        if isinstance(each, types.Function | types.Dispatcher | types.NumberClass):
            raise TypingError("RTCF:a function is a field of an object:call it where it is needed")
    return lambda values, record: _object_of(values, record)


@overload(helpers.rtcf_object, jit_options={**OPTIONS, "forceinline": True})
def _object(value, meaning):  # type: ignore[no-untyped-def]
    meant: Meaning = meaning.marker
    if isinstance(value, types.Optional):
        text = f"'NoneType' object has no attribute '{meant.attribute}'"

        def known(value, meaning):  # type: ignore[no-untyped-def]
            if value is None:
                raise AttributeError(text)
            return helpers.rtcf_object(unwrapped(value), meaning)

        return known
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
        fields = [each for side in (a, b) for each in getattr(side, "types", ())]
        if any(isinstance(each, types.Array) for each in fields):
            remedy = "compare their fields, by np.array_equal"
            raise TypingError(f"RTCF:objects with arrays are compared by {name}:{remedy}")
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


@overload(helpers.rtcf_same)
def _same(a, b):  # type: ignore[no-untyped-def]
    plain = [each.type if isinstance(each, types.Optional) else each for each in (a, b)]
    for each in plain:
        if is_object(each) or isinstance(each, types.BaseTuple):
            raise TypingError(f"RTCF:the identity of {words(each)} is not known:compare it by ==")
    enums = [isinstance(each, types.EnumMember | types.IntEnumMember) for each in plain]
    if any(enums) and not all(enums):
        what = f"{words(plain[0])} is compared with {words(plain[1])} by is"
        raise TypingError(f"RTCF:{what}:write ==")
    return lambda a, b: a is b


@overload(helpers.rtcf_reversed)
def _reversed(values):  # type: ignore[no-untyped-def]
    if isinstance(values, NamedTupleType):
        return lambda values: helpers.rtcf_reversed(fields_of(values))
    if isinstance(values, types.BaseTuple):
        parts = "".join(f"values[{number}]," for number in reversed(range(len(values))))
        scope: dict[str, Any] = {}
        exec(f"def each(values):\n    return ({parts})\n", scope)
        return scope["each"]
    if not isinstance(values, types.Array):
        remedy = "give it a vector, a matrix, a list or a tuple"
        raise TypingError(f"RTCF:reversed of {words(values)}:{remedy}")
    return lambda values: values[::-1]
