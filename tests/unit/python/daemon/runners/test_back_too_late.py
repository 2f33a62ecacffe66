"""A holder that returns while its lease is being ended gets an error."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

import pytest
from rtcf.v1 import control_pb2
from rtcfd_in_process import Refused, Rtcfd, spec, until

LEASE = control_pb2.OpenLease(component=spec("a"), run_id="run", holder="a launch")
HOLD = control_pb2.OpenHold(runner="rt_runner", token="token", holder="a launch")


async def lost(daemon: Rtcfd, method: str, opening: Any) -> asyncio.Event:
    """Kill the holder of a running loop; return the event that lets the loop's stop continue."""
    opened = asyncio.Event()
    holder = asyncio.create_task(daemon.hold(method, opening, opened))
    await opened.wait()
    await daemon.call("Start", control_pb2.StartRequest())
    peer = daemon.peer("rt_runner")
    assert peer is not None
    stopping, may_stop, stop = asyncio.Event(), asyncio.Event(), peer.stop

    async def slow_stop(*request: Any) -> Any:
        stopping.set()
        await may_stop.wait()
        return await stop(*request)

    peer.stop = slow_stop  # type: ignore[assignment]
    holder.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await holder
    await stopping.wait()
    return may_stop


def request_of(method: str, opening: Any) -> Any:
    kind = {"LeaseComponent": control_pb2.LeaseComponentRequest,
            "HoldRunner": control_pb2.HoldRunnerRequest}[method]  # fmt: skip
    return kind(open=opening)


def test_a_lease_of_a_component_being_unloaded_is_not_renewed(rtcfd: Callable[[], Rtcfd]) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        may_stop = await lost(daemon, "LeaseComponent", request_of("LeaseComponent", LEASE))
        back = control_pb2.OpenLease(attach=True)
        back.MergeFrom(LEASE)
        with pytest.raises(Refused, match="the lease of /a in runner rt_runner is being ended"):
            await daemon.hold("LeaseComponent", request_of("LeaseComponent", back), asyncio.Event())
        may_stop.set()
        desired = daemon.runners.get("rt_runner").desired
        await until(lambda: not desired.components and not desired.leased, "its end")
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_a_lease_of_a_runner_being_released_is_not_renewed(rtcfd: Callable[[], Rtcfd]) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        may_stop = await lost(daemon, "HoldRunner", request_of("HoldRunner", HOLD))
        back = control_pb2.OpenHold(attach=True)
        back.MergeFrom(HOLD)
        with pytest.raises(Refused, match="runner rt_runner is being given back, as a launch was"):
            await daemon.hold("HoldRunner", request_of("HoldRunner", back), asyncio.Event())
        may_stop.set()
        runner = daemon.runners.get("rt_runner")
        await until(lambda: runner.desired.hold is None and not runner.releasing, "its end")
        assert runner.hold_outbox is None
        # Another holder has the lease now.
        opened = asyncio.Event()
        other = asyncio.create_task(
            daemon.hold("HoldRunner", request_of("HoldRunner", HOLD), opened)
        )
        await opened.wait()
        other.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await other
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
