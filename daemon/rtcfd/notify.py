"""What systemd is told: READY, STATUS, STOPPING, and the watchdog's pings.

Does nothing where rtcfd was not started by systemd (no NOTIFY_SOCKET).
"""

import asyncio
import os
from collections.abc import Callable


def _sender() -> Callable[[str], object]:
    if not os.environ.get("NOTIFY_SOCKET"):
        return lambda _: None
    import systemd.daemon

    return systemd.daemon.notify  # type: ignore[no-any-return]


class Notify:
    """The service manager's ear."""

    def __init__(self) -> None:
        self._send = _sender()
        self._watchdog: asyncio.Task[None] | None = None

    def ready(self, status: str) -> None:
        """Say that clients are served, and begin to feed the watchdog."""
        self._send(f"READY=1\nSTATUS={status}")
        usec = os.environ.get("WATCHDOG_USEC", "")
        pid = os.environ.get("WATCHDOG_PID", str(os.getpid()))
        if usec.isdigit() and pid == str(os.getpid()):
            self._watchdog = asyncio.create_task(self._feed(int(usec) / 2e6))

    def status(self, status: str) -> None:
        """Say what is going on, in a line."""
        self._send(f"STATUS={status}")

    def stopping(self, status: str) -> None:
        """Say that the end has begun."""
        self._send(f"STOPPING=1\nSTATUS={status}")

    def close(self) -> None:
        """Feed the watchdog no more."""
        if self._watchdog is not None:
            self._watchdog.cancel()

    async def _feed(self, every_s: float) -> None:
        # From the event loop itself: the watchdog is to see that this one runs.
        while True:
            self._send("WATCHDOG=1")
            await asyncio.sleep(every_s)
