"""Writes MCAP files of ROS 1 messages, many of one channel at a time.

The format is that of https://mcap.dev/spec: version 0, profile `ros1`.  Every chunk is
followed by its index, so that a file whose writer was killed opens up to its last chunk.
"""

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


@dataclass(frozen=True)
class Column:
    """Messages of one channel, of one size; times in ns."""

    channel: int
    sequences: "NDArray[Any]"  # cycle numbers
    times: "NDArray[Any]"
    data: "NDArray[Any]"  # bytes, a row each


@dataclass
class _Summary:
    """What the end of the file repeats of it."""

    schemas: list[bytes] = field(default_factory=list)
    channels: list[bytes] = field(default_factory=list)
    chunks: list[bytes] = field(default_factory=list)
    metadata: list[bytes] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    start: int = 0
    end: int = 0


class McapWriter:
    """One file; owned by who records.  All methods raise OSError."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._at = 0
        self._summary = _Summary()
        self._compress = _compressor()
        self._write(MAGIC)
        self._record(HEADER, _text("ros1") + _text(_LIBRARY))

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._at

    def channel(
        self, topic: str, ros_type: str, definition: str, metadata: Mapping[str, str]
    ) -> int:
        """Add a topic of a type; return its number."""
        number = len(self._summary.channels) + 1
        schema = _text(ros_type) + _text("ros1msg") + _bytes(definition.encode())
        self._summary.schemas.append(struct.pack("<H", number) + schema)
        self._record(SCHEMA, self._summary.schemas[-1])
        channel = struct.pack("<HH", number, number) + _text(topic) + _text("ros1")
        pairs = b"".join(_text(key) + _text(value) for key, value in metadata.items())
        self._summary.channels.append(channel + _bytes(pairs))
        self._record(CHANNEL, self._summary.channels[-1])
        return number

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add what somebody may want to know of the file."""
        pairs = b"".join(_text(key) + _text(value) for key, value in values.items())
        at = self._at
        self._record(METADATA, _text(name) + _bytes(pairs))
        self._summary.metadata.append(struct.pack("<QQ", at, self._at - at) + _text(name))

    def chunk(self, columns: Sequence[Column]) -> None:
        """Write messages, with their index, and see that the system has them."""
        import numpy as np

        columns = [column for column in columns if len(column.times)]
        if not columns:
            return
        parts, offset = [], 0
        indexes: dict[int, bytes] = {}
        for column in columns:
            rows = _rows(column)
            offsets = offset + np.arange(len(rows), dtype="<u8") * rows.itemsize
            entries = np.empty(len(rows), [("time", "<u8"), ("offset", "<u8")])
            entries["time"], entries["offset"] = column.times, offsets
            indexes[column.channel] = indexes.get(column.channel, b"") + entries.tobytes()
            parts.append(rows.tobytes())
            offset += rows.nbytes
            counts = self._summary.counts
            counts[column.channel] = counts.get(column.channel, 0) + len(rows)
        start = min(int(column.times.min()) for column in columns)
        end = max(int(column.times.max()) for column in columns)
        first = not self._summary.chunks
        self._summary.start = start if first else min(start, self._summary.start)
        self._summary.end = max(end, self._summary.end)
        self._write_chunk(start, end, b"".join(parts), indexes)
        self._file.flush()

    def close(self) -> None:
        """End the file in order; the caller closes it."""
        self._record(DATA_END, struct.pack("<I", 0))
        start = self._at
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
            at = self._at
            for record in records:
                self._record(opcode, record)
            if self._at > at:
                offsets.append(struct.pack("<BQQ", opcode, at, self._at - at))
        offset_start = self._at
        for offset in offsets:
            self._record(SUMMARY_OFFSET, offset)
        self._record(FOOTER, struct.pack("<QQI", start, offset_start, 0))
        self._write(MAGIC)
        self._file.flush()

    def _write_chunk(
        self, start: int, end: int, records: bytes, indexes: Mapping[int, bytes]
    ) -> None:
        name, packed = self._compress(records)
        at = self._at
        head = struct.pack("<QQQI", start, end, len(records), zlib.crc32(records))
        self._record(CHUNK, head + _text(name) + struct.pack("<Q", len(packed)) + packed)
        length = self._at - at
        places = []
        index_start = self._at
        for channel, index in indexes.items():
            places.append(struct.pack("<HQ", channel, self._at))
            self._record(MESSAGE_INDEX, struct.pack("<H", channel) + _bytes(index))
        self._summary.chunks.append(
            struct.pack("<QQQQ", start, end, at, length)
            + _bytes(b"".join(places))
            + struct.pack("<Q", self._at - index_start)
            + _text(name)
            + struct.pack("<QQ", len(packed), len(records))
        )

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

    def _record(self, opcode: int, content: bytes) -> None:
        self._write(struct.pack("<BQ", opcode, len(content)) + content)

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._at += len(data)


def _rows(column: Column) -> "NDArray[Any]":
    """Return the records of messages, one after the other."""
    import numpy as np

    size = column.data.shape[1]
    rows = np.empty(
        len(column.times),
        [
            ("opcode", "u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("data", "u1", (size,)),
        ],
    )
    rows["opcode"] = MESSAGE
    rows["length"] = MESSAGE_HEAD - 9 + size
    rows["channel"] = column.channel
    rows["sequence"] = column.sequences & 0xFFFFFFFF
    rows["log_time"] = rows["publish_time"] = column.times
    rows["data"] = column.data
    return rows


def _compressor() -> Any:
    try:
        import zstandard
    except ImportError:
        return lambda data: ("", data)
    compressor = zstandard.ZstdCompressor(level=1)
    return lambda data: ("zstd", compressor.compress(data))


def _bytes(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _bytes(text.encode())
