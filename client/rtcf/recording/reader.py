"""Reads recordings: MCAP files of `rtcfctl record`, also one whose writer was killed."""

import contextlib
import os
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtcf_shared.arrays import as_list
from rtcf_shared.errors import RtcfError

from rtcf.closing import Closing
from rtcf.recording import mcap_writer as mcap
from rtcf.recording.fields import Fields
from rtcf.streams import ros_layout
from rtcf.streams.ports import signal_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_RECORD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
# Of a file that is damaged.
_NONSENSE = (ArithmeticError, LookupError, MemoryError, RuntimeError, ValueError, struct.error)


class RecordingError(RtcfError):
    """A file that is no recording, or not one that this module reads."""


@dataclass(frozen=True)
class RecordedSignal:
    """A number, or an array of numbers, of a recording."""

    name: str
    unit: str
    channel: int
    leaf: ros_layout.Leaf


@dataclass(frozen=True)
class RecordedColumn:
    """The values of a signal."""

    cycles: "NDArray[np.int64]"
    stamps_ns: "NDArray[np.int64]"
    values: "NDArray[Any]"  # by cycle, then as the signal is shaped


@dataclass(frozen=True, eq=False)
class RecordedTopic:
    """The messages of one output or state, or of the cycles; two may have one name."""

    number: int
    name: str
    ros_type: str
    definition: str  # with those of the types in it
    metadata: dict[str, str]


@dataclass
class _Chunk:
    at: int  # of its records, compressed or not
    length: int
    compression: str
    start_ns: int
    end_ns: int
    offsets: dict[int, int] = field(default_factory=dict)  # of a channel's index, in the file


