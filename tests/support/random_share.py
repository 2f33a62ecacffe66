"""A pytest plugin that gives all random tests of a run one budget of processor time.

Random tests are the property tests of hypothesis. Each gets a share of the budget, in proportion to
its weight: 1, or that of `@pytest.mark.random(weight)`. A test that has used up its share tries no
more examples; it tries at least one. The summary of the run states for each test how many it tried.
Tests marked `long` have no limit.
"""

import functools
import os
import time
from collections.abc import Callable
from typing import Any

import pytest

# A share is no larger than this for each unit of weight, also if few tests run.
_MOST_S = 5.0


class RandomShares:
    """Limits the examples of each property test."""

    def __init__(self, budget_s: float) -> None:
        self._budget_s = budget_s
        self._unit_s = _MOST_S

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        total = sum(_weight(item) for item in session.items if _is_random(item))
        self._unit_s = min(_MOST_S, self._budget_s / max(total, 1.0))

    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        if not _is_random(item):
            return
        share = _Share(_weight(item) * self._unit_s)
        handle = item.obj.hypothesis  # type: ignore[attr-defined]
        # Tests with several sets of parameters are one function.
        test = getattr(handle.inner_test, "unlimited", handle.inner_test)
        handle.inner_test = share.limit(test)
        item.stash[_SHARE] = share

    def pytest_runtest_teardown(self, item: pytest.Item) -> None:
        if (share := item.stash.get(_SHARE, None)) is not None:
            # Also reported by processes of pytest-xdist.
            item.user_properties.append(("random", share.text()))

    def pytest_terminal_summary(self, terminalreporter: Any) -> None:
        lines = [
            f"{report.nodeid}: {text}"
            for reports in terminalreporter.stats.values()
            for report in reports
            if isinstance(report, pytest.TestReport) and report.when == "teardown"
            for name, text in report.user_properties
            if name == "random"
        ]
        if lines:
            terminalreporter.section("random tests")
            for line in sorted(lines):
                terminalreporter.line(line)


_SHARE = pytest.StashKey["_Share"]()


class _Share:
    """The processor time of one test."""

    def __init__(self, share_s: float) -> None:
        self._share_s = share_s
        self._begin = _now()
        self._tried = 0
        self._left_out = 0

    def limit(self, test: Callable[..., Any]) -> Callable[..., Any]:
        """Return the test, which does nothing once the share is used up."""

        @functools.wraps(test)
        def limited(*arguments: Any, **named: Any) -> Any:
            if self._tried and self._used_s() > self._share_s:
                self._left_out += 1
                return None
            self._tried += 1
            return test(*arguments, **named)

        limited.unlimited = test  # type: ignore[attr-defined]
        return limited

    def _used_s(self) -> float:
        """Return the processor time, or half of the elapsed time if that is more: the time of a
        daemon that the test talks to is known only once it has ended.
        """
        processor, time_s = (now - begin for now, begin in zip(_now(), self._begin, strict=True))
        return max(processor, time_s / 2)

    def text(self) -> str:
        left_out = f", {self._left_out} left out" if self._left_out else ""
        return f"{self._tried} examples{left_out} in {self._used_s():.1f} of {self._share_s:.1f} s"


def _is_random(item: pytest.Item) -> bool:
    return (
        item.get_closest_marker("hypothesis") is not None
        and item.get_closest_marker("long") is None
    )


def _weight(item: pytest.Item) -> float:
    marker = item.get_closest_marker("random")
    return float(marker.args[0]) if marker else 1.0


def _now() -> tuple[float, float]:
    """Return the processor time of this process and of its ended children, and the time, in s."""
    now = os.times()
    return now.user + now.system + now.children_user + now.children_system, time.monotonic()
