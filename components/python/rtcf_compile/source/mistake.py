"""An error in the source of a component: one line with the place, the error and a remedy."""

import ast
import io
import linecache
import tokenize
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path


class Mistake(Exception):
    """An error that prevents compiling."""

    def __init__(self, file: str, line: int, what: str, remedy: str, text: str = "") -> None:
        """Describe an error and a remedy; `text`: the expression (default: the source line)."""
        self.file, self.line, self.what, self.remedy = file, line, what, remedy
        self.text = text or source_line(file, line)
        # Further errors that were found with this one.
        self.others: tuple[Mistake, ...] = ()
        # Report the error of this text only at its first place in the file.
        self.is_once = False
        super().__init__(str(self))

    def all(self) -> list["Mistake"]:
        """Return this error and the others."""
        return [self, *self.others]

    def __str__(self) -> str:
        """Return the message, one line."""
        place = f"{display(self.file)}:{self.line}: " if self.line else f"{display(self.file)}: "
        text = f"`{self.text}`: " if self.text else ""
        return f"{place}{text}{self.what}: {self.remedy}"


class Mistakes:
    """Collects the errors of a part of the compilation, which then goes on behind each."""

    def __init__(self) -> None:
        """Begin without errors."""
        self.found: list[Mistake] = []

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Collect the errors that the context raises."""
        try:
            yield
        except Mistake as mistake:
            self.add(mistake)

    def add(self, *mistakes: Mistake) -> None:
        """Add errors, each with those that were found with it."""
        self.found += [each for mistake in mistakes for each in mistake.all()]

    def one_per_line(self) -> None:
        """Keep the first error of each line."""
        self.found = list({(each.file, each.line): each for each in reversed(self.found)}.values())
        self.found.reverse()

    def report(self) -> None:
        """Raise the first error, with the others, if there is one."""
        if self.found:
            raise joined(self.found)


def joined(found: Sequence[Mistake]) -> Mistake:
    """Return several errors as one: the first, with the others."""
    first = found[0]
    first.others = tuple(each for each in found[1:] if each is not first)
    return first


def at(file: str, node: ast.AST, what: str, remedy: str) -> Mistake:
    """Return the error at a node of the source."""
    return Mistake(file, getattr(node, "lineno", 0), what, remedy, written(file, node))


def once(mistake: Mistake) -> Mistake:
    """Return the error of a name, which is reported only at its first place in the file."""
    mistake.is_once = True
    return mistake


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
