"""What reading a document may raise that is well-formed at best, and holds something else."""

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
