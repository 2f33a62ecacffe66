"""A pytest plugin with the fixture `bench`.

Enable it by `pytest_plugins = ["rtcf.testing.plugin"]` in conftest.py.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from rtcf.testing.bench import Bench


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    """Create benches, by a function with the arguments of Bench; they end with the test."""
    with ExitStack() as open_benches:

        def make(what: str, **arguments: Any) -> Bench:
            return open_benches.enter_context(Bench(what, **arguments))

        yield make
