"""State, events and log records of a runner for its tabs.

The state is sent every second, events and log records as they arrive.  Each of the three has a
thread while there are tabs.
"""

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import rtcf
from rtcf.streams.numbered import Lost
from rtcf_shared.errors import RtcfError

from rtcf_scope import catalog
from rtcf_scope.hub import Listener

_EVERY_S = 1.0
_MOST_RECORDS = 100  # log records per _EVERY_S; the rest is counted


class StatusFeed:
    """Sends state, events and log records of one runner to its tabs; lives in the event loop."""

    def __init__(self, client: rtcf.Client, runner: str) -> None:
        self._client = client
        self._runner = runner
        self._tabs: set[Listener] = set()
        self._ended: threading.Event | None = None
        self._streams: list[Any] = []

    @property
    def is_empty(self) -> bool:
        """Return whether there are no tabs."""
        return not self._tabs

    def join(self, tab: Listener) -> None:
        """Add a tab; the first one starts the threads."""
        self._tabs.add(tab)
        if self._ended is None:
            self._ended = threading.Event()
            for follow in (self._follow_state, self._follow_events, self._follow_logs):
                words = (follow, self._ended, asyncio.get_running_loop())
                threading.Thread(target=self._run, args=words, daemon=True).start()

    def leave(self, tab: Listener) -> None:
        """Remove a tab; the last one ends the threads."""
        self._tabs.discard(tab)
        if not self._tabs:
            self.close()

    def close(self) -> None:
        """End the threads, without waiting."""
        if self._ended is not None:
            self._ended.set()
            self._ended = None
        for stream in tuple(self._streams):
            stream.close()
        self._streams.clear()

    def _run(
        self,
        follow: Callable[[threading.Event, Callable[[dict[str, Any]], None]], None],
        ended: threading.Event,
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        def send(message: dict[str, Any]) -> None:
            try:
                loop.call_soon_threadsafe(self._send_all, ended, message)
            except RuntimeError:
                ended.set()  # the server has ended

        while not ended.is_set():
            try:
                follow(ended, send)
            except (RtcfError, ValueError) as error:  # ValueError: the name is not valid UTF-8
                send({"kind": "state", "state": "unknown", "status": str(error)})
            ended.wait(_EVERY_S)

    def _send_all(self, ended: threading.Event, message: dict[str, Any]) -> None:
        if ended.is_set():
            return
        for tab in tuple(self._tabs):
            tab.send(message)

    @contextlib.contextmanager
    def _closed_with(self, stream: Any) -> Iterator[None]:
        """Register a stream for close()."""
        self._streams.append(stream)
        try:
            yield
        finally:
            with contextlib.suppress(ValueError):  # closed meanwhile
                self._streams.remove(stream)

    def _follow_state(self, ended: threading.Event, send: Callable[[dict[str, Any]], None]) -> None:
        for status in self._client.get_status(self._runner).runners:
            send({"kind": "state"} | catalog.runner(status))

    def _follow_events(
        self, ended: threading.Event, send: Callable[[dict[str, Any]], None]
    ) -> None:
        with self._client.watch_events([self._runner]) as stream, self._closed_with(stream):
            if ended.is_set():
                return
            for found in stream:
                if isinstance(found, Lost):
                    send(catalog.lost(found.count, "events"))
                else:
                    send(catalog.event(found))

    def _follow_logs(self, ended: threading.Event, send: Callable[[dict[str, Any]], None]) -> None:
        with (
            self._client.watch_logs(self._runner, level="info") as stream,
            self._closed_with(stream),
        ):
            if ended.is_set():
                return
            begin, sent, dropped = time.monotonic(), 0, 0
            for found in stream:
                if time.monotonic() - begin > _EVERY_S:
                    if dropped:
                        send(catalog.lost(dropped, "log records"))
                    begin, sent, dropped = time.monotonic(), 0, 0
                if isinstance(found, Lost):
                    dropped += found.count
                elif sent < _MOST_RECORDS:
                    sent += 1
                    send(catalog.record(found))
                else:
                    dropped += 1
