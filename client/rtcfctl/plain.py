"""Protobuf messages as plain dicts, lists, numbers and strings, for JSON and YAML.

Other than in protobuf's own JSON, integers are numbers, all fields are there,
an enumerator is its short name ("running"), the value of a parameter or of a
port is that value itself, and what has no value is null.
"""

import math
from typing import Any

from google.protobuf.descriptor import FieldDescriptor
from rtcf_shared.enums import word

_VALUE_MESSAGE = "rtcf.v1.ParameterValue"
_PORT_MESSAGE = "rtcf.v1.PortInfo"


def plain(message: Any) -> Any:
    """Return a message as a dict, or the value if it is a parameter's value."""
    if message.DESCRIPTOR.full_name == _VALUE_MESSAGE:
        kind = message.WhichOneof("kind")
        return None if kind is None else _number(getattr(message, kind))
    result = {field.name: _field(message, field) for field in message.DESCRIPTOR.fields}
    if message.DESCRIPTOR.full_name == _PORT_MESSAGE and result["value"] is not None:
        result["value"] = _of_yaml(result["value"])
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
    return _number(value)


def _of_yaml(text: str) -> Any:
    """Return a port's value, which travels as text, as the numbers and fields that it has."""
    import yaml

    try:
        return yaml.safe_load(text)
    except yaml.YAMLError:  # it was cut
        return text


def _number(value: Any) -> Any:
    # JSON has no words for these.
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value
