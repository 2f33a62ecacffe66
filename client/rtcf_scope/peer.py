"""The user at the other end of a TCP connection."""

import socket
import struct
from pathlib import Path
from typing import Any

# proc(5): the connections of all processes, with the uid of each.
_TABLES = {socket.AF_INET: "/proc/self/net/tcp", socket.AF_INET6: "/proc/self/net/tcp6"}
_WORDS = {socket.AF_INET: "=I", socket.AF_INET6: "=4I"}
_LOCAL, _REMOTE, _UID = 1, 2, 7  # columns


def user_of(connection: Any) -> str:
    """Return the user of a connection of this machine, else the address of the other machine.

    Empty if the connection has ended already.

    `connection` is a socket, or asyncio's view of one.
    """
    address = ""
    try:
        address = connection.getpeername()[0]
        there, here = (
            _text(connection.family, *place[:2])
            for place in (connection.getpeername(), connection.getsockname())
        )
        for line in Path(_TABLES[connection.family]).read_text().splitlines()[1:]:
            columns = line.split()
            if (columns[_LOCAL], columns[_REMOTE]) == (there, here):
                return f"uid {columns[_UID]}"
    except (OSError, KeyError, IndexError, ValueError):
        pass
    return address


def _text(family: int, address: str, port: int) -> str:
    """Return an address and a port as in the table: words in the machine's byte order."""
    words = struct.unpack(_WORDS[socket.AddressFamily(family)], socket.inet_pton(family, address))
    return "".join(f"{word:08X}" for word in words) + f":{port:04X}"
