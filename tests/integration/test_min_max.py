"""Streams of minima and maxima: no value of a cycle is hidden, whatever the rate."""

import numpy as np
import rtcf
from daemon_process import Daemon
from rtcf.streams.ports import PortBatch

_WINDOWS, _EVERY = 100, 1000
_CYCLES = _WINDOWS * _EVERY


def test_a_glitch_of_one_cycle_is_told_with_its_cycle(client: rtcf.Client) -> None:
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
    # A glitch in each window, at a cycle of its own.
    glitches = np.concatenate([batch.maxima("/glitch.out") for batch in windows])
    places = np.concatenate([batch.maxima_at("/glitch.out") for batch in windows])
    assert (glitches == 1000.0).all()
    assert len(set((places % _EVERY).tolist())) > _WINDOWS // 2


def test_people_see_the_extremes(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Glitch", name="glitch"))
    client.start()
    done = daemon.ctl("echo", "glitch.out", "--min-max", "--rate", "1Hz", "-n", "1")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("cycles ")
    assert lines[1].startswith("  /glitch.out: 0 to 1000 (cycle ")
