"""Standard output and error without control characters from other users.

All text is printed through SafeStream, which prints line ends, tabs and the sequences of
control() as they are, and other unprintable characters as escapes.
"""

import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from rtcf_shared.printable import printable

# Encloses our own sequences.  Nobody else knows it.
_MARK = f"\0{os.urandom(8).hex()}\0"
_UNUSUAL = re.compile(r"[^\n\t -~]")


def control(sequence: str) -> str:
    """Return a control sequence of rtcfctl itself, which SafeStream prints as it is."""
    return f"{_MARK}{sequence}{_MARK}"


class SafeStream:
    """A text stream that prints no control characters but those of control()."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write one text."""
        if _UNUSUAL.search(text):
            parts = text.split(_MARK)
            parts[::2] = [printable(each, "\n\t") for each in parts[::2]]
            text = "".join(parts)
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def safe_streams() -> Iterator[None]:
    """Make standard output and error safe.

    A closed stream discards its text: a change must not fail because of it.
    """
    before = sys.stdout, sys.stderr
    out, error = (each or open(os.devnull, "w", encoding="utf-8") for each in before)  # noqa: SIM115
    sys.stdout, sys.stderr = SafeStream(out), SafeStream(error)  # type: ignore[assignment]
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before
