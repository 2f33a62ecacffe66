"""Reads recordings: MCAP files of `rtcfctl record`, also after a kill of the writer."""

import contextlib
import json
import os
import struct
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtcf_shared import mcap_writer as mcap
from rtcf_shared import ros_layout
from rtcf_shared.arrays import as_list
from rtcf_shared.errors import RtcfError
from rtcf_shared.ports import signal_name

from rtcf.connection import Closing
from rtcf.recording.fields import Fields

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_RECORD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_MESSAGE = struct.Struct("<BQH")
_AHEAD = 2  # chunks decompressed in advance
# The fields of cycle messages.
_CYCLE = {
    name: ros_layout.Leaf(name, "<i8", None, offset)
    for name, offset in (("iteration", 16), ("duration_ns", 24), ("latency_ns", 32))
}
# Exceptions raised by parsing a damaged file.
_NONSENSE = (ArithmeticError, LookupError, MemoryError, RuntimeError, ValueError, struct.error)


class RecordingError(RtcfError):
    """A file is missing, damaged, or not a supported recording."""


@dataclass(frozen=True)
class RecordedSignal:
    """A number or an array of numbers in a recording."""

    name: str
    unit: str
    channel: int
    leaf: ros_layout.Leaf


@dataclass(frozen=True)
class RecordedColumn:
    """The values of a signal."""

    cycles: "NDArray[np.int64]"
    stamps_ns: "NDArray[np.int64]"
    values: "NDArray[Any]"  # of shape (cycles, *shape of the signal)


@dataclass(frozen=True, eq=False)
class RecordedTopic:
    """The messages of one output or state, or of the cycles; names need not be unique."""

    number: int
    name: str
    ros_type: str
    definition: str  # including its field types
    metadata: dict[str, str]


@dataclass(frozen=True)
class _Chunk:
    at: int  # offset of its records in the file
    length: int  # bytes in the file
    compression: str  # empty = none
    start_ns: int
    end_ns: int
    size: int  # bytes, uncompressed
    crc: int  # of the uncompressed records; 0 = unknown


@dataclass(frozen=True)
class _Run:
    """Consecutive messages of one channel and size."""

    at: int  # offset in the chunk
    count: int
    size: int  # bytes of a message record


class _Records:
    """The records of a chunk."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.runs: dict[int, list[_Run]] = {}  # by channel
        at, guess = 0, 1
        while at + mcap.MESSAGE_HEAD <= len(data):
            opcode, length, channel = _MESSAGE.unpack_from(data, at)
            size = _RECORD.size + length
            if opcode == mcap.MESSAGE:
                guess = self._count(at, size, guess)
                self.runs.setdefault(channel, []).append(_Run(at, guess, size))
                size *= guess
            at += size

    def field(self, run: _Run, offset: int, kind: str, count: int | None = None) -> "NDArray[Any]":
        """Return one field of each record of a run, or `count` consecutive fields of each."""
        import numpy as np

        each = ros_layout.size_of(kind)
        if offset + each * (1 if count is None else count) > run.size:
            raise ValueError(f"a message of {run.size - mcap.MESSAGE_HEAD} bytes is too short")
        shape, strides = ((run.count,), (run.size,)) if count is None else (
            (run.count, count), (run.size, each)
        )  # fmt: skip
        fields: NDArray[Any] = np.ndarray(shape, kind, self.data, run.at + offset, strides)
        return fields

    def _count(self, at: int, size: int, guess: int) -> int:
        """Return the number of consecutive messages of one channel and size.

        `guess` is the first number tried, usually the length of the previous run.
        """
        import numpy as np

        most, count = (len(self.data) - at) // size, 1
        if most == 0:
            raise ValueError("a message is longer than its chunk")
        head = _MESSAGE.unpack_from(self.data, at)
        while count < most:
            run = _Run(at + count * size, min(guess + 1, most - count), size)
            heads = (self.field(run, *each) for each in ((0, "u1"), (1, "<u8"), (9, "<u2")))
            others = np.logical_or.reduce(
                [found != one for found, one in zip(heads, head, strict=True)]
            )
            if others.any():
                return count + int(others.argmax())
            count += run.count
            guess *= 2
        return count


@dataclass(frozen=True, eq=False)
class _Cycles:
    """The cycles of a channel's messages in a chunk."""

    low: "NDArray[np.uint32]"  # the low 32 bits of the cycle numbers, from the messages
    stamps_ns: "NDArray[np.int64]"
    numbers: "NDArray[np.int64]"


