"""`rtcfctl convert`: recordings in other programs' formats, with each value of each cycle."""

import csv
import io
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rosbag
import rospy
import rtcf
import std_msgs.msg
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for
from rtcf.recording.bags import md5_of
from rtcf.recording.convert import convert
from rtcf.v1 import ports_pb2
from rtcf_shared.mcap_writer import Column, McapWriter
from rtcf_shared.ports import PortBatch, schema_of
from rtcf_shared.recorder import Recorder


@pytest.fixture
def recorded(running: Daemon, tmp_path: Path) -> Path:
    """Return a recording of half a second."""
    file = tmp_path / "run.mcap"
    done = running.ctl("record", "-o", str(file), "--duration", "0.5s")
    assert done.returncode == 0, done.stderr
    return file


def _lines(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as text:
        return list(csv.DictReader(text))


def test_csv_has_one_line_per_cycle_with_the_same_numbers(running: Daemon, recorded: Path) -> None:
    file = recorded.with_suffix(".csv")
    done = running.ctl("convert", str(recorded), str(file))
    assert (done.returncode, done.stderr) == (0, "")
    lines = _lines(file)
    with rtcf.read_recording(recorded) as recording:
        assert f"{file}: {len(lines)} cycles" in done.stdout
        assert [int(line["cycle"]) for line in lines] == recording.cycles.tolist()
        assert [int(line["stamp_ns"]) for line in lines] == recording.stamps_ns.tolist()
        assert [int(line["duration_ns"]) for line in lines] == recording.durations_ns.tolist()
        assert [int(line["latency_ns"]) for line in lines] == recording.latencies_ns.tolist()
        for name in recording.signals:
            values = recording[name]
            assert values.ndim == 1, name
            assert np.array_equal([float(line[name]) for line in lines], values), name


def _batch(first: int, begin_ns: int, **states: tuple[str, "np.ndarray[Any, Any]"]) -> PortBatch:
    """Return cycles as sent by a stream, 1 ms apart; `states`: type and values by name."""
    count = len(next(iter(states.values()))[1])
    columns = [
        ports_pb2.PortColumn(
            component="/a",
            name=name,
            kind=ports_pb2.PortColumn.KIND_STATE,
            type=kind,
            size=values.nbytes // count,
        )
        for name, (kind, values) in states.items()
    ]
    message = ports_pb2.PortBatch(
        first_cycle=first,
        stamps_ns=range(begin_ns, begin_ns + count * 1_000_000, 1_000_000),
        latencies_ns=[0] * count,
        durations_ns=[0] * count,
        values=[values.tobytes() for _, values in states.values()],
    )
    schema = schema_of(ports_pb2.PortSchema(columns=columns))
    return PortBatch(schema, 1, first, 0, False, message)


def test_missing_values_are_empty_cells_and_array_elements_have_columns(
    running: Daemon, tmp_path: Path
) -> None:
    gains = np.array([[0.1, 1e30], [np.nan, -np.inf], [3.0, 0.25]], "<f4")
    late = np.array([2**63 + 1, 0], "<u8")
    with (tmp_path / "run.mcap").open("xb") as out:
        writer = McapWriter(out)
        recorder = Recorder(writer, "rt_runner")
        recorder.add(_batch(6, 10**18, gains=("float[2]", gains)))
        # The loop was restarted: cycles 7 and 8 occur again.
        recorder.add(
            _batch(7, 10**18 + 10**10, gains=("float[2]", gains[:2]), late=("uint64", late))
        )
        recorder.flush()
        writer.close()
    done = running.ctl("convert", str(tmp_path / "run.mcap"), str(tmp_path / "run.csv"))
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "run.csv").read_text().splitlines() == [
        "cycle,stamp_ns,duration_ns,latency_ns,/a.gains[0],/a.gains[1],/a.late",
        "6,1000000000000000000,0,0,0.1,1e+30,",
        "7,1000000000001000000,0,0,nan,-inf,",
        "8,1000000000002000000,0,0,3.0,0.25,",
        "7,1000000010000000000,0,0,0.1,1e+30,9223372036854775809",
        "8,1000000010001000000,0,0,nan,-inf,0",
    ]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_conversion_that_is_ended_leaves_no_file(tmp_path: Path, number: signal.Signals) -> None:
    values = np.random.default_rng(1).normal(size=(4000, 512))
    with (tmp_path / "run.mcap").open("xb") as out:
        writer = McapWriter(out)
        recorder = Recorder(writer, "rt_runner")
        for place in range(0, len(values), 500):
            part = values[place : place + 500]
            recorder.add(_batch(place + 1, 10**18 + place * 10**6, x=("double[512]", part)))
            recorder.flush()
        writer.close()
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "convert", tmp_path / "run.mcap", tmp_path / "run.csv"],
        stderr=subprocess.PIPE,
    )
    wait_for(lambda: len(list(tmp_path.iterdir())) == 2, "a part of the file")
    process.send_signal(number)
    _, said = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 1
    assert said.startswith(b"rtcfctl: interrupted")
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


