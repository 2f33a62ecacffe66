"""The errors of a run: one line each, sorted by place, without duplicates."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from rtcf.component import DeclarationError

from rtcf_compile.source.mistake import Mistake, display

MOST = 20  # lines
_PLACE = re.compile(r"(?P<file>.+?):(?P<line>\d+): ")


class Report:
    """Collects errors of all components of a run."""

    def __init__(self) -> None:
        """Begin without errors."""
        # Lines by their place; the last key is the error.
        self._lines: dict[tuple[str, int, str], str] = {}
        # Errors of names by file, and the place of the first.
        self._once: dict[tuple[str, str], tuple[str, int, str]] = {}

    def __bool__(self) -> bool:
        """Return whether there is an error."""
        return bool(self._lines)

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Collect the errors that the context raises."""
        try:
            yield
        except Mistake as mistake:
            for each in mistake.all():
                self._add(each)
        except DeclarationError as error:
            for line in str(error).splitlines():
                self._declaration(line)

    def lines(self) -> list[str]:
        """Return the messages."""
        found = [" ".join(text.split()) for _, text in sorted(self._lines.items())]
        more = len(found) - MOST
        return found if more <= 0 else [*found[:MOST], f"and {more} more"]

    def _add(self, mistake: Mistake) -> None:
        key = (mistake.file, mistake.line, mistake.what)
        if mistake.is_once:
            name = (mistake.file, f"{mistake.text}: {mistake.what}")
            first = self._once.setdefault(name, key)
            if first[1] <= mistake.line and first != key:
                return
            self._lines.pop(first, None)
            self._once[name] = key
        self._lines.setdefault(key, str(mistake))

    def _declaration(self, text: str) -> None:
        place = _PLACE.match(text)
        if place is None:
            self._lines.setdefault(("", 0, text), text)
            return
        file, line = place["file"], int(place["line"])
        self._lines.setdefault((file, line, text), f"{display(file)}:{line}: {text[place.end() :]}")
