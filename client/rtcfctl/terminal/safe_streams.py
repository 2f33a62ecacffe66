"""Standard output and error without control characters from other users.

All text is printed through SafeStream, which prints line ends, tabs and the sequences of
control() as they are, and other unprintable characters as escapes. In the locale C, it prints
ASCII.
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
# What stands for other characters in ASCII; "?" for those that are not here.
_ASCII = {
    **dict.fromkeys("\u2212\u2013\u2014\u2010", "-"),
    **dict.fromkeys("\u2018\u2019", "'"), **dict.fromkeys("\u201c\u201d", '"'),
    **dict.fromkeys("█▇▆▅▄▃▂▁▉▊▋▌▍▎▏", "#"),
    **dict.fromkeys("◄◀←", "<"), **dict.fromkeys("►▶→", ">"),
    **dict.fromkeys("\u202f\u2009\u00a0", " "),
    "µ": "u", "…": "~", "×": "x", "±": "+-", "°": " deg", "²": "^2", "³": "^3", "·": "-", "▲": "^",
    "▼": "v", "≤": "<=", "≥": ">=", "●": "*", "✓": "+", "Δ": "d",
}  # fmt: skip
_BOXES, _BRAILLE = range(0x2500, 0x2580), range(0x2800, 0x2900)
_LINES = {"─": "-", "━": "-", "═": "-", "╌": "-", "┄": "-", "│": "|", "┃": "|", "║": "|"}


def control(sequence: str) -> str:
    """Return a control sequence of rtcfctl itself, which SafeStream prints as it is."""
    return f"{_MARK}{sequence}{_MARK}"


def wants_ascii() -> bool:
    """Return whether the user has chosen the locale C, whose terminals show ASCII only."""
    names = (os.environ.get(each) for each in ("LC_ALL", "LC_CTYPE", "LANG"))
    return next((each for each in names if each), "") in ("C", "POSIX")


def in_ascii(text: str) -> str:
    """Return a text in ASCII."""
    return "".join(each if each.isascii() else _stand_in(each) for each in text)


def _stand_in(character: str) -> str:
    code = ord(character)
    if code in _BOXES:
        return _LINES.get(character, _ASCII.get(character, "+"))
    return "*" if code in _BRAILLE else _ASCII.get(character, "?")


class SafeStream:
    """A text stream that prints no control characters but those of control().

    ascii  whether it prints ASCII only
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self.ascii = False

    def write(self, text: str) -> int:
        """Write one text."""
        if self.ascii and not text.isascii():
            text = in_ascii(text)
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
