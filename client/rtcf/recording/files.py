"""A recording in one file, or in several files of a limited size or length."""

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

from rtcf_shared.disks import free_mib
from rtcf_shared.errors import RtcfError
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch
from rtcf_shared.recorder import Recorder
from rtcf_shared.whole_files import whole_file

from rtcf.connection import Closing

Result = TypeVar("Result")

# Free space at which a recording ends, so that it leaves room for others on its disk.
LEAST_FREE_MIB = 100


def require_mcap_name(path: Path) -> None:
    """Raise ValueError if the name of a recording or incident promises another format than MCAP."""
    if path.suffix in (".bag", ".csv"):
        raise ValueError(
            f"{path}: recordings are MCAP files: write {path.with_suffix('.mcap')}, then "
            f"`rtcfctl convert {path.with_suffix('.mcap')} {path}`"
        )


class Files(Closing):
    """Writes a stream to `path`; after each next() to a new file with -1, -2, … in its name.

    Each file is a complete recording.  Methods raise RtcfError for errors of the disk.
    """

    def __init__(
        self,
        path: Path,
        runner: str,
        *,
        force: bool = False,
        least_free_mib: float = LEAST_FREE_MIB,
    ) -> None:
        """Create the first file; raises ValueError if it exists, unless `force` is set, or if its
        name promises another format than MCAP.

        If less than `least_free_mib` is free on the disk, this and flush() raise RtcfError.
        """
        if path.name == "-":
            raise ValueError("-: a recording is written to a file, name one: FILE.mcap")
        require_mcap_name(path)
        self.paths: list[Path] = []
        self._cycles = self._lost = 0  # of the files that are closed
        self._first = path
        self._runner = runner
        self._force = force
        self._least_free_mib = least_free_mib
        self._begun_ns = 0
        self._open()

    @property
    def size(self) -> int:
        """The size of the open file, in bytes."""
        return self._writer.size

    @property
    def bytes(self) -> int:
        """The size of all closed files, in bytes."""
        return sum(path.stat().st_size for path in self.paths)

    def taken_ns(self, batch: PortBatch) -> int:
        """Return the loop time from the first cycle of this file to the last of a batch; ns."""
        if not len(batch):
            return 0
        if not self._begun_ns:
            self._begun_ns = int(batch.message.stamps_ns[0])
        return int(batch.message.stamps_ns[-1]) - self._begun_ns

    def add(self, batch: PortBatch) -> list[str]:
        """Write a batch; return a note for each omitted state (without a ROS message type)."""
        return self._doing(lambda: self._recorder.add(batch))

    def flush(self) -> None:
        """Write buffered cycles to the disk."""
        self._doing(self._recorder.flush)
        path = self.paths[-1]
        if path.is_file():
            self._require_room(path, "the recording ends; the cycles written before are readable")

    def next(self) -> None:
        """Close this file and open the next one."""
        self.close()
        self._open()

    def close(self) -> None:
        """Close the file; cycles that could not be written are not counted."""
        if self._file.closed:
            return
        self._doing(self._finish)
        self._cycles += self._recorder.cycles
        self._lost += self._recorder.lost

    @property
    def cycles(self) -> int:
        """The number of cycles in all files, including buffered ones."""
        return self._cycles + (0 if self._file.closed else self._recorder.cycles)

    @property
    def lost(self) -> int:
        """The number of dropped cycles so far."""
        return self._lost + (0 if self._file.closed else self._recorder.lost)

    def _open(self) -> None:
        number = len(self.paths)
        stem, suffix = self._first.stem, self._first.suffix
        path = self._first.with_name(f"{stem}-{number}{suffix}") if number else self._first
        if not path.exists():
            self._require_room(path, "no cycle was written")
        try:
            # The file gets its name once it has a header, so that it is always readable.
            with whole_file(path, force=self._force) as part:
                self._file = part.open("wb", buffering=0)
                self._writer = _begun(self._file, path)
        except FileExistsError:
            raise ValueError(f"{path} already exists: --force overwrites it") from None
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror}") from None
        self.paths.append(path)
        self._begun_ns = 0
        self._recorder = Recorder(self._writer, self._runner)

    def _require_room(self, path: Path, result: str) -> None:
        try:
            free = free_mib(path.parent)
        except OSError:
            return  # writing the file gives the reason
        if free < self._least_free_mib:
            raise RtcfError(
                f"{path}: {free} MiB are free on its disk, less than {self._least_free_mib:g} "
                f"(--min-free): {result}"
            )

    def _finish(self) -> None:
        # Closing writes buffered data, so it can fail on a full disk, too.
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
        """Return the state of the file after an error for the user; remove it if it is empty."""
        path = self.paths[-1]
        with contextlib.suppress(OSError):
            self._file.close()
        if not path.is_file() or _has_cycles(path):
            return "the cycles written before are readable"
        path.unlink(missing_ok=True)
        return "no cycle was written; the file has been removed"


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
    from rtcf.recording.reader import read_recording  # needed only on a full disk

    try:
        with read_recording(path) as recording:
            return any(
                len(recording.read_cycles(chunk=chunk)["iteration"].values) > 0
                for chunk in range(recording.chunks)
            )
    except OSError:
        return True  # the file is not readable, so its content is unknown
    except (RtcfError, ValueError):
        return False
