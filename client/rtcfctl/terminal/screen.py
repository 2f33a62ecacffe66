"""A terminal that is drawn again and again, and its keys; left as it was found, however it ends."""

import os
import select
import signal
import sys
import termios
import time
import tty
from types import FrameType
from typing import Any, Self

_ENTER, _LEAVE = "\x1b[?1049h\x1b[?25l\x1b[?7l", "\x1b[?7h\x1b[?25h\x1b[?1049l"
_HOME, _REST_OF_LINE, _BELOW = "\x1b[H", "\x1b[K", "\x1b[J"
_NAMES = {"\x1b[A": "up", "\x1b[B": "down", "\t": "tab", "\x1b": "escape"}


class Screen:
    """Owned by one `with`; only where standard output is a terminal.  SIGTERM and SIGHUP end the
    process by SystemExit, in order."""

    def __init__(self) -> None:
        self._keys = sys.stdin.fileno() if sys.stdin.isatty() else -1
        self._before: list[Any] = []
        self._handlers: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in (signal.SIGTERM, signal.SIGHUP):
            self._handlers[number] = signal.signal(number, _end)
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

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines, as they are now."""
        try:
            found = os.get_terminal_size(sys.stdout.fileno())
        except OSError:
            return 80, 24
        return max(found.columns, 20), max(found.lines, 4)

    def draw(self, lines: list[str]) -> None:
        """Show lines, which may be styled; what does not fit below is left out."""
        _, height = self.size
        shown = [f"{line}{_REST_OF_LINE}" for line in lines[:height]]
        sys.stdout.write(_HOME + "\n".join(shown) + _BELOW)
        sys.stdout.flush()

    def key(self, wait_s: float) -> str:
        """Return the next key, by name if it has one; empty if none comes in time."""
        if self._keys < 0:
            time.sleep(wait_s)
            return ""
        if not select.select([self._keys], [], [], wait_s)[0]:
            return ""
        text = os.read(self._keys, 16).decode(errors="replace")
        # Of an empty terminal, as that of a connection that has ended.
        return _NAMES.get(text, text[:1]) if text else "q"


def _end(number: int, _: FrameType | None) -> None:
    raise SystemExit(128 + number)
