"""A pytest plugin that prints each failure at once: a run that is ended prints no summary."""

import pytest

_LINES = 8


class FailuresAtOnce:
    """Prints the name of a test that fails, and the last lines of its traceback."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if not report.failed:
            return
        terminal = self._config.pluginmanager.get_plugin("terminalreporter")
        terminal.write_line("")
        terminal.write_line(f"{report.nodeid}: failed in {report.when}")
        for line in report.longreprtext.splitlines()[-_LINES:]:
            terminal.write_line(f"    {line}")
