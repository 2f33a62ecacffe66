"""How long what is in a request may be: looked at before anything else is done with it.

Names go into look-ups, suggestions, log records and refusals, each of which
costs by their length.
"""

from typing import Any

from rtcf.v1 import errors_pb2

from rtcfd.common.refusals import InvalidArgument

LONGEST_NAME = 255  # ROS's own
LONGEST_TEXT = 4096  # remaps, expressions, URIs
LONGEST_VALUE = 64 * 1024  # of a parameter that is a string
_NAMES = frozenset(
    {
        "runner", "component", "components", "package", "type", "name", "ns", "port", "run_id",
        "token", "holder",
    }
)  # fmt: skip
# Values are what somebody wants to have, not names of something.
_VALUES = "rtcf.v1.ParameterValue"
_BULK = frozenset({"rtcf.v1.RecordedMessage"})


def check(message: Any) -> None:
    """Refuse a message with a text in it that is too long."""
    full_name = message.DESCRIPTOR.full_name
    if full_name in _BULK:
        return
    for field, value in message.ListFields():
        if field.message_type is not None:
            # A single message has no length.
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
