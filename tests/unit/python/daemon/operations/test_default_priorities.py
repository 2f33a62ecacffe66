"""Default priorities: derived from the frequency, so that the faster of two loops runs first."""

import asyncio
import itertools
from typing import Any

import pytest
from rtcf.v1 import runner_pb2
from rtcf_shared.quantities import RUNNER
from rtcfctl.loop.status import shared_cpus
from rtcfd.common import runner_settings
from rtcfd.runners.status import note_shared_cpus, statuses_of
from rtcfd.state.desired import Desired

DEFAULTS = runner_settings.defaults(runner_pb2.REALTIME_PREFERRED)
LOW, HIGH = int(RUNNER["priority"].low), int(RUNNER["priority"].high)


def priority(**chosen: Any) -> int:
    desired = Desired("arm")
    desired.choose(runner_pb2.RunnerSettings(**chosen))
    return int(desired.complete(DEFAULTS).priority)


@pytest.mark.parametrize(
    ("frequency_hz", "expected"),
    [(1000, 80), (2000, 82), (500, 78), (1400, 81), (0.1, 53), (50000, 91)],
)
def test_the_default_follows_the_frequency(frequency_hz: float, expected: int) -> None:
    assert priority(frequency_hz=frequency_hz) == expected


def test_a_faster_loop_never_has_a_lower_priority() -> None:
    found = [priority(frequency_hz=0.1 * 1.2**step) for step in range(72)]
    assert all(slower <= faster for slower, faster in itertools.pairwise(found))
    assert all(found[step] < found[step + 4] for step in range(68)), "a frequency twice as high"
    assert LOW <= found[0] <= found[-1] <= HIGH


def test_a_given_priority_wins() -> None:
    assert priority(frequency_hz=50.0, priority=80) == 80
    file = runner_settings.merged(DEFAULTS, runner_pb2.RunnerSettings(priority=33))
    desired = Desired("arm")
    desired.choose(runner_pb2.RunnerSettings(frequency_hz=8000.0))
    assert desired.complete(file).priority == 33


def test_only_a_change_of_the_frequency_changes_the_priority() -> None:
    desired = Desired("arm")
    faster = runner_pb2.RunnerSettings(frequency_hz=4000.0)
    assert desired.effect(faster, DEFAULTS) == runner_pb2.RunnerSettings(
        frequency_hz=4000.0, priority=84
    )
    assert faster == runner_pb2.RunnerSettings(frequency_hz=4000.0), "the saved settings"
    spin = runner_pb2.RunnerSettings(spin_us=3)
    assert desired.effect(spin, DEFAULTS) == spin
    desired.choose(runner_pb2.RunnerSettings(priority=20))
    assert desired.effect(faster, DEFAULTS) == faster


def status(name: str, cpu: int | None, priority: int) -> runner_pb2.RunnerStatus:
    found = runner_pb2.RunnerStatus(runner=name)
    found.settings.priority = priority
    if cpu is not None:
        found.loop_cpu = cpu
    return found


def test_loops_that_share_a_cpu_are_named() -> None:
    statuses = [
        status("arm", 3, 80),
        status("leg", 3, 82),
        status("alone", 2, 80),
        status("stopped", None, 80),
        status("left", 1, 80),
        status("right", 1, 80),
        status("slow", 1, 60),
    ]
    note_shared_cpus(statuses)
    assert [(each.runner, each.priority) for each in statuses[0].shares_cpu_with] == [("leg", 82)]
    assert not statuses[2].shares_cpu_with
    assert not statuses[3].shares_cpu_with
    one, two = shared_cpus(statuses)
    assert one == (
        "CPU 1 has several loops, left (priority 80), right (priority 80), slow (priority 60): "
        "loops of equal priority delay each other; "
        "use `rtcfctl runner set NAME --cpu N` or `--priority N`"
    )
    assert two == (
        "CPU 3 has several loops, leg (priority 82), arm (priority 80): "
        "each loop runs before the loops after it"
    )
    # The others are known even if only one is queried.
    assert shared_cpus([statuses[0]]) == [two]


class Told:
    """A runner with a given status, or one that is stuck."""

    def __init__(self, name: str, found: runner_pb2.RunnerStatus | None) -> None:
        self.name = name
        self._found = found

    async def status(self) -> runner_pb2.RunnerStatus:
        if self._found is None:
            await asyncio.get_running_loop().create_future()
        assert self._found is not None
        return self._found


def test_a_stuck_runner_delays_no_other_status() -> None:
    arm, leg = Told("arm", status("arm", 3, 80)), Told("leg", status("leg", 3, 82))
    stuck = Told("stuck", None)

    async def ask() -> list[runner_pb2.RunnerStatus]:
        return await statuses_of([arm], [arm, leg, stuck])

    (found,) = asyncio.run(ask())
    assert found.runner == "arm"
    assert [each.runner for each in found.shares_cpu_with] == ["leg"]
