"""A terminal with a command in it: its screen, and keys to type."""

import codecs
import os
import pty
import re
import select
import subprocess
import termios
import time

from daemon_process import BUILD_TREE, DEADLINE_S, Daemon

_PIECE = re.compile(
    r"\x1b\[(?P<parameters>[0-9;?]*)(?P<final>[A-Za-z])|(?P<control>[\r\n])|(?P<text>[^\x1b\r\n]+)"
)


class _Cells:
    """The characters of a terminal without wrapping, as on a VT100: the cursor stays in the
    last column after a write there, and the next erase deletes that character."""

    def __init__(self, columns: int, lines: int) -> None:
        self.resize(columns, lines)
        self.screen = ""  # the last complete screen

    def resize(self, columns: int, lines: int) -> None:
        self._columns = columns
        self._rows = [[" "] * columns for _ in range(lines)]
        self._row = self._column = 0

    def feed(self, text: str) -> str:
        """Process a program's output; return the start of an incomplete sequence."""
        at = 0
        while (found := _PIECE.match(text, at)) is not None:
            at = found.end()
            if found["text"] is not None:
                self._put(found["text"])
            elif found["control"] == "\r":
                self._column = 0
            elif found["control"] == "\n":
                self._line_feed()
            else:
                self._sequence(found["parameters"], found["final"])
        return text[at:]

    def _put(self, text: str) -> None:
        for character in text:
            self._rows[self._row][self._column] = character
            self._column = min(self._column + 1, self._columns - 1)

    def _line_feed(self) -> None:
        if self._row + 1 < len(self._rows):
            self._row += 1
        else:
            self._rows = [*self._rows[1:], [" "] * self._columns]

    def _sequence(self, parameters: str, final: str) -> None:
        if (parameters, final) == ("?2026", "l"):
            self.screen = self.text()
        elif final == "H":
            assert not parameters
            self._row = self._column = 0
        elif final in "KJ":
            assert not parameters
            rest = self._columns - self._column
            self._rows[self._row][self._column :] = [" "] * rest
            if final == "J":
                for row in self._rows[self._row + 1 :]:
                    row[:] = [" "] * self._columns
        else:
            assert final in "hlm", f"the terminal of the tests does not know {parameters}{final}"

    def text(self) -> str:
        return "\n".join("".join(row).rstrip() for row in self._rows).rstrip("\n")


class Terminal:
    """A terminal in which rtcfctl runs, until close()."""

    def __init__(self, daemon: Daemon, *words: str, columns: int = 80, lines: int = 24) -> None:
        self._ours, self.theirs = pty.openpty()
        termios.tcsetwinsize(self.theirs, (lines, columns))
        self._cells = _Cells(columns, lines)
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        self._left = ""
        self.before = termios.tcgetattr(self.theirs)
        self.process = subprocess.Popen(
            # As the leader of a session with this terminal: a signal reports a new size.
            ["setsid", "--ctty", BUILD_TREE / "bin" / "rtcfctl", *words],
            env=daemon.environment() | {"NO_COLOR": "1"},
            stdin=self.theirs, stdout=self.theirs, stderr=self.theirs,
        )  # fmt: skip
        self.shown = b""

    def close(self) -> None:
        """End the command."""
        self.process.kill()
        self.process.wait()
        os.close(self.theirs)
        os.close(self._ours)

    def see(self, pattern: str) -> str:
        """Wait for a complete screen that matches; return it as shown."""
        deadline = time.monotonic() + DEADLINE_S
        while True:
            self._read()
            if re.search(pattern, self._cells.screen, re.MULTILINE):
                return self._cells.screen
            assert time.monotonic() < deadline, (
                f"no {pattern} in\n{self._cells.screen}\nof {self.shown[-1000:]!r}"
            )

    def press(self, keys: bytes) -> None:
        """Type keys."""
        os.write(self._ours, keys)

    def end(self) -> int:
        """Wait for the end; return the exit status."""
        deadline = time.monotonic() + DEADLINE_S
        while self.process.poll() is None:
            assert time.monotonic() < deadline, self.shown[-2000:]
            self._read()
        self._read()
        return int(self.process.wait())

    def resize(self, columns: int, lines: int) -> None:
        """Change the size of the terminal."""
        self._read()
        self._cells.resize(columns, lines)
        termios.tcsetwinsize(self._ours, (lines, columns))

    def _read(self) -> None:
        for _ in range(1000):
            if not select.select([self._ours], [], [], 0.05)[0]:
                return
            data = os.read(self._ours, 65536)
            self.shown += data
            self._left = self._cells.feed(self._left + self._decoder.decode(data))
