"""Executors that do not answer a starting rtcfd, which keeps looking for them."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
from rtcf.v1 import errors_pb2, runner_pb2
from rtcfd.common.errors import Silent
from rtcfd.executor.executor import Executor
from rtcfd.runners import runners
from rtcfd.state.desired import Desired, RunnerLeaseTerms
from rtcfd_in_process import Rtcfd, until


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Simulate executors that do not answer twice and are gone at the third attempt; return the
    list of attempts."""
    looks: list[str] = []

    async def adopt(runner: str, *_: Any) -> None:
        looks.append(runner)
        if len(looks) < 3:
            raise Silent("it does not answer", errors_pb2.REASON_EXECUTOR_SILENT)

    monkeypatch.setattr(Executor, "adopt", adopt)
    monkeypatch.setattr(runners, "_LOOK_AGAIN_S", 0.01)
    return looks


def test_a_launchs_runner_is_removed_when_its_silent_executor_dies(
    rtcfd: Callable[[], Rtcfd], looks: list[str]
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        desired = Desired("arm")
        desired.hold = RunnerLeaseTerms(
            "token", "a launch", runner_pb2.RunnerSettings(), added=True
        )
        daemon.runners.adopt([desired])
        await daemon.runners.bring_up()
        assert [runner.name for runner in daemon.runners.all()] == ["arm"]
        await until(lambda: not daemon.runners.all(), "its removal")
        assert looks == ["arm"] * 3
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_the_silent_executor_of_an_unknown_runner_is_retried_until_it_dies(
    rtcfd: Callable[[], Rtcfd], looks: list[str]
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.runners.bring_up(["stranger"])
        assert [runner.name for runner in daemon.runners.all()] == ["stranger"]
        await until(lambda: not daemon.runners.all(), "its end")
        assert looks == ["stranger"] * 3
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
