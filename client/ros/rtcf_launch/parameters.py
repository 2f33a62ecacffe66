"""Private parameters of a node, read with type checks; an error is one line."""

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Any

from rtcf_launch.codes import Code, Ending

_MISSING = object()
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?", re.ASCII)


def _wrong(message: str) -> Ending:
    return Ending(Code.USAGE, message)


class Parameters:
    """The private parameters of one node.  Reading a parameter removes it, see rest()."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = dict(values)

    def boolean(self, name: str, default: bool | None = None) -> bool | None:
        """Take a bool: true, false, 1 or 0."""
        value = self._take(name)
        if value is _MISSING:
            return default
        value = as_boolean(value)
        if not isinstance(value, bool):
            raise _wrong(f"~{name} must be true or false, not {_shown(value)}")
        return value

    def integer(self, name: str, low: int, high: int) -> int | None:
        """Take an integer in a range, also one written as 2.0."""
        value = self._take(name)
        if value is _MISSING:
            return None
        value = as_integer(value)
        if isinstance(value, bool) or not isinstance(value, int):
            raise _wrong(f"~{name} must be an integer, not {_shown(value)}")
        if not low <= value <= high:
            raise _wrong(f"~{name} of {value} is out of range: {low} to {high}")
        return int(value)

    def number(self, name: str, low: float, high: float) -> float | None:
        """Take a number in a range."""
        value = self._take(name)
        if value is _MISSING:
            return None
        value = as_number(value)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(f"~{name} must be a number, not {_shown(value)}")
        if not low <= value <= high:  # NaN is in no range
            raise _wrong(f"~{name} of {value:g} is out of range: {low:g} to {high:g}")
        return float(value)

    def text(self, name: str) -> str | None:
        """Take a string."""
        value = self._take(name)
        if value is _MISSING:
            return None
        if not isinstance(value, str):
            raise _wrong(f"~{name} must be a string, not {_shown(value)}: put it in quotes")
        return value

    def word(self, name: str, allowed: Iterable[str]) -> str | None:
        """Take one of some words, in any case."""
        value = self._take(name)
        if value is _MISSING:
            return None
        words = list(allowed)
        if not isinstance(value, str) or value.lower() not in words:
            raise _wrong(f"~{name} must be one of {', '.join(words)}, not {_shown(value)}")
        return value.lower()

    def raw(self, name: str) -> Any:
        """Take a value of any type; None if it does not exist."""
        value = self._take(name)
        return None if value is _MISSING else value

    def has(self, name: str) -> bool:
        """Return whether a parameter exists and has not been taken."""
        return name in self._values

    def put(self, name: str, value: Any) -> None:
        """Give a value back."""
        self._values[name] = value

    def rest(self) -> dict[str, Any]:
        """Return the parameters that have not been taken."""
        return dict(self._values)

    def _take(self, name: str) -> Any:
        return self._values.pop(name, _MISSING)


def as_integer(value: Any) -> Any:
    """Convert a float with an integer value, such as 2.0, to int; return other values unchanged."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def as_number(value: Any) -> Any:
    """Convert a text such as 1e-3 to float, which YAML 1.1 does not read as a number; return other
    values unchanged."""
    if not isinstance(value, str) or not _NUMBER.fullmatch(value):
        return value
    return float(value)


def as_boolean(value: Any) -> Any:
    """Convert the integers 1 and 0 to bool; return other values unchanged."""
    return bool(value) if isinstance(value, int) and value in (0, 1) else value


def close_to(name: str, known: Iterable[str]) -> str:
    """Return '; did you mean ~x?' with a name in the same group, or nothing."""
    group = name[: name.rfind("/") + 1]
    there = [each.removeprefix(group) for each in known if each.startswith(group)]
    close = difflib.get_close_matches(name.removeprefix(group), there, n=1)
    return f"; did you mean ~{group}{close[0]}?" if close else ""


def _shown(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)
