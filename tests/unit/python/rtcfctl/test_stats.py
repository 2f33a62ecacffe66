"""The output of rtcfctl stats for statistics that are rare on a real system."""

import pytest
from rtcf.v1 import runner_pb2
from rtcfctl.loop import stats
from rtcfctl.terminal.output import Output


@pytest.mark.parametrize(
    ("uncounted", "said"),
    [(0, ""), (1, "1 cycle missing in the durations"), (7, "7 cycles missing in the durations")],
)
def test_cycles_that_were_not_counted_in_time_are_said(
    uncounted: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    found = runner_pb2.RunnerStatistics(runner="rt_runner", iterations=10, uncounted=uncounted)
    stats._print(found, Output("table"))
    printed = capsys.readouterr().out
    assert ("missing" in printed) == bool(uncounted)
    assert said in printed
    assert all(len(line) <= 100 for line in printed.splitlines())


@pytest.mark.parametrize(
    ("log_records", "published", "said"),
    [
        (0, 0, []),
        (1, 0, ["1 log record dropped (ring full)"]),
        (0, 2, ["up to 2 published values lost: the ROS node was late"]),
        (3, 1, ["3 log records dropped", "up to 1 published value lost"]),
    ],
)
def test_losses_are_said(
    log_records: int, published: int, said: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    found = runner_pb2.RunnerStatistics(
        runner="rt_runner", iterations=10, log_dropped=log_records, tap_dropped=published
    )
    stats._print(found, Output("table"))
    printed = capsys.readouterr().out
    assert all(line in printed for line in said)
    assert ("dropped" in printed, "lost" in printed) == (bool(log_records), bool(published))
