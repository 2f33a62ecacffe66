"""What rtcfctl prints: tables for people, JSON or YAML for machines.

rich and yaml are imported only where they are used: a call of rtcfctl is short.
"""

import sys
from collections.abc import Iterable, Sequence
from typing import Any

from rtcf.v1 import control_pb2

from rtcfctl.plain import plain

# Where the output is no terminal nothing may be folded to a terminal's width.
_UNLIMITED_WIDTH = 10_000


class Output:
    """Prints in the format that was asked for; owned by main()."""

    def __init__(self, kind: str, verbose: bool = False) -> None:
        self._kind = kind
        self._verbose = verbose or sys.stderr.isatty()
        self._console: Any = None

    @property
    def for_people(self) -> bool:
        """Tell whether tables and sentences are wanted."""
        return self._kind == "table"

    def data(self, value: Any) -> None:
        """Print messages, lists or dicts for machines."""
        document = _plain(value)
        if self._kind == "yaml":
            import yaml

            print(yaml.safe_dump(document, sort_keys=False, allow_unicode=True), end="")
        else:
            import json

            print(json.dumps(document, indent=2, ensure_ascii=False))

    def line(self, text: str, style: str = "") -> None:
        """Print a line for people."""
        from rich.text import Text

        self._rich().print(Text(text, style=style), soft_wrap=True)

    def table(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[Any]],
        right: Sequence[str] = (),
        title: str = "",
    ) -> None:
        """Print a table; `right` names the columns of numbers.

        A cell is a string, or a string and its style.
        """
        from rich import box
        from rich.table import Table
        from rich.text import Text

        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title=title, title_justify="left")
        for column in columns:
            table.add_column(
                column, justify="right" if column in right else "left", overflow="fold"
            )
        for row in rows:
            # Text, not str: brackets in names are no markup.
            table.add_row(
                *(Text(*cell) if isinstance(cell, tuple) else Text(str(cell)) for cell in row)
            )
        self._rich().print(table)

    def begin_anew(self) -> None:
        """Before output that takes the place of the last: clear a terminal; elsewhere begin
        another YAML document (JSON documents just follow each other)."""
        if not self.for_people:
            if self._kind == "yaml":
                print("---")
        elif sys.stdout.isatty():
            self._rich().clear()

    def progress(self, line: str) -> None:
        """Show what a long call is doing."""
        if self._verbose:
            print(line, file=sys.stderr)

    def changed(self, sentence: str, result: control_pb2.ChangeResult) -> None:
        """Print the outcome of a change."""
        if not self.for_people:
            self.data(result)
            return
        print(sentence)
        self.notes(result)

    def notes(self, result: control_pb2.ChangeResult) -> None:
        """Print what else the caller of a change should know."""
        for note in result.notes:
            print(f"rtcfctl: note: {note}", file=sys.stderr)

    def _rich(self) -> Any:
        if self._console is None:
            from rich.console import Console

            width = None if sys.stdout.isatty() else _UNLIMITED_WIDTH
            self._console = Console(width=width, highlight=False, markup=False)
        return self._console


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return plain(value) if hasattr(value, "DESCRIPTOR") else value
