"""Notifies systemd: READY, STATUS, STOPPING, and the watchdog's pings.

Does nothing if systemd has not started rtcfd (no NOTIFY_SOCKET).
"""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable

from rtcfd.common.background import log_failure

_EXTEND_EVERY_S = 10
_ASKING_TIMEOUT_S = 10.0  # of systemctl, which is slow while the machine shuts down


async def machine_goes_down() -> bool:
    """Return whether the machine is shutting down, according to systemd.

    Loops that run then resume after the next boot.  Loops that an administrator ends do not.
    """
    if not os.environ.get("NOTIFY_SOCKET"):
        return False
    try:
        process = await asyncio.create_subprocess_exec(
            "systemctl", "is-system-running",
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
    except OSError:
        return False
    try:
        async with asyncio.timeout(_ASKING_TIMEOUT_S):
            return (await process.communicate())[0].strip() == b"stopping"
    except TimeoutError:
        process.kill()
        await process.wait()
        return False


def _sender() -> Callable[[str], object]:
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return lambda _: None
    # The name of an abstract socket begins with a zero byte.
    to = "\0" + address[1:] if address.startswith("@") else address
    to_systemd = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)

    def send(text: str) -> None:
        # Go on if systemd does not listen any more.
        with contextlib.suppress(OSError):
            to_systemd.sendto(text.encode(), to)

    return send


class Notify:
    """The notifications to the service manager."""

    def __init__(self) -> None:
        self._send = _sender()
        self._watchdog: asyncio.Task[None] | None = None
        self._starting: asyncio.Task[None] | None = None

    def starting(self) -> None:
        """Extend the start timeout repeatedly, until ready() is called."""
        self._starting = log_failure(asyncio.create_task(self._extend()), "asking systemd for time")

    def ready(self, status: str) -> None:
        """Report that rtcfd serves clients, and begin to feed the watchdog."""
        if self._starting is not None:
            self._starting.cancel()
        self._send(f"READY=1\nSTATUS={status}")
        usec = os.environ.get("WATCHDOG_USEC", "")
        pid = os.environ.get("WATCHDOG_PID", str(os.getpid()))
        if usec.isdigit() and pid == str(os.getpid()):
            self._watchdog = log_failure(
                asyncio.create_task(self._feed(int(usec) / 2e6)), "the watchdog's feeding"
            )

    def status(self, status: str) -> None:
        """Report the status in one line."""
        self._send(f"STATUS={status}")

    def stopping(self, status: str) -> None:
        """Report that the shutdown has begun."""
        self._send(f"STOPPING=1\nSTATUS={status}")

    def close(self) -> None:
        """Stop all repeated notifications."""
        for task in (self._watchdog, self._starting):
            if task is not None:
                task.cancel()

    async def _extend(self) -> None:
        while True:
            # Counted from now, see sd_notify(3): a hanging event loop requests no more time.
            self._send(f"EXTEND_TIMEOUT_USEC={2 * _EXTEND_EVERY_S * 1_000_000}")
            await asyncio.sleep(_EXTEND_EVERY_S)

    async def _feed(self, every_s: float) -> None:
        # From the event loop, because the watchdog checks that the event loop runs.
        while True:
            self._send("WATCHDOG=1")
            await asyncio.sleep(every_s)
