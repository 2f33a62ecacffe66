"""Rejects unknown enumerators.

proto3 accepts any number as an enumerator, and a reader would treat it like the enumerator of
its last branch.  So each request is checked once, on arrival.
"""

from functools import cache
from typing import Any

from google.protobuf.descriptor import Descriptor, EnumDescriptor, FieldDescriptor
from google.protobuf.message import Message
from rtcf.v1 import errors_pb2
from rtcf_shared.enums import choices
from rtcf_shared.naming import listing

from rtcfd.common.errors import InvalidArgument


def check(message: Message) -> None:
    """Raise InvalidArgument for a message with an unknown enumerator, at any depth."""
    for field in _to_look_at(message.DESCRIPTOR):
        value: Any = getattr(message, field.name)
        repeated = field.label == FieldDescriptor.LABEL_REPEATED
        if field.enum_type is not None:
            for each in value if repeated else [value]:
                check_value(field.enum_type, field.name, each)
        elif repeated:
            for each in value:
                check(each)
        elif message.HasField(field.name):
            check(value)


def check_value(enum_type: EnumDescriptor, name: str, value: object) -> None:
    """Raise InvalidArgument for a value that is no enumerator of the setting `name`."""
    if value not in enum_type.values_by_number:
        raise InvalidArgument(
            f"{name} {value} is not known: choose one of {listing(choices(enum_type))}",
            errors_pb2.REASON_VALUE_INVALID,
            setting=name,
        )


@cache
def _to_look_at(message: Descriptor) -> tuple[FieldDescriptor, ...]:
    """Return the fields that are enums or contain some."""
    return tuple(
        field
        for field in message.fields
        if field.enum_type is not None or _holds(field.message_type, frozenset())
    )


def _holds(message: Descriptor | None, above: frozenset[str]) -> bool:
    """Return whether messages of a type contain enums."""
    if message is None or message.full_name in above:
        return False
    within = above | {message.full_name}
    return any(
        field.enum_type is not None or _holds(field.message_type, within)
        for field in message.fields
    )