def test_a_bag_of_changing_sizes_is_read_by_rosbag(tmp_path: Path) -> None:
    """The messages of a topic have several sizes, in several chunks; others begin later."""
    file, draw = tmp_path / "run.mcap", np.random.default_rng(2)
    wanted: dict[str, list[tuple[int, list[float]]]] = {"/a": [], "/b": []}
    with file.open("xb") as out:
        writer = McapWriter(out)
        definition = std_msgs.msg.Float64MultiArray._full_text
        channels: dict[str, int] = {}
        for number in range(5):
            columns = []
            for name in wanted if number > 1 else ("/a",):
                if name not in channels:
                    kind = {"component": name, "name": "x", "kind": "output"}
                    channels[name] = writer.channel(
                        name, "std_msgs/Float64MultiArray", definition, kind
                    )
                for size in (3, 1) if name == "/a" else (2,):
                    stamp = 10**18 + number * 10**9 + size * 10**6
                    message = std_msgs.msg.Float64MultiArray(data=draw.normal(size=size).tolist())
                    stream = io.BytesIO()
                    message.serialize(stream)
                    data = np.frombuffer(stream.getvalue(), "u1").reshape(1, -1)
                    stamps = np.array([stamp])
                    columns.append(Column(channels[name], np.array([number]), stamps, data))
                    wanted[name].append((stamp, message.data))
            writer.chunk(columns)
        writer.close()
    with rtcf.read_recording(file) as recording:
        assert convert(recording, tmp_path / "run.bag") == sum(map(len, wanted.values()))
    with rosbag.Bag(str(tmp_path / "run.bag")) as bag:
        for name, values in wanted.items():
            found = [(time.to_nsec(), list(each.data)) for _, each, time in bag.read_messages(name)]
            assert found == sorted(values)
        times = [time.to_nsec() for _, _, time in bag.read_messages()]
        assert times == sorted(times)
        later = rospy.Time(10**9 + 3)
        assert min(t for _, _, t in bag.read_messages(start_time=later)) >= later


def test_a_bag_has_the_messages_with_their_stamps(running: Daemon, recorded: Path) -> None:
    file = recorded.with_suffix(".bag")
    done = running.ctl("convert", str(recorded), str(file), "-o", "json")
    assert (done.returncode, done.stderr) == (0, "")
    with rosbag.Bag(str(file)) as bag, rtcf.read_recording(recorded) as recording:
        topics = bag.get_type_and_topic_info().topics
        assert topics["/wave/phase"].msg_type == "std_msgs/Float64"
        assert topics["/wave/above"].msg_type == "std_msgs/Bool"
        assert topics["/rt_runner/cycles"].msg_type == "rtcf_msgs/Cycle"
        assert {each.message_count for each in topics.values()} == {len(recording.cycles)}
        for name in ("/wave/phase", "/wave/wave", "/wave/above", "/mimo/out1"):
            found = [(time.to_nsec(), message.data) for _, message, time in bag.read_messages(name)]
            column = recording.read(name.replace("/", ".").replace(".", "/", 1))
            assert found == list(zip(column.stamps_ns, column.values, strict=True)), name
        cycles = [each.message.iteration for each in bag.read_messages("/rt_runner/cycles")]
        assert cycles == recording.cycles.tolist()


