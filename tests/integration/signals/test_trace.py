"""Traces of real loops: JSON for Perfetto and chrome://tracing."""

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
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
from rtcf.v1 import runner_pb2

Event = dict[str, Any]


def read(file: Path) -> list[Event]:
    """Return the events; checks that each has the fields that the format requires."""
    events: list[Event] = json.loads(file.read_text())
    for each in events:
        assert each["ph"] in "MXiC" and each["pid"] == 1
        assert each["ph"] == "M" or isinstance(each["ts"], int | float)
        assert each["ph"] != "X" or each["dur"] >= 0
    return events


def tracks(events: list[Event]) -> dict[str, int]:
    """Return the number of each track."""
    return {e["args"]["name"]: e["tid"] for e in events if e["name"] == "thread_name"}


def cycles(events: list[Event]) -> list[Event]:
    """Return the cycles."""
    return [each for each in events if each["ph"] == "X"]


@contextmanager
def tracing(daemon: Daemon, file: Path, expected: int = 0) -> Iterator[None]:
    """Trace during the block, until Ctrl-C."""
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", daemon.socket, "trace", "-o", file],
        stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=clean_environment(),
    )  # fmt: skip

    def begun() -> bool:
        assert process.poll() is None
        parts = list(file.parent.glob(f".{file.name}.*.part"))
        return bool(parts) and '"ph": "X"' in parts[0].read_text()

    try:
        wait_for(begun, "the first cycles")
        yield
        if not expected:
            signal_twice(process, signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert process.returncode == expected, said
    finally:
        process.kill()
        process.wait()


def test_a_trace_has_each_cycle_and_the_durations_of_components(
    running: Daemon, tmp_path: Path
) -> None:
    file = tmp_path / "trace.json"
    done = running.ctl("trace", "-o", str(file), "--cycles", "300")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{file}: 300 cycles, ")
    events = read(file)
    found = cycles(events)
    numbers = [each["args"]["cycle"] for each in found]
    assert len(numbers) == 300
    if "none lost" in done.stdout:
        assert numbers == list(range(numbers[0], numbers[0] + 300))
    begins = [each["ts"] for each in found]
    assert begins == sorted(begins)
    assert begins[-1] - begins[0] > 200_000  # µs: 300 cycles of 1 ms
    names = {each["name"] for each in events if each["ph"] == "C"}
    assert names == {"wake-up latency (µs)", "/wave (µs, mean)", "/mimo (µs, mean)"}
    assert next(e for e in events if e["name"] == "process_name")["args"]["name"] == "rt_runner"


def test_components_are_spans_within_their_cycles(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("rtcf_faults", "Sleeps", name="slow", parameters=["after:=0"]))
    client.load(rtcf.component("rtcf_examples", "Wave", name="half", every=2))
    client.load(rtcf.component("rtcf_examples", "Mimo", name="mimo"))
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    order = [each.full_name for each in client.list_components()]
    client.start()
    file = tmp_path / "trace.json"
    done = daemon.ctl("trace", "-o", str(file), "--cycles", "300", "--components")
    assert done.returncode == 0, done.stderr
    events = read(file)
    spans: dict[int, list[Event]] = {}
    for each in cycles(events):
        spans.setdefault(each["args"]["cycle"], []).append(each)
    assert len(spans) == 300
    for number, (cycle, *components) in spans.items():
        assert cycle["name"] in ("cycle", "late cycle")
        names = [each["name"] for each in components]
        assert names == [each for each in order if each != "/half" or number % 2 == 0], number
        assert {each["tid"] for each in components} == {cycle["tid"]}
        # One after the other, and all within their cycle, to the written precision.
        end = cycle["ts"]
        for each in components:
            assert each["ts"] >= end - 0.002
            end = each["ts"] + each["dur"]
        assert end <= cycle["ts"] + cycle["dur"] + 0.002
        took = {each["name"]: each["dur"] for each in components}
        assert took["/slow"] >= 100  # µs of sleep
        assert took["/mimo"] < cycle["dur"] - 100
    # They are traced only on request.
    assert daemon.ctl("trace", "-o", str(file), "--cycles", "50", "--force").returncode == 0
    assert len(cycles(read(file))) == 50


def test_spans_of_components_continue_over_changes_and_end_with_the_loop(
    running: Daemon, client: rtcf.Client
) -> None:
    with client.watch_ports((), component_times=True) as stream:
        client.load(rtcf.component("rtcf_examples", "Wave", name="more"))
        client.unload(["mimo"])
        client.stop()
        seen = []
        for batch in stream:
            if not len(batch):
                continue
            seen.append(batch.schema.turns)
            turns = batch.turns_ns
            assert turns.shape == (len(batch), 1 + len(batch.schema.turns))
            ran = turns[:-1] if batch.last_of_loop else turns
            assert (ran >= 0).all()
            assert (np.diff(ran, axis=1) >= 0).all()
            assert (ran[:, -1] <= batch.durations_ns[: len(ran)]).all()
            assert (batch.part(1).turns_ns == turns[1:]).all()
            if batch.last_of_loop:
                assert (turns[-1] == -1).all()  # safe hooks ran
                break
    assert seen[0] == ("/mimo", "/wave")
    assert seen[-1] == ("/more", "/wave")


def test_windows_have_no_times_of_components(running: Daemon, client: rtcf.Client) -> None:
    with pytest.raises(rtcf.RtcfError, match="available per cycle, not per window"):
        client.watch_ports((), every=10, min_max=True, component_times=True)


def test_changes_faults_and_log_records_are_marks(
    running: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "trace.json"
    with tracing(running, file):
        client.load(
            rtcf.component("rtcf_faults", "Throws", name="bad", parameters=["after:=1000000"])
        )
        client.set_parameters("wave", [rtcf.parse_parameter("amplitude:=9.5")])
        with client.watch_logs(components=["wave"], level="warn") as stream:
            next(iter(stream))
        client.set_parameters("bad", [rtcf.parse_parameter("after:=0")])
        wait_for(
            lambda: (
                client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_FAULTED
            ),
            "the fault",
        )
    events = read(file)
    marks = {each["name"]: each for each in events if each["ph"] == "i"}
    assert "graph: /bad loaded (rtcf_faults/Throws)" in marks
    said = marks["warn: amplitude 9.5 is large"]
    assert said["tid"] == tracks(events)["log of /wave"]
    assert said["args"]["cycle"] in {each["args"]["cycle"] for each in cycles(events)}
    (fault,) = [each for name, each in marks.items() if name.startswith("loop_fault: ")]
    assert fault["s"] == "g" and "/bad" in fault["name"]


def test_late_cycles_are_listed(daemon: Daemon, client: rtcf.Client, tmp_path: Path) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0))
    client.load(rtcf.component("rtcf_faults", "Sleeps", name="slow", parameters=["after:=0"]))
    client.start()
    file = tmp_path / "trace.json"
    done = daemon.ctl("trace", "-o", str(file), "--cycles", "100", "--output", "json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    late = [each for each in cycles(read(file)) if each["name"] == "late cycle"]
    assert told["cycles"] == 100
    assert told["late"] == len(late) > 0
    marks = [each for each in read(file) if each["name"] == "overrun"]
    assert [each["args"]["cycle"] for each in marks] == [each["args"]["cycle"] for each in late]
    assert all(each["args"]["late_us"] > 0 for each in marks)


def test_records_have_their_cycles_time_on_a_simulated_clock(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    client.load(rtcf.component("rtcf_examples", "Wave", name="wave"))
    file = tmp_path / "trace.json"
    process = subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "--socket", daemon.socket, "trace", "-o", file,
         "--cycles", "4000"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=clean_environment(),
    )  # fmt: skip
    assert process.stderr is not None
    assert "does not run" in process.stderr.readline()
    client.step(6000)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0, said
    events = read(file)
    first = cycles(events)[0]["args"]["cycle"]
    records = [each for each in events if "through zero in cycle" in each["name"]]
    assert len(records) >= 3
    for each in records:
        assert each["ts"] == pytest.approx((each["args"]["cycle"] - first) * 1000.0)


def test_a_dead_executor_leaves_the_trace(
    running: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "trace.json"
    with tracing(running, file, expected=1):
        os.kill(client.get_status("rt_runner").runners[0].pid, signal.SIGKILL)
    events = read(file)
    assert cycles(events)
    (fault,) = [each for each in events if each["name"].startswith("executor_fault: ")]
    assert "SIGKILL" in fault["name"]


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("-o", "there.json"), 2, "exists: use --force to overwrite it"),
        (("-o", "none/trace.json"), 1, "No such file or directory"),
        (("-o", "trace.json", "--cycles", "0"), 2, "--cycles 0: at least 1"),
        (("-o", "trace.json", "-r", "nobody"), 1, 'no runner "nobody"'),
        ((), 2, "-o"),
    ],
)
def test_errors_are_one_line(
    running: Daemon, tmp_path: Path, words: tuple[str, ...], code: int, said: str
) -> None:
    (tmp_path / "there.json").write_text("mine")
    words = tuple(str(tmp_path / each) if each.endswith("json") else each for each in words)
    done = running.ctl("trace", *words)
    assert done.returncode == code
    assert said in done.stderr.splitlines()[-1]
    assert (tmp_path / "there.json").read_text() == "mine"
    assert not list(tmp_path.glob("*trace.json*"))
