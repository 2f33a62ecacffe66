"""One page at its WebSocket: its requests and the messages sent to it.

A slow page loses whole chunks, oldest first.  Their cycles are counted, and nothing else waits.
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
from rtcf_shared.ports import PortSchema
from rtcf_shared.printable import printable

from rtcf_scope import wire
from rtcf_scope.chunk import Chunk, column_of, has_trace
from rtcf_scope.hub import Hub
from rtcf_scope.trigger import CYCLE, Search, Trigger, TriggerError, parse

PROTOCOL = "rtcf-scope"  # subprotocol of the WebSocket

_MOST_WAITING = 8 * 1024 * 1024  # bytes queued for a slow page
MOST_TRACES = 256
_MOST_NAMED = 5  # signals named in a message
_LONGEST_NAME = 200  # characters of a name
_PING_S = 20.0  # ping interval; a page that does not answer is disconnected


class Tab:
    """A page at its WebSocket, a Listener of its hub; lives in the event loop."""

    def __init__(self, hub: Hub) -> None:
        self.wants = False
        self.columns: tuple[str, ...] = ()
        self._hub = hub
        self._shows = False  # whether the page shows cycles
        self._requested: list[str] = []  # the traces requested by the page
        self._excess: list[str] = []  # requested traces above MOST_TRACES
        self._schema: PortSchema | None = None  # of the last chunk
        self._names: list[str] = []  # requested traces that exist in `_schema`
        self._number = 0  # counts the changes of `_names`
        self._sent_number = -1  # the number in the last `watching` message
        self._missing = _Missing()  # as last sent to the page
        self._sent_error: str | None = None
        self._waiting: deque[tuple[bytes | str, int]] = deque()  # messages, cycles in each
        self._bytes = 0  # in `_waiting`, without shots
        self._lost = 0  # cycles dropped since the last chunk sent
        self._has_begun = False  # whether cycles were sent: earlier ones do not count as lost
        self._queued = asyncio.Event()
        self._armed: _ArmedTrigger | None = None

    async def serve(self, request: web.Request) -> web.WebSocketResponse:
        """Exchange messages until the page disconnects; return the closed WebSocket."""
        socket = web.WebSocketResponse(
            heartbeat=_PING_S, max_msg_size=256 * 1024, protocols=(PROTOCOL,)
        )
        await socket.prepare(request)
        self._hub.join(self)
        sending = asyncio.create_task(self._write(socket))
        try:
            async for message in socket:
                if message.type == WSMsgType.TEXT:
                    self._handle(message.data)
        finally:
            self._hub.leave(self)
            sending.cancel()
            with contextlib.suppress(asyncio.CancelledError, ConnectionError):
                await sending
        return socket

    def take(self, chunk: Chunk) -> None:
        """Queue a chunk of cycles, and search it for trigger hits."""
        if chunk.batch.schema is not self._schema:
            self._schema = chunk.batch.schema
            self._select_traces()
        if self._shows:
            self._send_cycles(chunk)
        if self._armed is not None:
            for begin, hit, end in self._armed.search(chunk):
                self._send_shot(begin, hit, end)

    def _send_cycles(self, chunk: Chunk) -> None:
        base_ns = self._send_watching()
        body = wire.body(chunk, self._names, base_ns)
        lost, self._lost = self._lost + (chunk.lost if self._has_begun else 0), 0
        self._has_begun = True
        head = wire.head(
            wire.CYCLES, self._number, len(chunk), len(self._names) + 4,
            lost=lost, last=chunk.batch.last_of_loop,
        )  # fmt: skip
        self._queue(head + body, len(chunk) + lost)

    def set_schema(self, schema: PortSchema) -> None:
        """Send the page the requested signals that the graph does not have."""
        self._send_missing(
            _Missing(
                tuple(name for name in self._requested if not has_trace(schema, name)),
                tuple(name for name in self._watched() if not has_trace(schema, name)),
                tuple(self._excess),
            )
        )

    def set_error(self, text: str) -> None:
        """Send the page an error of the stream, if it has changed."""
        if text != self._sent_error:
            self._sent_error = text
            self.send({"kind": "error", "text": text})

    def send(self, message: dict[str, Any]) -> None:
        """Queue a text message."""
        self._queue(json.dumps(message), 0)

    def _handle(self, text: str) -> None:
        try:
            request = json.loads(text)
        except (ValueError, RecursionError):
            request = None
        if not isinstance(request, dict):
            self.send({"kind": "refused", "text": "a message must be a JSON object"})
            return
        if "watch" in request:
            self._watch(request["watch"])
        if "trigger" in request:
            self._arm(request["trigger"])

    def _watch(self, request: Any) -> None:
        if not isinstance(request, list):
            self.send({"kind": "refused", "text": "watch must be a list of signal names"})
            return
        names = list(dict.fromkeys(name for name in request if isinstance(name, str)))
        # Latency and duration (~) are in every message.
        traces = [name for name in names if not name.startswith("~")]
        self._requested, self._excess = traces[:MOST_TRACES], traces[MOST_TRACES:]
        self._shows = bool(names)
        if not self._shows:
            self._has_begun = False
        self._select_traces()
        self._update_columns()

    def _arm(self, request: Any) -> None:
        """Arm the trigger that a page requests; an invalid request disarms."""
        self._armed, error_text = None, ""
        try:
            if request is not None:
                self._armed = _ArmedTrigger(parse(request))
        except TriggerError as error:
            error_text = str(error)
            self.send({"kind": "refused", "text": error_text})
        self.send(
            {"kind": "trigger", "state": "off" if self._armed is None else "armed",
             "signals": [] if self._armed is None else self._armed.trigger.signals,
             "refused": error_text}
        )  # fmt: skip
        self._update_columns()

    def _watched(self) -> list[str]:
        """Return the outputs and states that the trigger uses."""
        signals = [] if self._armed is None else self._armed.trigger.signals
        return [name for name in signals if not name.startswith("~")]

    def _update_columns(self) -> None:
        names = (*self._requested, *self._watched())
        self.columns = tuple(dict.fromkeys(column for n in names if (column := column_of(n))))
        self.wants = self._shows or self._armed is not None
        before = self._missing  # only signals that are still requested
        self._send_missing(
            _Missing(
                tuple(name for name in before.names if name in self._requested),
                tuple(name for name in before.trigger if name in self._watched()),
                tuple(self._excess),
            )
        )
        self._hub.changed()

    def _send_missing(self, missing: "_Missing") -> None:
        if missing != self._missing:
            self._missing = missing
            self.send({"kind": "missing", "text": missing.text} | asdict(missing))

    def _select_traces(self) -> None:
        """Select the requested traces that exist in the present schema."""
        schema = self._schema
        names = [] if schema is None else [n for n in self._requested if has_trace(schema, n)]
        if names != self._names:
            self._names = names
            self._number = (self._number + 1) & 0xFFFF

    def _send_watching(self) -> int:
        """Describe the next binary messages by `watching`, if needed; return their base time."""
        base_ns = self._hub.base_ns or 0
        if self._sent_number != self._number:
            self._sent_number = self._number
            self.send(
                {"kind": "watching", "number": self._number, "names": self._names,
                 "base_ns": str(base_ns)}
            )  # fmt: skip
        return base_ns

    def _send_shot(self, begin: int, hit: int, end: int) -> None:
        base_ns = self._send_watching()
        begin = max(begin, self._hub.since)
        chunks = self._hub.history.between(begin, end)
        if hit < chunks[0].at:
            self.send({"kind": "refused", "text": "hit no longer in memory: show fewer cycles"})
            return
        columns = wire.cut(chunks, self._names, base_ns, begin, end)
        at = hit - max(begin, chunks[0].at)
        head = wire.head(wire.SHOT, self._number, columns.shape[1], columns.shape[0], hit=at)
        self._queue(head + columns.tobytes(), 0)
        if self._armed is not None and self._armed.done:
            self._armed = None
            self.send({"kind": "trigger", "state": "done"})
            self._update_columns()

    def _queue(self, data: bytes | str, cycles: int) -> None:
        if _is_shot(data, cycles):
            # Keep one shot of any size, so that the user sees it.
            self._waiting = deque(each for each in self._waiting if not _is_shot(*each))
        else:
            self._bytes += len(data)
        self._waiting.append((data, cycles))
        while self._bytes > _MOST_WAITING:
            oldest = next(
                (i for i, each in enumerate(self._waiting) if each[1]),
                next(i for i, each in enumerate(self._waiting) if not _is_shot(*each)),
            )
            dropped, lost = self._waiting[oldest]
            del self._waiting[oldest]
            self._bytes -= len(dropped)
            self._lost += lost
        self._queued.set()

    async def _write(self, socket: web.WebSocketResponse) -> None:
        while True:
            await self._queued.wait()
            self._queued.clear()
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


class _ArmedTrigger:
    """An armed trigger: waits for its hit, then for the cycles after it."""

    def __init__(self, trigger: Trigger) -> None:
        self.trigger = trigger
        self.done = False
        self._search = Search(trigger)
        self._hit = -1  # counted as Chunk.at; -1 = none yet
        self._from = 0  # earlier cycles do not hit

    def search(self, chunk: Chunk) -> list[tuple[int, int, int]]:
        """Return begin, hit and end of the shots that this chunk completes.

        If the trigger stays armed, return only the last of them.
        """
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
        if not all(name in special or has_trace(schema, name) for name in signals):
            # The last value belongs to another graph: do not compare with it.
            self._search = Search(self.trigger)
            return np.zeros(0, np.int64)
        columns = (special[name] if name in special else chunk.values(name) for name in signals)
        return self._search.hits(*columns) + chunk.at


@dataclass(frozen=True)
class _Missing:
    """Requested signals without values."""

    names: tuple[str, ...] = ()  # traces that the graph does not have
    trigger: tuple[str, ...] = ()  # signals of the trigger that the graph does not have
    over: tuple[str, ...] = ()  # traces above MOST_TRACES

    @property
    def text(self) -> str:
        """The message for the user; empty if nothing is missing."""
        parts = []
        if self.names:
            parts.append(f"signals omitted until they exist: {_first_names(self.names)}")
        if self.trigger:
            parts.append(f"the trigger waits until its signals exist: {_first_names(self.trigger)}")
        if self.over:
            parts.append(f"traces omitted above {MOST_TRACES} per page: {_first_names(self.over)}")
        return "; ".join(parts)


def _first_names(names: tuple[str, ...]) -> str:
    more = len(names) - _MOST_NAMED
    shown = ", ".join(printable(name[:_LONGEST_NAME]) for name in names[:_MOST_NAMED])
    return f"{shown} and {more} more" if more > 0 else shown
