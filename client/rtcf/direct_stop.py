"""Stops loops directly at their executors, when rtcfd is dead, hangs or has no free connection.

Each executor has a socket in the folder `stop` beside rtcfd's socket. It accepts one line from
users with the right `operate`; `echo stop | nc -U /run/rtcfd/stop/rt_runner` does the same.
"""

import contextlib
import os
import select
import socket as sockets
import struct
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rtcf_shared.errors import RtcfError
from rtcf_shared.processes import is_frozen

from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.failures import refused
from rtcf.v1 import control_pb2

PATIENCE_S = 0.5  # for rtcfd to answer before the executor is asked directly
TIMEOUT_S = 5.0  # longer than the executor's own timeout for a component that does not return
_VERDICT_S = 3.0  # for rtcfd to report the cause of an executor's death
_CREDENTIALS = struct.Struct("3i")  # struct ucred: pid, uid, gid


@dataclass(frozen=True)
class Stopped:
    """The result of stopping one loop."""

    runner: str
    error: RtcfError | None = None  # None: the loop has ended
    notes: tuple[str, ...] = ()  # lines for the user
    died: bool = False  # the executor died, and the loop with it


def is_unsaved(note: str) -> bool:
    """Return whether a note reports that a stop was not saved on disk."""
    return note.startswith("not saved")


def folders(socket: str) -> list[Path]:
    """Return the possible folders of the executors' sockets, for the rtcfd at `socket`."""
    path = Path(socket)
    return [path.with_name(path.name + ".d") / "stop", path.parent / "stop"]


def stop(runner: str, socket: str) -> Stopped:
    """Stop one loop; return after its end, in order or by the death of its executor.

    Raises RefusedError, also if a component does not return from its cycle, and
    DaemonUnreachableError if the executor does not exist or the caller has no access to it.
    """
    problem: OSError | None = None
    for folder in folders(socket):
        try:
            return _ask(folder / runner, runner)
        except (FileNotFoundError, NotADirectoryError, ConnectionRefusedError) as error:
            problem = problem or error
        except OSError as error:
            problem = error
    why = f"{problem.strerror or problem}" if isinstance(problem, PermissionError) else ""
    raise DaemonUnreachableError(
        f"no executor of runner {runner} found in {folders(socket)[-1]}", why
    )


def stop_with_fallback(
    ask: Callable[[Callable[[str], None]], control_pb2.ChangeResult],
    runner: str,
    socket: str,
    on_progress: Callable[[str], None] | None,
) -> control_pb2.ChangeResult:
    """Stop a loop by rtcfd, or directly at its executor if rtcfd does not answer in time.

    `ask` calls rtcfd; its argument is called for each line of progress.
    """
    answered = threading.Event()
    asked: Future[control_pb2.ChangeResult] = Future()

    def heard(line: str) -> None:
        answered.set()
        if on_progress is not None:
            on_progress(line)

    def work() -> None:
        try:
            asked.set_result(ask(heard))
        except Exception as error:
            asked.set_exception(error)
        answered.set()

    threading.Thread(target=work, daemon=True).start()
    problem = f"rtcfd does not answer within {PATIENCE_S:g} s"
    if answered.wait(PATIENCE_S):
        try:
            return asked.result()
        except RtcfError as error:
            if not _concerns_rtcfd_only(error):
                raise
            problem = str(error)
    try:
        stopped = stop(runner, socket)
    except DaemonUnreachableError:
        return asked.result()  # wait for rtcfd
    if stopped.died:
        return _after_a_death(asked)
    note = f"the loop was stopped at its executor, because {problem}"
    return control_pb2.ChangeResult(notes=[note, *stopped.notes])


def _after_a_death(asked: "Future[control_pb2.ChangeResult]") -> control_pb2.ChangeResult:
    """Return the result of a stop whose executor died, with the cause if rtcfd reports it."""
    why = "which died"
    try:
        return asked.result(_VERDICT_S)
    except (TimeoutError, DaemonUnreachableError):
        pass
    except RefusedError as error:
        # These errors were sent before the death and are obsolete. Errors of safe() are not: the
        # loop has not ended safely.
        early = error.reason == "LOOP_STUCK" or error.code == "RESOURCE_EXHAUSTED"
        if not early or ".safe()" in str(error):
            raise
        why = f"after an error of rtcfd: {error}"
    return control_pb2.ChangeResult(notes=[f"the loop has ended with its executor, {why}"])


