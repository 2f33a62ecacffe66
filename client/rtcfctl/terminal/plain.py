"""Protobuf messages as plain dicts, lists, numbers and strings, for JSON and YAML.

Unlike protobuf's own JSON, integers are numbers, all fields are present, an enumerator is
its short name ("running"), the value of a parameter, port or state is the plain value, and a
missing value is null.
"""

import math
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from rtcf_shared.enums import word

_VALUE_MESSAGE = "rtcf.v1.ParameterValue"
# Fields whose values are transmitted as text.
_TEXTS = {"rtcf.v1.PortInfo": ("value",), "rtcf.v1.StateInfo": ("initial", "value")}


def plain(message: Any) -> Any:
    """Return a message as a dict, or the value if it is a parameter's value."""
    if message.DESCRIPTOR.full_name == _VALUE_MESSAGE:
        kind = message.WhichOneof("kind")
        return None if kind is None else number(getattr(message, kind))
    result = {field.name: _field(message, field) for field in message.DESCRIPTOR.fields}
    for name in _TEXTS.get(message.DESCRIPTOR.full_name, ()):
        if result[name]:
            from rtcf_shared.value_text import parse

            result[name] = parse(result[name])
        else:
            result[name] = None
    return result


def enumerator(message: Any, name: str) -> str:
    """Return the short name of an enum field's value, e.g. "catch_up"."""
    field = message.DESCRIPTOR.fields_by_name[name]
    return word(field.enum_type, getattr(message, name))


def _field(message: Any, field: FieldDescriptor) -> Any:
    value = getattr(message, field.name)
    if field.label == FieldDescriptor.LABEL_REPEATED:
        return [_single(field, each) for each in value]
    if field.has_presence and not message.HasField(field.name):
        return None
    return _single(field, value)


def _single(field: FieldDescriptor, value: Any) -> Any:
    if field.message_type is not None:
        return plain(value)
    if field.enum_type is not None:
        return word(field.enum_type, value)
    return number(value)


def number(value: Any) -> Any:
    """Return NaN and infinity as text, and any other value unchanged."""
    # JSON has no NaN and infinity.
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
