"""A disk below rtcfd's states that hangs, is full or is read-only for a while."""

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rtcf_shared import whole_files
from rtcfd.common import regular_files
from rtcfd.runners import runner
from rtcfd.state import saver, store

MODES = ("well", "hangs", "full", "read-only")
_LONGEST_S = 60.0  # longest hang in a test
# rtcfd's patience with a disk that hangs, which is detected quickly, and with one that works, also
# on a loaded machine.
_SHORT_S, _LONG_S = 0.02, 2.0


class Killed(BaseException):
    """Ends a thread of a dead rtcfd."""


class FailingDisk:
    """Passes on the writes of rtcfd's threads to the state folder; reads bypass it."""

    def __init__(self) -> None:
        self.ever_bad = False
        self._folder = Path("/nowhere")
        self._mode = "well"
        self._life = 0  # of rtcfd: pending writes of an earlier life are lost
        self._changed = threading.Condition()

    def begin(self, folder: Path) -> None:
        """Move to another folder, and work normally."""
        self.next_life()
        self._folder = folder
        self.become("well")
        self.ever_bad = False

    def become(self, mode: str) -> None:
        """Set one of MODES; "dead": no write succeeds in this life."""
        with self._changed:
            self._enter(mode)
            self.ever_bad |= mode != "well"

    def next_life(self) -> None:
        """End the present rtcfd; its successor starts with a disk that answers."""
        with self._changed:
            self._life += 1
            self._enter("well" if self._mode in ("hangs", "dead") else self._mode)

    def install(self, monkeypatch: Any) -> None:
        """Install it between the store and its folder."""
        monkeypatch.setattr(saver, "PATIENCE_S", _LONG_S)
        monkeypatch.setattr(runner, "LEAVE_TIMEOUT_S", _LONG_S)
        monkeypatch.setattr(store, "whole_files", self)
        monkeypatch.setattr(store, "regular_files", self)
        unmark, remove = store._unmark, store.Store.remove
        monkeypatch.setattr(store, "_unmark", lambda mark: self._do(mark, lambda: unmark(mark)))

        def remove_all(of: store.Store, runner: str) -> None:
            self._do(self._folder / runner, lambda: remove(of, runner))

        monkeypatch.setattr(store.Store, "remove", remove_all)

    # The functions of whole_files and regular_files that the store uses.

    def replace(self, file: Path, data: bytes, *, sync: bool = True) -> None:
        self._do(file, lambda: whole_files.replace(file, data, sync=sync), room=True)

    def sync_folder(self, folder: Path) -> None:
        self._do(folder / "any", lambda: whole_files.sync_folder(folder))

    def append(self, file: Path, data: bytes) -> None:
        self._do(file, lambda: regular_files.append(file, data), room=True)

    read_bytes = staticmethod(regular_files.read_bytes)
    read_text = staticmethod(regular_files.read_text)

    def _enter(self, mode: str) -> None:
        self._mode = mode
        saver.PATIENCE_S = runner.LEAVE_TIMEOUT_S = _SHORT_S if mode == "hangs" else _LONG_S
        self._changed.notify_all()

    def _do(self, file: Path, work: Callable[[], None], room: bool = False) -> None:
        if file.parent != self._folder:
            work()
            return
        with self._changed:
            life = self._life
            assert self._changed.wait_for(
                lambda: self._mode != "hangs" or self._life != life, _LONGEST_S
            )
            if self._life != life or self._mode == "dead":
                raise Killed
            for mode, number in (("full", errno.ENOSPC), ("read-only", errno.EROFS)):
                if self._mode == mode and (room or mode == "read-only"):
                    raise OSError(number, os.strerror(number))
            work()
