"""An error in the source of a component: one line with the place, the error and a remedy."""

import ast
import io
import linecache
import tokenize
from pathlib import Path


class Mistake(Exception):
    """An error that prevents compiling."""

    def __init__(self, file: str, line: int, what: str, remedy: str, text: str = "") -> None:
        """Describe an error and a remedy; `text`: the expression (default: the source line)."""
        self.file, self.line, self.what, self.remedy = file, line, what, remedy
        self.text = text or source_line(file, line)
        super().__init__(str(self))

    def __str__(self) -> str:
        """Return the message, one line."""
        place = f"{display(self.file)}:{self.line}: " if self.line else f"{display(self.file)}: "
        text = f"`{self.text}`: " if self.text else ""
        return f"{place}{text}{self.what}: {self.remedy}"


def at(file: str, node: ast.AST, what: str, remedy: str) -> Mistake:
    """Return the error at a node of the source."""
    return Mistake(file, getattr(node, "lineno", 0), what, remedy, written(file, node))


def written(file: str, node: ast.AST) -> str:
    """Return the source text of a node; empty if it is longer than 60 characters or one line."""
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
        pass  # the line is only a part of a statement
    return text


def display(file: str) -> str:
    """Return the path of a file, relative if it is below the working directory."""
    path = Path(file)
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
