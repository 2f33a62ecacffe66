"""Finds executors that an earlier rtcfd left running.

By their sockets, and by their processes: somebody may remove a socket by mistake, and two
executors of one runner would drive the same hardware.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


def runners(folder: Path) -> list[str]:
    """Return the runners whose executors have, or had, a socket in this folder."""
    found = {socket.stem for _, socket in _processes() if socket.parent == folder}
    with contextlib.suppress(OSError):
        found |= {each.stem for each in folder.glob("*.sock") if each.is_socket()}
    return sorted(found)


def process(socket: Path) -> int | None:
    """Return the process that listens at a socket, even if the socket's file was removed."""
    return next((pid for pid, its in _processes() if its == socket), None)


def listens(pid: int, socket: Path) -> bool:
    """Return whether this process is an executor of our user with this socket."""
    return _socket_of(Path(f"/proc/{pid}")) == socket


def _processes() -> Iterator[tuple[int, Path]]:
    """Yield the pids of our user's executors, and their sockets."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and (socket := _socket_of(entry)) is not None:
            yield int(entry.name), socket


def _socket_of(entry: Path) -> Path | None:
    """Return the socket of an executor of our user; None for any other process."""
    try:
        words = (entry / "cmdline").read_bytes().split(b"\0")
        if b"--runner" not in words or b"--socket" not in words[:-1]:
            return None
        if not _is_ours(entry):
            return None  # another user could otherwise keep us from starting an executor
    except OSError:
        return None  # it has just ended, or we may not read it
    return Path(os.fsdecode(words[words.index(b"--socket") + 1]))


def _is_ours(entry: Path) -> bool:
    # Not by the owner of the folder: it is root for a process that is not dumpable, see proc(5).
    lines = (entry / "status").read_text(errors="replace").splitlines()
    ours = str(os.geteuid())
    return any(line.split()[:3] == ["Uid:", ours, ours] for line in lines)
