"""One page: what it asks, and what it is told as fast as it takes it.

A page that does not keep up loses whole chunks, oldest first, which are counted; nobody waits
for it.
"""

import asyncio
import contextlib
import json
from collections import deque
from typing import Any

from aiohttp import WSMsgType, web

from rtcf_scope import wire
from rtcf_scope.chunk import Chunk
from rtcf_scope.hub import Hub, columns_of
from rtcf_scope.trigger import Search, Trigger, TriggerError, parse

_MOST_WAITING = 8 * 1024 * 1024  # bytes for a page that does not take them
MOST_TRACES = 256
_BEAT_S = 20.0  # a page that answers no ping in so long is gone


class Tab:
    """A page at its WebSocket; a listener of its hub."""

    def __init__(self, hub: Hub) -> None:
        self.columns: frozenset[str] = frozenset()
        self._hub = hub
        self._names: list[str] = []
        self._number = 0  # of what it watches
        self._told = -1  # the number that `watching` has told
        self._waiting: deque[tuple[bytes | str, int]] = deque()  # what to send, cycles in it
        self._bytes = 0
        self._lost = 0  # cycles
        self._news = asyncio.Event()
        self._armed: _Armed | None = None

    async def serve(self, request: web.Request) -> web.WebSocketResponse:
        """Talk until the page goes."""
        socket = web.WebSocketResponse(heartbeat=_BEAT_S, max_msg_size=256 * 1024)
        await socket.prepare(request)
        self._hub.join(self)
        sending = asyncio.create_task(self._send(socket))
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    self._hear(message.data)
        finally:
            self._hub.leave(self)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return socket

    def take(self, chunk: Chunk) -> None:
        """Queue cycles, and look whether the trigger hits."""
        if not self._names:
            return
        base_ns = self._tell_watching()
        body = wire.body(chunk, self._names, base_ns)
        lost, self._lost = self._lost + chunk.lost, 0
        head = wire.head(
            wire.CYCLES, self._number, len(chunk), len(self._names) + 4,
            lost=lost, last=chunk.batch.last_of_loop,
        )  # fmt: skip
        self._queue(head + body, len(chunk) + lost)
        if self._armed is not None:
            for begin, hit, end in self._armed.search(chunk):
                self._shoot(begin, hit, end)

    def tell(self, message: dict[str, Any]) -> None:
        """Queue a text message."""
        self._queue(json.dumps(message), 0)

    def _hear(self, text: str) -> None:
        try:
            told = json.loads(text)
            if not isinstance(told, dict):
                raise TriggerError("not an object")
            if "watch" in told:
                self._watch([str(name) for name in told["watch"]])
            if "trigger" in told:
                self._arm(told["trigger"])
        except (TypeError, ValueError) as error:
            self.tell({"kind": "refused", "text": str(error)})

    def _watch(self, names: list[str]) -> None:
        if len(names) > MOST_TRACES:
            raise ValueError(f"{len(names)} traces: at most {MOST_TRACES}")
        self._names = list(dict.fromkeys(names))
        self._number = (self._number + 1) & 0xFFFF
        self._retune()

    def _arm(self, told: Any) -> None:
        self._armed = None if told is None else _Armed(parse(told))
        self._retune()
        self.tell({"kind": "trigger", "state": "off" if told is None else "armed"})

    def _retune(self) -> None:
        wanted = [*self._names]
        if self._armed is not None:
            wanted += [each for each in self._armed.trigger.signals if not each.startswith("~")]
        self.columns = columns_of(wanted)
        self._hub.changed()

    def _tell_watching(self) -> int:
        """Tell what stands in the binary messages that follow; return the base of their times."""
        base_ns = self._hub.base_ns or 0
        if self._told != self._number:
            self._told = self._number
            self.tell(
                {"kind": "watching", "number": self._number, "names": self._names,
                 "base_ns": str(base_ns)}
            )  # fmt: skip
        return base_ns

    def _shoot(self, begin: int, hit: int, end: int) -> None:
        base_ns = self._tell_watching()
        chunks = self._hub.memory.between(begin, end)
        columns = wire.cut(chunks, self._names, base_ns, begin, end)
        at = hit - max(begin, chunks[0].at)
        head = wire.head(wire.SHOT, self._number, columns.shape[1], columns.shape[0], hit=at)
        self._queue(head + columns.tobytes(), 0)
        if self._armed is not None and self._armed.done:
            self._armed = None
            self.tell({"kind": "trigger", "state": "done"})

    def _queue(self, data: bytes | str, cycles: int) -> None:
        if _is_shot(data, cycles):
            # One waits, however large: who asked for it is to see it.
            self._waiting = deque(each for each in self._waiting if not _is_shot(*each))
        else:
            self._bytes += len(data)
        self._waiting.append((data, cycles))
        while self._bytes > _MOST_WAITING:
            oldest = next(
                (i for i, each in enumerate(self._waiting) if each[1]),
                next(i for i, each in enumerate(self._waiting) if not _is_shot(*each)),
            )
            gone, lost = self._waiting[oldest]
            del self._waiting[oldest]
            self._bytes -= len(gone)
            self._lost += lost
        self._news.set()

    async def _send(self, socket: web.WebSocketResponse) -> None:
        while True:
            await self._news.wait()
            self._news.clear()
            while self._waiting:
                data, cycles = self._waiting.popleft()
                if not _is_shot(data, cycles):
                    self._bytes -= len(data)
                if isinstance(data, str):
                    await socket.send_str(data)
                else:
                    await socket.send_bytes(data)


def _is_shot(data: bytes | str, cycles: int) -> bool:
    return isinstance(data, bytes) and not cycles


class _Armed:
    """A trigger that waits for its cycle, then for those behind it."""

    def __init__(self, trigger: Trigger) -> None:
        self.trigger = trigger
        self.done = False
        self._search = Search(trigger)
        self._hit = -1  # place at the hub; -1 = none yet
        self._from = 0  # nothing hits before

    def search(self, chunk: Chunk) -> list[tuple[int, int, int]]:
        """Return begin, hit and end of the shots that are complete with this chunk."""
        shots = []
        special = {"~latency": chunk.latencies_us, "~duration": chunk.durations_us}
        columns = (
            special[name] if name in special else chunk.values(name)
            for name in self.trigger.signals
        )  # fmt: skip
        hits = self._search.hits(*columns) + chunk.at
        while not self.done:
            if self._hit < 0:
                left = hits[hits >= self._from]
                if not len(left):
                    break
                self._hit = int(left[0])
            end = self._hit + self.trigger.after
            if end > chunk.end:
                break
            shots.append((self._hit - self.trigger.before, self._hit, end))
            self._from = end + self.trigger.holdoff
            self._hit = -1
            self.done = self.trigger.single
        return shots[-1:] if not self.done else shots
