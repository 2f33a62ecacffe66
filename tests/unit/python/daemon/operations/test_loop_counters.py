"""The start of statistics, and the alarm for late loops."""

import asyncio
from collections.abc import Callable

import pytest
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import runner_pb2
from rtcfd.executor.link import STATISTICS_PROTOCOL
from rtcfd.operations.loop_counters import LoopCounters
from rtcfd_in_process import Rtcfd, SlowPeer, control_pb2


def status(iteration: int, overruns: int, missed: int = 0) -> runner_pb2.RunnerStatus:
    return runner_pb2.RunnerStatus(
        state=runner_pb2.RUNNER_STATE_RUNNING,
        iteration=iteration, overruns=overruns, missed=missed,
    )  # fmt: skip


def shown(counts: LoopCounters, found: runner_pb2.RunnerStatus) -> tuple[int, int, str]:
    counts.put_into(found)
    return found.overruns, found.missed, found.late


def test_status_and_statistics_of_an_older_executor_have_the_same_start() -> None:
    counts = LoopCounters()
    counts.leave_out(status(0, 7, 9), runner_pb2.RunnerStatistics(overruns=0, missed=0))
    assert shown(counts, status(100, 8, 12))[:2] == (1, 3)
    # For an adopted executor, its statistics determine the start.
    counts.leave_out(status(100, 8, 12), runner_pb2.RunnerStatistics(overruns=3, missed=5))
    assert shown(counts, status(200, 9, 12))[:2] == (4, 5)


@pytest.mark.parametrize("protocol", [STATISTICS_PROTOCOL - 1, STATISTICS_PROTOCOL])
def test_a_reset_is_one_request_if_the_executor_supports_it(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch, protocol: int
) -> None:
    """Cycles end late between any two requests; the counts that an older executor's status has
    from its start are subtracted here."""
    monkeypatch.setenv("PEER_PROTOCOL", str(protocol))
    asked: list[str] = []
    late = [7]

    async def answer(peer: SlowPeer, request: wire.Request) -> None:
        asked.append(request.WhichOneof("kind") or "")
        await Peer.answer(peer, request)

    get_status = Peer.get_status

    async def get_late_status(peer: Peer, request: wire.GetStatus, id_: int) -> wire.Response:
        response = await get_status(peer, request, id_)
        response.status.overruns = late[0]
        return response

    async def play() -> None:
        life = rtcfd()
        await life.start()
        runner = life.runners.get("rt_runner")
        asked.clear()
        await life.call("ResetStatistics", control_pb2.ResetStatisticsRequest())
        one = ["reset_statistics"]
        old = [*one, "get_status", "get_statistics"]  # one more overrun each
        assert asked == (old if protocol < STATISTICS_PROTOCOL else one)
        late[0] += 3
        left_out = 7 - 1 if protocol < STATISTICS_PROTOCOL else 0
        assert (await runner.status()).overruns == 10 - left_out
        await life.runners.close(in_order=False)

    monkeypatch.setattr(SlowPeer, "answer", answer)
    monkeypatch.setattr(Peer, "get_status", get_late_status)
    asyncio.run(play())


def test_only_a_constantly_late_loop_raises_the_alarm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [100.0]
    monkeypatch.setattr("rtcfd.operations.loop_counters.time.monotonic", lambda: clock[0])
    counts = LoopCounters()
    said = "400 cycles ended late in 10 s, most of them in /slow"
    counts.note_late_cycles(status(1000, 1), "1 cycle ended late")
    assert shown(counts, status(1000, 1))[2] == ""
    clock[0] += 10
    counts.note_late_cycles(status(2000, 401), said)
    assert shown(counts, status(2100, 420))[2] == f"40% of its cycles: {said}"
    stopped = status(2100, 420)
    stopped.state = runner_pb2.RUNNER_STATE_STOPPED
    assert shown(counts, stopped)[2] == ""
    # An occasional late cycle is not permanent.
    clock[0] += 10
    counts.note_late_cycles(status(12000, 402), "1 cycle ended late")
    assert shown(counts, status(12000, 402))[2] == ""
    # It is on time again.
    counts.note_late_cycles(status(13000, 902), said)
    clock[0] += 20
    assert shown(counts, status(20000, 902))[2] == ""
