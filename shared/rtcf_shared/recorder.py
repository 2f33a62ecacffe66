"""Writes a stream of port values to an MCAP file."""

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rtcf.v1 import ports_pb2

from rtcf_shared.mcap_writer import Column, McapWriter
from rtcf_shared.ports import PortBatch, PortSchema, Signal

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CHUNK = 8 * 1024 * 1024  # bytes of messages, about
_LAYOUT = """MultiArrayLayout layout
{kind}[] data
================================================================================
MSG: std_msgs/MultiArrayLayout
MultiArrayDimension[] dim
uint32 data_offset
================================================================================
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
"""
_CYCLE = """Header header
uint64 iteration
int64 duration_ns
int64 latency_ns
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
_KINDS = {
    "?": "bool", "<f4": "float32", "<f8": "float64", "<i1": "int8", "<u1": "uint8",
    "<i2": "int16", "<u2": "uint16", "<i4": "int32", "<u4": "uint32", "<i8": "int64",
    "<u8": "uint64",
}  # fmt: skip


@dataclass(frozen=True)
class _State:
    """The std_msgs message type in which a declared state is recorded."""

    signal: Signal
    ros_type: str
    definition: str
    prefix: bytes  # of a serialised message, before the numbers


class Recorder:
    """A recording of one runner; methods raise OSError for errors of its file."""

    def __init__(self, writer: McapWriter, runner: str) -> None:
        self._writer = writer
        self._schema: PortSchema | None = None
        self._channels: dict[tuple[str, ...], int] = {}
        self._kept: list[tuple[int, int, _State | None]] = []  # column of the schema, channel
        self._cycle_channel = writer.channel(
            f"/{runner}/cycles", "rtcf_msgs/Cycle", _CYCLE, {"runner": runner, "kind": "cycle"}
        )
        self._columns: list[Column] = []
        self._bytes = 0
        self.cycles = 0
        self.lost = 0

    def add(self, batch: PortBatch) -> list[str]:
        """Add a batch; return a note for each omitted state (without a ROS message type)."""
        self.lost += batch.lost
        if not len(batch):
            return []
        # Add new topics before their first messages.
        notes = self._enter(batch.schema) if batch.schema is not self._schema else []
        self.cycles += len(batch)
        self._take(batch)
        if self._bytes >= _CHUNK:
            self.flush()
        return notes

    def flush(self) -> None:
        """Write the buffered batches as a chunk."""
        self._writer.chunk(self._columns)
        self._columns, self._bytes = [], 0

    def _enter(self, schema: PortSchema) -> list[str]:
        self._schema = schema
        self._kept.clear()
        notes = []
        of_column = {signal.column: signal for signal in schema.signals.values()}
        for number, column in enumerate(schema.columns):
            state = None
            if column.kind == ports_pb2.PortColumn.KIND_STATE:
                state = _state(of_column.get(number))
                if state is None:
                    notes.append(
                        f"{column.component}.{column.name} is omitted: no ROS message for its type "
                        f"{column.type}"
                    )
                    continue
            key = _key(column)
            if key not in self._channels:
                self._channels[key] = self._channel(column, state)
            self._kept.append((number, self._channels[key], state))
        return notes

    def _channel(self, column: ports_pb2.PortColumn, state: "_State | None") -> int:
        return self._writer.channel(
            f"{column.component}/{column.name}",
            column.ros_type if state is None else state.ros_type,
            column.ros_definition if state is None else state.definition,
            {
                "component": column.component,
                "name": column.name,
                "kind": "output" if state is None else "state",
                "type": column.type,
                "unit": column.unit,
                "mapped": column.mapped,
                "md5sum": column.ros_md5,
            },
        )

    def _take(self, batch: PortBatch) -> None:
        import numpy as np

        cycles, stamps = batch.cycles, batch.stamps_ns
        self._put(self._cycle_channel, cycles, stamps, _cycle_rows(batch))
        for number, channel, state in self._kept:
            if state is None:
                data = np.frombuffer(batch.message.values[number], "u1")
                self._put(channel, cycles, stamps, data.reshape(len(batch), -1))
                continue
            numbers = np.ascontiguousarray(batch[state.signal.name]).reshape(len(batch), -1)
            data = numbers.view("u1").reshape(len(batch), -1)
            if state.prefix:
                head = np.broadcast_to(
                    np.frombuffer(state.prefix, "u1"), (len(batch), len(state.prefix))
                )
                data = np.hstack([head, data])
            self._put(channel, cycles, stamps, data)

    def _put(
        self, channel: int, cycles: "NDArray[Any]", stamps: "NDArray[Any]", data: "NDArray[Any]"
    ) -> None:
        self._columns.append(Column(channel, cycles, stamps, data))
        self._bytes += data.nbytes + 31 * len(data)


def _key(column: ports_pb2.PortColumn) -> tuple[str, ...]:
    """Return the key of a channel: a rebuilt type with other properties gets a new channel."""
    kind = str(column.kind)
    return column.component, column.name, kind, column.type, column.unit, column.ros_md5


def _cycle_rows(batch: PortBatch) -> "NDArray[Any]":
    import numpy as np

    rows = np.zeros(
        len(batch),
        [
            ("seq", "<u4"), ("secs", "<u4"), ("nsecs", "<u4"), ("frame_id", "<u4"),
            ("iteration", "<u8"), ("duration", "<i8"), ("latency", "<i8"),
        ],
    )  # fmt: skip
    cycles, stamps = batch.cycles, batch.stamps_ns
    rows["seq"] = cycles & 0xFFFFFFFF
    rows["secs"], rows["nsecs"] = stamps // 1_000_000_000, stamps % 1_000_000_000
    rows["iteration"] = cycles
    rows["duration"], rows["latency"] = batch.durations_ns, batch.latencies_ns
    return rows.view("u1").reshape(len(batch), -1)


def _state(signal: Signal | None) -> _State | None:
    if signal is None:
        return None
    kind = _KINDS[signal.format]
    name = kind[:1].upper() + kind[1:] if kind[0] != "u" else "UInt" + kind[4:]
    if not signal.shape:
        return _State(signal, f"std_msgs/{name}", f"{kind} data\n", b"")
    if kind == "bool":
        name, kind = "UInt8", "uint8"
    count = 1
    for length in signal.shape:
        count *= length
    # No dimensions, no offset, the number of values; matrices by rows.
    prefix = struct.pack("<III", 0, 0, count)
    return _State(signal, f"std_msgs/{name}MultiArray", _LAYOUT.format(kind=kind), prefix)
