"""A pytest plugin that adds the time of each test to a table: processor time of the test and of the
processes that it has waited for, elapsed time, and the time in which it waited, in seconds.

Fixtures that several tests share count for the test that creates or ends them.
"""

import os
import time
from pathlib import Path

_of_others_s = 0.0


def count(processor_s: float) -> None:
    """Count the processor time of a process that is no child of this one for the running test."""
    global _of_others_s
    _of_others_s += processor_s


class TimeTable:
    """Writes a line per test; several processes may write the same file."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._begin = (0.0, 0.0)

    def pytest_runtest_logstart(self) -> None:
        self._begin = _processor_s(), time.monotonic()

    def pytest_runtest_logfinish(self, nodeid: str) -> None:
        processor = _processor_s() - self._begin[0]
        elapsed = time.monotonic() - self._begin[1]
        line = f"{processor:.2f}\t{elapsed:.2f}\t{max(elapsed - processor, 0.0):.2f}\t{nodeid}\n"
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as table:
            table.write(line)


def _processor_s() -> float:
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system + _of_others_s
