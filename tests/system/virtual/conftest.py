"""rtcfd of this machine as installed: real time is required and available."""

from collections.abc import Iterator

import pytest
from local_machine import LocalMachine
from loop_2khz import Loop


@pytest.fixture
def settings() -> str:
    """Return the settings: no ROS master exists here; all others are the defaults."""
    return "[runner.ros]\nenabled = false\n"


@pytest.fixture
def loop(settings: str) -> Iterator[Loop]:
    """Yield the service with a loop running at 2 kHz."""
    loop = Loop(LocalMachine(), settings)
    loop.reset()
    loop.begin()
    yield loop
    loop.reset()
