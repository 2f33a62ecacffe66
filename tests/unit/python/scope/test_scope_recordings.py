"""Recordings sent to the scope's page: each cycle, or minima and maxima of windows."""

import struct
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import rtcf
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from rtcf.recording.reader import RecordingError
from rtcf.v1 import ports_pb2
from rtcf_scope import recordings
from rtcf_scope.recordings import Recordings
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.ports import PortBatch, schema_of
from rtcf_shared.recorder import Recorder

_HEAD = 40
_BEGIN_NS = 10**18
NO_RTCFD = rtcf.Client("/nonexistent")


def _record(file: Path, values: NDArray[Any], lost: int) -> None:
    """Record a state, with `lost` cycles missing in the middle."""
    column = ports_pb2.PortColumn(
        component="/a", name="x", kind=ports_pb2.PortColumn.KIND_STATE, type="double", size=8
    )
    schema = schema_of(ports_pb2.PortSchema(columns=[column]))
    with file.open("xb", buffering=0) as out:
        writer = McapWriter(out)
        recorder = Recorder(writer, "rt_runner")
        first = 1
        for part in np.array_split(values, 2):
            stamps = [_BEGIN_NS + 1_000_000 * (first + i) for i in range(len(part))]
            message = ports_pb2.PortBatch(
                first_cycle=first,
                stamps_ns=stamps,
                latencies_ns=[0] * len(part),
                durations_ns=[0] * len(part),
                values=[part.tobytes()],
            )
            recorder.add(PortBatch(schema, 1, first, 0, False, message))
            first += len(part) + lost
        recorder.flush()
        writer.close()


def _told(file: Path, *span: float) -> tuple[NDArray[np.float64], int]:
    """Return the columns sent to a page, and the length of a window."""
    data = Recordings([file], None, NO_RTCFD).columns(file.name, ["/a.x"], *span)
    count, width = struct.unpack_from("<II", data, 4)
    (each,) = struct.unpack_from("<d", data, 24)
    return np.frombuffer(data, "<f8", offset=_HEAD).reshape(width, count), int(each)


@settings(max_examples=40)
@given(data=st.data(), count=st.integers(2, 400), lost=st.sampled_from([0, 3]))
def test_no_minimum_and_no_maximum_is_hidden(
    tmp_path_factory: pytest.TempPathFactory, data: Any, count: int, lost: int
) -> None:
    values = np.random.default_rng(count).standard_normal(count)
    values[data.draw(st.integers(0, count - 1))] = 1e6  # a spike of one cycle
    file = tmp_path_factory.mktemp("recording") / "run.mcap"
    _record(file, values, lost)
    most = data.draw(st.integers(4, 500))
    with mock.patch.object(recordings, "MOST_VALUES", most * 5):
        columns, each = _told(file)
    cells = count + (lost > 0)
    if cells <= most:
        assert each == 1
        assert np.array_equal(columns[4][~np.isnan(columns[4])], values)
        assert np.isnan(columns[4]).sum() == (lost > 0)
        return
    assert columns.shape[1] <= most + 1
    assert np.nanmax(columns[4]) == 1e6
    # With a gap of NaN for the missing cycles.
    cell_values = np.insert(values, (count + 1) // 2, [np.nan] * (lost > 0))
    for number in range(0, columns.shape[1], 2):
        part = cell_values[number // 2 * each : (number // 2 + 1) * each]
        if np.isnan(part).all():
            assert np.isnan(columns[4][number])
        else:
            assert columns[4][number : number + 2].tolist() == [np.nanmin(part), np.nanmax(part)]
    assert np.all(np.diff(columns[0]) >= 0)


def test_a_part_has_full_resolution_and_one_beyond_the_end_is_rejected(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    _record(file, np.arange(2000.0), 0)
    columns, each = _told(file, 0.5, 0.6)
    assert each == 1
    assert columns[4].tolist() == [float(i) for i in range(500, 600)]
    assert columns[0][0] == pytest.approx(0.5)
    with pytest.raises(RecordingError, match="run.mcap has no cycles in this range"):
        _told(file, 5.0, 6.0)
    assert Recordings([file], None, NO_RTCFD).describe("run.mcap")["seconds"] == pytest.approx(
        1.999
    )
