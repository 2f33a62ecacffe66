"""The events of a node: signals, and the messages of its leases.

The main thread owns the queue and handles its events. A thread for each lease adds the messages.
"""

import signal
import threading
import time
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any

import rtcf


@dataclass(frozen=True)
class EndRequest:
    """A request to end the process."""

    why: str = ""  # empty = a signal


@dataclass(frozen=True)
class LeaseLost:
    """A lease ended without its last message."""

    error: rtcf.RtcfError


@dataclass(frozen=True)
class MasterBack:
    """The node is registered again after a restart of the ROS master."""


class Inbox:
    """A queue of events; signal handlers add to it, too."""

    def __init__(self) -> None:
        self._queue: SimpleQueue[Any] = SimpleQueue()
        self.end_requested = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._signalled)

    def read(self, lease: rtcf.Lease) -> None:
        """Add the messages of a lease, in a thread of their own."""
        threading.Thread(target=self._read, args=(lease,), daemon=True).start()

    def get(self, timeout_s: float | None = None) -> Any:
        """Return the next event; None after the timeout."""
        try:
            return self._queue.get(timeout=timeout_s)
        except Empty:
            return None

    def pause(self, seconds: float) -> bool:
        """Wait, at most until a request to end; return whether there is one."""
        others = []
        deadline = time.monotonic() + seconds
        while not self.end_requested and (left := deadline - time.monotonic()) > 0:
            event = self.get(left)
            if event is not None and not isinstance(event, EndRequest):
                others.append(event)
        for event in others:
            self._queue.put(event)
        return self.end_requested

    def request_end(self, why: str) -> None:
        """Request the end of the process, as a signal does.  Any thread."""
        self.end_requested = True
        self._queue.put(EndRequest(why))

    def master_back(self) -> None:
        """Report that the node is registered again.  Any thread."""
        self._queue.put(MasterBack())

    def _signalled(self, _: int, __: Any) -> None:
        self.end_requested = True
        self._queue.put(EndRequest())

    def _read(self, lease: rtcf.Lease) -> None:
        try:
            for message in lease:
                self._queue.put(message)
        except rtcf.RtcfError as error:
            self._queue.put(LeaseLost(error))
