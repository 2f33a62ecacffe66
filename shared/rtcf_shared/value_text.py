"""Converts the values of ports and state from text to numbers, lists and objects."""

import math
import re
from typing import Any

import yaml

_MOST_DIGITS = 300  # of an integer that is finite as a double
_INTEGER = re.compile(r"[-+]?[0-9]+")
_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {"true": True, "false": False}
# A matrix or a vector: rows separated by semicolons.
_MATRIX = re.compile(r"\[([^][{}\"]*;[^][{}\"]*)\]")


class _Loader(yaml.BaseLoader):  # type: ignore[misc]
    """Reads numbers as numbers, even if YAML 1.1 reads them as words, dates or times of day."""

    def construct_scalar(self, node: Any) -> Any:
        text = super().construct_scalar(node)
        return text if node.style else _scalar(text)


def parse(text: str) -> Any:
    """Return the value of a text, or the text itself if it is not valid, e.g. truncated."""
    try:
        return yaml.load(_MATRIX.sub(_rows, text), _Loader)
    except yaml.YAMLError:
        return text


def _rows(found: re.Match[str]) -> str:
    rows = found[1].split(";")
    if any("," in row for row in rows):
        rows = [f"[{row}]" for row in rows]
    return f"[{','.join(rows)}]"


def _scalar(text: str) -> Any:
    # Infinity, NaN and integers of thousands of digits stay text, because JSON cannot represent
    # them.
    if _INTEGER.fullmatch(text) and len(text) <= _MOST_DIGITS:
        return int(text)
    if _FLOAT.fullmatch(text) and math.isfinite(number := float(text)):
        return number
    return _WORDS.get(text, text)
