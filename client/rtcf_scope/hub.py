"""The one stream of a runner that all its tabs share, and the last of what it told.

A thread reads the stream; all else happens in the event loop.
"""

import asyncio
import threading
from typing import Any, Protocol

import rtcf
from rtcf.streams.ports import PortBatch, PortStream
from rtcf_shared.errors import RtcfError

from rtcf_scope.chunk import Chunk, Memory, column_of

_AHEAD = 32  # batches that the reader may be before the event loop
_AGAIN_S = 1.0
_MEMORY = 64 * 1024 * 1024


class Listener(Protocol):
    """A tab."""

    columns: frozenset[str]

    def take(self, chunk: Chunk) -> None:
        """Take cycles; does not wait."""

    def tell(self, message: dict[str, Any]) -> None:
        """Take a text message; does not wait."""


class _Reader:
    """One stream and its thread."""

    def __init__(self, hub: "Hub", columns: frozenset[str]) -> None:
        self.columns = columns
        self._hub = hub
        self._loop = asyncio.get_running_loop()
        self._room = threading.Semaphore(_AHEAD)
        self._ended = threading.Event()
        self._stream: PortStream | None = None
        threading.Thread(target=self._run, name="scope stream", daemon=True).start()

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
        trouble = ""
        while not self._ended.is_set():
            try:
                self._read()
                trouble = "the stream has ended"
            except RtcfError as error:
                trouble = str(error)
            if not self._ended.is_set():
                self._call(self._hub.trouble, self, trouble)
                self._ended.wait(_AGAIN_S)

    def _read(self) -> None:
        with self._hub.client.watch_ports(sorted(self.columns), self._hub.runner) as stream:
            self._stream = stream
            if self._ended.is_set():  # before close() could see it
                return
            self._call(self._hub.trouble, self, "")
            for batch in stream:
                self._room.acquire()
                if self._ended.is_set():
                    return
                self._call(self._hub.take, self, batch)

    def _call(self, *words: Any) -> None:
        try:
            self._loop.call_soon_threadsafe(*words)
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
        self._tabs: set[Listener] = set()
        self._reader: _Reader | None = None  # whose cycles are told
        self._next: _Reader | None = None  # of another selection, until its first ones come
        self._seen = (-1, 0)  # the last cycle told, and its stamp
        self._overlap = False
        self._trouble = ""

    def join(self, tab: Listener) -> None:
        """Begin to tell a tab; call `changed` when its columns are others."""
        self._tabs.add(tab)
        tab.tell({"kind": "trouble", "text": self._trouble})
        self.changed()

    def leave(self, tab: Listener) -> None:
        """Tell it nothing more; without tabs nothing is watched."""
        self._tabs.discard(tab)
        self.changed()

    def close(self) -> None:
        """End the streams."""
        for reader in (self._reader, self._next):
            if reader is not None:
                reader.close()
        self._reader = self._next = None

    def changed(self) -> None:
        """Watch what the tabs want now."""
        columns = frozenset[str]().union(*(tab.columns for tab in self._tabs))
        if not columns:
            self.close()
            return
        newest = self._next or self._reader
        if newest is not None and newest.columns == columns:
            return
        if self._next is not None:
            self._next.close()
        reader = _Reader(self, columns)
        if self._reader is None:
            self._reader = reader
            self._overlap = True
        else:
            self._next = reader

    def take(self, reader: _Reader, batch: PortBatch) -> None:
        """Take what a reader read."""
        reader.taken()
        if reader is self._next:
            # It has begun before the old one ends, so that no cycle is missed.
            assert self._reader is not None
            self._reader.close()
            self._reader, self._next = reader, None
            self._overlap = True
        if reader is not self._reader:
            return
        chunk = Chunk(batch, self.told, batch.lost)
        if self._overlap and len(batch):
            chunk = self._unseen(batch)
        if not len(chunk):
            return
        self._seen = (int(chunk.cycles[-1]), int(chunk.stamps_ns[-1]))
        if self.base_ns is None:
            self.base_ns = int(chunk.stamps_ns[0])
        self.told = chunk.end
        self.memory.add(chunk)
        for tab in tuple(self._tabs):
            tab.take(chunk)

    def _unseen(self, batch: PortBatch) -> Chunk:
        """Return what the stream before has not told already, which is all after a restart."""
        cycle, stamp = self._seen
        seen = (batch.cycles <= cycle) & (batch.stamps_ns <= stamp)
        skip = int(seen.sum())
        if skip < len(batch):
            self._overlap = False
        lost = 0 if skip or cycle < 0 else max(batch.first_cycle - cycle - 1, 0)
        return Chunk(batch.part(skip) if skip else batch, self.told, lost)

    def trouble(self, reader: _Reader, text: str) -> None:
        """Tell the tabs what is wrong, or that nothing is any more."""
        if reader not in (self._reader, self._next) or text == self._trouble:
            return
        self._trouble = text
        for tab in tuple(self._tabs):
            tab.tell({"kind": "trouble", "text": text})


def columns_of(names: list[str]) -> frozenset[str]:
    """Return what has to be watched for some traces."""
    return frozenset(column_of(name) for name in names)
