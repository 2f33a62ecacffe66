"""Figures and values as words for tables."""

import argparse
import re
import time
from collections.abc import Callable
from typing import Any

from rtcf.v1 import graph_pb2
from rtcf_shared.quantities import parse

from rtcfctl.terminal.plain import plain

# Of what somebody has chosen, and of what is measured or computed.
_CHOSEN_DIGITS, _MEASURED_DIGITS = 10, 6
_LONG_NUMBER = re.compile(r"(?<![\w.])-?\d*\.\d{5,}(e[-+]?\d+)?(?![\w.])")
_UNITS = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"), (1.0, "ns"))


def age(nanoseconds: int) -> str:
    """Return an age in the unit that suits it: "1.50 ms"."""
    for size, unit in _UNITS:
        if abs(nanoseconds) >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return "0 ns"


def date(nanoseconds: int) -> str:
    """Return a time since 1970 by the clock here: "2026-03-01 14:05:09"."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(nanoseconds / 1e9))


def date_ms(nanoseconds: int) -> str:
    """Likewise, with milliseconds: "2026-03-01 14:05:09.250"."""
    return f"{date(nanoseconds)}.{nanoseconds // 1_000_000 % 1000:03}"


def amount(unit: str) -> Callable[[str], float]:
    """Return what argparse reads a number by, with or without a unit of the kind of `unit`."""

    def value(text: str) -> float:
        try:
            return parse(text, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return value


def whole(text: str) -> int:
    """Read a count, for argparse."""
    try:
        number = int(text)
    except ValueError:
        number = -1
    if not 0 <= number < 2**32:
        raise argparse.ArgumentTypeError(f"{text}: a whole number from 0 to {2**32 - 1}, please")
    return number


def microseconds(nanoseconds: float) -> str:
    """Return a duration in µs, without the unit; of a long one the digits that matter."""
    size = abs(nanoseconds)
    return f"{nanoseconds / 1e3:.{2 if size < 1e6 else 1 if size < 1e7 else 0}f}"


def counted(count: int, what: str) -> str:
    """Return "1 overrun", "2 overruns"."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def value(found: graph_pb2.ParameterValue) -> str:
    """Return a parameter's value as it is written on the command line."""
    content: Any = plain(found)
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, float):
        return f"{content:.{_CHOSEN_DIGITS}g}"
    return "" if content is None else str(content)


def port_value(text: str) -> str:
    """Return a port's value, of a message with one field that field's, with the digits that
    matter to the eye."""
    lines = text.split("\n")
    if len(lines) == 1:
        text = text.removeprefix("data: ")
    return _LONG_NUMBER.sub(lambda found: f"{float(found[0]):.{_MEASURED_DIGITS}g}", text)


def figure(number: float) -> str:
    """Return a number that was measured or computed, with the digits that matter to the eye."""
    return f"{number:.{_MEASURED_DIGITS}g}"


def yes(condition: bool, word: str = "yes") -> str:
    """Return a word, or nothing."""
    return word if condition else ""
