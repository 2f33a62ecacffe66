"""Limits on the length of texts in a request, checked before all other work.

Names go into look-ups, suggestions, log records and errors.  The cost of each grows
with their length.
"""

from typing import Any

from rtcf.v1 import errors_pb2

from rtcfd.common.refusals import InvalidArgument

# In characters.
LONGEST_NAME = 255  # the limit of ROS
LONGEST_TEXT = 4096  # remaps, expressions, URIs
LONGEST_VALUE = 64 * 1024  # string parameters
_NAMES = frozenset(
    {
        "runner", "component", "components", "package", "type", "name", "ns", "port", "run_id",
        "token", "holder",
    }
)  # fmt: skip
_VALUES = "rtcf.v1.ParameterValue"
_BULK = frozenset({"rtcf.v1.RecordedMessage"})


def check(message: Any) -> None:
    """Raise InvalidArgument if a text in a message, at any depth, is too long."""
    full_name = message.DESCRIPTOR.full_name
    if full_name in _BULK:
        return
    for field, value in message.ListFields():
        if field.message_type is not None:
            # `value` is one message or a list of messages.
            for each in [value] if hasattr(value, "DESCRIPTOR") else value:
                check(each)
        elif field.cpp_type == field.CPPTYPE_STRING and field.type == field.TYPE_STRING:
            longest = (
                LONGEST_VALUE
                if full_name == _VALUES
                else LONGEST_NAME
                if field.name in _NAMES
                else LONGEST_TEXT
            )
            for text in [value] if isinstance(value, str) else value:
                if len(text) > longest:
                    raise InvalidArgument(
                        f"{field.name} of {len(text)} characters is too long: at most {longest} "
                        f"({text[:40]}…)",
                        errors_pb2.REASON_TEXT_TOO_LONG,
                        field=field.name,
                    )
