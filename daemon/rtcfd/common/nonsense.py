"""Exceptions raised by parsing unexpected content."""

from google.protobuf import json_format

NONSENSE = (
    ValueError,
    TypeError,
    AttributeError,
    LookupError,
    OverflowError,
    RecursionError,
    json_format.ParseError,
)
