"""Writes MCAP files of ROS 1 messages by columns.

The format is https://mcap.dev/spec, version 0, profile `ros1`.  In a chunk, all messages of a
channel are consecutive.  A chunk has no message index, which would be larger than the messages.

The file is valid at any time: it ends with a footer without a summary, which the next chunk
overwrites as its last step.  Readers can open the file up to its last chunk, even if the writer was
killed.  On a pipe, the footer is written only at the end.
"""

import contextlib
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0C, 0x0D, 0x0E, 0x0F
MESSAGE_HEAD = 31  # bytes of a message's record before its data
_LIBRARY = "rtcf"
_FOOTER = struct.Struct("<QQI")


def record(opcode: int, content: bytes) -> bytes:
    """Return a record with its head."""
    return struct.pack("<BQ", opcode, len(content)) + content


# The end of a file without a summary.
END = record(DATA_END, bytes(4)) + record(FOOTER, bytes(_FOOTER.size)) + MAGIC
FOOTER_SIZE = len(record(FOOTER, bytes(_FOOTER.size)))


@dataclass(frozen=True)
class Column:
    """Messages of one channel and of equal size; times in ns."""

    channel: int
    sequences: "NDArray[Any]"  # cycle numbers
    times: "NDArray[Any]"
    data: "NDArray[Any]"  # bytes, a row per message


@dataclass(frozen=True)
class Chunk:
    """Compressed records; times in ns."""

    start: int
    end: int
    size: int  # bytes, uncompressed
    crc: int  # of the uncompressed records
    compression: str
    packed: bytes


@dataclass
class _Summary:
    """The content of the summary at the end of the file."""

    schemas: list[bytes] = field(default_factory=list)
    channels: list[bytes] = field(default_factory=list)
    chunks: list[bytes] = field(default_factory=list)
    metadata: list[bytes] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    start: int = 0
    end: int = 0


