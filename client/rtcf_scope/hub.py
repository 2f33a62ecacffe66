"""The stream of a runner that all its tabs share, and the history of its last cycles.

A thread reads the stream; everything else runs in the event loop.  rtcfd omits signals that the
graph does not have, and adds them to the stream when they exist.
"""

import asyncio
import sys
import threading
from collections import deque
from typing import Any, Protocol

import rtcf
from rtcf.streams.ports import PortStream
from rtcf_shared.errors import RtcfError
from rtcf_shared.ports import PortBatch, PortSchema

from rtcf_scope.chunk import Chunk, History

_MOST_BATCHES = 32  # batches between reader thread and event loop
_REOPEN_S = 1.0  # delay before a failed stream is opened again
_HISTORY_BYTES = 64 * 1024 * 1024
_MOST_COLUMNS = 16384  # outputs and states that rtcfd accepts in one selection
_NO_COLUMN = "/."  # matches no output and no state: only the cycles are streamed
_SWITCH_S = 2.0  # for the old reader to reach the first cycle of the new one
_STOPPED_S = 0.5  # without a cycle, after which a loop counts as stopped


class Listener(Protocol):
    """The hub's view of a tab; no method blocks."""

    wants: bool  # whether the tab needs cycles
    columns: tuple[str, ...]  # outputs and states that the tab needs

    def take(self, chunk: Chunk) -> None:
        """Process a chunk of cycles."""

    def set_schema(self, schema: PortSchema) -> None:
        """Process the schema of the stream: which columns exist."""

    def send(self, message: dict[str, Any]) -> None:
        """Send a text message to the page."""

    def set_error(self, text: str) -> None:
        """Process an error of the stream; an empty text ends the error."""


class _Reader:
    """One stream and its thread; the event loop owns the attributes without `_`."""

    def __init__(self, hub: "Hub", columns: tuple[str, ...]) -> None:
        self.columns = frozenset(columns)
        self.schema: PortSchema | None = None  # None until the stream is open
        self.opened = 0.0  # event loop time, s
        self.error = ""
        self._selection = columns or (_NO_COLUMN,)
        self._hub = hub
        self.loop = asyncio.get_running_loop()
        self._room = threading.Semaphore(_MOST_BATCHES)
        self._ended = threading.Event()
        self._stream: PortStream | None = None
        threading.Thread(target=self._run, name="scope stream", daemon=True).start()

    @property
    def is_open(self) -> bool:
        """Return whether the stream is open and free of errors."""
        return self.schema is not None and not self.error

    def close(self) -> None:
        """End the stream and its thread, without waiting."""
        self._ended.set()
        self._room.release()
        if self._stream is not None:
            self._stream.close()

    def release(self) -> None:
        """Free the place of a processed batch; the thread may read another one."""
        self._room.release()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                self._read()
                text = "the stream has ended"
            except RtcfError as error:
                text = str(error)
            except Exception as error:  # the thread must go on: pages wait for its values
                text = f"the stream failed: {error!r}"
            if not self._ended.is_set():
                self._call(self._hub.failed, self, text)
                self._ended.wait(_REOPEN_S)

    def _read(self) -> None:
        with self._hub.client.watch_ports(
            self._selection, self._hub.runner, allow_missing=True
        ) as stream:
            self._stream = stream
            if self._ended.is_set():  # closed before `_stream` was set
                return
            self._call(self._hub.opened, self, stream.schema)
            stream.on_schema = lambda schema: self._call(self._hub.opened, self, schema)
            for batch in stream:
                self._room.acquire()
                if self._ended.is_set():
                    return
                self._call(self._hub.take, self, batch)

    def _call(self, *words: Any) -> None:
        try:
            self.loop.call_soon_threadsafe(*words)
        except RuntimeError:
            self._ended.set()  # the server has ended