class Recording(Closing):
    """A recording, opened for reading; values are read when they are asked for.

    `signals` are there by name, as in a stream of ports; `whole` tells whether the file was ended
    in order; `metadata` has what else stands in it, by name.  Raises RecordingError.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.whole = False
        self.signals: dict[str, RecordedSignal] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self._channels: dict[int, RecordedTopic] = {}
        self._chunks: list[_Chunk] = []
        self._cycle_channel = 0
        self._cache: tuple[int, bytes] = (-1, b"")
        try:
            self._file = self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path}: {error.strerror}") from None
        try:
            with self._whole_only():
                self._scan()
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def chunks(self) -> int:
        """How many parts the file has, one after the other, that are read at once each."""
        return len(self._chunks)

    @property
    def cycles(self) -> "NDArray[np.int64]":
        """The numbers of all cycles, in the order in which they were recorded."""
        return self.read_cycles("iteration").values

    @property
    def stamps_ns(self) -> "NDArray[np.int64]":
        """CLOCK_REALTIME of each cycle's deadline, or the simulated time; ns."""
        return self.read_cycles("iteration").stamps_ns

    @property
    def durations_ns(self) -> "NDArray[np.int64]":
        """Calculation in each cycle; ns."""
        return self.read_cycles("duration_ns").values

    @property
    def latencies_ns(self) -> "NDArray[np.int64]":
        """Wake-up after each deadline; ns."""
        return self.read_cycles("latency_ns").values

    def __getitem__(self, name: str) -> "NDArray[Any]":
        """Return all values of a signal."""
        return self.read(name).values

    def read(
        self,
        name: str,
        begin_ns: int | None = None,
        end_ns: int | None = None,
        chunk: int | None = None,
    ) -> RecordedColumn:
        """Return the values of a signal whose stamps are from `begin_ns` to before `end_ns`, or
        those in one chunk; of the file no more than that is read."""
        signal = self.signals.get(name)
        if signal is None:
            known = ", ".join(list(self.signals)[:8])
            raise RecordingError(f"{self.path} has no signal {name}; it has {known or 'none'}")
        with self._whole_only():
            return self._read(signal.channel, signal.leaf, begin_ns, end_ns, chunk)

    def read_cycles(self, name: str, chunk: int | None = None) -> RecordedColumn:
        """Return `iteration`, `duration_ns` or `latency_ns` of all cycles, or of those in one
        chunk."""
        if not self._cycle_channel:
            raise RecordingError(f"{self.path} tells no cycles: rtcfctl record has not written it")
        with self._whole_only():
            return self._read(self._cycle_channel, self._leaf_of_cycles(name), chunk=chunk)

    def messages(self, chunk: int) -> list[tuple[RecordedTopic, int, bytes]]:
        """Return the messages of a chunk as ROS 1 serialises them, with their stamps (ns), in the
        order of these."""
        found = []
        with self._whole_only():
            for number in self._chunks[chunk].offsets:
                topic = self._channels[number]
                index = as_list(self._index(self._chunks[chunk], number))
                found += [(time, at, topic) for time, at in index]
            found.sort(key=lambda each: each[:2])
            records = self._records(chunk)
            return [(topic, time, self._data(records, at)) for time, at, topic in found]

    def to_pandas(self, names: Iterable[str] | None = None) -> Any:
        """Return a pandas.DataFrame of signals that are numbers, by cycle."""
        import pandas

        columns = {}
        for name in self.signals if names is None else names:
            column = self.read(name)
            if column.values.ndim == 1:
                columns[name] = pandas.Series(column.values, index=column.cycles)
        return pandas.DataFrame(columns)

    @contextlib.contextmanager
    def _whole_only(self) -> Iterator[None]:
        try:
            yield
        except _NONSENSE as error:
            raise RecordingError(f"{self.path} is damaged: {error}") from None

    def _leaf_of_cycles(self, path: str) -> ros_layout.Leaf:
        offsets = {"iteration": 16, "duration_ns": 24, "latency_ns": 32}
        return ros_layout.Leaf(path, "<i8", None, offsets[path])

    def _read(
        self,
        channel: int,
        leaf: ros_layout.Leaf,
        begin_ns: int | None = None,
        end_ns: int | None = None,
        chunk: int | None = None,
    ) -> RecordedColumn:
        import numpy as np

        shape = () if leaf.count is None else (leaf.count,)
        size = ros_layout.size_of(leaf.format) * (1 if leaf.count is None else leaf.count)
        cycles, stamps, values = [], [], []
        for number in range(self.chunks) if chunk is None else (chunk,):
            part = self._chunks[number]
            if channel not in part.offsets:
                continue
            if (end_ns is not None and part.start_ns >= end_ns) or (
                begin_ns is not None and part.end_ns < begin_ns
            ):
                continue
            index = self._index(part, channel)
            keep = np.ones(len(index), bool)
            if begin_ns is not None:
                keep &= index["time"] >= begin_ns
            if end_ns is not None:
                keep &= index["time"] < end_ns
            index = index[keep]
            records = np.frombuffer(self._records(number), "u1")
            at = index["offset"].astype("i8")[:, None]
            low = records[at + 11 + np.arange(4)].reshape(-1).view("<u4").astype("i8")
            cycles.append(self._cycles_of(part, records, low))
            stamps.append(index["time"].astype("i8"))
            data = records[at + mcap.MESSAGE_HEAD + leaf.offset + np.arange(size)]
            values.append(data.reshape(-1).view(leaf.format).reshape(len(index), *shape))
        none = np.zeros((0, *shape), leaf.format)
        return RecordedColumn(
            np.concatenate(cycles or [np.zeros(0, "i8")]),
            np.concatenate(stamps or [np.zeros(0, "i8")]),
            np.concatenate(values or [none]),
        )

    def _cycles_of(
        self, chunk: _Chunk, records: "NDArray[Any]", low: "NDArray[Any]"
    ) -> "NDArray[np.int64]":
        """Return the numbers of cycles of which messages tell the low 32 bits."""
        import numpy as np

        if self._cycle_channel not in chunk.offsets:
            return low
        at = self._index(chunk, self._cycle_channel)["offset"].astype("i8")[:, None]
        leaf = self._leaf_of_cycles("iteration")
        data = records[at + mcap.MESSAGE_HEAD + leaf.offset + np.arange(8)]
        numbers = np.unique(data.reshape(-1).view(leaf.format))
        numbers = numbers[np.argsort(numbers & 0xFFFFFFFF, kind="stable")]
        place = np.searchsorted(numbers & 0xFFFFFFFF, low).clip(max=len(numbers) - 1)
        found: NDArray[np.int64] = numbers[place]
        return found

    def _index(self, chunk: _Chunk, channel: int) -> "NDArray[Any]":
        import numpy as np

        self._file.seek(chunk.offsets[channel])
        _, length = _RECORD.unpack(self._file.read(_RECORD.size))
        content = self._file.read(length)
        return np.frombuffer(content, [("time", "<u8"), ("offset", "<u8")], offset=6)

    def _records(self, number: int) -> bytes:
        if self._cache[0] != number:
            chunk = self._chunks[number]
            self._file.seek(chunk.at)
            self._cache = (number, self._unpacked(chunk.compression, self._file.read(chunk.length)))
        return self._cache[1]

    def _unpacked(self, compression: str, data: bytes) -> bytes:
        if compression == "":
            return data
        if compression != "zstd":
            raise RecordingError(f"{self.path}: chunks compressed by {compression} are not read")
        try:
            import zstandard
        except ImportError:
            raise RecordingError(
                f"{self.path} is compressed: install python3-zstandard to read it"
            ) from None
        try:
            return bytes(zstandard.ZstdDecompressor().decompress(data))
        except zstandard.ZstdError as error:
            raise ValueError(error) from None

    def _scan(self) -> None:
        """Find channels and chunks, up to the end or to where the writer was killed."""
        size = self._file.seek(0, os.SEEK_END)
        self._file.seek(0)
        if self._file.read(len(mcap.MAGIC)) != mcap.MAGIC:
            raise RecordingError(f"{self.path} is no MCAP file")
        schemas: dict[int, tuple[str, str]] = {}
        at = len(mcap.MAGIC)
        chunk: _Chunk | None = None
        while at + _RECORD.size <= size:
            self._file.seek(at)
            opcode, length = _RECORD.unpack(self._file.read(_RECORD.size))
            content_at, at = at + _RECORD.size, at + _RECORD.size + length
            if at > size:
                break
            if opcode == mcap.DATA_END:
                self.whole = True
                break
            if opcode == mcap.CHUNK:
                chunk = self._chunk(content_at)
                self._chunks.append(chunk)
            elif opcode == mcap.MESSAGE_INDEX and chunk is not None:
                (channel,) = struct.unpack("<H", self._file.read(2))
                chunk.offsets[channel] = content_at - _RECORD.size
            elif opcode == mcap.SCHEMA:
                reader = Fields(self._file.read(length))
                (number,) = reader.numbers("<H")
                ros_type, _ = reader.text(), reader.text()
                schemas[number] = ros_type, reader.text()
            elif opcode == mcap.CHANNEL:
                reader = Fields(self._file.read(length))
                number, schema = reader.numbers("<HH")
                topic, _ = reader.text(), reader.text()
                self._channels[number] = RecordedTopic(
                    number, topic, *schemas[schema], reader.pairs()
                )
            elif opcode == mcap.METADATA:
                reader = Fields(self._file.read(length))
                name = reader.text()
                self.metadata[name] = reader.pairs()
        self._find_signals()

    def _chunk(self, at: int) -> _Chunk:
        start, end, _, _ = _CHUNK_HEAD.unpack(self._file.read(_CHUNK_HEAD.size))
        (length,) = struct.unpack("<I", self._file.read(4))
        compression = self._file.read(length).decode()
        (size,) = struct.unpack("<Q", self._file.read(8))
        return _Chunk(self._file.tell(), size, compression, start, end)

    def _find_signals(self) -> None:
        outputs = {
            (channel.metadata.get("component"), channel.metadata.get("name"))
            for channel in self._channels.values()
            if channel.metadata.get("kind") == "output"
        }
        for number, channel in self._channels.items():
            if channel.metadata.get("kind") == "cycle":
                self._cycle_channel = number
                continue
            sample = self._sample(number)
            if sample is None:
                continue
            name = channel.name
            if "component" in channel.metadata:
                component, own = channel.metadata["component"], channel.metadata["name"]
                is_state = channel.metadata.get("kind") == "state"
                name = signal_name(component, own, is_state and (component, own) in outputs)
            for leaf in ros_layout.leaves(channel.definition, sample):
                full = f"{name}.{leaf.path}" if leaf.path else name
                unit = channel.metadata.get("unit", "")
                self.signals[full] = RecordedSignal(full, unit, number, leaf)

    def _sample(self, channel: int) -> bytes | None:
        for number, chunk in enumerate(self._chunks):
            if channel in chunk.offsets:
                offset = int(self._index(chunk, channel)["offset"][0])
                return self._data(self._records(number), offset)
        return None

    @staticmethod
    def _data(records: bytes, at: int) -> bytes:
        """Return the message of a record."""
        (_, length) = _RECORD.unpack_from(records, at)
        return records[at + mcap.MESSAGE_HEAD : at + _RECORD.size + length]


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording; see Recording."""
    return Recording(path)
