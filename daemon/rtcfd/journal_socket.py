"""The journal's native protocol (systemd.io/JOURNAL_NATIVE_PROTOCOL): one datagram per record.

Uses Python's socket, which releases the interpreter lock while it waits: a journal that does not
read blocks only the thread that sends.  libsystemd's function would block all threads of rtcfd.
"""

import errno
import fcntl
import os
import socket
from array import array
from collections.abc import Mapping

ADDRESS = "/run/systemd/journal/socket"

# The size that libsystemd requests; the kernel grants at most net.core.wmem_max.
_SEND_BUFFER = 8 << 20
# The journal requires these seals of a file, which it reads in place.
_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_WRITE | fcntl.F_SEAL_SEAL


class JournalSocket:
    """Sends records; owned and called by one thread."""

    def __init__(self, address: str = ADDRESS) -> None:
        self._address = address
        # Not connected: a restarted journal may have a new socket.
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)

    def send(self, fields: Mapping[str, str]) -> None:
        """Send a record; waits until the journal has room for it.

        Raises OSError if there is no journal.
        """
        data = encoded(fields)
        try:
            self._socket.sendto(data, self._address)
        except OSError as error:
            if error.errno not in (errno.EMSGSIZE, errno.ENOBUFS):
                raise
            self._send_as_file(data)

    def _send_as_file(self, data: bytes) -> None:
        descriptor = os.memfd_create("rtcfd-log", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        with os.fdopen(descriptor, "wb", buffering=0) as file:
            rest = memoryview(data)
            while rest:
                rest = rest[file.write(rest) :]
            fcntl.fcntl(file, fcntl.F_ADD_SEALS, _SEALS)
            passed = (socket.SOL_SOCKET, socket.SCM_RIGHTS, array("i", [file.fileno()]))
            self._socket.sendmsg([], [passed], 0, self._address)


def encoded(fields: Mapping[str, str]) -> bytes:
    """Return a record in the journal's format."""
    return b"".join(_field(name, value) for name, value in fields.items())


def _field(name: str, value: str) -> bytes:
    # A file name may not be valid text; escaped, it stays readable, as on stderr.
    data = value.encode(errors="backslashreplace")
    if b"\n" not in data:
        return b"%s=%s\n" % (name.encode(), data)
    return b"%s\n%s%s\n" % (name.encode(), len(data).to_bytes(8, "little"), data)