class Recording(Closing):
    """A recording, opened for reading; values are read on demand.

    path      the file
    signals   by name, with the same names as in a stream of ports
    whole     whether the file was closed in order
    metadata  the metadata records of the file, by name

    The constructor and all methods raise RecordingError.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.whole = False
        self.signals: dict[str, RecordedSignal] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self._channels: dict[int, RecordedTopic] = {}
        self._chunks: list[_Chunk] = []
        self.cycle_topic = 0  # topic number of the cycles; 0 = none
        self._declared: dict[int, int] = {}  # number of chunks before each channel
        self._cache: tuple[int, _Records] | None = None
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
        """The number of chunks: parts of the file that are read as a whole."""
        return len(self._chunks)

    @property
    def begin_ns(self) -> int:
        """The stamp of the first message; ns, 0 = no messages."""
        return self._chunks[0].start_ns if self._chunks else 0

    @property
    def end_ns(self) -> int:
        """The stamp of the last message; ns, 0 = no messages."""
        return self._chunks[-1].end_ns if self._chunks else 0

    @property
    def cycles(self) -> "NDArray[np.int64]":
        """The numbers of all cycles, in order of recording."""
        return self.read_cycles()["iteration"].values

    @property
    def stamps_ns(self) -> "NDArray[np.int64]":
        """CLOCK_REALTIME of each cycle's deadline, or the simulated time; ns."""
        return self.read_cycles()["iteration"].stamps_ns

    @property
    def durations_ns(self) -> "NDArray[np.int64]":
        """The calculation duration of each cycle; ns."""
        return self.read_cycles()["duration_ns"].values

    @property
    def latencies_ns(self) -> "NDArray[np.int64]":
        """The wake-up latency of each cycle; ns."""
        return self.read_cycles()["latency_ns"].values

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
        """Return the values of a signal with stamps in [begin_ns, end_ns), or those in one chunk.

        Chunks outside the range are not read.
        """
        return self.read_all([name], begin_ns, end_ns, chunk)[name]

    def read_all(
        self,
        names: Iterable[str] | None = None,
        begin_ns: int | None = None,
        end_ns: int | None = None,
        chunk: int | None = None,
    ) -> dict[str, RecordedColumn]:
        """Return the values of several signals (default: all) by name; see `read`.

        Each chunk is read once.  Signals of the same cycles share `cycles` and `stamps_ns`.
        """
        found = list(dict.fromkeys(self.signals if names is None else names))
        for name in found:
            if name not in self.signals:
                known = ", ".join(list(self.signals)[:8])
                raise RecordingError(f"{self.path} has no signal {name}; it has {known or 'none'}")
        leaves = [(self.signals[name].channel, self.signals[name].leaf) for name in found]
        with self._whole_only():
            return dict(zip(found, self._read(leaves, begin_ns, end_ns, chunk), strict=True))

    def read_cycles(
        self,
        begin_ns: int | None = None,
        end_ns: int | None = None,
        chunk: int | None = None,
    ) -> dict[str, RecordedColumn]:
        """Return `iteration`, `duration_ns` and `latency_ns` of the cycles; see `read_all`."""
        if not self.cycle_topic:
            raise RecordingError(
                f"{self.path} has no cycle topic: it was not written by rtcfctl record"
            )
        leaves = [(self.cycle_topic, leaf) for leaf in _CYCLE.values()]
        with self._whole_only():
            return dict(zip(_CYCLE, self._read(leaves, begin_ns, end_ns, chunk), strict=True))

    def listed(self, name: str) -> list[Any]:
        """Return the list in a metadata record, such as `events`; empty if it is damaged."""
        try:
            found = json.loads(self.metadata.get(name, {}).get("json", "[]"))
        except ValueError:
            return []
        return found if isinstance(found, list) else []

    def runs(
        self, chunk: int
    ) -> "list[tuple[RecordedTopic, NDArray[np.int64], NDArray[np.uint8]]]":
        """Return the messages of a chunk by topic and size: stamps (ns), and the serialised ROS 1
        messages, of shape (messages, bytes of a message), as views of the chunk.
        """
        with self._whole_only():
            records = self._records(chunk)
            return [
                (self._channels[channel], records.field(run, 15, "<i8"),
                 records.field(run, mcap.MESSAGE_HEAD, "u1", run.size - mcap.MESSAGE_HEAD))
                for channel, runs in records.runs.items()
                for run in runs
            ]  # fmt: skip

    def messages(self, chunk: int) -> list[tuple[RecordedTopic, int, bytes]]:
        """Return topic, stamp (ns) and serialised ROS 1 message of a chunk's messages, by stamp."""
        found: list[tuple[int, int, int, RecordedTopic]] = []
        with self._whole_only():
            records = self._records(chunk)
            for channel, runs in records.runs.items():
                for run in runs:
                    stamps = as_list(records.field(run, 15, "<i8"))
                    places = range(run.at, run.at + run.count * run.size, run.size)
                    found += [
                        (stamp, at, at + run.size, self._channels[channel])
                        for stamp, at in zip(stamps, places, strict=True)
                    ]
            found.sort(key=lambda each: each[:2])
            data = records.data
            return [
                (topic, stamp, data[at + mcap.MESSAGE_HEAD : end])
                for stamp, at, end, topic in found
            ]

    def packed_chunk(self, chunk: int) -> tuple[mcap.Chunk, dict[int, int]]:
        """Return a chunk, still compressed, and its number of messages by channel.

        Raises RecordingError if the chunk is damaged.
        """
        with self._whole_only():
            found = self._chunks[chunk]
            records = self._records(chunk)
            if found.crc and zlib.crc32(records.data) != found.crc:
                raise ValueError("a chunk has a wrong checksum")
            counts = {
                channel: sum(run.count for run in runs) for channel, runs in records.runs.items()
            }
            times = found.start_ns, found.end_ns
            return mcap.Chunk(*times, found.size, found.crc, found.compression,
                              self._packed(found)), counts  # fmt: skip

    @property
    def topics(self) -> list[RecordedTopic]:
        """The topics of outputs, states and cycles, sorted by number."""
        return [self._channels[number] for number in sorted(self._channels)]

    def to_pandas(self, names: Iterable[str] | None = None) -> Any:
        """Return a pandas.DataFrame of the scalar signals, indexed by cycle number."""
        import pandas

        columns = self.read_all(names)
        indexes: dict[int, Any] = {}  # one for all signals of the same cycles
        series = {}
        for name, column in columns.items():
            if column.values.ndim == 1:
                key = id(column.cycles)
                if key not in indexes:
                    indexes[key] = pandas.Index(column.cycles)
                series[name] = pandas.Series(column.values, index=indexes[key])
        return pandas.DataFrame(series)

    @contextlib.contextmanager
    def _whole_only(self) -> Iterator[None]:
        try:
            yield
        except _NONSENSE as error:
            raise RecordingError(
                f"{self.path} is damaged: {error}; rtcfctl convert --repair keeps the rest"
            ) from None

    def _read(
        self,
        leaves: Sequence[tuple[int, ros_layout.Leaf]],
        begin_ns: int | None = None,
        end_ns: int | None = None,
        chunk: int | None = None,
    ) -> list[RecordedColumn]:
        """Return the columns of (channel, leaf) pairs."""
        import numpy as np

        cycles: dict[int, list[_Cycles]] = {channel: [] for channel, _ in leaves}
        values: list[list[NDArray[Any]]] = [[] for _ in leaves]
        numbers = [
            number
            for number in (range(self.chunks) if chunk is None else (chunk,))
            if (end_ns is None or self._chunks[number].start_ns < end_ns)
            and (begin_ns is None or self._chunks[number].end_ns >= begin_ns)
        ]
        for records in self._several(numbers):
            keep: dict[int, Any] = {}
            kept: dict[int, tuple[Any, _Cycles]] = {}  # by the object, which channels share
            for channel, found in self._cycles(records, cycles).items():
                if id(found) not in kept:
                    kept[id(found)] = _between(found, begin_ns, end_ns)
                keep[channel], those = kept[id(found)]
                cycles[channel].append(those)
            for (channel, leaf), column in zip(leaves, values, strict=True):
                if channel in keep:
                    column.append(_column(records, channel, leaf)[keep[channel]])
        shared: dict[tuple[int, ...], tuple[NDArray[np.int64], NDArray[np.int64]]] = {}
        columns = []
        for (channel, leaf), column in zip(leaves, values, strict=True):
            parts = cycles[channel]
            key = tuple(map(id, parts))
            if key not in shared:
                none = np.zeros(0, "i8")
                shared[key] = (
                    np.concatenate([none, *(part.numbers for part in parts)]),
                    np.concatenate([none, *(part.stamps_ns for part in parts)]),
                )
            shape = () if leaf.count is None else (leaf.count,)
            empty = np.zeros((0, *shape), leaf.format)
            columns.append(RecordedColumn(*shared[key], np.concatenate([empty, *column])))
        return columns

    def _cycles(self, records: _Records, channels: Iterable[int]) -> dict[int, _Cycles]:
        """Return the cycles of each channel with messages.

        Channels with the same cycles share one object.
        """
        import numpy as np

        every: _Cycles | None = None
        if self.cycle_topic in records.runs:
            numbers = _column(records, self.cycle_topic, _CYCLE["iteration"])
            every = _Cycles(*_low(records, self.cycle_topic), numbers)
        found = {}
        for channel in channels:
            if channel not in records.runs:
                continue
            low, stamps = _low(records, channel)
            if every is None:
                found[channel] = _Cycles(low, stamps, low.astype("i8"))
            elif np.array_equal(low, every.low) and np.array_equal(stamps, every.stamps_ns):
                found[channel] = every
            else:
                order = np.argsort(every.low, kind="stable")
                place = np.searchsorted(every.low[order], low).clip(max=len(order) - 1)
                found[channel] = _Cycles(low, stamps, every.numbers[order][place])
        return found

    def _records(self, number: int) -> _Records:
        if self._cache is None or self._cache[0] != number:
            self._cache = None  # free the memory before the next chunk is read
            chunk = self._chunks[number]
            packed = self._packed(chunk)
            self._cache = (number, _Records(self._unpacked(chunk, packed)))
        return self._cache[1]

    def _several(self, numbers: Sequence[int]) -> Iterator[_Records]:
        """Yield the records of chunks; decompress the next ones in threads meanwhile."""
        if len(numbers) < 2:
            yield from map(self._records, numbers)
            return
        with ThreadPoolExecutor(_AHEAD) as pool:
            waiting: deque[Future[bytes]] = deque()
            try:
                for number in numbers:
                    chunk = self._chunks[number]
                    waiting.append(pool.submit(self._unpacked, chunk, self._packed(chunk)))
                    if len(waiting) > _AHEAD:
                        yield _Records(waiting.popleft().result())
                while waiting:
                    yield _Records(waiting.popleft().result())
            finally:
                for each in waiting:
                    each.cancel()

    def _packed(self, chunk: _Chunk) -> bytes:
        self._file.seek(chunk.at)
        return self._file.read(chunk.length)

    def _unpacked(self, chunk: _Chunk, data: bytes) -> bytes:
        if chunk.compression == "":
            return data
        if chunk.compression != "zstd":
            raise RecordingError(f"{self.path}: unsupported compression {chunk.compression}")
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
        """Find all channels and chunks, up to the end or to the last complete record."""
        size = self._file.seek(0, os.SEEK_END)
        self._file.seek(0)
        if self._file.read(len(mcap.MAGIC)) != mcap.MAGIC:
            raise RecordingError(f"{self.path} is not an MCAP file")
        schemas: dict[int, tuple[str, str]] = {}
        at = len(mcap.MAGIC)
        while at + _RECORD.size <= size:
            self._file.seek(at)
            opcode, length = _RECORD.unpack(self._file.read(_RECORD.size))
            content_at, at = at + _RECORD.size, at + _RECORD.size + length
            if at > size:
                break
            if opcode == mcap.DATA_END:
                self.whole = self._has_summary(size)
                break
            if opcode == mcap.CHUNK:
                self._chunks.append(self._chunk(content_at))
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
                self._declared[number] = len(self._chunks)
            elif opcode == mcap.METADATA:
                reader = Fields(self._file.read(length))
                name = reader.text()
                self.metadata[name] = reader.pairs()
        self._find_signals()

    def _chunk(self, at: int) -> _Chunk:
        start, end, size, crc = _CHUNK_HEAD.unpack(self._file.read(_CHUNK_HEAD.size))
        (length,) = struct.unpack("<I", self._file.read(4))
        compression = self._file.read(length).decode()
        (packed,) = struct.unpack("<Q", self._file.read(8))
        return _Chunk(self._file.tell(), packed, compression, start, end, size, crc)

    def _has_summary(self, size: int) -> bool:
        """Return whether the file has a summary, which close() writes."""
        self._file.seek(max(size - mcap.FOOTER_SIZE - len(mcap.MAGIC), 0))
        opcode, length = _RECORD.unpack(self._file.read(_RECORD.size))
        (start,) = struct.unpack("<Q", self._file.read(8))
        return bool(
            opcode == mcap.FOOTER and length == mcap.FOOTER_SIZE - _RECORD.size and start > 0
        )

    def _find_signals(self) -> None:
        outputs = {
            (channel.metadata.get("component"), channel.metadata.get("name"))
            for channel in self._channels.values()
            if channel.metadata.get("kind") == "output"
        }
        for number, channel in self._channels.items():
            if channel.metadata.get("kind") == "cycle":
                self.cycle_topic = number
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
                unit = channel.metadata.get("unit", "") if leaf.has_unit else ""
                self.signals[full] = RecordedSignal(full, unit, number, leaf)

    def _sample(self, channel: int) -> bytes | None:
        """Return the first message of a channel; None if it has none."""
        for number in range(self._declared[channel], self.chunks):
            records = self._records(number)
            for run in records.runs.get(channel, ()):
                return records.data[run.at + mcap.MESSAGE_HEAD : run.at + run.size]
        return None


