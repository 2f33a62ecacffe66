"""Frames of the executor protocol: a 4-byte little-endian length and a message."""

import asyncio

MAX_FRAME = 16 * 1024 * 1024
_LENGTH_BYTES = 4


class FrameError(Exception):
    """The peer does not keep to the protocol."""


def pack(message: bytes) -> bytes:
    """Return the frame of a serialized message."""
    if len(message) > MAX_FRAME:
        raise FrameError(f"a message of {len(message)} bytes is above the {MAX_FRAME} of a frame")
    return len(message).to_bytes(_LENGTH_BYTES, "little") + message


async def read(reader: asyncio.StreamReader) -> bytes | None:
    """Return the next message, or None at the end of the stream."""
    try:
        size = int.from_bytes(await reader.readexactly(_LENGTH_BYTES), "little")
        if size > MAX_FRAME:
            raise FrameError(f"a frame of {size} bytes is above the limit of {MAX_FRAME}")
        return await reader.readexactly(size)
    except (asyncio.IncompleteReadError, ConnectionError):
        return None
