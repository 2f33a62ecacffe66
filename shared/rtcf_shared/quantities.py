"""The numeric settings of a runner, each with its range, unit and default.

rtcfd checks values with this table, rtcfctl and rt_runner use it for their help and limits, and a
test compares it with rtcfd.toml, the manual pages and the comments in runner.proto.
"""

import math
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """One setting; `low` and `high` are inclusive, in `unit`."""

    low: float
    high: float
    default: float
    unit: str = ""  # empty = none

    def range(self) -> str:
        """Return the range as text: "0.1 to 20000 Hz"."""
        return f"{_figure(self.low)} to {_figure(self.high)}{self.unit and f' {self.unit}'}"

    def holds(self, value: float) -> bool:
        """Return whether a value is in the range; NaN is in none."""
        return math.isfinite(value) and self.low <= value <= self.high


_COUNT = 2**31 - 1  # XML-RPC has no larger integers

# Named as in RunnerSettings.
RUNNER = {
    "frequency_hz": Quantity(0.1, 50000.0, 1000.0, "Hz"),
    "priority": Quantity(1, 98, 80),  # 99 is for the kernel's watchdog and migration threads
    "spin_us": Quantity(0, 1_000_000, 0, "µs"),  # also at most half a period
    "max_overruns": Quantity(0, _COUNT, 0),
    "warmup_cycles": Quantity(0, _COUNT, 10),
    "stall_timeout_ms": Quantity(0, 3_600_000, 2000, "ms"),
    "hook_timeout_s": Quantity(0.1, 3600.0, 10.0, "s"),
    "orphan_timeout_s": Quantity(0.0, 86400.0, 60.0, "s"),
    "max_clock_jump_s": Quantity(0.0, 86400.0, 10.0, "s"),
    "log_limit": Quantity(0, 1_000_000, 100),  # records per source line and second; 0 = unlimited
    "heap_kb": Quantity(0, 1024 * 1024, 8192, "KiB"),
    "stack_kb": Quantity(16, 64 * 1024, 256, "KiB"),
    "frame_kb": Quantity(0, 1024, 64, "KiB"),  # 0 = only watched values
}
# Named as in RosSettings.
ROS = {
    "queue": Quantity(1, 1_000_000, 1000),
    "decimation": Quantity(1, 1_000_000, 1),
    "largest_message_kb": Quantity(1, 65536, 256, "KiB"),
}

# By dimension: the size of each unit.
_UNITS = (
    {"ns": 1e-9, "us": 1e-6, "µs": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0},
    {"Hz": 1.0, "kHz": 1e3},
    {
        "KiB": 1.0,
        "kB": 1.0,
        "MiB": 1024.0,
        "MB": 1024.0,
        "GiB": 1024.0 * 1024.0,
        "GB": 1024.0 * 1024.0,
    },
)
_TEXT = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf))\s*([A-Za-zµ]*)\s*"
)


def parse(text: str, unit: str) -> float:
    """Return the value of a text, with or without a unit, in `unit`.

    If `unit` is µs, "30us", "0.03 ms" and "30" have the same value.  Raises ValueError.
    """
    found = _TEXT.fullmatch(text)
    known: dict[str, float] = next((units for units in _UNITS if unit in units), {})
    if found and not found[2]:
        return float(found[1])
    if not found or found[2] not in known:
        allowed = f" with one of {', '.join(known)}" if known else ""
        raise ValueError(f"{text}: give a number{allowed}")
    value = float(found[1]) * known[found[2]] / known[unit]
    if not math.isfinite(value):
        return value  # the caller's range check fails
    # 30us is 30 µs, not 29.999999999999996.
    return round(value) if math.isclose(value, round(value), rel_tol=1e-12) else value


def _figure(value: float) -> str:
    return f"{value:g}" if value < 1e5 or value != int(value) else str(int(value))
