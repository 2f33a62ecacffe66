"""The build id of a program or library, which differs for each build with other content."""

import struct
from pathlib import Path

_NOTES = 4  # PT_NOTE
_BUILD_ID = 3  # NT_GNU_BUILD_ID


def build_id(file: Path) -> str:
    """Return the build id in hexadecimal, empty if there is none.

    Raises OSError, or ValueError if the file is not a 64-bit ELF file.
    """
    data = file.read_bytes()
    try:
        return _noted_id(data)
    except struct.error:
        raise ValueError(f"{file} is truncated") from None


def _noted_id(data: bytes) -> str:
    if data[:6] != b"\x7fELF\x02\x01":
        raise ValueError("not a 64-bit ELF file")
    (headers,) = struct.unpack_from("<Q", data, 32)
    size, count = struct.unpack_from("<HH", data, 54)
    for i in range(count):
        kind, _, at, _, _, length = struct.unpack_from("<IIQQQQ", data, headers + i * size)
        end = at + length
        while kind == _NOTES and at + 12 <= end:
            name, content, note = struct.unpack_from("<III", data, at)
            begin = at + 12 + _aligned(name)
            if note == _BUILD_ID and data[at + 12 : at + 16] == b"GNU\0":
                return data[begin : begin + content].hex()
            at = begin + _aligned(content)
    return ""


def _aligned(size: int) -> int:
    return (size + 3) // 4 * 4
