"""rtcfd of this machine as it was installed: real time is required, and given."""

from collections.abc import Iterator

import pytest
from local_machine import LocalMachine
from loop_2khz import Loop

# Without a master, as there is none; all else is as shipped.
_SETTINGS = "[runner.ros]\nenabled = false\n"


@pytest.fixture
def loop() -> Iterator[Loop]:
    """Give the service with a loop that runs at 2 kHz."""
    loop = Loop(LocalMachine(), _SETTINGS)
    loop.reset()
    loop.begin()
    yield loop
    loop.reset()
