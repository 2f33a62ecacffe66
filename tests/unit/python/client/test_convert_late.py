"""Conversion of recordings whose graph changed during the recording."""

import csv
from pathlib import Path

import numpy as np
from rtcf.recording.convert import convert
from rtcf.recording.reader import Recording
from rtcf.v1 import ports_pb2
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch, PortSchema, schema_of
from rtcf_shared.recorder import Recorder


def _state(component: str, name: str, kind: str, size: int) -> ports_pb2.PortColumn:
    return ports_pb2.PortColumn(
        component=component,
        name=name,
        kind=ports_pb2.PortColumn.KIND_STATE,
        type=kind,
        size=size,
    )


def _cycles(schema: PortSchema, first: int, *columns: list[list[float]]) -> PortBatch:
    count = len(columns[0])
    message = ports_pb2.PortBatch(
        first_cycle=first,
        stamps_ns=[1_000_000 * (first + i) for i in range(count)],
        latencies_ns=[0] * count,
        durations_ns=[0] * count,
        values=[np.array(each, "<f8").tobytes() for each in columns],
    )
    return PortBatch(schema, 1, first, 0, False, message)


def test_a_later_array_has_empty_cells_before_it_appears(tmp_path: Path) -> None:
    number = _state("/a", "x", "double", 8)
    before = schema_of(ports_pb2.PortSchema(columns=[number]))
    after = schema_of(ports_pb2.PortSchema(columns=[number, _state("/b", "v", "double[3]", 24)]))
    file = tmp_path / "it.mcap"
    with file.open("xb") as out:
        writer = McapWriter(out)
        recorder = Recorder(writer, "rt_runner")
        recorder.add(_cycles(before, 0, [[1.0], [2.0]]))
        recorder.flush()
        recorder.add(_cycles(after, 2, [[3.0]], [[4.0, 5.0, 6.0]]))
        recorder.flush()
        writer.close()
    to = tmp_path / "it.csv"
    with Recording(file) as recording:
        assert convert(recording, to) == 3
    with to.open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    (first,) = (name for name in rows[0] if name.startswith("/a.x"))
    assert [row[first] for row in rows] == ["1.0", "2.0", "3.0"]
    (last,) = (name for name in rows[0] if name.startswith("/b.v") and name.endswith("[2]"))
    assert [row[last] for row in rows] == ["", "", "6.0"]
