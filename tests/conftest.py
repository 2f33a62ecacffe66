"""Property tests: one pace for all, and no second chance for what a counterexample shows.

A counterexample is kept in build/hypothesis/, from which the next run tries it first.  It is also
noted in build/test/counterexamples: tests/run does not repeat such a test, as other draws may pass.
"""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, errors, settings
from hypothesis.database import DirectoryBasedExampleDatabase

_BUILD = Path(__file__).resolve().parents[1] / "build"
_NOTED = _BUILD / "test" / "counterexamples"

# How fast this machine draws and tries is no property of the code under test.
settings.register_profile(
    "any pace",
    deadline=None,
    database=DirectoryBasedExampleDatabase(str(_BUILD / "hypothesis")),  # type: ignore[no-untyped-call]
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("any pace")


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, Any, None]:
    """Note a property test that has found a counterexample."""
    report: pytest.TestReport = (yield).get_result()
    if report.when != "call" or not report.failed or call.excinfo is None:
        return
    # Hypothesis repeats a failure; Flaky says that it did not come back.
    by_chance = (errors.Flaky, errors.FailedHealthCheck)
    if item.get_closest_marker("hypothesis") and not isinstance(call.excinfo.value, by_chance):
        _NOTED.parent.mkdir(parents=True, exist_ok=True)
        with _NOTED.open("a") as noted:
            noted.write(f"{item.nodeid}\n")
