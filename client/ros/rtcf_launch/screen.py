"""What a node prints: log records and its own words, as rosconsole does.

Warnings and errors go to standard error, which roslaunch always shows; the
rest to standard output, which it shows with output="screen".
"""

import contextlib
import sys
import time
from typing import Any

from rtcf.v1 import control_pb2

_WORDS = {
    control_pb2.LogRecord.LEVEL_DEBUG: "DEBUG",
    control_pb2.LogRecord.LEVEL_INFO: "INFO",
    control_pb2.LogRecord.LEVEL_WARN: "WARN",
    control_pb2.LogRecord.LEVEL_ERROR: "ERROR",
    control_pb2.LogRecord.LEVEL_FATAL: "FATAL",
}
_COLOURS = {"DEBUG": "\033[32m", "WARN": "\033[33m", "ERROR": "\033[31m", "FATAL": "\033[31m"}


class Screen:
    """Prints lines; owned by the node."""

    def __init__(self, name: str) -> None:
        self._name = name

    def info(self, text: str) -> None:
        """Print a line of the node's own."""
        self._print("INFO", time.time(), text)

    def warn(self, text: str) -> None:
        """Print a warning of the node's own."""
        self._print("WARN", time.time(), text)

    def error(self, text: str) -> None:
        """Print an error of the node's own."""
        self._print("ERROR", time.time(), text)

    def records(self, logs: control_pb2.LogRecords) -> None:
        """Print records of a loop."""
        if logs.dropped:
            self.warn(f"{logs.dropped} log records were lost: this terminal is slower than they")
        for record in logs.records:
            word = _WORDS.get(record.level, "INFO")
            self._print(word, record.time_ns / 1e9, record.message, record.component)

    def _print(self, word: str, time_s: float, text: str, name: str = "") -> None:
        stream: Any = sys.stderr if word in ("WARN", "ERROR", "FATAL") else sys.stdout
        line = f"[{word:>5}] [{time_s:.6f}]: {name or self._name}: {text}"
        if word in _COLOURS and stream.isatty():
            line = f"{_COLOURS[word]}{line}\033[0m"
        # The terminal may have gone; the journal has it all the same.
        with contextlib.suppress(OSError):
            # In one piece, as other nodes of a launch write to the same terminal: where Python does
            # not buffer, print() writes the end of the line by itself.
            stream.write(f"{line}\n")
            stream.flush()
