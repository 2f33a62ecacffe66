"""Figures and values as words for tables."""

from typing import Any

from rtcf.v1 import graph_pb2

from rtcfctl.plain import plain

_UNITS = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"), (1.0, "ns"))


def age(nanoseconds: int) -> str:
    """Return an age in the unit that suits it: "1.50 ms"."""
    for size, unit in _UNITS:
        if abs(nanoseconds) >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return "0 ns"


def microseconds(nanoseconds: float) -> str:
    """Return a duration in µs, without the unit."""
    return f"{nanoseconds / 1e3:.2f}"


def value(found: graph_pb2.ParameterValue) -> str:
    """Return a parameter's value as it is written on the command line."""
    content: Any = plain(found)
    if isinstance(content, bool):
        return "true" if content else "false"
    return "" if content is None else str(content)


def yes(condition: bool, word: str = "yes") -> str:
    """Return a word, or nothing."""
    return word if condition else ""
