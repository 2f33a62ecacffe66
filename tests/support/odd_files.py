"""Replacements for a file in tests: pipe, folder, socket, …; and a deadline for opening them."""

import contextlib
import os
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from daemon_process import DEADLINE_S


def pipe(place: Path) -> None:
    os.mkfifo(place)


def folder(place: Path) -> None:
    place.mkdir()


def dangling(place: Path) -> None:
    place.symlink_to(place.with_name("nowhere"))


def plug(place: Path) -> None:
    # A short path: a unix socket's path has at most 107 characters.
    descriptor = os.open(place.parent, os.O_RDONLY | os.O_DIRECTORY)
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(f"/proc/self/fd/{descriptor}/{place.name}")
    os.close(descriptor)


def device(place: Path) -> None:
    place.symlink_to("/dev/null")


def unreadable(place: Path) -> None:
    """A regular file whose read fails, even for root: EIO at address 0."""
    place.symlink_to("/proc/self/mem")


@contextlib.contextmanager
def deadline() -> Iterator[None]:
    """Fail if the block takes too long."""

    def late(_: int, __: FrameType | None) -> None:
        raise AssertionError(f"it hangs: {DEADLINE_S:g} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, DEADLINE_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


ODD = [pipe, folder, dangling, plug, device, unreadable]
