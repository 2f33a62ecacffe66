"""Writes ROS 1 bags, format 2.0: http://wiki.ros.org/Bags/Format/2.0.

rosbag writes one message at a time, which takes some 30 times as long as reading a recording.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MAGIC = b"#ROSBAG V2.0\n"
_HEAD = 4096  # bytes of the record at the begin, with its padding
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7  # opcodes
_U4, _U8 = struct.Struct("<I"), struct.Struct("<Q")
_NS = 1_000_000_000


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages of one connection and size, in the order of their stamps."""

    connection: int
    stamps_ns: "NDArray[np.int64]"
    data: "NDArray[np.uint8]"  # of shape (messages, bytes of a message)


class BagWriter:
    """A bag, which is complete after close(); raises OSError and RecordingError.

    file  opened for reading and writing, and empty
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._connections: list[bytes] = []  # their records
        self._infos: list[bytes] = []  # of chunks: their records
        self._in_chunks = 0  # number of connections whose record is in a chunk
        file.write(_MAGIC + self._bag_record(0))

    def connection(self, topic: str, ros_type: str, md5: str, definition: str) -> int:
        """Add a topic; return its number."""
        number = len(self._connections)
        name = topic.encode()
        described = _header(
            topic=name, type=ros_type.encode(), md5sum=md5.encode(),
            message_definition=definition.encode(),
        )  # fmt: skip
        head = _header(op=bytes([_CONNECTION]), conn=_U4.pack(number), topic=name)
        self._connections.append(_record(head, described))
        return number

    def chunk(self, runs: Sequence[Messages]) -> None:
        """Write messages as a chunk."""
        import numpy as np

        runs = [each for each in runs if len(each.stamps_ns)]
        if not runs:
            return
        # A connection is described before its first message.
        parts = self._connections[self._in_chunks :]
        self._in_chunks = len(self._connections)
        at = sum(map(len, parts))
        entries: dict[int, list[NDArray[np.uint32]]] = {}
        for run in runs:
            records = _message_records(run)
            count, size = records.shape
            entry = np.empty((count, 3), "<u4")
            entry[:, 0], entry[:, 1] = _seconds(run.stamps_ns)
            entry[:, 2] = at + np.arange(count) * size
            entries.setdefault(run.connection, []).append(entry)
            parts.append(records.tobytes())
            at += count * size
        place = self._file.tell()
        head = _header(op=bytes([_CHUNK]), compression=b"none", size=_U4.pack(at))
        self._file.write(_U4.pack(len(head)) + head + _U4.pack(at))
        self._file.writelines(parts)
        counts = b""
        for connection, found in entries.items():
            together = np.concatenate(found)
            if len(found) > 1:  # readers search for times
                together = together[np.lexsort((together[:, 1], together[:, 0]))]
            number, length = _U4.pack(connection), _U4.pack(len(together))
            head = _header(op=bytes([_INDEX]), ver=_U4.pack(1), conn=number, count=length)
            self._file.write(_record(head, together.tobytes()))
            counts += number + length
        stamps = np.concatenate([each.stamps_ns for each in runs])
        head = _header(
            op=bytes([_CHUNK_INFO]), ver=_U4.pack(1), chunk_pos=_U8.pack(place),
            start_time=_time(int(stamps.min())), end_time=_time(int(stamps.max())),
            count=_U4.pack(len(entries)),
        )  # fmt: skip
        self._infos.append(_record(head, counts))

    def close(self) -> None:
        """Write the index."""
        place = self._file.tell()
        self._file.writelines(self._connections)
        self._file.writelines(self._infos)
        self._file.seek(len(_MAGIC))
        self._file.write(self._bag_record(place))

    def _bag_record(self, index: int) -> bytes:
        head = _header(
            op=bytes([_BAG]), index_pos=_U8.pack(index),
            conn_count=_U4.pack(len(self._connections)), chunk_count=_U4.pack(len(self._infos)),
        )  # fmt: skip
        return _record(head, b" " * (_HEAD - len(_record(head, b""))))


def _message_records(run: Messages) -> "NDArray[np.uint8]":
    """Return the records of messages, of shape (messages, bytes of a record)."""
    import numpy as np

    count, size = run.data.shape
    stamp = _field("time", bytes(8))
    head = _header(op=bytes([_MESSAGE]), conn=_U4.pack(run.connection), time=bytes(8))
    begin = np.frombuffer(_U4.pack(len(head)) + head + _U4.pack(size), np.uint8)
    records = np.empty((count, len(begin) + size), np.uint8)
    records[:, : len(begin)] = begin
    times = np.empty((count, 2), "<u4")
    times[:, 0], times[:, 1] = _seconds(run.stamps_ns)
    end = _U4.size + len(head)
    assert head.endswith(stamp)
    records[:, end - 8 : end] = times.view(np.uint8).reshape(count, 8)
    records[:, len(begin) :] = run.data
    return records


def _seconds(stamps_ns: "NDArray[np.int64]") -> "tuple[NDArray[np.int64], NDArray[np.int64]]":
    return stamps_ns // _NS, stamps_ns % _NS


def _time(stamp_ns: int) -> bytes:
    return struct.pack("<II", *divmod(stamp_ns, _NS))


def _field(name: str, value: bytes) -> bytes:
    return _U4.pack(len(name) + 1 + len(value)) + name.encode() + b"=" + value


def _header(**fields: bytes) -> bytes:
    return b"".join(_field(name, value) for name, value in fields.items())


def _record(head: bytes, data: bytes) -> bytes:
    return _U4.pack(len(head)) + head + _U4.pack(len(data)) + data
