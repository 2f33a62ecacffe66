"""A mistake in a component's source: one line that says where, what, and what to write instead."""

import ast
import io
import linecache
import tokenize
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
    return Mistake(file, getattr(node, "lineno", 0), what, way_out, written(file, node))


def written(file: str, node: ast.AST) -> str:
    """Return a short expression of one line as the source has it; else nothing."""
    line, last, begin, end = (
        getattr(node, each, None)
        for each in ("lineno", "end_lineno", "col_offset", "end_col_offset")
    )
    if line is None or begin is None or end is None or last != line:
        return ""
    text = linecache.getline(file, line).encode()[begin:end].decode(errors="replace").strip()
    return text if len(text) <= 60 else ""


def source_line(file: str, line: int) -> str:
    """Return a line of a source file without its indent and its comment."""
    text = linecache.getline(file, line).strip()
    try:
        for each in tokenize.generate_tokens(io.StringIO(text).readline):
            if each.type == tokenize.COMMENT:
                return text[: each.start[1]].strip() or text
    except (tokenize.TokenError, SyntaxError):
        pass  # a part of a statement, before a comment
    return text


def display(file: str) -> str:
    """Return a file's name, relative where it is below the present folder."""
    path = Path(file)
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
