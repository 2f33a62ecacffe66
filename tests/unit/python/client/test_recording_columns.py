"""Recordings against a model: each value of each cycle, in files that are valid at any time."""

import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rtcf.recording.convert import repair
from rtcf.recording.reader import Recording, RecordingError, read_recording
from rtcf.v1 import ports_pb2
from rtcf_shared import mcap_writer as mcap
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch, schema_of
from rtcf_shared.recorder import Recorder

_KINDS = {"double": "<f8", "bool": "?", "uint16[3]": "<u2", "float[2x2]": "<f4"}
_COUNTS = {"double": (), "bool": (), "uint16[3]": (3,), "float[2x2]": (2, 2)}

# A batch: its states, its cycles, the dropped cycles before it, and whether a flush follows.
_BATCHES = st.lists(
    st.tuples(
        st.sets(st.sampled_from(sorted(_KINDS))),
        st.integers(0, 40),
        st.integers(0, 3),
        st.booleans(),
    ),
    max_size=8,
)


class _Disk(io.BytesIO):
    """A file that stores its content after each write."""

    def __init__(self) -> None:
        super().__init__()
        self.states: list[bytes] = []

    def write(self, data: Any, /) -> int:
        count = super().write(data)
        self.states.append(self.getvalue())
        return count


class _Model:
    """The expected values of a recording."""

    def __init__(self, first_cycle: int, seed: int) -> None:
        self.cycles: list[int] = []
        self.stamps: list[int] = []
        self.values: dict[str, list[tuple[int, Any]]] = {}
        self._next = first_cycle
        self._random = np.random.default_rng(seed)

    def batch(self, kinds: set[str], count: int, lost: int) -> PortBatch:
        """Return a batch and add it to the model."""
        first = self._next + lost
        self._next = first + count
        cycles = range(first, first + count)
        stamps = [10**18 + cycle * 1_000_000 for cycle in cycles]
        self.cycles += cycles
        self.stamps += stamps
        columns, data = [], []
        for kind in sorted(kinds):
            name = kind.partition("[")[0]
            shape = (count, *_COUNTS[kind])
            values = self._random.integers(0, 2, shape).astype(_KINDS[kind])
            if kind == "double":
                values = self._random.standard_normal(shape)
            size = values.dtype.itemsize * int(np.prod(_COUNTS[kind], dtype=int))
            columns.append(
                ports_pb2.PortColumn(
                    component="/a",
                    name=name,
                    kind=ports_pb2.PortColumn.KIND_STATE,
                    type=kind,
                    size=size,
                )
            )
            # A matrix is stored column by column.
            data.append((values.swapaxes(1, 2) if values.ndim == 3 else values).tobytes())
            flat = [value.reshape(-1) if _COUNTS[kind] else value for value in values]
            rows = zip(cycles, flat, strict=True)
            self.values.setdefault(f"/a.{name}", []).extend(rows)
        message = ports_pb2.PortBatch(
            first_cycle=first,
            stamps_ns=stamps,
            latencies_ns=[0] * count,
            durations_ns=[cycle % 1000 for cycle in cycles],
            values=data,
        )
        schema = schema_of(ports_pb2.PortSchema(columns=columns))
        return PortBatch(schema, 1, first, lost, False, message)

    def check(self, recording: Recording) -> None:
        """Check that a recording contains everything."""
        columns = recording.read_cycles() if self.cycles else {}
        expected = {
            "iteration": self.cycles,
            "duration_ns": [cycle % 1000 for cycle in self.cycles],
            "latency_ns": [0] * len(self.cycles),
        }
        for name, column in columns.items():
            assert list(column.values) == expected[name]
            assert column.stamps_ns.tolist() == self.stamps
        there = {name: rows for name, rows in self.values.items() if rows}
        assert set(recording.signals) == set(there)
        found = recording.read_all(there)
        for name, rows in there.items():
            assert found[name].cycles.tolist() == [cycle for cycle, _ in rows], name
            assert np.array_equal(found[name].values, [value for _, value in rows]), name
            assert np.array_equal(found[name].values, recording[name]), name


def _record(disk: io.BytesIO, batches: Any, first_cycle: int) -> _Model:
    model = _Model(first_cycle, len(batches))
    recorder = Recorder(McapWriter(disk), "rt_runner")
    for kinds, count, lost, flush in batches:
        recorder.add(model.batch(kinds, count, lost))
        if flush:
            recorder.flush()
    recorder.flush()
    recorder._writer.close()
    return model