def test_a_state_with_the_name_of_an_output_is_a_separate_topic(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with file.open("xb") as out:
        writer = McapWriter(out)
        columns = []
        for kind in ("output", "state", "state"):
            metadata = {"component": "/a", "name": "x", "kind": kind}
            channel = writer.channel("/a/x", "std_msgs/Float64", "float64 data\n", metadata)
            data = np.array([float(channel)]).view("u1").reshape(1, 8)
            columns.append(Column(channel, np.array([7]), np.array([10**9]), data))
        writer.chunk(columns)
        writer.close()
    with rtcf.read_recording(file) as recording:
        assert convert(recording, tmp_path / "run.bag") == 3
    with rosbag.Bag(str(tmp_path / "run.bag")) as bag:
        found = [(each.topic, each.message.data) for each in bag.read_messages()]
    assert found == [("/a/x", 1.0), ("/a/x/state", 2.0), ("/a/x/state", 3.0)]


@pytest.mark.parametrize("name", ["Float64", "Header", "Float64MultiArray", "UInt8MultiArray"])
def test_md5_sums_are_those_of_ros(name: str) -> None:
    kind = getattr(std_msgs.msg, name)
    assert md5_of(kind._type, kind._full_text) == kind._md5sum


def test_errors_are_one_line_and_leave_no_file(running: Daemon, recorded: Path) -> None:
    there = recorded.with_name("there.csv")
    there.write_text("mine")
    itself = recorded.with_name("itself.csv")
    itself.symlink_to(recorded)
    itself.with_suffix(".mcap").symlink_to(recorded)
    before = set(recorded.parent.iterdir())
    for source, to, words, code, reason in (
        (
            recorded,
            Path("run.txt"),
            (),
            2,
            "the suffix must be .csv or .bag, to select the format",
        ),
        (recorded, there, (), 2, "already exists: --force overwrites it"),
        (recorded, itself, ("--force",), 2, "is the recording itself: write to another file"),
        (recorded, Path("no/where.csv"), (), 2, "No such file or directory"),
        (there, Path("run.csv"), (), 1, "is not an MCAP file"),
        (recorded, Path("run.csv"), ("--repair",), 2, "the suffix must be .mcap"),
        (recorded, itself.with_suffix(".mcap"), ("--repair", "--force"), 2, "recording itself"),
        (recorded.with_name("none"), Path("run.csv"), (), 1, "No such file or directory"),
    ):
        done = running.ctl("convert", str(source), str(recorded.parent / to), *words)
        assert done.returncode == code, done.stderr
        assert reason in done.stderr
        assert len(done.stderr.splitlines()) == 1
    assert set(recorded.parent.iterdir()) == before
    assert there.read_text() == "mine"
    assert running.ctl("convert", str(recorded), str(there), "--force").returncode == 0
    assert len(_lines(there)) > 0


@pytest.mark.parametrize("suffix", [".csv", ".bag"])
def test_a_full_disk_is_reported_in_one_line(running: Daemon, recorded: Path, suffix: str) -> None:
    to = recorded.with_name(f"full{suffix}")
    to.symlink_to("/dev/full")
    done = running.ctl("convert", str(recorded), str(to), "--force")
    assert done.returncode == 1
    assert done.stderr.splitlines() == [f"rtcfctl: {to}: No space left on device"]
    assert os.path.exists("/dev/full")
    assert to.is_symlink()


def test_a_recording_of_another_program_has_no_cycles(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "other.mcap"
    with file.open("xb") as out:
        writer = McapWriter(out)
        writer.close()
    done = running.ctl("convert", str(file), str(tmp_path / "x.csv"))
    assert done.returncode == 1
    assert "has no cycle topic: it was not written by rtcfctl record" in done.stderr
    assert not (tmp_path / "x.csv").exists()


def test_without_genmsg_the_package_to_install_is_named(
    recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    modules: Any = sys.modules
    monkeypatch.setitem(modules, "genmsg", None)
    with (
        rtcf.read_recording(recorded) as recording,
        pytest.raises(
            rtcf.RecordingError, match="bags need genmsg: sudo apt install python3-genmsg"
        ),
    ):
        convert(recording, recorded.with_suffix(".bag"))
    assert not recorded.with_suffix(".bag").exists()
