"""What ports and state hold, which travels as text, as numbers, lists and objects."""

import math
import re
from typing import Any

import yaml

_MOST_DIGITS = 300  # with which a number is finite
_INTEGER = re.compile(r"[-+]?[0-9]+")
_FLOAT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {"true": True, "false": False}
# A matrix, or a vector: rows between semicolons.
_MATRIX = re.compile(r"\[([^][{}\"]*;[^][{}\"]*)\]")


class _Loader(yaml.BaseLoader):  # type: ignore[misc]
    """Takes for a number what is one, also where YAML 1.1 knows a word, a date or a time of day."""

    def construct_scalar(self, node: Any) -> Any:
        text = super().construct_scalar(node)
        return text if node.style else _scalar(text)


def parse(text: str) -> Any:
    """Return the value that a text stands for; the text itself if it was cut."""
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
    # JSON has no words for what is not finite, and no reader takes thousands of digits: it stays
    # a text.
    if _INTEGER.fullmatch(text) and len(text) <= _MOST_DIGITS:
        return int(text)
    if _FLOAT.fullmatch(text) and math.isfinite(number := float(text)):
        return number
    return _WORDS.get(text, text)
