"""Saves of a Python component while its loop runs at 2 kHz: no cycle is missed, state stays."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rtcf
from loop_2khz import FREQUENCY_HZ, Loop
from machine import wait_for

SAVES = 20
DEADLINE_S = 600.0  # of emulated time
SOURCE = """\
import numpy as np
from rtcf.component import Component, Output, Parameter, State


class Follower(Component):
    y: Output[float]
    kp: Parameter[float] = Parameter(1.0)
    count: State[int]
    x: State[np.float64, 4]

    def update(self):
        self.count += 1
        self.x[:] = 0.9 * np.roll(self.x, 1) + {gain}
        self.y.write(self.kp * (self.x @ self.x))
"""
CACHE = Path("/srv/cache")


@pytest.fixture
def settings(settings: str) -> str:
    """Add the folder of compiled libraries: the system's rtcfd searches no user's cache."""
    (CACHE / "rtcf-components").mkdir(parents=True, exist_ok=True)
    return f'[daemon]\npath = ["{CACHE}/rtcf-components"]\n{settings}'


@contextmanager
def watching(source: Path, said: Path) -> Iterator[None]:
    """Load a source and its later versions until the end of the block."""
    with said.open("wb") as output:
        process = subprocess.Popen(
            ["rtcfctl", "load", str(source), "Follower", "--watch"],
            stdout=output,
            stderr=subprocess.STDOUT,
            env={**os.environ, "XDG_CACHE_HOME": str(CACHE)},
        )
    try:
        yield
    finally:
        process.terminate()
        process.wait(60)


def save(source: Path, gain: float) -> None:
    """Replace the file atomically."""
    part = source.with_suffix(".part")
    part.write_text(SOURCE.format(gain=gain))
    part.replace(source)


def wait_until_said(said: Path, text: str, times: int = 1) -> None:
    """Wait until the output contains a text; fail with the output."""
    try:
        wait_for(lambda: said.read_text().count(text) >= times, text, DEADLINE_S)
    except AssertionError as error:
        raise AssertionError(f"{error}: {said.read_text()}") from None


def cycles_without(client: rtcf.Client, loop: Loop) -> float:
    """Return the number of cycles that the component's state has not counted.

    The time between the two queries counts, too.
    """
    (state,) = (s for s in client.get_component("Follower").states if s.name == "count")
    return loop.now().iteration - int(state.value)


def test_saves_of_a_python_component(loop: Loop, tmp_path: Path) -> None:
    source, said = tmp_path / "follower.py", tmp_path / "said"
    save(source, 0.0)
    before = loop.now()
    with watching(source, said), rtcf.Client() as client:
        wait_until_said(said, "loaded /Follower")
        client.set_parameters("Follower", [rtcf.parse_parameter("kp:=3.0")])
        without = cycles_without(client, loop)
        for number in range(1, SAVES + 1):
            save(source, number / 8)
            wait_until_said(said, "reloaded /Follower", number)
            # A component that has lost its state counts from 0.
            assert cycles_without(client, loop) < without + 5 * FREQUENCY_HZ
        assert said.read_text().count("; kept kp 3") == SAVES
    loop.must_have_gone_on(before)
