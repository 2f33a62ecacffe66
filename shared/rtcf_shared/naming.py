"""Lists of names, and suggestions for misspelt names, for messages."""

import difflib
import itertools
from collections.abc import Iterable

_LONGEST = 255
_MOST = 2000


def suggestion(name: str, known: Iterable[str], most: int = 2) -> str:
    """Return '; did you mean "x"?' with at most `most` names; empty if no name is close."""
    close = _close(name, known, most)
    if not close:
        return ""
    return "; did you mean " + " or ".join(f'"{name}"' for name in close) + "?"


def closest(name: str, known: Iterable[str]) -> str:
    """Return the closest name; empty if none is close."""
    return next(iter(_close(name, known, 1)), "")


def listing(names: Iterable[str]) -> str:
    """Return names in order, separated by commas, or "none"."""
    return ", ".join(sorted(names)) or "none"


def _close(name: str, known: Iterable[str], most: int) -> list[str]:
    if len(name) > _LONGEST:
        return []  # the cost of a comparison grows with the length
    known = itertools.islice(known, _MOST)
    return difflib.get_close_matches(name, list(known), n=most, cutoff=0.6)