@settings(max_examples=60)
@given(batches=_BATCHES, first_cycle=st.sampled_from([1, 2**32 - 30, 2**40]))
def test_each_value_is_read_as_recorded(
    tmp_path_factory: pytest.TempPathFactory, batches: Any, first_cycle: int
) -> None:
    disk = _Disk()
    model = _record(disk, batches, first_cycle)
    file = tmp_path_factory.mktemp("recording") / "run.mcap"
    file.write_bytes(disk.getvalue())
    with read_recording(file) as recording:
        assert recording.whole
        model.check(recording)
        if len(model.stamps) > 2:
            begin, end = model.stamps[len(model.stamps) // 3], model.stamps[-1]
            for name in recording.signals:
                part = recording.read(name, begin, end)
                rows = [
                    (cycle, value)
                    for cycle, value in model.values[name]
                    if begin <= 10**18 + cycle * 1_000_000 < end
                ]
                assert part.cycles.tolist() == [cycle for cycle, _ in rows]
                assert len(rows) == 0 or np.array_equal(part.values, [value for _, value in rows])


def _ends_in_a_footer(data: bytes) -> bool:
    """Return whether readers can find the summary from the end of a file."""
    end = data[-mcap.FOOTER_SIZE - len(mcap.MAGIC) :]
    opcode, _, summary, offsets, _ = struct.unpack_from("<BQQQI", end)
    first = data[summary : summary + 1]
    return (
        opcode == mcap.FOOTER
        and end.endswith(mcap.MAGIC)
        and (summary == offsets == 0 or first[0] in (mcap.SCHEMA, mcap.STATISTICS))
    )


@settings(max_examples=30)
@given(batches=_BATCHES)
def test_the_file_is_valid_after_each_write_with_all_earlier_chunks(
    tmp_path_factory: pytest.TempPathFactory, batches: Any
) -> None:
    disk = _Disk()
    model = _record(disk, batches, 1)
    folder = tmp_path_factory.mktemp("recording")
    cycles = 0
    # In the last state but one the start of the summary is not written yet.
    for number, state in enumerate([*disk.states[:-2], disk.states[-1]]):
        assert _ends_in_a_footer(state), number
        file = folder / f"{number}.mcap"
        file.write_bytes(state)
        with read_recording(file) as recording:
            assert recording.whole == (state is disk.states[-1])
            found = list(recording.cycles) if recording.cycle_topic else []
        assert found == model.cycles[: len(found)]
        assert len(found) >= cycles
        cycles = len(found)
    assert cycles == len(model.cycles)


class _Full(io.BytesIO):
    """A disk with limited space."""

    room = 0

    def write(self, data: Any, /) -> int:
        if self.tell() + len(data) > self.room:
            super().write(data[: max(self.room - self.tell(), 0)])
            raise OSError(28, "No space left on device")
        return super().write(data)


@settings(max_examples=40)
@given(room=st.integers(60, 6000), batches=_BATCHES)
def test_a_full_disk_leaves_a_valid_file(
    tmp_path_factory: pytest.TempPathFactory, room: int, batches: Any
) -> None:
    disk = _Full()
    disk.room = 10**9
    writer = McapWriter(disk)
    disk.room = max(room, disk.tell())
    recorder = Recorder(writer, "rt_runner")
    model = _Model(1, 0)
    written = 0
    try:
        for kinds, count, lost, _ in batches:
            recorder.add(model.batch(kinds, count, lost))
            recorder.flush()
            written = len(model.cycles)
    except OSError:
        pass
    assert _ends_in_a_footer(disk.getvalue())
    file = tmp_path_factory.mktemp("recording") / "run.mcap"
    file.write_bytes(disk.getvalue())
    with read_recording(file) as recording:
        found = recording.cycles.tolist() if recording.cycle_topic else []
    assert found == model.cycles[:written]


def _some_chunks(file: Path) -> _Model:
    disk = _Disk()
    batches = [({"double", "bool"}, 30, 0, True)] * 4
    model = _record(disk, batches, 1)
    file.write_bytes(disk.states[-3])  # the state before it was closed
    return model


def test_a_repaired_recording_is_complete(tmp_path: Path) -> None:
    killed, whole = tmp_path / "killed.mcap", tmp_path / "whole.mcap"
    model = _some_chunks(killed)
    with killed.open("ab") as file:
        file.write(b"half a chunk")
    with read_recording(killed) as recording:
        assert not recording.whole
        assert repair(recording, whole) == (120, 0)
    with read_recording(whole) as recording:
        assert recording.whole
        model.check(recording)
    assert _ends_in_a_footer(whole.read_bytes())


def test_a_repair_leaves_out_a_damaged_chunk(tmp_path: Path) -> None:
    killed, whole = tmp_path / "killed.mcap", tmp_path / "whole.mcap"
    _some_chunks(killed)
    data = bytearray(killed.read_bytes())
    with read_recording(killed) as recording:
        chunk = recording._chunks[2]
    data[chunk.at + chunk.length // 2] ^= 0x40
    killed.write_bytes(data)
    with read_recording(killed) as recording:
        assert repair(recording, whole) == (90, 1)
    with read_recording(whole) as recording:
        assert recording.cycles.tolist() == [*range(1, 61), *range(91, 121)]


def test_no_changed_bit_of_a_chunk_is_read_as_a_value(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    _some_chunks(file)
    data = file.read_bytes()
    with read_recording(file) as recording:
        chunk = recording._chunks[2]
        names = list(recording.signals)
        before = recording.read_all(names)
    found = 0
    for at in range(chunk.at, chunk.at + chunk.length):
        file.write_bytes(data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :])
        try:
            with read_recording(file) as recording:
                after = recording.read_all(names)
        except RecordingError as error:
            found += 1
            assert "convert --repair" in str(error)
            continue
        for name in names:
            assert np.array_equal(after[name].values, before[name].values)
    assert found >= chunk.length - 8  # some bits of the frame's head have no meaning


def test_a_repair_overwrites_no_file(tmp_path: Path) -> None:
    killed, whole = tmp_path / "killed.mcap", tmp_path / "whole.mcap"
    _some_chunks(killed)
    whole.write_text("mine")
    with read_recording(killed) as recording:
        for to, said in (
            (whole, "already exists: --force overwrites it"),
            (killed, "is the recording itself"),
            (tmp_path / "run.bag", "the suffix must be .mcap"),
        ):
            with pytest.raises(ValueError, match=said):
                repair(recording, to)
        assert whole.read_text() == "mine"
        assert repair(recording, whole, force=True) == (120, 0)


def test_a_file_of_another_writer_is_read_message_by_message(tmp_path: Path) -> None:
    """Messages of two channels alternate, with an index after the chunk."""
    file = tmp_path / "other.mcap"
    rows = []
    for cycle in range(5):
        for channel, size in ((1, 8), (2, 4)):
            row = np.zeros(1, mcap.message_type(size))
            row["opcode"], row["length"] = mcap.MESSAGE, mcap.MESSAGE_HEAD - 9 + size
            row["channel"], row["sequence"] = channel, cycle
            row["log_time"] = row["publish_time"] = cycle * 1000
            row["data"] = np.frombuffer(struct.pack("<d", cycle)[-size:], "u1")
            rows.append(row.tobytes())
    records = b"".join(rows)
    with file.open("xb", buffering=0) as out:
        writer = McapWriter(out)
        writer.channel("/a/x", "std_msgs/Float64", "float64 data\n", {})
        writer.channel("/a/y", "std_msgs/UInt32", "uint32 data\n", {})
        index = mcap.record(mcap.MESSAGE_INDEX, struct.pack("<HI", 1, 0))
        writer.packed_chunk(mcap.Chunk(0, 4000, len(records), 0, "", records), {1: 5, 2: 5})
        writer._pending += index
        writer.close()
    with read_recording(file) as recording:
        assert list(recording["/a/x"]) == [0.0, 1.0, 2.0, 3.0, 4.0]
        assert len(recording["/a/y"]) == 5
        assert [stamp for _, stamp, _ in recording.messages(0)] == [
            cycle * 1000 for cycle in range(5) for _ in range(2)
        ]


def test_invalid_data_in_a_chunk_is_damage(tmp_path: Path) -> None:
    file = tmp_path / "x.mcap"
    for records in (mcap.record(mcap.MESSAGE, b"")[:-1] + b"\xff" * 40, b"\x05" + b"\xff" * 60):
        with file.open("wb", buffering=0) as out:
            writer = McapWriter(out)
            writer.channel("/a/x", "std_msgs/Float64", "float64 data\n", {})
            writer.packed_chunk(mcap.Chunk(0, 1, len(records), 0, "", records), {})
            writer.close()
        with pytest.raises(RecordingError, match="is damaged"):
            read_recording(file)
