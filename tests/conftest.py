"""Property tests: no time limits, one budget, and no repetition of a test with a counterexample.
Signals: programs that tests start end by Ctrl-C, also where pytest ignores it.

A counterexample is kept in build/hypothesis/; the next run tries it first. Its test is also listed
in build/test/counterexamples: tests/run does not repeat it, since other draws may pass.

The times of all tests are in build/test/times.tsv.
"""

import gc
import os
import signal
from pathlib import Path
from types import FrameType

import any_processor  # noqa: F401, before NumPy is imported
import forking  # noqa: F401, before gRPC is imported elsewhere: tests compile in child processes
import pytest
from failures_at_once import FailuresAtOnce
from hypothesis import HealthCheck, errors, settings
from hypothesis.database import DirectoryBasedExampleDatabase
from random_share import RandomShares
from time_table import TimeTable

_BUILD = Path(__file__).resolve().parents[1] / "build"
_NOTED = _BUILD / "test" / "counterexamples"

# The speed of this machine is no property of the code under test.
settings.register_profile(
    "any pace",
    deadline=None,
    database=DirectoryBasedExampleDatabase(str(_BUILD / "hypothesis")),
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("any pace")

# Processor time of all property tests of a run.
_RANDOM_S = float(os.environ.get("RTCF_RANDOM_S", "60"))


def pytest_configure(config: pytest.Config) -> None:
    # A process in the background or under nohup ignores these, and so do the programs it starts. A
    # handler is not passed to them.
    for number in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, _ignore)
    # As in rtcf-compile, which many tests run in this process.
    gc.set_threshold(100_000, 20, 20)
    config.pluginmanager.register(RandomShares(_RANDOM_S))
    is_worker = hasattr(config, "workerinput")
    if not is_worker:
        config.pluginmanager.register(FailuresAtOnce(config))
    # Not in the process that starts those of pytest-xdist.
    if is_worker or not config.getoption("numprocesses", None):
        config.pluginmanager.register(TimeTable(_BUILD / "test" / "times.tsv"))


def _ignore(number: int, frame: FrameType | None) -> None:
    """Ignore a signal in this process only."""


def pytest_exception_interact(
    node: pytest.Item, call: pytest.CallInfo[None], report: pytest.TestReport
) -> None:
    """Record a property test that has found a counterexample."""
    # Hypothesis repeats a failure; Flaky means that the repetition passed.
    by_chance = (errors.Flaky, errors.FailedHealthCheck)
    if report.when != "call" or call.excinfo is None or isinstance(call.excinfo.value, by_chance):
        return
    if node.get_closest_marker("hypothesis"):
        _NOTED.parent.mkdir(parents=True, exist_ok=True)
        with _NOTED.open("a") as noted:
            noted.write(f"{node.nodeid}\n")
