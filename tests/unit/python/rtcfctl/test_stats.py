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
