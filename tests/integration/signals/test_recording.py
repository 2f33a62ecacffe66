"""Recordings: the cycles of a loop in a file that other programs can read."""

import fcntl
import json
import os
import re
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rtcf
from daemon_process import (
    BUILD_TREE,
    Daemon,
    clean_environment,
    signal_twice,
    wait_for,
)

# MCAP's reference reader, which is not in Debian.
_MCAP = ("mcap==1.6.0", "lz4==4.4.5", "zstandard==0.25.0")
_DUMP = """
import json, sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file)
    summary = reader.get_summary()
    counts = {}
    last = {}
    for schema, channel, message in reader.iter_messages(log_time_order=True):
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
        assert message.log_time >= last.get(channel.topic, 0)
        last[channel.topic] = message.log_time
    print(json.dumps({
        "profile": reader.get_header().profile,
        "types": {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()},
        "encodings": sorted({s.encoding for s in summary.schemas.values()}),
        "counted": summary.statistics.message_count,
        "counts": counts,
    }))
"""


@pytest.fixture(scope="session")
def mcap_python() -> Path:
    """A Python with MCAP's reference reader."""
    folder = BUILD_TREE / "venv-mcap"
    python = folder / "bin" / "python"
    asked = [str(python), "-c", "import importlib.metadata as m; print(m.version('mcap'))"]
    if (
        not python.exists()
        or subprocess.run(asked, capture_output=True, text=True).stdout.strip()
        != _MCAP[0].partition("==")[2]
    ):
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, *_MCAP], check=True)
    return python


def _recorded(daemon: Daemon, file: Path, *words: str) -> None:
    done = daemon.ctl("record", "-o", str(file), *words)
    assert done.returncode == 0, done.stderr
    assert f"{file}: " in done.stdout and "none lost" in done.stdout


def _begun(daemon: Daemon, file: Path) -> subprocess.Popen[bytes]:
    """Return a rtcfctl that records and has written some cycles."""
    process = subprocess.Popen(
        [
            BUILD_TREE / "bin" / "rtcfctl",
            "--socket",
            daemon.socket,
            "record",
            "-o",
            file,
        ],
        env=clean_environment(),
        stdout=subprocess.PIPE,
    )
    wait_for(lambda: file.exists() and file.stat().st_size > 20_000, "a chunk in the file")
    return process


