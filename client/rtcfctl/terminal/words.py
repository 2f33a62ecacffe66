"""Numbers, times and values as text for tables."""

import argparse
import re
import time
from collections.abc import Callable
from typing import Any

from rtcf.v1 import graph_pb2
from rtcf_shared.quantities import parse

from rtcfctl.terminal.plain import plain

# Significant digits of parameters, and of measured or computed values.
_CHOSEN_DIGITS, _MEASURED_DIGITS = 10, 6
_LONG_NUMBER = re.compile(r"(?<![\w.])-?\d*\.\d{5,}(e[-+]?\d+)?(?![\w.])")
_UNITS = ((1e9, "s"), (1e6, "ms"), (1e3, "µs"), (1.0, "ns"))


def age(nanoseconds: int) -> str:
    """Return an age with a suitable unit: "1.5 ms"."""
    for size, unit in _UNITS:
        if abs(nanoseconds) >= size:
            return f"{nanoseconds / size:.3g} {unit}"
    return "0 ns"


def date(nanoseconds: int) -> str:
    """Return a time since 1970 in the local time zone: "2026-03-01 14:05:09"."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(nanoseconds / 1e9))


def date_ms(nanoseconds: int) -> str:
    """Likewise, with milliseconds: "2026-03-01 14:05:09.250"."""
    return f"{date(nanoseconds)}.{nanoseconds // 1_000_000 % 1000:03}"


def amount(unit: str) -> Callable[[str], float]:
    """Return a type for argparse: a number with an optional unit; the result is in `unit`."""

    def value(text: str) -> float:
        try:
            return parse(text, unit)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return value


def whole(text: str) -> int:
    """Parse a count, as a type for argparse."""
    try:
        number = int(text)
    except ValueError:
        number = -1
    if not 0 <= number < 2**32:
        raise argparse.ArgumentTypeError(f"{text}: use a whole number from 0 to {2**32 - 1}")
    return number


def microseconds(nanoseconds: float) -> str:
    """Return a duration in µs, without the unit; long durations have fewer decimals."""
    size = abs(nanoseconds)
    return f"{nanoseconds / 1e3:.{2 if size < 1e6 else 1 if size < 1e7 else 0}f}"


def counted(count: int, what: str) -> str:
    """Return "1 overrun", "2 overruns"."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def losses(log_records: int, published: int) -> list[str]:
    """Return one line for each kind of loss in a runner."""
    lines = []
    if log_records:
        lines.append(f"{counted(log_records, 'log record')} dropped (ring full)")
    if published:
        lines.append(f"up to {counted(published, 'published value')} lost: the ROS node was late")
    return lines


def value(found: graph_pb2.ParameterValue) -> str:
    """Return a parameter's value as it is written on the command line."""
    content: Any = plain(found)
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, float):
        return f"{content:.{_CHOSEN_DIGITS}g}"
    return "" if content is None else str(content)


def port_value(text: str) -> str:
    """Return a port's value with at most six digits; a message with the single field `data` is
    only the value of the field."""
    lines = text.split("\n")
    if len(lines) == 1:
        text = text.removeprefix("data: ")
    return _LONG_NUMBER.sub(lambda found: f"{float(found[0]):.{_MEASURED_DIGITS}g}", text)


def figure(number: float) -> str:
    """Return a measured or computed number with at most six digits."""
    return f"{number:.{_MEASURED_DIGITS}g}"


def yes(condition: bool, word: str = "yes") -> str:
    """Return a word if a condition is true, else an empty text."""
    return word if condition else ""