class Hub:
    """The tabs of one runner and their common stream; lives in the event loop.

    When the selection changes, a second reader opens the new stream while the first one continues.
    The hub switches to the second reader at its first cycle, to avoid lost or repeated cycles.
    """

    def __init__(self, client: rtcf.Client, runner: str) -> None:
        self.client = client
        self.runner = runner
        self.history = History(_HISTORY_BYTES)
        self.base_ns: int | None = None  # stamp of the first cycle
        self.sent = 0  # number of cycles sent to tabs
        self.since = 0  # `sent` when the present streams began
        self._tabs: dict[Listener, None] = {}  # in order of joining
        self._reader: _Reader | None = None  # the source of the cycles sent now
        self._next: _Reader | None = None  # with a new selection, until it replaces `_reader`
        self._held: deque[PortBatch] = deque()  # batches of `_next`
        self._waits = False  # the selection has changed again since `_next` was opened
        self._last_sent = (-1, 0)  # number and stamp of the last cycle sent
        self._lost = 0  # dropped cycles reported by empty batches
        self._overlap = False  # the next batch may repeat cycles

    @property
    def is_empty(self) -> bool:
        """Return whether the hub has neither tabs nor cycles."""
        return not self._tabs and not self.history

    def join(self, tab: Listener) -> None:
        """Add a tab, which calls `changed` when its columns change."""
        self._tabs[tab] = None
        self.changed()

    def leave(self, tab: Listener) -> None:
        """Remove a tab; without tabs the streams are closed."""
        self._tabs.pop(tab, None)
        self.changed()

    def close(self) -> None:
        """Close the streams."""
        for reader in (self._reader, self._next):
            if reader is not None:
                reader.close()
        self._reader = self._next = None
        self._held.clear()
        # Cycles while no stream is open do not count as lost.
        self._last_sent, self._lost, self.since = (-1, 0), 0, self.sent

    def changed(self) -> None:
        """Open the stream that the tabs need now."""
        if not any(tab.wants for tab in self._tabs):
            self.close()
            self._send_error()
            return
        # Above the limit, the columns of the first tabs have priority.
        columns = tuple(dict.fromkeys(each for tab in self._tabs for each in tab.columns))
        columns = columns[:_MOST_COLUMNS]
        newest = self._next or self._reader
        if newest is None:
            self._reader = _Reader(self, columns)
        elif newest.columns == frozenset(columns):
            self._waits = False
            if newest.schema is not None:
                self._send_schema(newest.schema)
        elif self._next is not None and self._is_expected(self._next):
            self._waits = True
        else:
            self._close_next()
            self._next = _Reader(self, columns)
        self._send_error()

    def opened(self, reader: _Reader, schema: PortSchema) -> None:
        """Process the schema of a reader's stream."""
        if reader not in (self._reader, self._next):
            return
        if not reader.is_open:
            reader.opened = reader.loop.time()
            if reader is self._next:
                reader.loop.call_later(_STOPPED_S, self._open_waiting)
        reader.schema, reader.error = schema, ""
        if reader is (self._next or self._reader):
            self._send_schema(schema)
        self._send_error()

    def take(self, reader: _Reader, batch: PortBatch) -> None:
        """Process a batch of a reader."""
        if reader is self._next:
            if not self._held:
                reader.loop.call_later(_SWITCH_S, self._take_over, reader)
            self._held.append(batch)
        else:
            reader.release()
            if reader is self._reader:
                self._send(batch)
        if self._held and self._is_due(self._held[0]):
            self._take_over(self._next)

    def failed(self, reader: _Reader, text: str) -> None:
        """Process the error of a reader's stream."""
        if reader not in (self._reader, self._next):
            return
        reader.error = text
        if reader is self._reader:
            self._overlap = True  # the next batch may repeat or skip cycles
        self._send_error()
        if self._held:
            self._take_over(self._next)
        self._open_waiting()

    def _is_expected(self, reader: _Reader) -> bool:
        """Return whether the first cycle of a reader is expected soon."""
        if reader.error:
            return False
        return (
            reader.schema is None
            or bool(self._held)
            or reader.loop.time() - reader.opened < _STOPPED_S
        )

    def _open_waiting(self) -> None:
        if self._waits:
            self._waits = False
            self.changed()

    def _is_due(self, first: PortBatch) -> bool:
        """Return whether all cycles before the next reader's first batch have been sent."""
        cycle, stamp = self._last_sent
        if self._reader is None or not self._reader.is_open or cycle < 0 or not len(first):
            return True
        return cycle == first.first_cycle - 1 or stamp >= first.message.stamps_ns[0]

    def _take_over(self, reader: _Reader | None) -> None:
        if reader is None or reader is not self._next or not self._held:
            return
        if self._reader is not None:
            self._reader.close()
        self._reader, self._next = reader, None
        self._overlap = True
        held, self._held = self._held, deque()
        for batch in held:
            reader.release()
            self._send(batch)
        self._send_error()
        self._open_waiting()

    def _close_next(self) -> None:
        if self._next is not None:
            self._next.close()
            self._next = None
        self._held.clear()

    def _send(self, batch: PortBatch) -> None:
        lost = batch.lost + self._lost
        if not len(batch):
            self._lost = lost
            return
        chunk = self._unsent(batch) if self._overlap else Chunk(batch, self.sent, lost)
        if not len(chunk):
            return
        self._lost = 0
        self._last_sent = (int(chunk.cycles[-1]), int(chunk.stamps_ns[-1]))
        if self.base_ns is None:
            self.base_ns = int(chunk.stamps_ns[0])
        self.sent = chunk.end
        self.history.add(chunk)
        for tab in tuple(self._tabs):
            try:
                tab.take(chunk)
            except Exception as error:  # an error of one page must not affect the others
                print(f"rtcf-scope: a page of {self.runner} failed: {error!r}", file=sys.stderr)

    def _unsent(self, batch: PortBatch) -> Chunk:
        """Return the cycles of a batch not sent yet: all of them after a restart of the loop."""
        cycle, stamp = self._last_sent
        seen = (batch.cycles <= cycle) & (batch.stamps_ns <= stamp)
        skip = int(seen.sum())
        if skip < len(batch):
            self._overlap = False
        lost = 0 if skip or cycle < 0 else max(batch.first_cycle - cycle - 1, 0)
        return Chunk(batch.part(skip) if skip else batch, self.sent, lost)

    def _send_schema(self, schema: PortSchema) -> None:
        for tab in tuple(self._tabs):
            tab.set_schema(schema)

    def _send_error(self) -> None:
        """Send each tab the error of the stream with its columns."""
        now = "" if self._reader is None else self._reader.error
        for tab in tuple(self._tabs):
            text = now
            if self._next is not None and self._reader is not None and not text:
                text = "" if self._reader.columns.issuperset(tab.columns) else self._next.error
            tab.set_error(text)
