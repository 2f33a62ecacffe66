"""One executor process and the link to it.

Owned by its Runner from its launch or adoption to its end.  An executor never
restarts: each start creates a new object.
"""

import asyncio
import contextvars
import logging
import os
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import errors_pb2, ports_pb2
from rtcf_shared.processes import is_frozen

from rtcfd import VERSION
from rtcfd.common.background import log_failure
from rtcfd.common.build_id import build_id
from rtcfd.common.errors import FailedPrecondition, RequestError, Silent, Unavailable
from rtcfd.common.limits import Limits
from rtcfd.executor import left_over, stop_socket
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.flight_recorder import FlightRecorder, Note, Trace
from rtcfd.executor.link import (
    ACCESS_PROTOCOL,
    LIMITS_PROTOCOL,
    PORTS_PROTOCOL,
    PROTOCOL,
    STATISTICS_PROTOCOL,
    Link,
    OnAnswer,
    OnPorts,
    Progress,
    Unasked,
)
from rtcfd.executor.watched_process import Child, End, Process

log = logging.getLogger(__name__)

CONNECT_TIMEOUT_S = 10.0
QUERY_TIMEOUT_S = 5.0
STOP_TIMEOUT_S = 10.0  # for the loop to end and the stop hooks to return, at least
_STUCK_S = 1.0  # from the timeout of a hook to the answer
EXIT_TIMEOUT_S = 5.0  # from the exit message, and then from SIGTERM, to the end
FROZEN_S = 1.0  # for a frozen executor to continue
_FROZEN_LOOK_S = 0.05
_RETRY_S = 0.01
_RENEW_S = 3.0  # longest time in which an executor recreates a removed socket, or ends
_RENEW_LOOK_S = 0.1

OnEnd = Callable[["Executor", End], None]


