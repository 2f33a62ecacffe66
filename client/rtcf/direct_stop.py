"""Stopping loops at their executors, without rtcfd: it may be dead, hung, or full of clients.

Each executor has a socket for that in the folder `stop` beside rtcfd's own. It takes one line from
whoever has the right `operate`: `echo stop | nc -U /run/rtcfd/stop/rt_runner` does the same.
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

from rtcf.errors import DaemonUnreachableError, RefusedError
from rtcf.failures import refused
from rtcf.v1 import control_pb2

PATIENCE_S = 0.5  # with rtcfd, until a loop's executor is asked instead
TIMEOUT_S = 5.0  # above the executor's own for a component that does not return
_VERDICT_S = 3.0  # for rtcfd to name the cause of an executor's death
_CREDENTIALS = struct.Struct("3i")  # struct ucred: pid, uid, gid


@dataclass(frozen=True)
class Stopped:
    """What came of stopping one loop; `error` is None if it has ended."""

    runner: str
    error: RtcfError | None = None
    notes: tuple[str, ...] = ()  # for the caller, a line each
    died: bool = False  # ended with its executor, which died


def is_unsaved(note: str) -> bool:
    """Tell whether a note says that a stop is not on disk."""
    return note.startswith("not saved")


def folders(socket: str) -> list[Path]:
    """Return where the executors of the rtcfd that serves `socket` may have theirs."""
    path = Path(socket)
    return [path.with_name(path.name + ".d") / "stop", path.parent / "stop"]


def stop(runner: str, socket: str) -> Stopped:
    """Stop one loop; return when it has ended: in order, or with its executor's death.

    Raises RefusedError, also if a component does not return from its cycle,
    and DaemonUnreachableError if there is no executor of that name, or the
    caller may not reach it.
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
        f"no executor of runner {runner} can be stopped at {folders(socket)[-1]}", why
    )


def where_rtcfd_does_not(
    ask: Callable[[Callable[[str], None]], control_pb2.ChangeResult],
    runner: str,
    socket: str,
    on_progress: Callable[[str], None] | None,
) -> control_pb2.ChangeResult:
    """Ask rtcfd to stop a loop, by `ask`, and its executor if that does not answer in time."""
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
            if not _is_rtcfds_trouble(error):
                raise
            problem = str(error)
    try:
        stopped = stop(runner, socket)
    except DaemonUnreachableError:
        return asked.result()  # what rtcfd says in the end
    if stopped.died:
        return _after_a_death(asked)
    told = f"the loop was stopped at its executor, as {problem}"
    return control_pb2.ChangeResult(notes=[told, *stopped.notes])


def _after_a_death(asked: "Future[control_pb2.ChangeResult]") -> control_pb2.ChangeResult:
    """Return the result of a stop whose executor died: rtcfd knows the cause of death, if it
    answers at all."""
    why = "which died"
    try:
        return asked.result(_VERDICT_S)
    except (TimeoutError, DaemonUnreachableError):
        pass
    except RefusedError as error:
        # rtcfd gave this answer before the death. A loop that did not become safe has not stopped,
        # though.
        early = error.reason == "LOOP_STUCK" or error.code == "RESOURCE_EXHAUSTED"
        if not early or ".safe()" in str(error):
            raise
        why = f"as {error}"
    return control_pb2.ChangeResult(notes=[f"the loop has ended with its executor, {why}"])


def _is_rtcfds_trouble(error: RtcfError) -> bool:
    """Tell whether the loop's executor may do what rtcfd could not."""
    if isinstance(error, RefusedError):
        return error.code in ("RESOURCE_EXHAUSTED", "UNAVAILABLE")
    return True


def stop_all(socket: str) -> list[Stopped]:
    """Stop all loops at once; return what came of each, by runner.

    Raises DaemonUnreachableError if there are folders, and none can be read.
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
            f"cannot look for loops: {problem.filename}: {problem.strerror}"
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
        # One that has ended since has no loop any more.
        gone = isinstance(error, DaemonUnreachableError) and not any(
            os.path.exists(folder / runner) for folder in folders(socket)
        )
        return Stopped(runner, None if gone else error)


def _ask(path: Path, runner: str) -> Stopped:
    """Say `stop` and take the answer; raises OSError or RefusedError."""
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as connection:
        # Not settimeout(): one that blocks in the kernel has its turn in a queue that is full.
        limit = struct.pack("ll", int(TIMEOUT_S), 0)
        for option in (sockets.SO_SNDTIMEO, sockets.SO_RCVTIMEO):
            connection.setsockopt(sockets.SOL_SOCKET, option, limit)
        connection.connect(str(path))
        found = connection.getsockopt(sockets.SOL_SOCKET, sockets.SO_PEERCRED, _CREDENTIALS.size)
        pid, _, _ = _CREDENTIALS.unpack(found)  # of the executor; 0: seen from a container
        # Whoever may not is told so, and hung up on, before anything is read.
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
            f"runner {runner} is asked to stop, and {reason}", "UNAVAILABLE", "LOOP_STUCK", about
        )
    if not hung_up and _state(pid) in ("T", "t"):
        problem = (
            f"the executor of runner {runner} (pid {pid}) is frozen, by a signal or a debugger: "
            f"its loop stands still now, and goes on if somebody lets it; `rtcfctl runner restart "
            f"{runner}` ends it, or `kill -KILL {pid}` where rtcfd does not answer"
        )
    elif hung_up:
        problem = f"the executor of runner {runner} (pid {pid}) hung up, and lives on"
    else:
        problem = (
            f"the executor of runner {runner} (pid {pid}) does not answer within {TIMEOUT_S:g} s"
        )
    raise refused(problem, "UNAVAILABLE", "EXECUTOR_SILENT", about)


def _wait_for_end(pid: int) -> bool:
    """Wait for the end of a process that has closed its sockets; tell whether it came."""
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


def _state(pid: int) -> str:
    """Return the letter of a process's state, see proc(5); empty: there is none to be seen."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
    return text.rpartition(")")[2].split()[0]