class McapWriter:
    """The writer of one unbuffered file, owned by its recorder.

    All methods can raise OSError; the file is then unchanged.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._seeks = file.seekable()  # otherwise close() writes the only footer
        self._at = 0  # bytes written, without the footer
        self._pending = bytearray()  # records to be written after them
        self._summary = _Summary()
        self._compress = _compressor()
        self._pending += MAGIC + record(HEADER, _text("ros1") + _text(_LIBRARY))
        self._commit(END)

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._at

    def channel(
        self, topic: str, ros_type: str, definition: str, metadata: Mapping[str, str]
    ) -> int:
        """Add a topic; return its number.

        It is written with the next chunk, which must have its first messages.
        """
        number = len(self._summary.channels) + 1
        schema = _text(ros_type) + _text("ros1msg") + _bytes(definition.encode())
        self._summary.schemas.append(struct.pack("<H", number) + schema)
        self._pending += record(SCHEMA, self._summary.schemas[-1])
        channel = struct.pack("<HH", number, number) + _text(topic) + _text("ros1")
        pairs = b"".join(_text(key) + _text(value) for key, value in metadata.items())
        self._summary.channels.append(channel + _bytes(pairs))
        self._pending += record(CHANNEL, self._summary.channels[-1])
        return number

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record, written with the next chunk."""
        pairs = b"".join(_text(key) + _text(value) for key, value in values.items())
        metadata = record(METADATA, _text(name) + _bytes(pairs))
        self._summary.metadata.append(
            struct.pack("<QQ", self._at + len(self._pending), len(metadata)) + _text(name)
        )
        self._pending += metadata

    def chunk(self, columns: Sequence[Column]) -> None:
        """Write messages as one chunk and flush it to the operating system."""
        merged: dict[tuple[int, int], list[Column]] = {}
        for column in columns:
            if len(column.times):
                key = column.channel, column.data.shape[1]
                merged.setdefault(key, []).append(column)
        if not merged:
            return
        parts = []
        counts: dict[int, int] = {}
        for (channel, _), several in merged.items():
            rows = _rows(several)
            parts.append(rows.tobytes())
            counts[channel] = counts.get(channel, 0) + len(rows)
        start = min(int(column.times.min()) for part in merged.values() for column in part)
        end = max(int(column.times.max()) for part in merged.values() for column in part)
        records = b"".join(parts)
        name, packed = self._compress(records)
        self.packed_chunk(
            Chunk(start, end, len(records), zlib.crc32(records), name, packed), counts
        )

    def packed_chunk(self, chunk: Chunk, counts: Mapping[int, int]) -> None:
        """Write an already compressed chunk; `counts` has its number of messages by channel."""
        head = struct.pack("<QQQI", chunk.start, chunk.end, chunk.size, chunk.crc)
        name = _text(chunk.compression)
        packed = record(CHUNK, head + name + struct.pack("<Q", len(chunk.packed)) + chunk.packed)
        mark = len(self._pending)
        at = self._at + mark
        self._pending += packed
        try:
            self._commit(END)
        except OSError:
            del self._pending[mark:]
            raise
        # No message index: an empty map with a length of 0 bytes.
        summary = self._summary
        summary.chunks.append(
            struct.pack("<QQQQ", chunk.start, chunk.end, at, len(packed))
            + _bytes(b"")
            + struct.pack("<Q", 0)
            + name
            + struct.pack("<QQ", len(chunk.packed), chunk.size)
        )
        first = len(summary.chunks) == 1
        summary.start = chunk.start if first else min(chunk.start, summary.start)
        summary.end = max(chunk.end, summary.end)
        for channel, count in counts.items():
            summary.counts[channel] = summary.counts.get(channel, 0) + count

    def close(self) -> None:
        """Write the summary and the footer; the caller closes the file."""
        self._pending += record(DATA_END, bytes(4))
        start = self._at + len(self._pending)
        summary = self._summary
        groups: list[tuple[int, Iterable[bytes]]] = [
            (SCHEMA, summary.schemas),
            (CHANNEL, summary.channels),
            (STATISTICS, [self._statistics()]),
            (CHUNK_INDEX, summary.chunks),
            (METADATA_INDEX, summary.metadata),
        ]
        offsets = []
        for opcode, records in groups:
            at = self._at + len(self._pending)
            for each in records:
                self._pending += record(opcode, each)
            length = self._at + len(self._pending) - at
            if length:
                offsets.append(struct.pack("<BQQ", opcode, at, length))
        offset_start = self._at + len(self._pending)
        for offset in offsets:
            self._pending += record(SUMMARY_OFFSET, offset)
        self._commit(record(FOOTER, _FOOTER.pack(start, offset_start, 0)) + MAGIC)

    def _commit(self, end: bytes) -> None:
        """Write the pending records and the new end of the file.

        The first bytes, which overwrite the old end, are written last.  Until then readers find the
        old end.
        """
        if not self._seeks:
            self._write(None, bytes(self._pending) + (b"" if end is END else end))
            self._at += len(self._pending)
            self._pending.clear()
            return
        data = memoryview(bytes(self._pending) + end)
        begin = len(END) if self._at else 0
        try:
            self._write(self._at + begin, data[begin:])
            if begin:
                self._write(self._at, data[:begin])
        except OSError:
            if self._at:  # restore the old end
                with contextlib.suppress(OSError):
                    self._write(self._at, END)
                    self._file.truncate(self._at + len(END))
            raise
        self._at += len(self._pending)
        self._pending.clear()

    def _write(self, at: int | None, data: "memoryview | bytes") -> None:
        if at is not None:
            self._file.seek(at)
        while len(data):
            data = data[self._file.write(data) :]
        self._file.flush()

    def _statistics(self) -> bytes:
        summary = self._summary
        counts = b"".join(struct.pack("<HQ", *pair) for pair in sorted(summary.counts.items()))
        return struct.pack(
            "<QHIIIIQQ",
            sum(summary.counts.values()),
            len(summary.schemas),
            len(summary.channels),
            0,
            len(summary.metadata),
            len(summary.chunks),
            summary.start,
            summary.end,
        ) + _bytes(counts)


def _rows(columns: Sequence[Column]) -> "NDArray[Any]":
    """Return the consecutive records of messages of one channel and size."""
    import numpy as np

    size = columns[0].data.shape[1]
    rows = np.empty(sum(len(column.times) for column in columns), message_type(size))
    rows["opcode"] = MESSAGE
    rows["length"] = MESSAGE_HEAD - 9 + size
    rows["channel"] = columns[0].channel
    at = 0
    for column in columns:
        part = rows[at : at + len(column.times)]
        part["sequence"] = column.sequences & 0xFFFFFFFF
        part["log_time"] = part["publish_time"] = column.times
        part["data"] = column.data
        at += len(part)
    return rows


def message_type(size: int) -> Any:
    """Return the NumPy type of a message record with `size` bytes of data."""
    import numpy as np

    return np.dtype(
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("data", "u1", (size,)),
        ]
    )


def _compressor() -> Any:
    try:
        import zstandard
    except ImportError:
        return lambda data: ("", data)
    # Heads and smooth values match those of the column before, at a large distance: a lazy search
    # finds longer matches there than levels 1 to 6, which skip or forget it. Readers check the
    # checksum, which is faster than the CRC of MCAP.
    compressor = zstandard.ZstdCompressor(
        compression_params=zstandard.ZstdCompressionParameters(
            strategy=zstandard.STRATEGY_LAZY, window_log=22, hash_log=17, chain_log=16,
            search_log=1, min_match=6, target_length=8, write_checksum=True,
        )
    )  # fmt: skip
    return lambda data: ("zstd", compressor.compress(data))


def _bytes(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _bytes(text.encode())
