"""The services get_loggers and set_logger_level of a node, in TCPROS, so that rqt_logger_level can
ask it as any other.  Its logger is for looks: what such a node prints is little."""

import contextlib
import socket
import struct
import threading

LOGGER = "ros.rtcf"
LEVELS = ("debug", "info", "warn", "error", "fatal")
# Of roscpp/GetLoggers and roscpp/SetLoggerLevel.
_MD5_SUMS = {
    "get_loggers": "32e97e85527d4678a8f9279894bb64b0",
    "set_logger_level": "51da076440d78ca1684d36c868df61ea",
}
_TYPES = {"get_loggers": "roscpp/GetLoggers", "set_logger_level": "roscpp/SetLoggerLevel"}
_LARGEST = 64 * 1024  # bytes of a header or a request
_PATIENCE_S = 10.0


class LoggerServices:
    """Serves both on a port of its own, in threads of its own."""

    def __init__(self, node: str) -> None:
        self._node = node
        self._level = "info"
        self._listener = socket.create_server(("", 0))
        self.port = int(self._listener.getsockname()[1])
        self.names = [f"{node}/{service}" for service in _MD5_SUMS]
        threading.Thread(target=self._listen, daemon=True).start()

    def end(self) -> None:
        """Take no more calls."""
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
            header = _fields(_block(connection))
            service = header.get("service", "").removeprefix(f"{self._node}/")
            wanted = header.get("md5sum", "*")
            if service not in _MD5_SUMS or wanted not in ("*", _MD5_SUMS[service]):
                connection.sendall(_header({"error": "no such service here"}))
                return
            connection.sendall(
                _header(
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
                answer = self._answer(service, _block(connection))
                connection.sendall(b"\1" + struct.pack("<I", len(answer)) + answer)
                if header.get("persistent") != "1":
                    return

    def _answer(self, service: str, request: bytes) -> bytes:
        if service == "get_loggers":
            return struct.pack("<I", 1) + _text(LOGGER) + _text(self._level)
        _, rest = _take_text(request)
        level, _ = _take_text(rest)
        if level.lower() in LEVELS:
            self._level = level.lower()
        return b""


def _exactly(connection: socket.socket, size: int) -> bytes:
    parts = bytearray()
    while len(parts) < size:
        part = connection.recv(size - len(parts))
        if not part:
            raise ValueError("the caller has gone")
        parts += part
    return bytes(parts)


def _block(connection: socket.socket) -> bytes:
    (size,) = struct.unpack("<I", _exactly(connection, 4))
    if size > _LARGEST:
        raise ValueError("larger than any call")
    return _exactly(connection, size)


def _text(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _take_text(data: bytes) -> tuple[str, bytes]:
    (size,) = struct.unpack_from("<I", data)
    return data[4 : 4 + size].decode(errors="replace"), data[4 + size :]


def _fields(data: bytes) -> dict[str, str]:
    found = {}
    while data:
        field, data = _take_text(data)
        name, _, value = field.partition("=")
        found[name] = value
    return found


def _header(fields: dict[str, str]) -> bytes:
    data = b"".join(_text(f"{name}={value}") for name, value in fields.items())
    return struct.pack("<I", len(data)) + data
