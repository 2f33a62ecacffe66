"""A mistake in a component's source: one line that says where, what, and what to write instead."""

import ast
import linecache
from pathlib import Path


class Mistake(Exception):
    """What cannot be compiled."""

    def __init__(self, file: str, line: int, what: str, way_out: str, text: str = "") -> None:
        """Say where; `text` is the expression, else it is the source line."""
        self.file, self.line, self.what, self.way_out = file, line, what, way_out
        self.text = text or source_line(file, line)
        super().__init__(str(self))

    def __str__(self) -> str:
        """Return the one line."""
        place = f"{display(self.file)}:{self.line}: " if self.line else f"{display(self.file)}: "
        text = f"`{self.text}`: " if self.text else ""
        return f"{place}{text}{self.what}: {self.way_out}"


def at(file: str, node: ast.AST, what: str, way_out: str) -> Mistake:
    """Return a mistake at a node of the source."""
    text = " ".join(ast.unparse(node).split())
    if len(text) > 60 or "\n" in ast.unparse(node):
        text = ""
    return Mistake(file, getattr(node, "lineno", 0), what, way_out, text)


def source_line(file: str, line: int) -> str:
    """Return a line of a source file without its indent."""
    return linecache.getline(file, line).strip()


def display(file: str) -> str:
    """Return a file's name, relative where it is below the present folder."""
    path = Path(file)
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
