"""The process of an executor: our own child, or one that an earlier rtcfd left running.

Owned by the Executor.  Of a child the kernel tells how it ended; of another
process only that it did.  Nothing here ends a process that is merely forgotten:
executors outlive the rtcfd that started them.
"""

import asyncio
import os
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class End:
    """How a process ended: `status` as in `returncode`, None if nobody can know."""

    status: int | None = None

    def __str__(self) -> str:
        if self.status is None:
            return "ended (no child of this rtcfd: its exit status is unknown)"
        return describe_exit(self.status)


class Process:
    """A process, watched through a pidfd."""

    def __init__(self, pid: int) -> None:
        """Raises OSError, if there is none (any more)."""
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)
        self._ended = asyncio.Event()
        self._end: End | None = None
        self._loop = asyncio.get_running_loop()
        # Readable when the process has ended, see pidfd_open(2).
        self._loop.add_reader(self._descriptor, self.release)

    @property
    def end(self) -> End | None:
        """How it ended; None while it runs."""
        return self._end

    @property
    def frozen(self) -> bool:
        """Tell whether a signal or a debugger has stopped it: it does nothing."""
        if self._end is not None:
            return False
        try:
            text = Path(f"/proc/{self.pid}/stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        return text.rpartition(")")[2].split()[0] in ("T", "t")

    async def wait(self) -> End:
        """Wait until it has ended."""
        await self._ended.wait()
        return self._end or End()

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; nothing happens if it has ended."""
        if self._end is None:
            # By descriptor: never to another process that has got the number since.
            signal.pidfd_send_signal(self._descriptor, number)

    def release(self) -> None:
        """Watch it no more."""
        if self._end is None:
            self._loop.remove_reader(self._descriptor)
            os.close(self._descriptor)
            self._end = self._how_it_ended()
            self._ended.set()

    def _how_it_ended(self) -> End:
        return End()


class Child(Process):
    """A process that this rtcfd started."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        super().__init__(process.pid)
        self._process = process

    def _how_it_ended(self) -> End:
        return End(self._process.poll())


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
