"""Recordings in one file, or in several of a bounded size or time each."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

from rtcf_shared.errors import RtcfError
from rtcf_shared.whole_file import whole_file

from rtcf.closing import Closing
from rtcf.recording.mcap_writer import McapWriter
from rtcf.recording.recorder import Recorder
from rtcf.streams.ports import PortBatch

Result = TypeVar("Result")


class Files(Closing):
    """What a stream tells, written into `path`, and after next() into others of its name with -1,
    -2, …; each can be read by itself.  Raises RtcfError of what the disk refuses."""

    def __init__(self, path: Path, runner: str, *, force: bool = False) -> None:
        """Make the first file: what is there already is refused by ValueError, unless `force`."""
        self.paths: list[Path] = []
        self._cycles = self._lost = 0  # of the files that are closed
        self._first = path
        self._runner = runner
        self._force = force
        self._begun_ns = 0
        self._open()

    @property
    def size(self) -> int:
        """Bytes of the file that is being written."""
        return self._writer.size

    @property
    def bytes(self) -> int:
        """Bytes of all files that are closed."""
        return sum(path.stat().st_size for path in self.paths)

    def taken_ns(self, batch: PortBatch) -> int:
        """Return the loop time from the first cycle in this file to the end of a batch."""
        if not len(batch):
            return 0
        if not self._begun_ns:
            self._begun_ns = int(batch.message.stamps_ns[0])
        return int(batch.message.stamps_ns[-1]) - self._begun_ns

    def add(self, batch: PortBatch) -> list[str]:
        """Write a batch; return a line for each state that no message can hold."""
        return self._doing(lambda: self._recorder.add(batch))

    def flush(self) -> None:
        """Write what is still in memory."""
        self._doing(self._recorder.flush)

    def next(self) -> None:
        """End this file and begin another."""
        self.close()
        self._open()

    def close(self) -> None:
        """End the file; what the disk does not take is not counted."""
        if self._file.closed:
            return
        self._doing(self._finish)
        self._cycles += self._recorder.cycles
        self._lost += self._recorder.lost

    @property
    def cycles(self) -> int:
        """Cycles in all files, and in memory."""
        return self._cycles + (0 if self._file.closed else self._recorder.cycles)

    @property
    def lost(self) -> int:
        """Cycles that were not taken in time, so far."""
        return self._lost + (0 if self._file.closed else self._recorder.lost)

    def _open(self) -> None:
        number = len(self.paths)
        stem, suffix = self._first.stem, self._first.suffix
        path = self._first.with_name(f"{stem}-{number}{suffix}") if number else self._first
        try:
            # It has its name from its head on: at any time a file of that name can be read.
            with whole_file(path, force=self._force) as part:
                self._file = part.open("wb", buffering=0)
                self._writer = _begun(self._file, path)
        except FileExistsError:
            raise ValueError(f"{path} is there already: --force writes over it") from None
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror}") from None
        self.paths.append(path)
        self._begun_ns = 0
        self._recorder = Recorder(self._writer, self._runner)

    def _finish(self) -> None:
        # Closing writes what is left, and may find no room either.
        with self._file:
            try:
                self._recorder.flush()
            finally:
                self._writer.close()

    def _doing(self, work: Callable[[], Result]) -> Result:
        try:
            return work()
        except OSError as error:
            raise RtcfError(f"{self.paths[-1]}: {error.strerror}: {self._left()}") from None

    def _left(self) -> str:
        """Describe the file that the disk has no more room for; an empty one is removed."""
        path = self.paths[-1]
        with contextlib.suppress(OSError):
            self._file.close()
        if not path.is_file() or _has_cycles(path):
            return "what was written before can be read"
        path.unlink(missing_ok=True)
        return "no cycle was written, and the file is removed"


def _begun(file: BinaryIO, path: Path) -> McapWriter:
    try:
        writer = McapWriter(file)
        file.flush()
    except OSError as error:
        with contextlib.suppress(OSError):
            file.close()
        raise RtcfError(f"{path}: {error.strerror}: no cycle was written") from None
    return writer


def _has_cycles(path: Path) -> bool:
    from rtcf.recording.reader import read_recording  # for a full disk alone

    try:
        with read_recording(path) as recording:
            return any(
                len(recording.read_cycles(chunk=chunk)["iteration"].values) > 0
                for chunk in range(recording.chunks)
            )
    except OSError:
        return True  # it cannot be read, which says nothing about its content
    except (RtcfError, ValueError):
        return False
