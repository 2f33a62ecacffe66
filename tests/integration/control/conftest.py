"""Fixture: a stepped loop for components of rtcf_control."""

from collections.abc import Iterator

import pytest
from block_bench import PATH
from rtcf.testing import Bench


@pytest.fixture(scope="module")
def stepped() -> Iterator[Bench]:
    """Yield a bench for `Stepped`, shared by the tests of a module."""
    with Bench("rtcf_examples/Identity", path=PATH) as bench:
        yield bench
