"""Streams of minima and maxima: they contain the extremes of every cycle, at any rate."""

import json
import re
from collections.abc import Iterator
from typing import Any

import hypothesis
import numpy as np
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon
from hypothesis import strategies as st
from numpy.typing import NDArray
from rtcf_shared.ports import PortBatch

_WINDOWS, _EVERY = 100, 1000
_CYCLES = _WINDOWS * _EVERY


def noise(cycles: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
    """Return the values that the component Noise writes in cycles."""
    with np.errstate(over="ignore"):
        mixed = cycles.astype(np.uint64) + np.uint64(0x9E3779B97F4A7C15)
        mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        mixed ^= mixed >> np.uint64(31)
    out = (mixed >> np.uint64(11)) * 2.0**-52 - 1.0
    return {
        "/noise.out": out,
        "/noise.gaps": np.where(mixed % np.uint64(500) == 0, np.nan, out),
        "/noise.steps": (mixed % np.uint64(5)).astype(np.int32),
    }


def extremes(values: NDArray[Any]) -> tuple[float, int, float, int]:
    """Return the minimum, its index, the maximum and its index; NaN is above all numbers."""
    ranks = np.where(np.isnan(values), np.inf, values)
    least, most = int(np.argmin(ranks)), int(np.argmax(ranks))
    return float(values[least]), least, float(values[most]), most


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[rtcf.Client]:
    """Yield a client of a daemon with a component of noise."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"), NO_ROS)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Noise", name="noise"))
        yield client
    daemon.end()


@hypothesis.settings(
    max_examples=30, deadline=None, suppress_health_check=list(hypothesis.HealthCheck)
)
@hypothesis.given(
    every=st.integers(2, 700),
    before=st.integers(0, 1500),
    steps=st.lists(st.integers(1, 900), min_size=1, max_size=3),
)
def test_extremes_are_in_the_cycles_named_by_their_window(
    shared: rtcf.Client, every: int, before: int, steps: list[int]
) -> None:
    shared.stop()
    if before:
        shared.step(before)
    with shared.watch_ports(["noise"], every=every, min_max=True) as stream:
        for count in steps:
            shared.step(count)
        shared.stop()  # ends the last window with a safe cycle, which writes nothing
        windows: list[PortBatch] = []
        for batch in stream:
            windows.append(batch)
            if batch.last_of_loop:
                break
    end = before + sum(steps)
    next_cycle = before
    for batch in windows:
        assert batch.lost == 0
        for index in range(len(batch)):
            first, last = int(batch.window_begins[index]), int(batch.window_ends[index])
            assert first == next_cycle
            assert last == min(int(batch.cycles[index]) + every - 1, end)
            assert batch.message.counts[index] == last - first + 1
            for name, values in noise(np.minimum(np.arange(first, last + 1), end - 1)).items():
                least, least_at, most, most_at = extremes(values)
                found = [
                    method(name)[index]
                    for method in (batch.minima, batch.minima_at, batch.maxima, batch.maxima_at)
                ]
                np.testing.assert_array_equal(
                    found, [least, first + least_at, most, first + most_at], name
                )
            next_cycle = last + 1
    assert next_cycle == end + 1


def test_a_glitch_of_one_cycle_is_reported_with_its_cycle(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Glitch", name="glitch"))
    client.load(rtcf.component("rtcf_test", "Gather", name="other", remaps=["out:=/o"]))
    with (
        client.watch_ports(["glitch"], every=_EVERY, min_max=True) as few,
        client.watch_ports(["glitch"]) as all_cycles,
    ):
        client.step(_CYCLES)
        whole: list[PortBatch] = []
        for batch in all_cycles:
            whole.append(batch)
            if sum(len(each) for each in whole) >= _CYCLES:
                break
        windows: list[PortBatch] = []
        for batch in few:
            windows.append(batch)
            if sum(len(each) for each in windows) >= _WINDOWS:
                break
    assert not any(batch.lost for batch in (*whole, *windows))
    assert all(set(batch.message.counts) == {_EVERY} for batch in windows)
    first = np.concatenate([batch.cycles for batch in windows])
    assert (first == np.arange(0, _CYCLES, _EVERY)).all()
    names = {"/glitch.out", "/glitch.three.x", "/glitch.three.y", "/glitch.three.z",
             "/glitch.state"}  # fmt: skip
    assert set(few.schema.signals) == names
    for name in names:
        told = np.concatenate([batch[name] for batch in whole]).reshape(_WINDOWS, _EVERY)
        for method, expected in (
            ("minima", told.min(axis=1)),
            ("maxima", told.max(axis=1)),
            ("minima_at", told.argmin(axis=1) + first),
            ("maxima_at", told.argmax(axis=1) + first),
        ):
            found = np.concatenate([getattr(batch, method)(name) for batch in windows])
            assert (found == expected).all(), (name, method)
    # A glitch in each window, in a different cycle.
    glitches = np.concatenate([batch.maxima("/glitch.out") for batch in windows])
    places = np.concatenate([batch.maxima_at("/glitch.out") for batch in windows])
    assert (glitches == 1000.0).all()
    assert len(set((places % _EVERY).tolist())) > _WINDOWS // 2


def test_text_output_shows_the_extremes(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Glitch", name="glitch"))
    client.start()
    done = daemon.ctl("echo", "glitch.out", "--min-max", "--rate", "1Hz", "-n", "2")
    assert done.returncode == 0, done.stderr
    # The stream starts at a random position within a window.
    lines = done.stdout.splitlines()[2:]
    assert lines[0].startswith("cycles ")
    assert lines[1].startswith("  /glitch.out: 0 to 1000 (cycle ")


def test_nan_is_named_beside_the_minimum(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Noise", name="noise"))
    client.start()
    done = daemon.ctl("echo", "noise.gaps", "--min-max", "--rate", "3Hz", "-n", "6")
    assert done.returncode == 0, done.stderr
    found = re.findall(r"cycles (\d+) to (\d+)\n  /noise.gaps: (.*) \(cycle ", done.stdout)
    assert len(found) == 6
    for first, last, said in found:
        values = noise(np.arange(int(first), int(last) + 1))["/noise.gaps"]
        if np.isnan(values).any():
            assert said == f"{np.nanmin(values):.6g} or more, and nan"
        else:
            assert said == f"{values.min():.6g} to {values.max():.6g}"


def test_json_lines_name_the_cycles_of_the_extremes(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Noise", name="noise"))
    client.start()
    # The stream starts at a random position within a window.
    for _ in range(3):
        done = daemon.ctl("echo", "noise.out", "--min-max", "--rate", "3Hz", "-n", "2")
        assert done.returncode == 0, done.stderr
        found = re.findall(
            r"cycles (\d+) to (\d+)\n  /noise.out: (\S+) to (\S+) \(cycle (\d+), (\d+)\)",
            done.stdout,
        )
        assert len(found) == 2
        for first, last, least, most, *places in found:
            values = noise(np.arange(int(first), int(last) + 1))["/noise.out"]
            model = extremes(values)
            assert [int(each) - int(first) for each in places] == [model[1], model[3]]
            assert (float(least), float(most)) == pytest.approx((model[0], model[2]), rel=1e-5)
    done = daemon.ctl("echo", "noise", "--min-max", "--rate", "3Hz", "-n", "1", "-o", "json")
    told = json.loads(done.stdout)
    assert told["cycles"] == told["last_cycle"] - told["cycle"] + 1
    for each in told["values"].values():
        assert told["cycle"] <= each["min_cycle"] <= told["last_cycle"]
        assert told["cycle"] <= each["max_cycle"] <= told["last_cycle"]
