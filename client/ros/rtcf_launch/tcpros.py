"""TCPROS, the wire format of ROS services: its blocks and headers, and a call."""

import socket
import struct
import urllib.parse
from collections.abc import Mapping
from typing import Any

_LARGEST_CALL = 64 * 1024  # bytes of a header or a request
_LARGEST_ANSWER = 64 * 1024 * 1024


class CallFailed(Exception):
    """A call of a service failed; the text is one line."""


def call(uri: str, service: str, kind: Any, caller: str, timeout_s: float) -> Any:
    """Call a service without arguments; return its response message.

    uri   of the service at the master, e.g. "rosrpc://robot:40123"
    kind  the service's class, e.g. rtcf_msgs.srv.GetRunnerInfo

    Raises CallFailed.
    """
    parts = urllib.parse.urlsplit(uri)
    fields = {"callerid": caller, "service": service, "md5sum": kind._md5sum, "persistent": "0"}
    try:
        address = (parts.hostname or "", parts.port or 0)
        with socket.create_connection(address, timeout_s) as connection:
            connection.settimeout(timeout_s)
            connection.sendall(header(fields) + struct.pack("<I", 0))
            answered = header_fields(block(connection))
            if "error" in answered:
                raise CallFailed(f"{service} at {uri}: {answered['error']}")
            good = exactly(connection, 1) == b"\1"
            answer = block(connection, _LARGEST_ANSWER)
    except (OSError, ValueError, struct.error) as error:
        raise CallFailed(f"{service} at {uri} does not answer: {error}") from None
    if not good:
        raise CallFailed(f"{service} at {uri}: {answer.decode(errors='replace')}")
    return kind._response_class().deserialize(answer)


def exactly(connection: socket.socket, size: int) -> bytes:
    """Read `size` bytes.  Raises ValueError if the peer disconnects before."""
    parts = bytearray()
    while len(parts) < size:
        part = connection.recv(size - len(parts))
        if not part:
            raise ValueError("the peer disconnected")
        parts += part
    return bytes(parts)


def block(connection: socket.socket, largest: int = _LARGEST_CALL) -> bytes:
    """Read a size and a block of that size.  Raises ValueError beyond `largest` bytes."""
    (size,) = struct.unpack("<I", exactly(connection, 4))
    if size > largest:
        raise ValueError(f"{size} bytes are more than the {largest} allowed")
    return exactly(connection, size)


def text(value: str) -> bytes:
    """Return a string in the wire format: its size, then its bytes."""
    encoded = value.encode()
    return struct.pack("<I", len(encoded)) + encoded


def take_text(data: bytes) -> tuple[str, bytes]:
    """Parse a string; return it and the remaining bytes."""
    (size,) = struct.unpack_from("<I", data)
    return data[4 : 4 + size].decode(errors="replace"), data[4 + size :]


def header_fields(data: bytes) -> dict[str, str]:
    """Return the fields of a header, without its size."""
    found = {}
    while data:
        field, data = take_text(data)
        name, _, value = field.partition("=")
        found[name] = value
    return found


def header(fields: Mapping[str, str]) -> bytes:
    """Return a header with its size."""
    data = b"".join(text(f"{name}={value}") for name, value in fields.items())
    return struct.pack("<I", len(data)) + data