class Executor:
    """A running executor.  Calls `on_end` once, with the way in which it ended."""

    def __init__(
        self,
        runner: str,
        process: Process,
        command: ExecutorCommand,
        on_unasked: Unasked,
        on_end: OnEnd,
    ) -> None:
        self.pid = process.pid
        self.expected = False  # rtcfd has requested its end
        self.ended = asyncio.Event()  # set after on_end
        self.verdict = ""  # the cause of its end, or the reason for which rtcfd requested it
        self.safe = True  # see Verdict.safe
        self.version = ""  # of rtcf
        self.unconfigured = False  # no rtcfd has sent it the runner's settings yet
        self.foreign = ""  # why it accepts only the requests stop and exit; empty = it accepts all
        self.other_build = False  # it was built otherwise than the present program of this version
        self._protocol = 0
        self._runner = runner
        self._peer = f"executor of {runner} (pid {process.pid})"
        self._process = process
        self._socket, *_ = self._sockets = command.sockets(runner)
        self._on_unasked = on_unasked
        self._on_end = on_end
        self._link: Link | None = None
        self._recorder: FlightRecorder | None = None
        self.frames: int | None = None  # descriptor of the frames, for incidents/frame_file.py
        self._watching: asyncio.Task[None] | None = None

    @classmethod
    async def launch(
        cls, runner: str, command: ExecutorCommand, on_unasked: Unasked, on_end: OnEnd
    ) -> "Executor":
        """Start the process and connect; a failure leaves no process behind."""
        try:
            # An own session: Ctrl-C at rtcfd's terminal reaches only rtcfd, which
            # then stops the loops in order.  restore_signals=False keeps SIGPIPE
            # ignored, so that a loop survives the reader of our stderr.  Not
            # asyncio's subprocess, which is killed when the event loop closes.
            started = subprocess.Popen(
                command.arguments(runner),
                stdin=subprocess.DEVNULL,
                stdout=2,
                env=command.environment(),
                start_new_session=True,
                restore_signals=False,
            )
        except OSError as error:
            raise FailedPrecondition(
                f"cannot run {command.binary}: {error.strerror}", errors_pb2.REASON_EXECUTOR_FAILED
            ) from None
        process = Child(started)
        executor = cls(runner, process, command, on_unasked, on_end)
        try:
            await executor._attach()
            if executor.foreign:
                raise FailedPrecondition(
                    f"{executor.foreign}: install both in one version, then restart rtcfd",
                    errors_pb2.REASON_EXECUTOR_FOREIGN,
                )
        except BaseException:
            process.signal(signal.SIGKILL)
            await process.wait()
            executor._remove_sockets()
            executor._close_memory()
            raise
        executor._begin_to_watch()
        return executor

    @classmethod
    async def adopt(
        cls, runner: str, command: ExecutorCommand, on_unasked: Unasked, on_end: OnEnd
    ) -> "Executor | None":
        """Take over an executor that an earlier rtcfd left running.

        Returns None if there is none, and removes a dead socket.  An executor with an
        incompatible protocol is `foreign`: its loop goes on, and can be stopped.
        """
        socket = command.socket(runner)
        link = await _link_to(runner, socket, on_unasked)
        if link is None:
            return None
        try:
            process = Process(link.peer_pid)
        except OSError:
            await link.close()  # it has just ended
            _remove_dead(socket)
            return None
        executor = cls(runner, process, command, on_unasked, on_end)
        try:
            link.peer = executor._peer
            await executor._greet(link, QUERY_TIMEOUT_S)
            executor.other_build = _is_other_build(link.peer_pid, command.binary)
            if executor.foreign:
                executor.foreign += (
                    f": its loop goes on as it is; `rtcfctl -r {runner} stop` ends it, "
                    f"`rtcfctl runner restart {runner}` starts one of this version"
                )
                log.error("%s", executor.foreign)
        except BaseException as problem:
            await link.close()
            process.release()
            executor._close_memory()
            if isinstance(problem, Unavailable):
                raise _silent(runner, str(problem), "rtcfd keeps asking it", executor.pid) from None
            raise
        executor._begin_to_watch()
        return executor

    @property
    def connected(self) -> bool:
        """Whether the link is open."""
        return self._link is not None and not self._link.ended.is_set()

    @property
    def frozen(self) -> str:
        """Why the process stands still, with the remedy: a signal or a debugger has stopped it.

        Empty if it does not.
        """
        if not self._process.frozen:
            return ""
        return f"{self._peer} {_frozen(self._runner, self.pid)}"

    async def require_not_frozen(self) -> None:
        """Raise Unavailable if the process stays frozen for FROZEN_S.

        For requests that it would not answer in time, before they are sent.
        """
        if not self._process.frozen:
            return
        loop = asyncio.get_running_loop()
        deadline = loop.time() + FROZEN_S
        while frozen := self.frozen:
            if loop.time() > deadline:
                raise Unavailable(frozen, errors_pb2.REASON_EXECUTOR_SILENT)
            await asyncio.sleep(_FROZEN_LOOK_S)  # a debugger may freeze it briefly

    def note(self) -> Note | None:
        """Return the current content of the flight recorder; None if there is none."""
        return None if self._recorder is None else self._recorder.read()

    def trace(self) -> Trace | None:
        """Return the stack trace of its crash, if it is known."""
        return None if self._recorder is None else self._recorder.trace()

    async def request(
        self,
        request: wire.Request,
        timeout_s: float | None = QUERY_TIMEOUT_S,
        on_progress: Progress | None = None,
        on_answer: OnAnswer | None = None,
    ) -> wire.Response:
        """Send one request; see Link.request."""
        if self._link is None:
            raise Unavailable(f"{self._peer} is not connected", errors_pb2.REASON_EXECUTOR_DOWN)
        if self.foreign and request.WhichOneof("kind") not in ("stop", "exit"):
            raise FailedPrecondition(self.foreign, errors_pb2.REASON_EXECUTOR_FOREIGN)
        return await self._link.request(request, timeout_s, on_progress, on_answer)

    async def watch_ports(self, request: ports_pb2.WatchPortsRequest, on_ports: OnPorts) -> None:
        """Pass the values of ports on until cancelled; see Link.watch_ports."""
        if self._link is None:
            raise Unavailable(f"{self._peer} is not connected", errors_pb2.REASON_EXECUTOR_DOWN)
        if self.foreign:
            raise FailedPrecondition(self.foreign, errors_pb2.REASON_EXECUTOR_FOREIGN)
        if self._protocol < PORTS_PROTOCOL:
            raise FailedPrecondition(
                f"{self._peer} is of rtcf {self.version}, which sends no values of ports: `rtcfctl "
                f"runner restart {self._runner}` stops the loop and starts one that does",
                errors_pb2.REASON_EXECUTOR_FOREIGN,
            )
        await self._link.watch_ports(request, on_ports)

    @property
    def resets_all_at_once(self) -> bool:
        """Whether a reset of its statistics also resets the counters of its status.

        If not, rtcfd subtracts the earlier counts.
        """
        return self._protocol >= STATISTICS_PROTOCOL

    async def limit(self, limits: Limits) -> None:
        """Send the limits of its graph.  An old executor without this request has no limits."""
        if self._protocol >= LIMITS_PROTOCOL and not self.foreign:
            await self.request(wire.Request(limits=wire.Limits(taps=limits.taps)), None)

    async def grant(self, rules: wire.AccessRules) -> None:
        """Send the access rules: which users may stop its loop directly, and whose ROS master it
        may follow."""
        if self._protocol >= ACCESS_PROTOCOL and not self.foreign:
            await self.request(wire.Request(access=rules))

    async def leave(self) -> None:
        """Disconnect without ending it: the next rtcfd adopts it."""
        if self._watching is not None:
            self._watching.cancel()
            await asyncio.gather(self._watching, return_exceptions=True)
        if self._link is not None:
            await self._link.close()
        self._close_memory()
        self._process.release()

    async def shut_down(self, hook_timeout_s: float = 0.0) -> None:
        """Stop the loop in order, then end the process, by signals if necessary."""
        self.expected = True
        try:
            if frozen := self.frozen:
                raise Unavailable(frozen, errors_pb2.REASON_EXECUTOR_SILENT)
            patience_s = max(STOP_TIMEOUT_S, hook_timeout_s + _STUCK_S)
            await self.request(wire.Request(stop=wire.Stop()), patience_s)
            await self.request(wire.Request(exit=wire.Exit()), EXIT_TIMEOUT_S)
        except RequestError as error:
            log.warning("%s: cannot end it in order: %s", self._peer, error)
            if error.reason == errors_pb2.REASON_HOOK_STUCK:
                # Its loop has ended, and an orderly end would wait for the hook.
                self._process.signal(signal.SIGKILL)
            else:
                _terminate(self._process)
        await _end(self._process, self._peer, self._hook)
        if self._watching is not None:
            await self._watching

    def _hook(self) -> str:
        """Return the hook that its graph thread runs; empty if there is none."""
        note = self.note()
        return f"{note.hooking}.{note.hook}" if note is not None and note.hooking else ""

    async def _attach(self) -> None:
        """Connect and exchange hello messages, within CONNECT_TIMEOUT_S."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + CONNECT_TIMEOUT_S
        while True:
            if self._process.end is not None:
                raise FailedPrecondition(
                    f"{self._peer} {self._process.end} before it listened at its socket; "
                    "rtcfd's log has its reason",
                    errors_pb2.REASON_EXECUTOR_FAILED,
                )
            try:
                link = await Link.connect(self._peer, self._socket, self._on_unasked)
                break
            except OSError as error:  # also if rtcfd is out of file descriptors: retry
                if loop.time() > deadline:
                    raise Unavailable(
                        f"{self._peer} does not listen at {self._socket} "
                        f"{CONNECT_TIMEOUT_S:g} s after its start ({error.strerror or error})",
                        errors_pb2.REASON_EXECUTOR_SILENT,
                    ) from None
                await asyncio.sleep(_RETRY_S)
        try:
            await self._greet(link, max(deadline - loop.time(), 1.0))
        except BaseException:
            await link.close()
            raise

    async def _greet(self, link: Link, timeout_s: float) -> None:
        """Exchange hello messages, and open the shared memory that the answer names."""
        if not _belongs(link.peer_pid, self.pid):
            raise Unavailable(
                f"{self._socket} is served by process {link.peer_pid}, which is not the executor "
                f"of {self._runner} (pid {self.pid}): end process {link.peer_pid}",
                errors_pb2.REASON_EXECUTOR_SILENT,
            )
        hello = await link.hello(timeout_s)
        if hello.runner != self._runner:
            raise Unavailable(
                f'{self._socket} is served by the executor of runner "{hello.runner}" instead of '
                f'"{self._runner}": end it (pid {link.peer_pid})',
                errors_pb2.REASON_EXECUTOR_SILENT,
            )
        self.version = hello.version or "?"
        self._protocol = hello.protocol
        self.unconfigured = hello.unconfigured
        if abs(hello.protocol - PROTOCOL) > 1:
            self.foreign = (
                f"{self._peer} is of rtcf {self.version} and speaks protocol {hello.protocol}, "
                f"which rtcfd {VERSION} with protocol {PROTOCOL} does not"
            )
        if self._recorder is None and hello.flight_recorder_fd > 0:
            try:
                self._recorder = FlightRecorder(link.peer_pid, hello.flight_recorder_fd)
            except (OSError, ValueError) as error:
                log.warning("%s: no flight recorder: %s", self._peer, error)
        if self.frames is None and hello.frames_fd > 0:
            try:
                path = f"/proc/{link.peer_pid}/fd/{hello.frames_fd}"
                self.frames = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
            except OSError as error:
                log.warning("%s: cannot read its frames: %s", self._peer, error)
        self._link = link
        if hello.HasField("direct_stop"):
            link.direct_stops = hello.direct_stop.count
            self._on_unasked(wire.Response(direct_stop=hello.direct_stop))

    def _begin_to_watch(self) -> None:
        # Own context: do not attribute its end to the client whose call started it.
        watching = asyncio.create_task(self._watch(), context=contextvars.Context())
        self._watching = log_failure(watching, f"the watch over {self._peer}")

    async def _watch(self) -> None:
        """Wait for the end of the process; reconnect if the link breaks before."""
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
            log.error(
                "%s; reconnecting", self._link.problem or f"{self._peer} closed the connection"
            )
            try:
                await self._attach()
            except RequestError as error:
                log.error("%s: ending it", error)
                self._process.signal(signal.SIGTERM)
                break
        end = await ending
        if self._link is not None:
            await self._link.close()
        self._remove_sockets()
        self._on_end(self, end)
        self._close_memory()
        self.ended.set()

    def _close_memory(self) -> None:
        """Close the memory that it shares with us."""
        if self._recorder is not None:
            self._recorder.close()
            self._recorder = None
        if self.frames is not None:
            os.close(self.frames)
            self.frames = None

    def _remove_sockets(self) -> None:
        """Remove the sockets of an ended executor: one that was killed leaves them."""
        for socket in self._sockets:
            socket.unlink(missing_ok=True)


def _belongs(pid: int, to: int) -> bool:
    """Return whether process `pid` is process `to`, or in the session that it leads."""
    try:
        return pid == to or os.getsid(pid) == to
    except OSError:
        return False


async def stop_left_over(runner: str, command: ExecutorCommand, patience_s: float) -> bool:
    """Stop the loop of an executor that was not adopted, at its stop socket.

    Returns whether the executor confirms that the loop has ended.  A frozen one stops it when it
    continues.
    """
    _, *sockets = command.sockets(runner)
    stopped = [await stop_socket.stop(each, patience_s) for each in sockets]
    return bool(stopped) and all(stopped)


async def end_left_over(runner: str, command: ExecutorCommand) -> None:
    """End an executor that was not adopted: in order, or by SIGKILL if it does not end.

    Raises Unavailable if another process serves its socket.
    """
    socket = command.socket(runner)
    sockets = []
    while (process := await _left_over(socket)) is not None:
        sockets = command.sockets(runner)
        peer = f"left-over executor of {runner} (pid {process.pid})"
        try:
            log.warning("%s: ending it by a signal", peer)
            _terminate(process)
            await _end(process, peer)
        finally:
            process.release()
    try:
        link = await Link.connect(f"left-over executor of {runner}", socket, lambda _: None)
    except OSError:
        for each in sockets:  # one that was killed leaves them
            each.unlink(missing_ok=True)
        return
    await link.close()
    raise Unavailable(
        f"{socket} is served by process {link.peer_pid}, which is not recognised as the executor "
        f"of runner {runner}: end it with `kill -KILL {link.peer_pid}`, then repeat the request",
        errors_pb2.REASON_EXECUTOR_SILENT,
    )


async def _left_over(socket: Path) -> Process | None:
    """Return the process of the executor with a socket, watched; None if there is none."""
    while (pid := await asyncio.to_thread(left_over.process, socket)) is not None:
        try:
            process = Process(pid)
        except OSError:
            continue  # it has just ended
        # Again: the pid may have passed to another process before the descriptor was opened.
        if await asyncio.to_thread(left_over.listens, pid, socket):
            return process
        process.release()
    return None


def _terminate(process: Process) -> None:
    """Ask a process to end in order, also a frozen one."""
    process.signal(signal.SIGTERM)
    # A frozen process receives the pending SIGTERM when it continues.
    process.signal(signal.SIGCONT)


def _frozen(runner: str, pid: int) -> str:
    return (
        f"is frozen, by a signal or a debugger: `rtcfctl runner restart {runner}` ends it, "
        f"`kill -CONT {pid}` lets its loop go on"
    )


def _silent(runner: str, problem: str, search: str, pid: int) -> Silent:
    """Return the error for an executor that exists but cannot be adopted now."""
    if is_frozen(pid):
        remedy = f"it {_frozen(runner, pid)}"
    else:
        remedy = f"`rtcfctl runner restart {runner}` ends it"
    return Silent(
        f"{problem}; its loop may be running: {search}; {remedy}",
        errors_pb2.REASON_EXECUTOR_SILENT,
    )


async def _end(process: Process, peer: str, hook: Callable[[], str] = str) -> None:
    """Wait for a process that was asked to end; send SIGTERM, then SIGKILL, if it does not.

    `hook` returns the hook that it runs.
    """
    for harder in (signal.SIGTERM, signal.SIGKILL):
        try:
            await asyncio.wait_for(process.wait(), EXIT_TIMEOUT_S)
            return
        except TimeoutError:
            waits = f", as {running}() does not return" if (running := hook()) else ""
            log.warning("%s does not end%s: sending %s", peer, waits, harder.name)
            process.signal(harder)
    await process.wait()


async def _link_to(runner: str, socket: Path, on_unasked: Unasked) -> Link | None:
    """Connect to an executor of an earlier rtcfd; None if there is none any more.

    An executor recreates a removed socket within a second; one that is ending takes a while.
    Waits for either, and raises Silent if neither happens.
    """
    deadline = time.monotonic() + _RENEW_S
    while True:
        try:
            return await Link.connect(f"left-over executor of {runner}", socket, on_unasked)
        except FileNotFoundError:
            pass
        except ConnectionRefusedError:
            _remove_dead(socket)
        pid = await asyncio.to_thread(left_over.process, socket)
        if pid is None:
            return None
        if time.monotonic() > deadline:
            raise _silent(
                runner,
                f"the executor of runner {runner} (pid {pid}) exists, but its socket {socket} does "
                "not",
                "rtcfd keeps looking for it",
                pid,
            )
        await asyncio.sleep(_RENEW_LOOK_S)


def _is_other_build(pid: int, program: Path) -> bool:
    """Return whether the file of a program has another build id than a process of it."""
    try:
        return build_id(Path(f"/proc/{pid}/exe")) != build_id(program)
    except (OSError, ValueError):
        return False  # unknown, for example if the program is a script


def _remove_dead(socket: Path) -> None:
    try:
        socket.unlink(missing_ok=True)
    except OSError as error:
        raise FailedPrecondition(
            f"{socket} is in the way and is not an executor's socket: remove it ({error.strerror})",
            errors_pb2.REASON_EXECUTOR_FAILED,
        ) from None
