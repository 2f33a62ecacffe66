"""Output of rtcfctl: tables and sentences for people, JSON or YAML for programs.

yaml and json are imported only when used, because imports take most of the time of a call.
"""

import os
import sys
import time
from collections.abc import Iterable, Sequence
from typing import Any, TextIO

from rtcf.v1 import control_pb2
from rtcf_shared.errors import RtcfError

from rtcfctl.terminal.plain import number, plain
from rtcfctl.terminal.safe_streams import SafeStream, control, wants_ascii
from rtcfctl.terminal.table import Cell, format_table

_PATIENCE_S = 10.0  # time from the start until progress is printed without --verbose
_ANSI = {"bold": "1", "red": "31", "green": "32", "yellow": "33", "blue": "34",
         "magenta": "35", "cyan": "36"}  # fmt: skip


class Output:
    """Prints in the selected format; owned by main()."""

    def __init__(self, kind: str, verbose: bool = False) -> None:
        self._kind = kind
        if self.for_people and wants_ascii():
            for each in (sys.stdout, sys.stderr):
                if isinstance(each, SafeStream):
                    each.ascii = True
        self._verbose = verbose or sys.stderr.isatty()
        self._since = time.monotonic()

    @property
    def for_people(self) -> bool:
        """Whether the output is tables and sentences."""
        return self._kind == "table"

    @property
    def in_json(self) -> bool:
        """Whether the output is JSON."""
        return self._kind == "json"

    @property
    def width(self) -> int | None:
        """Columns of the terminal; None if standard output is not a terminal."""
        return _width()

    def data(self, value: Any) -> None:
        """Print messages, lists or dicts for programs."""
        if self._kind == "yaml":
            import yaml

            document = _plain(value)
            text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
            if not text.replace("\n", "").isprintable():  # yaml takes more for printable
                text = yaml.safe_dump(document, sort_keys=False)
            print(text, end="")
        else:
            print(self.json(value))

    def json(self, value: Any, indent: int | None = 2) -> str:
        """Return messages, lists or dicts as JSON."""
        import json

        text = json.dumps(_plain(value), indent=indent, ensure_ascii=False)
        if text.replace("\n", "").isprintable():
            return text
        return "".join(
            each if each.isprintable() or each == "\n" else json.dumps(each)[1:-1] for each in text
        )

    def record(self, value: Any) -> None:
        """Print one of several documents: a line of JSON, or a YAML document."""
        if self._kind == "yaml":
            print("---")
            self.data(value)
        else:
            print(self.json(value, indent=None))

    def line(self, text: str, style: str = "", to: TextIO | None = None) -> None:
        """Print a line for people; `style` consists of words, e.g. "bold red"."""
        stream = to or sys.stdout
        print(styled(text, style, coloured(stream)), file=stream)

    def table(
        self, columns: Sequence[str], rows: Iterable[Sequence[Any]], right: Sequence[str] = ()
    ) -> None:
        """Print a table; `right` names the columns of numbers.

        A cell is a string, or a string and its style.  Empty columns are left out.  On a
        terminal, columns of text are folded to its width.
        """
        cells: list[list[Cell]] = [
            [(each[0], each[1]) if isinstance(each, tuple) else (str(each), "") for each in row]
            for row in rows
        ]
        in_colours = coloured(sys.stdout)
        for text_of_line in format_table(columns, cells, right, _width()):
            print("".join(styled(text, style, in_colours) for text, style in text_of_line).rstrip())

    def restart(self) -> None:
        """Prepare for output that replaces the previous output: clear a terminal, or begin a YAML
        document (JSON documents need no separator)."""
        if not self.for_people:
            if self._kind == "yaml":
                print("---")
        elif is_screen():
            print(control("\x1b[2J\x1b[H"), end="")

    def progress(self, line: str) -> None:
        """Print the progress of a call, if verbose or after 10 s."""
        if self._verbose or time.monotonic() - self._since > _PATIENCE_S:
            print(line, file=sys.stderr)

    def begin(self, line: str) -> None:
        """Print at once what begins and takes seconds."""
        print(line, file=sys.stderr, flush=True)

    def error(self, error: RtcfError) -> None:
        """Print an error after which the command goes on."""
        for line in error.lines:
            print(f"rtcfctl: {line}", file=sys.stderr, flush=True)

    def alarm(self, runner: str, reasons: Iterable[str], to: TextIO | None = None) -> None:
        """Print the reasons why a runner is not real time."""
        lines = list(reasons)
        if lines:
            self.line(f"!! {runner} IS NOT REAL TIME:", "bold red", to)
        for reason in lines:
            self.line(f"!!   {reason}", "red", to)

    def changed(self, sentence: str, result: control_pb2.ChangeResult) -> None:
        """Print the outcome of a change."""
        if not self.for_people:
            self.data(result)
            return
        print(sentence)
        self.notes(result.notes)

    def notes(self, lines: Iterable[str]) -> None:
        """Print the notes of a change on standard error."""
        for note in lines:
            print(f"rtcfctl: note: {note}", file=sys.stderr)


def _width() -> int | None:
    """Return the width of the terminal; None if standard output is not a terminal."""
    if not sys.stdout.isatty():
        return None
    try:
        return max(os.get_terminal_size(sys.stdout.fileno()).columns, 40)
    except OSError:
        return 80


def is_screen() -> bool:
    """Return whether standard output is a terminal that can be cleared and drawn again."""
    return sys.stdout.isatty() and os.environ.get("TERM") != "dumb"


def coloured(stream: TextIO) -> bool:
    """Return whether a stream shows colours."""
    return stream.isatty() and "NO_COLOR" not in os.environ and os.environ.get("TERM") != "dumb"


def styled(text: str, style: str, in_colours: bool) -> str:
    """Return a text in a style, e.g. "bold red"."""
    codes = ";".join(_ANSI[word] for word in style.split())
    if not (in_colours and codes and text.strip()):
        return text
    return control(f"\x1b[{codes}m") + text + control("\x1b[0m")


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return plain(value) if hasattr(value, "DESCRIPTOR") else number(value)
