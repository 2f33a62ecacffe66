"""The one stream of a runner that all its tabs share, and the last of what it told.

A thread reads the stream; all else happens in the event loop.  Names that the graph does not have
are left out of the stream by rtcfd, and are told as soon as it has them.
"""

import asyncio
import sys
import threading
from collections import deque
from typing import Any, Protocol

import rtcf
from rtcf.streams.ports import PortBatch, PortSchema, PortStream
from rtcf_shared.errors import RtcfError

from rtcf_scope.chunk import Chunk, Memory

_AHEAD = 32  # batches that the reader may be before the event loop
_AGAIN_S = 1.0
_MEMORY = 64 * 1024 * 1024
_MOST_COLUMNS = 16384  # that rtcfd looks up
_NO_COLUMN = "/."  # selects no output and no state: the cycles alone
_PATIENCE_S = 2.0  # of a selection to come for the one before to tell what is before it
_STANDS_S = 0.5  # without a cycle, after which a loop counts as one that stands


class Listener(Protocol):
    """A tab."""

    wants: bool  # cycles
    columns: tuple[str, ...]  # outputs and states

    def take(self, chunk: Chunk) -> None:
        """Take cycles; does not wait."""

    def know(self, schema: PortSchema) -> None:
        """Take notice of which of its columns there are."""

    def tell(self, message: dict[str, Any]) -> None:
        """Take a text message; does not wait."""

    def trouble(self, text: str) -> None:
        """Take what keeps its values away; empty: nothing does."""


