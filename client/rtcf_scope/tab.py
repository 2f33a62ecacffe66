"""One page: what it asks, and what it is told as fast as it takes it.

A page that does not keep up loses whole chunks, oldest first, which are counted; nobody waits
for it.
"""

import asyncio
import contextlib
import json
from collections import deque
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from aiohttp import WSMsgType, web
from numpy.typing import NDArray
from rtcf.streams.ports import PortSchema

from rtcf_scope import wire
from rtcf_scope.chunk import Chunk, column_of, is_there
from rtcf_scope.hub import Hub
from rtcf_scope.line import line
from rtcf_scope.trigger import CYCLE, Search, Trigger, TriggerError, parse

PROTOCOL = "rtcf-scope"  # of the WebSocket

_MOST_WAITING = 8 * 1024 * 1024  # bytes for a page that does not take them
MOST_TRACES = 256
_NAMED = 5  # signals in a message
_LONGEST_NAMED = 200  # characters
_BEAT_S = 20.0  # a page that answers no ping in so long is gone


class Tab:
    """A page at its WebSocket; a listener of its hub."""

    def __init__(self, hub: Hub) -> None:
        self.wants = False
        self.columns: tuple[str, ...] = ()
        self._hub = hub
        self._shows = False  # cycles
        self._asked: list[str] = []  # the traces that the page shows
        self._over: list[str] = []  # those that are too many
        self._schema: PortSchema | None = None  # of the last cycles
        self._names: list[str] = []  # those asked for that have values in these
        self._number = 0  # of what it watches
        self._told = -1  # the number that `watching` has told
        self._missing = _Missing()  # as the page knows it
        self._told_trouble: str | None = None
        self._waiting: deque[tuple[bytes | str, int]] = deque()  # what to send, cycles in it
        self._bytes = 0
        self._lost = 0  # cycles
        self._has_begun = False  # to tell cycles: those before are not lost
        self._news = asyncio.Event()
        self._armed: _Armed | None = None

    async def serve(self, request: web.Request) -> web.WebSocketResponse:
        """Talk until the page goes."""
        socket = web.WebSocketResponse(
            heartbeat=_BEAT_S, max_msg_size=256 * 1024, protocols=(PROTOCOL,)
        )
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
        if chunk.batch.schema is not self._schema:
            self._schema = chunk.batch.schema
            self._choose()
        if self._shows:
            self._show(chunk)
        if self._armed is not None:
            for begin, hit, end in self._armed.search(chunk):
                self._shoot(begin, hit, end)

    def _show(self, chunk: Chunk) -> None:
        base_ns = self._tell_watching()
        body = wire.body(chunk, self._names, base_ns)
        lost, self._lost = self._lost + (chunk.lost if self._has_begun else 0), 0
        self._has_begun = True
        head = wire.head(
            wire.CYCLES, self._number, len(chunk), len(self._names) + 4,
            lost=lost, last=chunk.batch.last_of_loop,
        )  # fmt: skip
        self._queue(head + body, len(chunk) + lost)

    def know(self, schema: PortSchema) -> None:
        """Tell the page which of its signals the graph does not have."""
        self._tell_missing(
            _Missing(
                tuple(name for name in self._asked if not is_there(schema, name)),
                tuple(name for name in self._watched() if not is_there(schema, name)),
                tuple(self._over),
            )
        )

    def trouble(self, text: str) -> None:
        """Tell the page what keeps its values away."""
        if text != self._told_trouble:
            self._told_trouble = text
            self.tell({"kind": "trouble", "text": text})

    def tell(self, message: dict[str, Any]) -> None:
        """Queue a text message."""
        self._queue(json.dumps(message), 0)

    def _hear(self, text: str) -> None:
        try:
            told = json.loads(text)
        except (ValueError, RecursionError):
            told = None
        if not isinstance(told, dict):
            self.tell({"kind": "refused", "text": "a page says an object of JSON"})
            return
        if "watch" in told:
            self._watch(told["watch"])
        if "trigger" in told:
            self._arm(told["trigger"])

    def _watch(self, told: Any) -> None:
        if not isinstance(told, list):
            self.tell({"kind": "refused", "text": "a page says what it watches as a list of names"})
            return
        names = list(dict.fromkeys(name for name in told if isinstance(name, str)))
        # Of the cycle itself each message tells.
        traces = [name for name in names if not name.startswith("~")]
        self._asked, self._over = traces[:MOST_TRACES], traces[MOST_TRACES:]
        self._shows = bool(names)
        if not self._shows:
            self._has_begun = False
        self._choose()
        self._retune()

    def _arm(self, told: Any) -> None:
        """Arm what a page says; of what cannot be, nothing is armed either."""
        self._armed, refusal = None, ""
        try:
            if told is not None:
                self._armed = _Armed(parse(told))
        except TriggerError as error:
            refusal = str(error)
            self.tell({"kind": "refused", "text": refusal})
        self.tell(
            {"kind": "trigger", "state": "off" if self._armed is None else "armed",
             "signals": [] if self._armed is None else self._armed.trigger.signals,
             "refused": refusal}
        )  # fmt: skip
        self._retune()

    def _watched(self) -> list[str]:
        """Return the signals of outputs and states that the trigger looks at."""
        signals = [] if self._armed is None else self._armed.trigger.signals
        return [name for name in signals if not name.startswith("~")]

    def _retune(self) -> None:
        names = (*self._asked, *self._watched())
        self.columns = tuple(dict.fromkeys(column for n in names if (column := column_of(n))))
        self.wants = self._shows or self._armed is not None
        before = self._missing  # as far as it is still asked for
        self._tell_missing(
            _Missing(
                tuple(name for name in before.names if name in self._asked),
                tuple(name for name in before.trigger if name in self._watched()),
                tuple(self._over),
            )
        )
        self._hub.changed()

    def _tell_missing(self, missing: "_Missing") -> None:
        if missing != self._missing:
            self._missing = missing
            self.tell({"kind": "missing", "text": missing.text} | asdict(missing))

    def _choose(self) -> None:
        """Tell those traces that have values."""
        schema = self._schema
        names = [] if schema is None else [n for n in self._asked if is_there(schema, n)]
        if names != self._names:
            self._names = names
            self._number = (self._number + 1) & 0xFFFF

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
        begin = max(begin, self._hub.since)
        chunks = self._hub.memory.between(begin, end)
        if hit < chunks[0].at:
            self.tell({"kind": "refused", "text": "the cycle of the hit is not kept: show fewer"})
            return
        columns = wire.cut(chunks, self._names, base_ns, begin, end)
        at = hit - max(begin, chunks[0].at)
        head = wire.head(wire.SHOT, self._number, columns.shape[1], columns.shape[0], hit=at)
        self._queue(head + columns.tobytes(), 0)
        if self._armed is not None and self._armed.done:
            self._armed = None
            self.tell({"kind": "trigger", "state": "done"})
            self._retune()

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
        hits = self._hits(chunk)
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

    def _hits(self, chunk: Chunk) -> NDArray[np.int64]:
        special = dict(zip(CYCLE, (chunk.latencies_us, chunk.durations_us), strict=True))
        signals, schema = self.trigger.signals, chunk.batch.schema
        if not all(name in special or is_there(schema, name) for name in signals):
            # What it compared with is of another graph.
            self._search = Search(self.trigger)
            return np.zeros(0, np.int64)
        columns = (special[name] if name in special else chunk.values(name) for name in signals)
        return self._search.hits(*columns) + chunk.at


@dataclass(frozen=True)
class _Missing:
    """Signals that a page asks for and does not get."""

    names: tuple[str, ...] = ()  # of traces that the graph does not have
    trigger: tuple[str, ...] = ()  # that the trigger looks at, likewise
    over: tuple[str, ...] = ()  # traces above the most of a page

    @property
    def text(self) -> str:
        """What to tell a person; empty: nothing is missing."""
        parts = []
        if self.names:
            parts.append(f"no such signal, left out until there is: {_few(self.names)}")
        if self.trigger:
            parts.append(f"the trigger waits for a signal that is not there: {_few(self.trigger)}")
        if self.over:
            parts.append(f"a page shows {MOST_TRACES} traces at most, left out: {_few(self.over)}")
        return "; ".join(parts)


def _few(names: tuple[str, ...]) -> str:
    more = len(names) - _NAMED
    shown = ", ".join(line(name[:_LONGEST_NAMED]) for name in names[:_NAMED])
    return f"{shown} and {more} more" if more > 0 else shown
