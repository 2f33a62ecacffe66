"""The services get_loggers and set_logger_level of a node, in TCPROS, for rqt_logger_level.

The level applies to the node's own messages.
"""

import contextlib
import socket
import struct
import threading
from collections.abc import Callable

from rtcf_launch import tcpros

LOGGER = "ros.rtcf"
LEVELS = ("debug", "info", "warn", "error", "fatal")
# Of roscpp/GetLoggers and roscpp/SetLoggerLevel.
_MD5_SUMS = {
    "get_loggers": "32e97e85527d4678a8f9279894bb64b0",
    "set_logger_level": "51da076440d78ca1684d36c868df61ea",
}
_TYPES = {"get_loggers": "roscpp/GetLoggers", "set_logger_level": "roscpp/SetLoggerLevel"}
_PATIENCE_S = 10.0


class LoggerServices:
    """Serves both services on its own port, in its own threads."""

    def __init__(self, node: str, level_set: Callable[[str], None]) -> None:
        """Serve; any thread calls `level_set` with a new level."""
        self._node = node
        self._level = "info"
        self._level_set = level_set
        self._listener = socket.create_server(("", 0))
        self.port = int(self._listener.getsockname()[1])
        self.names = [f"{node}/{service}" for service in _MD5_SUMS]
        threading.Thread(target=self._listen, daemon=True).start()

    def end(self) -> None:
        """Accept no more calls."""
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _listen(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        with connection, contextlib.suppress(OSError, ValueError, struct.error):
            connection.settimeout(_PATIENCE_S)
            header = tcpros.header_fields(tcpros.block(connection))
            service = header.get("service", "").removeprefix(f"{self._node}/")
            wanted = header.get("md5sum", "*")
            if service not in _MD5_SUMS or wanted not in ("*", _MD5_SUMS[service]):
                connection.sendall(tcpros.header({"error": "no such service here"}))
                return
            connection.sendall(
                tcpros.header(
                    {
                        "callerid": self._node,
                        "md5sum": _MD5_SUMS[service],
                        "type": _TYPES[service],
                        "request_type": _TYPES[service] + "Request",
                        "response_type": _TYPES[service] + "Response",
                    }
                )
            )
            if header.get("probe") == "1":
                return
            while True:
                answer = self._answer(service, tcpros.block(connection))
                connection.sendall(b"\1" + struct.pack("<I", len(answer)) + answer)
                if header.get("persistent") != "1":
                    return

    def _answer(self, service: str, request: bytes) -> bytes:
        if service == "get_loggers":
            return struct.pack("<I", 1) + tcpros.text(LOGGER) + tcpros.text(self._level)
        _, rest = tcpros.take_text(request)
        level, _ = tcpros.take_text(rest)
        if level.lower() in LEVELS:
            self._level = level.lower()
            self._level_set(self._level)
        return b""
