"""A stopped replay is over: its client does not continue in another client's replay."""

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2
from rtcfd_in_process import Context, Refused, Rtcfd

Request = control_pb2.ReplayRequest


class Caller:
    """A client that replays piece by piece."""

    def __init__(self, rtcfd: Rtcfd) -> None:
        self._pieces: asyncio.Queue[Any] = asyncio.Queue()
        self._answers = rtcfd.control.Replay(self._requests(), Context())

    async def _requests(self) -> AsyncIterator[control_pb2.ReplayRequest]:
        while (piece := await self._pieces.get()) is not None:
            yield piece

    async def replay(self, piece: control_pb2.ReplayRequest) -> None:
        self._pieces.put_nowait(piece)
        await anext(self._answers)

    async def end(self) -> None:
        self._pieces.put_nowait(None)
        assert [each async for each in self._answers] == []


def test_a_stopped_replay_does_not_continue_in_another_clients(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    replayed: list[int] = []

    async def replay(_: Peer, request: control_pb2.ReplayRequest, __: int) -> wire.Response:
        replayed.append(request.until_ns)
        return wire.Response(replay=control_pb2.ReplayResponse(cycles=1))

    monkeypatch.setattr(Peer, "replay", replay, raising=False)

    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        first, second = Caller(daemon), Caller(daemon)
        await first.replay(Request(begin=True, until_ns=1))
        await daemon.call("Stop", control_pb2.StopRequest())
        await second.replay(Request(begin=True, until_ns=2))
        with pytest.raises(Refused, match="its loop was stopped, and this replay with it"):
            await first.replay(Request(until_ns=3))
        await second.replay(Request(until_ns=4))
        assert replayed == [1, 2, 4]
        await second.end()
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
