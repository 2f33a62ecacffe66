"""The process of an executor: our own child, or one that an earlier rtcfd left running.

Owned by the Executor.  The kernel reports the exit status of a child, but only the
end of another process.  The end of these objects does not end the process, because
executors outlive the rtcfd that started them.
"""

import asyncio
import contextlib
import os
import signal
import subprocess
from dataclasses import dataclass

from rtcf_shared.processes import is_frozen


@dataclass(frozen=True)
class End:
    """The end of a process; `status` is as in `returncode`, None if it cannot be known."""

    status: int | None = None

    def __str__(self) -> str:
        if self.status is None:
            return "ended (with unknown exit status, as it is not a child of this rtcfd)"
        return describe_exit(self.status)


class Process:
    """A process, watched through a pidfd."""

    def __init__(self, pid: int) -> None:
        """Raises OSError if the process does not exist (any more)."""
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)
        self._ended = asyncio.Event()
        self._end: End | None = None
        self._loop = asyncio.get_running_loop()
        # Readable when the process has ended, see pidfd_open(2).
        self._loop.add_reader(self._descriptor, self.release)

    @property
    def end(self) -> End | None:
        """The end of the process; None while it runs."""
        return self._end

    @property
    def frozen(self) -> bool:
        """Whether a signal or a debugger has stopped it."""
        return self._end is None and is_frozen(self.pid)

    async def wait(self) -> End:
        """Wait until it has ended."""
        await self._ended.wait()
        return self._end or End()

    def signal(self, number: signal.Signals) -> None:
        """Send a signal; does nothing if the process has ended."""
        if self._end is None:
            # By descriptor: another process may have the same pid by now.
            with contextlib.suppress(ProcessLookupError):  # ended, but not reported to us yet
                signal.pidfd_send_signal(self._descriptor, number)

    def release(self) -> None:
        """Stop watching the process."""
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
    """Return a phrase on how a process ended, from its `returncode`."""
    if status >= 0:
        return f"ended with exit status {status}"
    return f"was killed by {describe_signal(-status)}"


def describe_signal(number: int) -> str:
    """Return the name of a signal and its meaning."""
    try:
        return f"{signal.Signals(number).name} ({signal.strsignal(number)})"
    except ValueError:
        return f"signal {number}"