def test_every_cycle_is_in_the_file(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    _recorded(running, file, "--duration", "1s")
    with rtcf.read_recording(file) as recording:
        assert recording.whole
        assert {"/wave.wave", "/wave.phase", "/wave.above", "/mimo.out1"} <= set(recording.signals)
        cycles = recording.cycles
        assert len(cycles) >= 1000
        assert np.all(np.diff(cycles) == 1)
        phase = recording["/wave.phase"]
        assert len(phase) == len(cycles)
        step = np.diff(phase) % 1.0
        assert np.all(np.abs(step - 0.001) < 1e-9)
        assert np.allclose(recording["/wave.wave"], np.sin(2 * np.pi * phase))
        assert recording["/wave.above"].dtype == np.bool_
        assert len(recording.durations_ns) == len(recording.latencies_ns) == len(cycles)
        assert np.all(recording.durations_ns >= 0)


def test_a_slice_has_the_cycles_between_two_stamps(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    _recorded(running, file, "wave.phase", "--duration", "1s")
    with rtcf.read_recording(file) as recording:
        whole = recording.read("/wave.phase")
        begin, end = int(whole.stamps_ns[100]), int(whole.stamps_ns[200])
        part = recording.read("/wave.phase", begin, end)
        assert np.array_equal(part.cycles, whole.cycles[100:200])
        assert np.array_equal(part.values, whole.values[100:200])


def test_mcaps_reference_reader_reads_it(
    running: Daemon, tmp_path: Path, mcap_python: Path
) -> None:
    file = tmp_path / "run.mcap"
    _recorded(running, file, "--duration", "0.5s")
    done = subprocess.run(
        [mcap_python, "-c", _DUMP, file], capture_output=True, text=True, env=clean_environment()
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    assert found["profile"] == "ros1"
    assert found["encodings"] == ["ros1msg"]
    assert found["types"]["/rt_runner/cycles"] == "rtcf_msgs/Cycle"
    assert found["types"]["/wave/phase"] == "std_msgs/Float64"
    assert found["types"]["/wave/above"] == "std_msgs/Bool"
    assert found["types"]["/mimo/out1"] == "std_msgs/Float64"
    assert found["counted"] == sum(found["counts"].values())
    assert len(set(found["counts"].values())) == 1
    with rtcf.read_recording(file) as recording:
        assert found["counts"]["/wave/phase"] == len(recording.cycles)


_COUNT = """
import sys
from mcap.reader import make_reader
with open(sys.argv[1], "rb") as file:
    messages = make_reader(file).iter_messages()
    print(sum(channel.topic == "/wave/phase" for _, channel, _ in messages))
"""


def test_a_file_of_a_killed_writer_can_be_read(
    running: Daemon, tmp_path: Path, mcap_python: Path
) -> None:
    file = tmp_path / "run.mcap"
    process = _begun(running, file)
    process.kill()
    process.wait()
    with rtcf.read_recording(file) as recording:
        assert not recording.whole
        count = len(recording.cycles)
        assert count > 0
        assert np.all(np.diff(recording.cycles) == 1)
    done = subprocess.run(
        [mcap_python, "-c", _COUNT, file], capture_output=True, text=True, env=clean_environment()
    )
    assert (done.stdout, done.returncode) == (f"{count}\n", 0), done.stderr
    whole = tmp_path / "whole.mcap"
    done = running.ctl("convert", "--repair", str(file), str(whole))
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{whole}: {count} cycles, ")
    assert "its last second may be missing" in done.stdout
    with rtcf.read_recording(whole) as recording:
        assert recording.whole
        assert len(recording.cycles) == count
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[:-10])
    with rtcf.read_recording(cut) as recording:
        assert len(recording["/wave.phase"]) <= len(recording.cycles)


def test_ctrl_c_ends_the_file_in_order(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    process = _begun(running, file)
    signal_twice(process, signal.SIGINT)
    said, _ = process.communicate()
    assert process.returncode == 0
    assert b"none lost" in said
    with rtcf.read_recording(file) as recording:
        assert recording.whole


def test_new_ports_are_added_during_a_recording(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    client.start()
    file = tmp_path / "run.mcap"
    process = _begun(daemon, file)
    client.load(rtcf.component("rtcf_examples", "Mimo", name="late"))
    size = file.stat().st_size
    wait_for(lambda: file.stat().st_size > size + 50_000, "chunks with the new component")
    process.send_signal(signal.SIGINT)
    process.communicate()
    with rtcf.read_recording(file) as recording:
        cycles = recording.cycles
        assert np.all(np.diff(cycles) == 1)
        late = recording.read("/late.out1")
        assert np.array_equal(late.cycles, cycles[-len(late.cycles) :])
        assert 0 < len(late.cycles) < len(cycles)


def test_errors_touch_no_file(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    done = running.ctl("record", "-o", str(file), "nobody")
    assert done.returncode == 1
    assert "nobody matches no output" in done.stderr
    assert not file.exists()
    file.write_text("mine")
    done = running.ctl("record", "-o", str(file))
    assert done.returncode == 2
    assert "already exists: --force overwrites it" in done.stderr
    assert file.read_text() == "mine"
    done = running.ctl("record", "-o", str(tmp_path / "no" / "where"))
    assert done.returncode == 2
    assert "No such file or directory" in done.stderr
    done = running.ctl("record", "-o", str(file), "--duration", "0")
    assert done.returncode == 2
    bag = tmp_path / "run.bag"
    done = running.ctl("record", "-o", str(bag))
    assert done.returncode == 2
    assert "recordings are MCAP files" in done.stderr
    assert f"rtcfctl convert {bag.with_suffix('.mcap')} {bag}" in done.stderr
    assert not bag.exists()


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    """Yield a folder on a full disk."""
    disk = tmp_path / "full"
    disk.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=4k", "none", str(disk)]
    mounted = subprocess.run(mounting, capture_output=True, text=True, check=False)
    if mounted.returncode:
        pytest.skip(f"may not mount here: {mounted.stderr.strip()}")
    try:
        (disk / "filler").write_bytes(bytes(4096))
        yield disk
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


def test_a_full_disk_is_named_and_left_unchanged(running: Daemon, full_disk: Path) -> None:
    assert running.ctl("incident", "take").returncode == 0
    full = "No space left on device"
    for verb, what in {
        "record --duration 0.5 --min-free 0 -o": f"{full}: no cycle was written",
        "trace --cycles 100 -o": f" cannot be written: {full}",
        "incident export --to": f" cannot be written: {full}",
    }.items():
        to = full_disk / "out"
        done = running.ctl(*verb.split(), str(to))
        assert done.returncode == 1, (verb, done.stderr)
        (line,) = done.stderr.splitlines()
        assert line.startswith(f"rtcfctl: {to}"), line
        assert line.endswith(what), line
        assert [each.name for each in full_disk.iterdir()] == ["filler"], verb


def test_a_disk_without_room_for_a_cycle_is_left_unchanged(
    running: Daemon, full_disk: Path
) -> None:
    # Room for the head of a file only.
    subprocess.run(["mount", "-o", "remount,size=8k", full_disk], check=True)
    done = running.ctl(
        *("record", "--duration", "0.5", "--min-free", "0", "-o", str(full_disk / "out"))
    )
    assert done.returncode == 1
    end = "No space left on device: no cycle was written; the file has been removed"
    assert done.stderr == f"rtcfctl: {full_disk / 'out'}: {end}\n"
    assert [each.name for each in full_disk.iterdir()] == ["filler"]


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to mount a disk")
def test_a_disk_that_fills_up_ends_the_recording_with_a_readable_file(
    running: Daemon, tmp_path: Path
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", disk], check=True)
    try:
        file = disk / "run.mcap"
        done = running.ctl("record", "-o", str(file), "--min-free", "0")
        assert done.returncode == 1
        assert "No space left on device: the cycles written before are readable" in done.stderr
        with rtcf.read_recording(file) as recording:
            assert len(recording.cycles) > 0
    finally:
        subprocess.run(["umount", disk], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason="requires root to mount a disk")
def test_a_recording_leaves_room_on_its_disk(running: Daemon, tmp_path: Path) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "none", disk], check=True)
    try:
        file = disk / "run.mcap"
        done = running.ctl("record", "-o", str(file))
        assert done.returncode == 1
        assert done.stderr == (
            f"rtcfctl: {file}: 3 MiB are free on its disk, less than 100 (--min-free): "
            "no cycle was written\n"
        )
        assert list(disk.iterdir()) == []
        done = running.ctl("record", "-o", str(file), "--min-free", "2MiB")
        assert done.returncode == 1
        assert "less than 2 (--min-free): the recording ends; the cycles written" in done.stderr
        with rtcf.read_recording(file) as recording:
            assert len(recording.cycles) > 0
    finally:
        subprocess.run(["umount", disk], check=True)


def test_a_device_without_room_is_reported_in_one_line(running: Daemon) -> None:
    done = running.ctl("record", "-o", "/dev/full", "--force")
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "rtcfctl: /dev/full: No space left on device: no cycle was written"
    ]


def _cycles(*files: Path) -> list[int]:
    found: list[int] = []
    for file in files:
        with rtcf.read_recording(file) as recording:
            found += [int(cycle) for cycle in recording.cycles]
    return found


@pytest.mark.parametrize("bound", [("--duration", "300ms"), ("--size", "16KiB")])
def test_consecutive_files_miss_no_cycle(
    running: Daemon, tmp_path: Path, bound: tuple[str, str]
) -> None:
    files = [tmp_path / name for name in ("run.mcap", "run-1.mcap", "run-2.mcap")]
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", running.socket, "record", "-o",
         files[0], *bound, "--split"],
        env=clean_environment(),
        stdout=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    wait_for(lambda: files[2].exists(), "the third file")
    process.send_signal(signal.SIGINT)
    said, _ = process.communicate()
    assert process.returncode == 0
    assert "run.mcap to run-" in said
    cycles = _cycles(*files)
    assert cycles == list(range(cycles[0], cycles[0] + len(cycles)))


def test_a_file_ends_when_it_is_large_enough(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    _recorded(running, file, "--size", "32KiB")
    assert file.stat().st_size >= 32 * 1024
    assert len(_cycles(file)) > 10


def test_the_cycles_around_a_condition_are_in_the_file(running: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    done = running.ctl(
        "record", "-o", str(file), "wave.wave", "--trigger", "wave.phase < 0.0005", "--pre",
        "200ms", "--post", "100ms", "--output", "json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    hit = json.loads(done.stdout)["cycle"]
    with rtcf.read_recording(file) as recording:
        cycles = recording.cycles
        phase = recording["/wave.phase"]
        stamps_ns = recording.read("/wave.phase").stamps_ns
    (place,) = (cycles == hit).nonzero()[0].tolist()
    assert phase[place] < 0.0005
    # The recording may start within this distance of the hit.
    assert (phase[:place] >= 0.0005).all()
    assert stamps_ns[place] - stamps_ns[0] <= 200_000_000
    assert 99_000_000 <= stamps_ns[-1] - stamps_ns[place] <= 100_000_000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--size", "0"), "--size 0: more than 0 MiB"),
        (("--split",), "--split requires --duration or --size"),
        (("--pre", "1s"), "--pre and --post require --trigger"),
        (("--trigger", "wave.phase > 1", "--pre=-1s"), "--pre -1: 0 or more"),
        (("--trigger", "wave.phase > 1", "--duration", "1s"), "instead of --duration or --split"),
        (("--trigger", "wave.phase >"), "is not a condition"),
        (("--trigger", "wave.nothing > 1"), "/wave.nothing is not a number of this stream"),
    ],
)
def test_an_impossible_recording_is_rejected_before_a_file_exists(
    running: Daemon, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    file = tmp_path / "run.mcap"
    done = running.ctl("record", "-o", str(file), *words)
    assert done.returncode == 2
    assert said in done.stderr.splitlines()[-1]
    assert not file.exists()


def test_the_last_cycles_of_a_loop_are_written_immediately(
    running: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "run.mcap"
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", running.socket, "record", "-o", file],
        env=clean_environment(),
    )

    def last() -> int:
        with rtcf.read_recording(file) as recording:
            return int(recording.cycles[-1])

    wait_for(lambda: file.exists() and file.stat().st_size > 20_000, "a chunk in the file")
    client.stop()
    end = client.get_status().runners[0].iteration
    # The cycle in which components made safe; no later cycle would flush it.
    wait_for(lambda: last() == end, "the last cycle in the file")
    process.kill()
    process.wait()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_interrupts_no_write(
    running: Daemon, tmp_path: Path, number: signal.Signals
) -> None:
    # A disk that accepts the head of the file and some cycles, and then blocks for a while.
    disk = tmp_path / "disk"
    os.mkfifo(disk)
    reader = os.open(disk, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", running.socket, "record", "-o",
         disk, "--force"],
        env=clean_environment(),
    )  # fmt: skip
    written = b""
    while len(written) < 100_000:
        select.select([reader], [], [])
        written += os.read(reader, 4096)
    writer = os.open(disk, os.O_WRONLY)
    wait_for(lambda: not select.select([], [writer], [], 0)[1], "a full disk")
    os.close(writer)
    process.send_signal(number)
    pending = Path(f"/proc/{process.pid}/status")
    wait_for(
        lambda: re.search(r"^ShdPnd:\s+0+$", pending.read_text(), re.MULTILINE), "its signal's turn"
    )
    os.set_blocking(reader, True)
    file = tmp_path / "run.mcap"
    with open(reader, "rb") as disk_file:
        file.write_bytes(written + disk_file.read())
    assert process.wait() == 0
    with rtcf.read_recording(file) as recording:
        assert recording.whole
        assert len(recording.cycles) > 0
        assert np.all(np.diff(recording.cycles) == 1)
        for name in recording.signals:
            assert np.array_equal(recording.read(name).cycles, recording.cycles), name


def test_a_file_that_is_no_recording_is_reported(tmp_path: Path) -> None:
    file = tmp_path / "x.mcap"
    with pytest.raises(rtcf.RecordingError, match="No such file"):
        rtcf.read_recording(file)
    file.write_bytes(b"nothing of the kind")
    with pytest.raises(rtcf.RecordingError, match="is not an MCAP file"):
        rtcf.read_recording(file)
