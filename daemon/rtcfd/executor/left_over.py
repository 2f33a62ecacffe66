"""Executors that an earlier rtcfd left running.

Found by their sockets, and by their processes: a socket can be removed by mistake, and two
executors of one runner would drive the same hardware.
"""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path


def runners(folder: Path) -> list[str]:
    """Return the runners of executors that have, or had, a socket in this folder."""
    found = {socket.stem for _, socket in _processes() if socket.parent == folder}
    with contextlib.suppress(OSError):
        found |= {each.stem for each in folder.glob("*.sock") if each.is_socket()}
    return sorted(found)


def process(socket: Path) -> int | None:
    """Return the process that listens on a socket, or would if that had not been removed."""
    return next((pid for pid, its in _processes() if its == socket), None)


def _processes() -> Iterator[tuple[int, Path]]:
    """Yield the executors of our user, and their sockets."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
            if b"--runner" not in words or b"--socket" not in words:
                continue
            if not _is_ours(entry):
                continue  # who could keep us from starting ours
        except OSError:
            continue  # it has just ended, or is not ours to see
        socket = os.fsdecode(words[words.index(b"--socket") + 1])
        yield int(entry.name), Path(socket)


def _is_ours(entry: Path) -> bool:
    # Not the owner of the folder, which is root where a process may not be looked into.
    lines = (entry / "status").read_text(errors="replace").splitlines()
    ours = str(os.geteuid())
    return any(line.split()[:3] == ["Uid:", ours, ours] for line in lines)
