"""The output of a node: log records of the loop and its own messages, in the format of rosconsole
(ROSCONSOLE_FORMAT).

Warnings and errors go to standard error, which roslaunch always shows; others go to standard
output, which roslaunch shows with output="screen".
"""

import contextlib
import os
import re
import sys
import threading
import time
from typing import Any

from rtcf.connection import DEFAULT_SOCKET
from rtcf.v1 import control_pb2

from rtcf_launch import hints

_WORDS = {
    control_pb2.LogRecord.LEVEL_DEBUG: "DEBUG",
    control_pb2.LogRecord.LEVEL_INFO: "INFO",
    control_pb2.LogRecord.LEVEL_WARN: "WARN",
    control_pb2.LogRecord.LEVEL_ERROR: "ERROR",
    control_pb2.LogRecord.LEVEL_FATAL: "FATAL",
}
_ORDER = list(_WORDS.values())
_COLOURS = {"DEBUG": "\033[32m", "WARN": "\033[33m", "ERROR": "\033[31m", "FATAL": "\033[31m"}


_TOKEN = re.compile(r"\$\{([a-z]+)(?::([^}]*))?\}")


def system_socket() -> str:
    """Return the control socket that rtcfctl uses by default."""
    return os.environ.get("RTCF_SOCKET") or DEFAULT_SOCKET


class Screen:
    """Prints lines; owned by the node."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._format = os.environ.get("ROSCONSOLE_FORMAT", "")
        self._least = "INFO"
        self._socket = ""  # of a private rtcfd

    def use_daemon(self, socket: str) -> None:
        """Make commands in messages name the control socket, unless it is the system's."""
        self._socket = "" if socket == system_socket() else socket

    def set_level(self, level: str) -> None:
        """Set the lowest level of the node's own messages to print, e.g. "warn".  Any thread."""
        self._least = level.upper()

    def info(self, text: str) -> None:
        """Print a message of the node itself."""
        self._print_own("INFO", text)

    def warn(self, text: str) -> None:
        """Print a warning of the node itself."""
        self._print_own("WARN", text)

    def error(self, text: str) -> None:
        """Print an error of the node itself."""
        self._print_own("ERROR", text)

    def records(self, logs: control_pb2.LogRecords) -> None:
        """Print records of a loop."""
        if logs.dropped:
            self.warn(f"{logs.dropped} log records were dropped: this terminal is too slow")
        for record in logs.records:
            word = _WORDS.get(record.level, "INFO")
            place = (record.file, record.line)
            self._print(word, record.time_ns / 1e9, record.message, record.component, place)

    def _print_own(self, word: str, text: str) -> None:
        if _ORDER.index(word) >= _ORDER.index(self._least):
            self._print(word, time.time(), text)

    def _print(
        self,
        word: str,
        time_s: float,
        text: str,
        name: str = "",
        place: tuple[str, int] = ("", 0),
    ) -> None:
        text = hints.fitted(text, self._socket)
        stream: Any = sys.stderr if word in ("WARN", "ERROR", "FATAL") else sys.stdout
        line = (
            self._formatted(word, time_s, text, name, place)
            if self._format
            else f"[{word:>5}] [{time_s:.6f}]: {name or self._name}: {text}"
        )
        if word in _COLOURS and stream.isatty():
            line = f"{_COLOURS[word]}{line}\033[0m"
        # The terminal may be closed; the journal has the loop's records, too.
        with contextlib.suppress(OSError):
            # One write per line, because other nodes of the launch write to the same terminal:
            # print() without a buffer writes the end of the line separately.
            stream.write(f"{line}\n")
            stream.flush()

    def _formatted(
        self, word: str, time_s: float, text: str, name: str, place: tuple[str, int]
    ) -> str:
        """Return a line in the format of ROSCONSOLE_FORMAT."""
        values = {
            "severity": f"{word:>5}",
            "message": text,
            "logger": f"ros.rtcf.{name}" if name else "ros.rtcf",
            "node": self._name,
            "thread": hex(threading.get_ident()),
            "file": place[0],
            "line": str(place[1]),
            "function": "",
        }

        def value(token: re.Match[str]) -> str:
            kind, how = token.groups()
            if kind in ("time", "walltime"):
                local = time.localtime(time_s)
                return time.strftime(how, local) if how else f"{time_s:.9f}"
            return values.get(kind, token.group())

        return _TOKEN.sub(value, self._format)
