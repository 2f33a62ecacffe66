"""A pytest plugin: `pytest_plugins = ["rtcf.testing.plugin"]` in conftest.py."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from rtcf.testing.bench import Bench


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    """Make benches, with the arguments of rtcf.testing.Bench, that end with the test."""
    with ExitStack() as open_benches:

        def make(what: str, **arguments: Any) -> Bench:
            return open_benches.enter_context(Bench(what, **arguments))

        yield make