class _Reader:
    """One stream and its thread; the attributes without `_` are the event loop's."""

    def __init__(self, hub: "Hub", columns: tuple[str, ...]) -> None:
        self.columns = frozenset(columns)
        self.schema: PortSchema | None = None  # once it is open
        self.opened = 0.0  # the event loop's time
        self.trouble = ""
        self._selection = columns or (_NO_COLUMN,)
        self._hub = hub
        self.loop = asyncio.get_running_loop()
        self._room = threading.Semaphore(_AHEAD)
        self._ended = threading.Event()
        self._stream: PortStream | None = None
        threading.Thread(target=self._run, name="scope stream", daemon=True).start()

    @property
    def is_open(self) -> bool:
        """Tell whether it hears of each cycle."""
        return self.schema is not None and not self.trouble

    def close(self) -> None:
        """End it, without waiting for it."""
        self._ended.set()
        self._room.release()
        if self._stream is not None:
            self._stream.close()

    def taken(self) -> None:
        """Make room for another batch."""
        self._room.release()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                self._read()
                trouble = "the stream has ended"
            except RtcfError as error:
                trouble = str(error)
            except Exception as error:  # pages would wait for a thread that has ended
                trouble = f"the stream has failed: {error!r}"
            if not self._ended.is_set():
                self._call(self._hub.trouble, self, trouble)
                self._ended.wait(_AGAIN_S)

    def _read(self) -> None:
        with self._hub.client.watch_ports(
            self._selection, self._hub.runner, allow_missing=True
        ) as stream:
            self._stream = stream
            if self._ended.is_set():  # before close() could see it
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
    """The tabs of one runner and what they watch."""

    def __init__(self, client: rtcf.Client, runner: str) -> None:
        self.client = client
        self.runner = runner
        self.memory = Memory(_MEMORY)
        self.base_ns: int | None = None
        self.told = 0  # cycles
        self.since = 0  # `told` when somebody began to watch
        self._tabs: dict[Listener, None] = {}  # in the order in which they came
        self._reader: _Reader | None = None  # whose cycles are told
        self._next: _Reader | None = None  # of another selection, until it takes over
        self._held: deque[PortBatch] = deque()  # of that
        self._waits = False  # others are wanted than `_next` will have
        self._seen = (-1, 0)  # the last cycle told, and its stamp
        self._lost = 0  # cycles of batches that held none
        self._overlap = False

    @property
    def is_empty(self) -> bool:
        """Tell whether nobody misses it."""
        return not self._tabs and not self.memory

    def join(self, tab: Listener) -> None:
        """Begin to tell a tab; call `changed` when its columns are others."""
        self._tabs[tab] = None
        self.changed()

    def leave(self, tab: Listener) -> None:
        """Tell it nothing more; without tabs nothing is watched."""
        self._tabs.pop(tab, None)
        self.changed()

    def close(self) -> None:
        """End the streams."""
        for reader in (self._reader, self._next):
            if reader is not None:
                reader.close()
        self._reader = self._next = None
        self._held.clear()
        # What goes by unwatched is missed by nobody.
        self._seen, self._lost, self.since = (-1, 0), 0, self.told

    def changed(self) -> None:
        """Watch what the tabs want now."""
        if not any(tab.wants for tab in self._tabs):
            self.close()
            self._tell_trouble()
            return
        # Of values for which a cycle has no room those of the first tabs stay.
        columns = tuple(dict.fromkeys(each for tab in self._tabs for each in tab.columns))
        columns = columns[:_MOST_COLUMNS]
        newest = self._next or self._reader
        if newest is None:
            self._reader = _Reader(self, columns)
        elif newest.columns == frozenset(columns):
            self._waits = False
            if newest.schema is not None:
                self._tell_schema(newest.schema)
        elif self._next is not None and self._is_coming(self._next):
            self._waits = True
        else:
            self._close_next()
            self._next = _Reader(self, columns)
        self._tell_trouble()

    def opened(self, reader: _Reader, schema: PortSchema) -> None:
        """Take notice of what a reader will tell."""
        if reader not in (self._reader, self._next):
            return
        if not reader.is_open:
            reader.opened = reader.loop.time()
            if reader is self._next:
                reader.loop.call_later(_STANDS_S, self._look_again)
        reader.schema, reader.trouble = schema, ""
        if reader is (self._next or self._reader):
            self._tell_schema(schema)
        self._tell_trouble()

    def take(self, reader: _Reader, batch: PortBatch) -> None:
        """Take what a reader read."""
        if reader is self._next:
            if not self._held:
                reader.loop.call_later(_PATIENCE_S, self._take_over, reader)
            self._held.append(batch)
        else:
            reader.taken()
            if reader is self._reader:
                self._tell(batch)
        if self._held and self._is_due(self._held[0]):
            self._take_over(self._next)

    def trouble(self, reader: _Reader, text: str) -> None:
        """Take notice of what is wrong with a reader."""
        if reader not in (self._reader, self._next):
            return
        reader.trouble = text
        if reader is self._reader:
            self._overlap = True  # what comes next may have been told, or be later
        self._tell_trouble()
        if self._held:
            self._take_over(self._next)
        self._look_again()

    def _is_coming(self, reader: _Reader) -> bool:
        """Tell whether a reader is about to tell its first cycle."""
        if reader.trouble:
            return False
        return (
            reader.schema is None
            or bool(self._held)
            or reader.loop.time() - reader.opened < _STANDS_S
        )

    def _look_again(self) -> None:
        if self._waits:
            self._waits = False
            self.changed()

    def _is_due(self, first: PortBatch) -> bool:
        """Tell whether the present reader has told all that is before the next one's batch."""
        cycle, stamp = self._seen
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
            reader.taken()
            self._tell(batch)
        self._tell_trouble()
        self._look_again()

    def _close_next(self) -> None:
        if self._next is not None:
            self._next.close()
            self._next = None
        self._held.clear()

    def _tell(self, batch: PortBatch) -> None:
        lost = batch.lost + self._lost
        if not len(batch):
            self._lost = lost
            return
        chunk = self._unseen(batch) if self._overlap else Chunk(batch, self.told, lost)
        if not len(chunk):
            return
        self._lost = 0
        self._seen = (int(chunk.cycles[-1]), int(chunk.stamps_ns[-1]))
        if self.base_ns is None:
            self.base_ns = int(chunk.stamps_ns[0])
        self.told = chunk.end
        self.memory.add(chunk)
        for tab in tuple(self._tabs):
            try:
                tab.take(chunk)
            except Exception as error:  # of one page: not of the others
                print(f"rtcf-scope: a page of {self.runner} failed: {error!r}", file=sys.stderr)

    def _unseen(self, batch: PortBatch) -> Chunk:
        """Return what the stream before has not told already, which is all after a restart."""
        cycle, stamp = self._seen
        seen = (batch.cycles <= cycle) & (batch.stamps_ns <= stamp)
        skip = int(seen.sum())
        if skip < len(batch):
            self._overlap = False
        lost = 0 if skip or cycle < 0 else max(batch.first_cycle - cycle - 1, 0)
        return Chunk(batch.part(skip) if skip else batch, self.told, lost)

    def _tell_schema(self, schema: PortSchema) -> None:
        for tab in tuple(self._tabs):
            tab.know(schema)

    def _tell_trouble(self) -> None:
        """Tell each tab what is wrong with the stream that has its columns."""
        now = "" if self._reader is None else self._reader.trouble
        for tab in tuple(self._tabs):
            text = now
            if self._next is not None and self._reader is not None and not text:
                text = "" if self._reader.columns.issuperset(tab.columns) else self._next.trouble
            tab.trouble(text)
