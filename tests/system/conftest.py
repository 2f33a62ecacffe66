"""The tests of installed packages. They run as root, where tests/system/run put them."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from installed import Daemon


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Refuse to change the machine itself."""
    if os.environ.get("RTCF_SYSTEM_TEST") != "inside":
        raise pytest.UsageError("these tests install packages: run them by tests/system/run")


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    """Give an rtcfd of this test's own."""
    daemon = Daemon(tmp_path)
    daemon.wait_until_it_serves()
    yield daemon
    assert daemon.end() == 0