def _concerns_rtcfd_only(error: RtcfError) -> bool:
    """Return whether an error concerns rtcfd only, so that a direct stop is worth trying."""
    if isinstance(error, RefusedError):
        # Of a stuck hook the executor has told rtcfd, and has ended the loop.
        if error.reason == "HOOK_STUCK":
            return False
        return error.code in ("RESOURCE_EXHAUSTED", "UNAVAILABLE")
    return True


def stop_all(socket: str) -> list[Stopped]:
    """Stop all loops at once; return the results, sorted by runner.

    Raises DaemonUnreachableError if none of the existing folders is readable.
    """
    runners: set[str] = set()
    problem: OSError | None = None
    read = False
    for folder in folders(socket):
        try:
            runners |= {each.name for each in folder.iterdir()}
            read = True
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:
            problem = error
    if problem is not None and not read:
        raise DaemonUnreachableError(
            f"cannot find the loops: {problem.filename}: {problem.strerror}"
        )
    names = sorted(runners)
    if not names:
        return []
    with ThreadPoolExecutor(max_workers=len(names)) as pool:
        return list(pool.map(lambda name: _stopped(name, socket), names))


def _stopped(runner: str, socket: str) -> Stopped:
    try:
        return stop(runner, socket)
    except RtcfError as error:
        # If the socket has disappeared, the executor and its loop have ended.
        gone = isinstance(error, DaemonUnreachableError) and not any(
            os.path.exists(folder / runner) for folder in folders(socket)
        )
        return Stopped(runner, None if gone else error)


def _ask(path: Path, runner: str) -> Stopped:
    """Send `stop` and read the answer; raises OSError or RefusedError."""
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as connection:
        # Not settimeout(): a non-blocking connect() fails if the listen queue is full, a blocking
        # one waits in the kernel.
        limit = struct.pack("ll", int(TIMEOUT_S), 0)
        for option in (sockets.SO_SNDTIMEO, sockets.SO_RCVTIMEO):
            connection.setsockopt(sockets.SOL_SOCKET, option, limit)
        connection.connect(str(path))
        found = connection.getsockopt(sockets.SOL_SOCKET, sockets.SO_PEERCRED, _CREDENTIALS.size)
        pid, _, _ = _CREDENTIALS.unpack(found)  # of the executor; 0 in another PID namespace
        # Without the right, the executor answers and closes before it reads.
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            connection.sendall(b"stop\n")
        answer = b""
        hung_up = False
        try:
            while not answer.endswith(b"\n") and not hung_up:
                more = connection.recv(4096)
                answer += more
                hung_up = not more
        except BlockingIOError:
            pass
        except ConnectionResetError:
            hung_up = True
    word, _, reason = answer.decode(errors="replace").strip().partition(": ")
    if word == "stopped":
        return Stopped(runner, notes=(reason,) if is_unsaved(reason) else ())
    if hung_up and not answer and _wait_for_end(pid):
        return Stopped(runner, died=True)
    about = {"runner": runner}
    if word == "refused":
        raise refused(f"runner {runner}: {reason}", "PERMISSION_DENIED", "RIGHT_MISSING", about)
    if word == "late":
        raise refused(
            f"runner {runner} is stopping, but {reason}", "UNAVAILABLE", "LOOP_STUCK", about
        )
    if not hung_up and is_frozen(pid):
        problem = (
            f"the executor of runner {runner} (pid {pid}) is frozen, by a signal or a debugger: "
            f"its loop does not run now, but continues with the process; end it with `rtcfctl "
            f"runner restart {runner}`, or with `kill -KILL {pid}` if rtcfd does not answer"
        )
    elif hung_up:
        problem = f"the executor of runner {runner} (pid {pid}) closed the connection but runs on"
    else:
        problem = (
            f"the executor of runner {runner} (pid {pid}) does not answer within {TIMEOUT_S:g} s"
        )
    raise refused(problem, "UNAVAILABLE", "EXECUTOR_SILENT", about)


def _wait_for_end(pid: int) -> bool:
    """Return whether a process ends within TIMEOUT_S; false for pid 0 (unknown)."""
    if not pid:
        return False
    try:
        process = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        waiting = select.poll()
        waiting.register(process, select.POLLIN)
        return bool(waiting.poll(TIMEOUT_S * 1000))
    finally:
        os.close(process)
