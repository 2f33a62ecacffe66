"""Columns of values in streams and recordings, without a loop."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
import yaml
from rtcf.v1 import ports_pb2
from rtcf_shared.arrays import as_list
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch, PortSchema, schema_of
from rtcf_shared.recorder import Recorder
from rtcfctl.signals import echo
from rtcfctl.terminal.output import Output

STATE = ports_pb2.PortColumn.KIND_STATE
OUTPUT = ports_pb2.PortColumn.KIND_OUTPUT


def state(type_name: str, size: int) -> ports_pb2.PortColumn:
    return ports_pb2.PortColumn(component="/c", name="s", kind=STATE, type=type_name, size=size)


def output(definition: str, md5: str, value: bytes, name: str = "o") -> ports_pb2.PortColumn:
    return ports_pb2.PortColumn(
        component="/c", name=name, kind=OUTPUT, type="p/M", ros_type="p/M", ros_md5=md5,
        ros_definition=definition, sample=value, size=len(value),
    )  # fmt: skip


def schema(*columns: ports_pb2.PortColumn) -> PortSchema:
    return schema_of(ports_pb2.PortSchema(columns=columns))


def batch(of: PortSchema, first: int, *values: bytes) -> PortBatch:
    """Return a batch of two cycles."""
    message = ports_pb2.PortBatch(
        first_cycle=first, stamps_ns=[1, 2], latencies_ns=[0, 0], durations_ns=[5, 6],
        values=values,
    )  # fmt: skip
    return PortBatch(of, 1, first, 0, False, message)


def recorded(file: Path, *batches: PortBatch) -> rtcf.Recording:
    with file.open("wb") as out:
        writer = McapWriter(out)
        recorder = Recorder(writer, "r")
        for each in batches:
            recorder.add(each)
        recorder.flush()
        writer.close()
    return rtcf.read_recording(file)


def test_arrays_of_bytes_are_read_byte_by_byte(tmp_path: Path) -> None:
    cases: list[tuple[str, Any]] = [
        ("uint8[3]", np.array([[0, 1, 2], [253, 254, 255]], "u1")),
        ("int8[3]", np.array([[0, 1, 2], [-3, -2, -1]], "i1")),
        ("bool[3]", np.array([[True, False, True], [False, False, True]])),
        ("uint8[2x3]", np.arange(12, dtype="u1").reshape(2, 3, 2).swapaxes(1, 2)),
    ]
    for type_name, expected in cases:
        data = (expected.swapaxes(1, 2) if expected.ndim == 3 else expected).tobytes()
        told = batch(schema(state(type_name, len(data) // 2)), 0, data)
        assert as_list(told["/c.s"]) == expected.tolist(), type_name
        with recorded(tmp_path / "x.mcap", told) as recording:
            assert as_list(recording["/c.s"]) == expected.reshape(2, -1).tolist(), type_name


def test_a_row_major_matrix_is_not_transposed(tmp_path: Path) -> None:
    expected = np.arange(12, dtype="u1").reshape(2, 2, 3)
    told = batch(schema(state("uint8[2x3,RowMajor]", 6)), 0, expected.tobytes())
    assert as_list(told["/c.s"]) == expected.tolist()
    with recorded(tmp_path / "x.mcap", told) as recording:
        assert as_list(recording["/c.s"]) == expected.reshape(2, -1).tolist()


def test_a_state_of_three_dimensions_keeps_its_shape(tmp_path: Path) -> None:
    expected = np.arange(48.0).reshape(2, 2, 3, 4)
    told = batch(schema(state("double[2x3x4]", 192)), 0, expected.tobytes())
    assert told["/c.s"].tolist() == expected.tolist()
    with recorded(tmp_path / "x.mcap", told) as recording:
        assert recording["/c.s"].tolist() == expected.reshape(2, -1).tolist()


def test_an_output_and_a_state_of_the_same_name_are_separate(tmp_path: Path) -> None:
    made = output("float64 data\n", "1", bytes(8), name="s")
    for columns in ((made, state("double", 8)), (state("double", 8), made)):
        values = [
            np.array([1.0, 2.0] if column is made else [3.0, 4.0]).tobytes() for column in columns
        ]
        told = batch(schema(*columns), 0, *values)
        assert as_list(told["/c.s"]) == [1.0, 2.0]
        assert as_list(told["/c.s[state]"]) == [3.0, 4.0]
        with recorded(tmp_path / "x.mcap", told) as recording:
            assert as_list(recording["/c.s"]) == [1.0, 2.0]
            assert as_list(recording["/c.s[state]"]) == [3.0, 4.0]


def test_cycle_numbers_are_exact_for_long_runs(tmp_path: Path) -> None:
    of = schema(state("double", 8))
    batches = [batch(of, first, bytes(16)) for first in (2**32 - 2, 2**32, 5 * 2**32 + 7, 0)]
    expected = [first + i for first in (2**32 - 2, 2**32, 5 * 2**32 + 7, 0) for i in (0, 1)]
    for number, each in enumerate(batches):
        with recorded(tmp_path / "x.mcap", each) as recording:
            assert recording.cycles.tolist() == expected[2 * number : 2 * number + 2]
    with recorded(tmp_path / "x.mcap", batches[0], *batches[2:]) as recording:
        assert recording.cycles.tolist() == expected[:2] + expected[4:]
        assert recording.read("/c.s").cycles.tolist() == expected[:2] + expected[4:]


def test_a_type_rebuilt_during_a_recording_gets_a_new_topic(
    tmp_path: Path,
) -> None:
    before = batch(schema(output("float64 x\n", "1", bytes(8))), 0, bytes(16))
    after = batch(schema(output("float32 y\nint32 z\nint8 w\n", "2", bytes(9))), 2, bytes(18))
    with recorded(tmp_path / "x.mcap", before, after) as recording:
        assert {name: len(recording[name]) for name in recording.signals} == {
            "/c.o.x": 2, "/c.o.y": 2, "/c.o.z": 2, "/c.o.w": 2,
        }  # fmt: skip
        assert recording.read("/c.o.x").cycles.tolist() == [0, 1]
        assert recording.read("/c.o.w").cycles.tolist() == [2, 3]


def test_a_damaged_recording_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "x.mcap"
    recorded(file, batch(schema(state("double", 8)), 0, bytes(16))).close()
    whole = file.read_bytes()
    damaged = 0
    for at in range(len(whole)):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        try:
            with rtcf.read_recording(file) as recording:
                for name in recording.signals:
                    recording.read(name)
        except rtcf.RecordingError as error:
            damaged += f"{file} is damaged: " in str(error)
    assert damaged


@pytest.mark.parametrize(("kind", "read"), [("json", json.loads), ("yaml", yaml.safe_load)])
def test_non_finite_numbers_are_words_in_json(
    capsys: pytest.CaptureFixture[str], kind: str, read: Callable[[str], Any]
) -> None:
    told = batch(schema(state("double[3]", 24)), 0, np.array([1, np.nan, -np.inf] * 2).tobytes())
    echo._print(told, 1, Output(kind))
    printed = capsys.readouterr().out.removeprefix("---\n")
    assert read(printed) == {"cycle": 1, "stamp_ns": 2, "values": {"/c.s": [1.0, "nan", "-inf"]}}
