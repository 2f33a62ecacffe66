"""One executor process and the link to it.

Owned by its Runner from launch to end.  It never restarts: a new start is a
new object.
"""

import asyncio
import logging
import signal
from collections.abc import Callable
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire

from rtcfd.command import ExecutorCommand
from rtcfd.errors import FailedPrecondition, Refusal, Unavailable
from rtcfd.link import Link, Progress, Unasked

log = logging.getLogger(__name__)

CONNECT_TIMEOUT_S = 10.0
QUERY_TIMEOUT_S = 5.0
STOP_TIMEOUT_S = 10.0  # for the loop to end and the stop hooks to return
EXIT_TIMEOUT_S = 5.0  # from the exit frame, and then from SIGTERM, to the end
_RETRY_S = 0.01


def describe_exit(status: int) -> str:
    """Return how a process ended, from its `returncode`."""
    if status >= 0:
        return f"ended with exit status {status}"
    try:
        number = signal.Signals(-status)
    except ValueError:
        return f"was killed by signal {-status}"
    return f"was killed by {number.name} ({signal.strsignal(number)})"


class Executor:
    """A running executor.  `on_end` is called once, with how it ended."""

    def __init__(
        self,
        runner: str,
        process: asyncio.subprocess.Process,
        socket: Path,
        on_unasked: Unasked,
        on_end: Callable[["Executor", str], None],
    ) -> None:
        self.pid = process.pid
        self.expected = False  # its end was asked for
        self._peer = f"executor of {runner} (pid {process.pid})"
        self._process = process
        self._socket = socket
        self._on_unasked = on_unasked
        self._on_end = on_end
        self._link: Link | None = None
        self._watching: asyncio.Task[None] | None = None

    @classmethod
    async def launch(
        cls,
        runner: str,
        command: ExecutorCommand,
        on_unasked: Unasked,
        on_end: Callable[["Executor", str], None],
    ) -> "Executor":
        """Start the process and connect; a failure leaves no process behind."""
        socket = command.socket(runner)
        await retire_orphan(runner, socket)
        try:
            # An own session: Ctrl-C at rtcfd's terminal reaches rtcfd alone, which
            # then stops the loops in order.
            process = await asyncio.create_subprocess_exec(
                *command.arguments(runner),
                stdin=asyncio.subprocess.DEVNULL,
                stdout=2,
                env=command.environment(),
                start_new_session=True,
            )
        except OSError as error:
            raise FailedPrecondition(f"cannot run {command.binary}: {error.strerror}") from None
        executor = cls(runner, process, socket, on_unasked, on_end)
        try:
            await executor._attach()
        except BaseException:
            if process.returncode is None:
                process.kill()
            await process.wait()
            raise
        executor._watching = asyncio.create_task(executor._watch())
        return executor

    async def request(
        self,
        request: wire.Request,
        timeout_s: float | None = QUERY_TIMEOUT_S,
        on_progress: Progress | None = None,
    ) -> wire.Response:
        """Send one request; see Link.request."""
        if self._link is None:
            raise Unavailable(f"{self._peer} is not connected")
        return await self._link.request(request, timeout_s, on_progress)

    async def shut_down(self) -> None:
        """Stop the loop in order, then end the process, by force if it must be."""
        self.expected = True
        try:
            await self.request(wire.Request(stop=wire.Stop()), STOP_TIMEOUT_S)
            await self.request(wire.Request(exit=wire.Exit()), EXIT_TIMEOUT_S)
        except Refusal as refusal:
            log.warning("%s: no orderly end: %s", self._peer, refusal)
            self._signal(signal.SIGTERM)
        for harder in (signal.SIGTERM, signal.SIGKILL):
            try:
                await asyncio.wait_for(self._process.wait(), EXIT_TIMEOUT_S)
                break
            except TimeoutError:
                log.warning("%s does not end: sending %s", self._peer, harder.name)
                self._signal(harder)
        if self._watching is not None:
            await self._watching

    def _signal(self, number: signal.Signals) -> None:
        if self._process.returncode is None:
            self._process.send_signal(number)

    async def _attach(self) -> None:
        """Connect and say hello, within the deadline."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + CONNECT_TIMEOUT_S
        while True:
            if self._process.returncode is not None:
                raise FailedPrecondition(
                    f"{self._peer} {describe_exit(self._process.returncode)} before it served; "
                    "its reason is in rtcfd's log"
                )
            try:
                link = await Link.connect(self._peer, self._socket, self._on_unasked)
                break
            except (FileNotFoundError, ConnectionRefusedError):
                if loop.time() > deadline:
                    raise Unavailable(
                        f"{self._peer} does not serve {self._socket} "
                        f"{CONNECT_TIMEOUT_S:g} s after its start"
                    ) from None
                await asyncio.sleep(_RETRY_S)
        try:
            await link.hello(max(deadline - loop.time(), 1.0))
        except BaseException:
            await link.close()
            raise
        self._link = link

    async def _watch(self) -> None:
        """See the process end; a link lost before that is made anew."""
        ending = asyncio.create_task(self._process.wait())
        while self._link is not None:
            lost = asyncio.create_task(self._link.ended.wait())
            await asyncio.wait({ending, lost}, return_when=asyncio.FIRST_COMPLETED)
            lost.cancel()
            if not ending.done():
                # A process that dies closes its socket a little before it can be reaped.
                await asyncio.wait({ending}, timeout=1.0)
            if ending.done() or self.expected:
                break
            log.error("%s; connecting again", self._link.problem or f"{self._peer} hung up")
            try:
                await self._attach()
            except Refusal as refusal:
                log.error("%s: ending it", refusal)
                self._signal(signal.SIGTERM)
                break
        status = await ending
        if self._link is not None:
            await self._link.close()
        self._socket.unlink(missing_ok=True)
        self._on_end(self, describe_exit(status))


async def retire_orphan(runner: str, socket: Path) -> None:
    """End an executor that an earlier rtcfd left at this socket; remove a stale socket."""
    try:
        link = await Link.connect(f"left-over executor of {runner}", socket, lambda _: None)
    except FileNotFoundError:
        return
    except ConnectionRefusedError:
        socket.unlink(missing_ok=True)
        return
    log.warning("runner %s: ending the executor that an earlier rtcfd left running", runner)
    try:
        await link.hello(QUERY_TIMEOUT_S)
        await link.request(wire.Request(exit=wire.Exit()), STOP_TIMEOUT_S)
        await asyncio.wait_for(link.ended.wait(), EXIT_TIMEOUT_S)
    except (Refusal, TimeoutError) as problem:
        raise FailedPrecondition(
            f"an executor that an earlier rtcfd left at {socket} does not end: {problem}"
        ) from None
    finally:
        await link.close()
    socket.unlink(missing_ok=True)
