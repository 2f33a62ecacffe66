"""Intervals between repetitions of a message."""

import pytest
from rtcfd.common.growing_interval import GrowingInterval


def test_intervals_grow_to_the_longest_and_restart_after_a_pause(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [100.0]
    monkeypatch.setattr("rtcfd.common.growing_interval.time.monotonic", lambda: clock[0])
    interval = GrowingInterval(10.0, 40.0)
    said = []
    for _ in range(31):
        if (left_out := interval.due()) is not None:
            said.append((clock[0] - 100.0, left_out))
        clock[0] += 10.0
    assert said == [(0, 0), (10, 0), (30, 1), (70, 3), (110, 3), (150, 3), (190, 3), (230, 3),
                    (270, 3)]  # fmt: skip
    clock[0] += 30.0
    assert interval.due() == 0, "the interval restarts after a pause"
    clock[0] += 10.0
    assert interval.due() == 0
    clock[0] += 10.0
    assert interval.due() is None