def _low(records: _Records, channel: int) -> "tuple[NDArray[np.uint32], NDArray[np.int64]]":
    """Return the sequence numbers and stamps (ns) of a channel's messages."""
    import numpy as np

    runs = records.runs[channel]
    return (
        np.concatenate([records.field(run, 11, "<u4") for run in runs]),
        np.concatenate([records.field(run, 15, "<i8") for run in runs]),
    )


def _column(records: _Records, channel: int, leaf: ros_layout.Leaf) -> "NDArray[Any]":
    """Return the values of a leaf in a channel's messages."""
    import numpy as np

    offset = mcap.MESSAGE_HEAD + leaf.offset
    return np.concatenate(
        [records.field(run, offset, leaf.format, leaf.count) for run in records.runs[channel]]
    )


def _between(found: _Cycles, begin_ns: int | None, end_ns: int | None) -> tuple[Any, _Cycles]:
    """Return the index of the cycles with stamps in [begin_ns, end_ns), and these cycles."""
    import numpy as np

    if begin_ns is None and end_ns is None:
        return slice(None), found
    keep = np.ones(len(found.stamps_ns), bool)
    if begin_ns is not None:
        keep &= found.stamps_ns >= begin_ns
    if end_ns is not None:
        keep &= found.stamps_ns < end_ns
    return keep, _Cycles(found.low[keep], found.stamps_ns[keep], found.numbers[keep])


def read_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording; raises RecordingError."""
    return Recording(path)
