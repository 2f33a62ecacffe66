"""The process of an executor: our own child, or one that an earlier rtcfd left running.

Owned by the Executor.  Of a child the kernel tells how it ended; of another
process only that it did.
"""

import asyncio
import os
import signal
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class End:
    """How a process ended: `status` as in `returncode`, None if nobody can know."""

    status: int | None = None

    def __str__(self) -> str:
        if self.status is None:
            return "ended (no child of this rtcfd: its exit status is unknown)"
        return describe_exit(self.status)


class Process(Protocol):
    """What an Executor needs of its process."""

    pid: int

    @property
    def end(self) -> End | None:
        """How it ended; None while it runs."""

    async def wait(self) -> End:
        """Wait until it has ended."""

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; nothing happens if it has ended."""


class Child:
    """A process that this rtcfd started."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.pid = process.pid
        self._process = process

    @property
    def end(self) -> End | None:
        """How it ended; None while it runs."""
        status = self._process.returncode
        return None if status is None else End(status)

    async def wait(self) -> End:
        """Wait until it has ended."""
        return End(await self._process.wait())

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; nothing happens if it has ended."""
        if self._process.returncode is None:
            self._process.send_signal(number)


class Stranger:
    """A process that is no child of ours, watched through a pidfd."""

    def __init__(self, pid: int) -> None:
        """Raises OSError, if there is none (any more)."""
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)
        self._ended = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        # Readable when the process has ended, see pidfd_open(2).
        self._loop.add_reader(self._descriptor, self._on_end)

    @property
    def end(self) -> End | None:
        """How it ended; None while it runs."""
        return End() if self._ended.is_set() else None

    async def wait(self) -> End:
        """Wait until it has ended."""
        await self._ended.wait()
        return End()

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; nothing happens if it has ended."""
        if not self._ended.is_set():
            # By descriptor: never to another process that has got the number since.
            signal.pidfd_send_signal(self._descriptor, number)

    def release(self) -> None:
        """Watch it no more."""
        if not self._ended.is_set():
            self._on_end()

    def _on_end(self) -> None:
        self._loop.remove_reader(self._descriptor)
        os.close(self._descriptor)
        self._ended.set()


def describe_exit(status: int) -> str:
    """Return how a process ended, from its `returncode`."""
    if status >= 0:
        return f"ended with exit status {status}"
    return f"was killed by {describe_signal(-status)}"


def describe_signal(number: int) -> str:
    """Return the name of a signal and what it means."""
    try:
        return f"{signal.Signals(number).name} ({signal.strsignal(number)})"
    except ValueError:
        return f"signal {number}"
