"""Reads the first metadata record of an incident file, which describes the incident.

Reads only the beginning of the file, and needs no NumPy.
"""

import struct
from pathlib import Path

from rtcfd.common import regular_files

_MAGIC = b"\x89MCAP0\r\n"
_METADATA = 0x0C
_RECORD = struct.Struct("<BQ")
_LONGEST = 64 * 1024  # bytes read from the file
NAME = "incident"


def read(file: Path) -> dict[str, str]:
    """Return the keys and values; empty if the file is not an incident.  Raises OSError, also for
    anything but a regular file."""
    data = regular_files.read_piece(file, _LONGEST)
    try:
        return _pairs(data)
    except (struct.error, ValueError):
        return {}


def _pairs(data: bytes) -> dict[str, str]:
    if not data.startswith(_MAGIC):
        return {}
    at = len(_MAGIC)
    while True:
        opcode, length = _RECORD.unpack_from(data, at)
        at += _RECORD.size
        if opcode == _METADATA:
            break
        at += length
    name, at = _text(data, at)
    size, at = *struct.unpack_from("<I", data, at), at + 4
    end = at + size
    pairs = {}
    while name == NAME and at < end:
        key, at = _text(data, at)
        pairs[key], at = _text(data, at)
    return pairs


def _text(data: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, at)
    at += 4
    if at + length > len(data):
        raise ValueError("truncated")
    return data[at : at + length].decode(), at + length
