"""rtcfd of this machine as installed: real time is required and available."""

from collections.abc import Iterator

import pytest
from local_machine import LocalMachine
from loop_2khz import Loop

# No ROS master exists here; all other settings are the defaults.
_SETTINGS = "[runner.ros]\nenabled = false\n"


@pytest.fixture
def loop() -> Iterator[Loop]:
    """Yield the service with a loop running at 2 kHz."""
    loop = Loop(LocalMachine(), _SETTINGS)
    loop.reset()
    loop.begin()
    yield loop
    loop.reset()
