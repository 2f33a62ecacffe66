"""From when on figures count, and when a loop is said to be late."""

import pytest
from rtcf.v1 import runner_pb2
from rtcfd.operations.figures import Figures


def status(iteration: int, overruns: int, missed: int = 0) -> runner_pb2.RunnerStatus:
    return runner_pb2.RunnerStatus(
        state=runner_pb2.RUNNER_STATE_RUNNING,
        iteration=iteration, overruns=overruns, missed=missed,
    )  # fmt: skip


def shown(counts: Figures, found: runner_pb2.RunnerStatus) -> tuple[int, int, str]:
    counts.put_into(found)
    return found.overruns, found.missed, found.late


def test_status_counts_from_where_statistics_do() -> None:
    counts = Figures()
    counts.begin(status(0, 7, 9), runner_pb2.RunnerStatistics(overruns=0, missed=0))
    assert shown(counts, status(100, 8, 12))[:2] == (1, 3)
    # Of an executor that is adopted, its statistics tell.
    counts.begin(status(100, 8, 12), runner_pb2.RunnerStatistics(overruns=3, missed=5))
    assert shown(counts, status(200, 9, 12))[:2] == (4, 5)


def test_a_loop_that_keeps_being_late_is_late_and_one_late_cycle_is_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [100.0]
    monkeypatch.setattr("rtcfd.operations.figures.time.monotonic", lambda: clock[0])
    counts = Figures()
    said = "400 cycles ended late in 10 s, most of them in /slow"
    counts.told_of_late_cycles(status(1000, 1), "1 cycle ended late")
    assert shown(counts, status(1000, 1))[2] == ""
    clock[0] += 10
    counts.told_of_late_cycles(status(2000, 401), said)
    assert shown(counts, status(2100, 420))[2] == f"40% of its cycles: {said}"
    stopped = status(2100, 420)
    stopped.state = runner_pb2.RUNNER_STATE_STOPPED
    assert shown(counts, stopped)[2] == ""
    # Now and then one is not permanently.
    clock[0] += 10
    counts.told_of_late_cycles(status(12000, 402), "1 cycle ended late")
    assert shown(counts, status(12000, 402))[2] == ""
    # It is in time again.
    counts.told_of_late_cycles(status(13000, 902), said)
    clock[0] += 20
    assert shown(counts, status(20000, 902))[2] == ""
