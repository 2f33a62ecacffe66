"""A full-screen terminal and its keys; the terminal is restored at the end, also after an error."""

import codecs
import contextlib
import os
import re
import select
import signal
import sys
import termios
import time
import tty
from types import FrameType
from typing import Any, Self

from rtcfctl.terminal.interruption import kill_at_next
from rtcfctl.terminal.safe_streams import control

_ENTER = control("\x1b[?1049h\x1b[?25l\x1b[?7l")
_LEAVE = control("\x1b[?7h\x1b[?25h\x1b[?1049l")
# Synchronized update: terminals that support it show the output between these at once.
_BEGIN, _END = control("\x1b[?2026h"), control("\x1b[?2026l")
_HOME, _REST_OF_LINE, _BELOW = control("\x1b[H"), control("\x1b[K"), control("\x1b[J")
_ESCAPE = "\x1b"
_WHOLE_S = 0.05  # time for the rest of a key's characters to arrive, also over ssh
# Characters of one key; a single ESC is a key only if no characters follow in time.
_KEY = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O[ -~]|[^\[O\x1b])|\x1b(?=\x1b)|[^\x1b]")
_NAMES = {
    "\t": "tab",
    _ESCAPE: "escape",
    "\x1b[A": "up", "\x1bOA": "up", "\x1b[B": "down", "\x1bOB": "down",
    "\x1b[5~": "page up", "\x1b[6~": "page down",
    "\x1b[H": "home", "\x1bOH": "home", "\x1b[1~": "home", "\x1b[7~": "home",
    "\x1b[F": "end", "\x1bOF": "end", "\x1b[4~": "end", "\x1b[8~": "end",
}  # fmt: skip


class Screen:
    """A context manager; requires that standard output is a terminal.

    SIGTERM and SIGHUP raise SystemExit, so that the terminal is restored.
    """

    def __init__(self) -> None:
        self._keys = sys.stdin.fileno() if sys.stdin.isatty() else -1
        self._typed = ""  # received characters that key() has not returned yet
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._resized = -1, -1  # pipe to which the handler of SIGWINCH writes
        self._before: list[Any] = []
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        self._resized = os.pipe()
        for end in self._resized:
            os.set_blocking(end, False)
        for number in (signal.SIGTERM, signal.SIGHUP):
            self._handlers[number] = signal.signal(number, _end)
        self._handlers[signal.SIGWINCH] = signal.signal(signal.SIGWINCH, self._note_size)
        if self._keys >= 0:
            self._before = termios.tcgetattr(self._keys)
            tty.setcbreak(self._keys)
        sys.stdout.write(_ENTER)
        sys.stdout.flush()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            sys.stdout.write(_LEAVE)
            sys.stdout.flush()
        finally:
            if self._before:
                termios.tcsetattr(self._keys, termios.TCSADRAIN, self._before)
            for number, handler in self._handlers.items():
                signal.signal(number, handler)
            for end in self._resized:
                os.close(end)

    @property
    def size(self) -> tuple[int, int]:
        """Present columns and lines."""
        try:
            found = os.get_terminal_size(sys.stdout.fileno())
        except OSError:
            return 80, 24
        return max(found.columns, 20), max(found.lines, 4)

    def draw(self, lines: list[str]) -> None:
        """Show lines, which may be styled; lines below the last row are left out."""
        _, height = self.size
        # Clear a row before its text is written: after a text that fills the row, the cursor is
        # still on the last character, which clearing would remove.
        shown = [f"{_REST_OF_LINE}{line}" for line in lines[:height]]
        below = [_BELOW] if len(shown) < height else []
        sys.stdout.write(_BEGIN + _HOME + "\n".join([*shown, *below]) + _END)
        sys.stdout.flush()

    def key(self, wait_s: float) -> str:
        """Return the next key, by name if it has one, or "resize" if the size of the terminal has
        changed; empty if there is none within `wait_s`."""
        until = time.monotonic() + wait_s
        while not (key := self._next_key()):
            # The rest of an escape sequence follows at once; else ESC is a key itself.
            left = _WHOLE_S if self._typed else max(until - time.monotonic(), 0.0)
            ready, _, _ = select.select([end for end in self._ends if end >= 0], [], [], left)
            if self._resized[0] in ready:
                os.read(self._resized[0], 4096)
                return "resize"
            if not ready:
                begun, self._typed = self._typed, ""
                return _NAMES.get(begun, "")
            text = os.read(self._keys, 1024)
            if not text:
                return "q"  # end of file, for instance when the connection has ended
            self._typed += self._decoder.decode(text)
        return key

    @property
    def _ends(self) -> tuple[int, int]:
        return self._keys, self._resized[0]

    def _next_key(self) -> str:
        """Remove the first key from the received characters; empty if none is complete."""
        found = _KEY.match(self._typed)
        if found is None:
            return ""
        self._typed = self._typed[found.end() :]
        return _NAMES.get(found[0], found[0])

    def _note_size(self, _: int, __: FrameType | None) -> None:
        with contextlib.suppress(BlockingIOError):  # the pipe is full of notes
            os.write(self._resized[1], b"!")


def _end(number: int, _: FrameType | None) -> None:
    kill_at_next(number)
    raise SystemExit(128 + number)
