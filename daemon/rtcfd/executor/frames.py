"""Reads and writes messages on an executor's socket: a 4-byte little-endian length, then the
serialized message."""

import asyncio

MAX_FRAME = 16 * 1024 * 1024
_LENGTH_BYTES = 4


class FrameError(Exception):
    """A message violates the protocol."""


def pack(message: bytes) -> bytes:
    """Return a serialized message with its length before it."""
    if len(message) > MAX_FRAME:
        raise FrameError(f"a message of {len(message)} bytes is above the limit of {MAX_FRAME}")
    return len(message).to_bytes(_LENGTH_BYTES, "little") + message


async def read(reader: asyncio.StreamReader) -> bytes | None:
    """Return the next message, or None at the end of the stream."""
    try:
        size = int.from_bytes(await reader.readexactly(_LENGTH_BYTES), "little")
        if size > MAX_FRAME:
            raise FrameError(f"a message of {size} bytes is above the limit of {MAX_FRAME}")
        return await reader.readexactly(size)
    except (asyncio.IncompleteReadError, ConnectionError):
        return None
