"""Checks values against declared parameters, while no executor has the component.

Applies the rules of fitted_value.hpp of the executor, and of ParameterBase::check() in the
component API.  Errors of prepare() appear when the component is loaded.
"""

import math
import re
from collections.abc import Iterable, Mapping

from rtcf.v1 import control_pb2, errors_pb2, graph_pb2
from rtcf_shared.graph_writer import same_value
from rtcf_shared.naming import closest, listing, suggestion

from rtcfd.common.errors import InvalidArgument, NotFound

_LONGEST_WORD = 60  # characters of a value in a message
_EXACT = 2**53  # largest exact integer of a double
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)
_KINDS = {
    "bool_value": "a bool",
    "int_value": "an int",
    "double_value": "a double",
    "string_value": "a string",
}


def check(
    component: str,
    setting: graph_pb2.ParameterSetting,
    declared: Mapping[str, graph_pb2.ParameterInfo],
) -> None:
    """Raise NotFound or InvalidArgument for a value that the component would reject.

    Converts the value in place to the declared type where nothing is lost.
    """
    found = declared.get(setting.name)
    if found is None:
        raise NotFound(
            f"{component} has no parameter {setting.name}{suggestion(setting.name, declared)}; it "
            f"has {listing(declared)}",
            errors_pb2.REASON_PARAMETER_NOT_FOUND,
            component=component,
            parameter=setting.name,
            suggestion=closest(setting.name, declared),
        )
    _fit(setting.value, found.type)
    if why := _problem(setting.value, found):
        raise InvalidArgument(
            f"{component}: parameter {setting.name} {why}",
            errors_pb2.REASON_VALUE_INVALID,
            component=component,
            parameter=setting.name,
        )


def plain(value: graph_pb2.ParameterValue) -> object:
    """Return a value as a Python object; None if there is none."""
    kind = value.WhichOneof("kind")
    return None if kind is None else getattr(value, kind)


def word(value: graph_pb2.ParameterValue) -> str:
    """Return a value as text for a message."""
    return f"{plain(value)}"[:_LONGEST_WORD]


def set_vector_sizes(
    component: str,
    given: graph_pb2.ComponentSpec | control_pb2.SetParametersRequest,
    declared: Iterable[graph_pb2.ParameterInfo],
) -> None:
    """Set the size of each vector that a list sets, and clear `lists`.

    Raises InvalidArgument for a list that is too long, one that contradicts a size that is set,
    too, and for an empty one that is no vector.
    """
    sizes = {each.vector: each for each in declared if each.vector}
    values = {each.name: each.value for each in given.parameters}
    for name, length in ((each.name, each.length) for each in given.lists):
        size = sizes.get(name)
        why = ""
        if size is None:
            why = "" if length else "an empty list: only a vector can be empty"
        elif length > size.maximum:
            why = f"a list of length {length}: it takes at most {size.maximum:g} elements"
        elif size.name not in values:
            values[size.name] = graph_pb2.ParameterValue(int_value=length)
            given.parameters.add(name=size.name, value=values[size.name])
        elif (kept := values[size.name]).HasField("int_value") and kept.int_value != length:
            why = f"a list of length {length}, but {size.name} is set, too, to another number"
        if why:
            raise InvalidArgument(
                f"{component}: parameter {name} is {why}",
                errors_pb2.REASON_VALUE_INVALID,
                component=component,
                parameter=name,
            )
    given.ClearField("lists")


def _fit(value: graph_pb2.ParameterValue, wanted: str) -> None:
    kind = value.WhichOneof("kind")
    if kind is None:
        return
    plain = getattr(value, kind)
    if wanted == "double" and kind == "int_value":
        value.double_value = float(plain)
    elif wanted == "double" and kind == "string_value" and _NUMBER.fullmatch(plain):
        if math.isfinite(number := float(plain)):
            value.double_value = number
    elif wanted == "int" and kind == "double_value" and plain.is_integer():
        if abs(plain) <= _EXACT:
            value.int_value = int(plain)
    elif wanted == "bool" and kind == "int_value" and plain in (0, 1):
        value.bool_value = plain == 1
    elif wanted == "string" and kind != "string_value":
        value.string_value = _text(plain)


def _text(plain: bool | float) -> str:
    """Return the text of a number or bool, as fmt prints it."""
    if isinstance(plain, bool):
        return str(plain).lower()
    return repr(plain).removesuffix(".0")


def _problem(value: graph_pb2.ParameterValue, declared: graph_pb2.ParameterInfo) -> str:
    """Return the error of a value; empty = it is valid."""
    kind, wanted = value.WhichOneof("kind"), declared.default_value.WhichOneof("kind")
    if kind != wanted:
        given = "nothing" if kind is None else _KINDS[kind]
        return f"takes {'a name' if declared.type == 'enum' else _KINDS[str(wanted)]}, not {given}"
    plain = getattr(value, str(kind))
    if kind in ("int_value", "double_value"):
        if not math.isfinite(plain):
            # Only the declared default may be infinite or NaN.
            return "" if same_value(value, declared.default_value) else "must be finite"
        if declared.HasField("minimum") and plain < declared.minimum:
            return f"= {plain:g} is below its minimum {declared.minimum:g} {declared.unit}".rstrip()
        if declared.HasField("maximum") and plain > declared.maximum:
            return f"= {plain:g} is above its maximum {declared.maximum:g} {declared.unit}".rstrip()
    if declared.choices and plain not in declared.choices:
        return f"= {plain} is none of {', '.join(declared.choices)}"
    return ""
