"""Snapshots: taken and restored by command, of random graphs, with identical bits afterwards."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon
from hypothesis import strategies as st
from rtcf.executor.v1 import snapshot_pb2
from rtcf.v1 import graph_pb2

CYCLES = 10_000
SEED = int(os.environ.get("RTCF_SEED", "2021"))
NAMES = ["/p", "/q", "/n/r", "/s", "/t"]
HEADER = 24  # bytes of a file before its message


def _snapshot(client: rtcf.Client) -> snapshot_pb2.RunnerSnapshot:
    """Return a snapshot without its time stamp."""
    message = snapshot_pb2.RunnerSnapshot()
    message.ParseFromString(client.take_snapshot().snapshot[HEADER:])
    message.taken_ns = 0
    return message


@st.composite
def chaoses(draw: st.DrawFn) -> list[graph_pb2.ComponentSpec]:
    """Draw a graph in which any input may read any output, one cycle late where necessary."""
    names = draw(st.lists(st.sampled_from(NAMES), min_size=1, max_size=5, unique=True))
    specs = []
    for index, full_name in enumerate(names):
        ns, _, name = full_name.rpartition("/")
        remaps, breaks = [], []
        for port in ("x", "checked", "turned", "listed", "low", "high"):
            remaps.append(f"{port}:={full_name}_{port}")
        for port, outputs in {
            "a": ["x", "checked"],
            "b": ["x", "checked"],
            "frame": ["turned"],
            "list": ["listed"],
        }.items():
            source = draw(st.integers(0, len(names)))  # the last one: no source
            if source == len(names):
                remaps.append(f"{port}:=/nothing_{name}_{port}")
                continue
            remaps.append(f"{port}:={names[source]}_{draw(st.sampled_from(outputs))}")
            if source >= index or draw(st.booleans()):
                breaks.append(port)
        specs.append(
            rtcf.component(
                "rtcf_test",
                "Chaos",
                name=name,
                ns=ns or "/",
                remaps=remaps,
                parameters=[f"rate:={draw(st.sampled_from([3.7, 3.8, 3.9]))}", "timed:=true"],
                breaks=breaks,
                every=draw(st.sampled_from([1, 1, 1, 2, 4])),
            )
        )
    return specs


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[rtcf.Client]:
    """Yield a client of a daemon shared by all examples."""
    daemon = Daemon(tmp_path_factory.mktemp("daemon"), NO_ROS)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        yield client
    daemon.end()


@hypothesis.seed(SEED)
@hypothesis.settings(
    max_examples=40, derandomize=False,
    suppress_health_check=list(hypothesis.HealthCheck),
)  # fmt: skip
@hypothesis.given(
    before=chaoses(), graph=chaoses(), warm_up=st.integers(0, 40), late=st.integers(0, 40)
)
def test_any_graph_continues_with_the_same_bits(
    shared: rtcf.Client,
    before: list[graph_pb2.ComponentSpec],
    graph: list[graph_pb2.ComponentSpec],
    warm_up: int,
    late: int,
) -> None:
    """Input values from an earlier graph are part of the snapshot."""
    shared.stop()
    shared.apply([], "rt_runner")
    shared.apply(before, "rt_runner")
    shared.step(1 + warm_up)
    shared.apply(graph, "rt_runner")
    if late:
        shared.step(late)
    taken = shared.take_snapshot().snapshot
    begin = _snapshot(shared)
    shared.step(CYCLES)
    end = _snapshot(shared)
    assert end != begin
    shared.restore_snapshot(taken)
    assert _snapshot(shared) == begin
    shared.step(CYCLES)
    assert _snapshot(shared) == end


def _chaos(rate: float = 3.9) -> Any:
    return rtcf.component("rtcf_test", "Chaos", name="chaos", parameters=[f"rate:={rate}"])


def _rate(client: rtcf.Client) -> float:
    found = {each.name: each.value for each in client.get_component("chaos").parameters}
    return float(found["rate"].double_value)


def test_commands_take_and_restore_in_a_running_loop(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "before.rtcf"
    client.load(_chaos(3.7))
    client.start()
    done = daemon.ctl("snapshot", str(file))
    assert done.returncode == 0, done.stderr
    assert f"in {file}" in done.stdout
    client.set_parameters("chaos", [rtcf.parse_parameter("rate:=3.9")])
    done = daemon.ctl("restore", str(file))
    assert done.returncode == 0, done.stderr
    assert _rate(client) == 3.7
    saved = daemon.ctl("save").stdout
    assert "rate: 3.7" in saved
    status = client.get_status("rt_runner").runners[0]
    assert "running" in daemon.ctl("status").stdout, status


def test_restored_values_outlive_the_daemon(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(_chaos(3.7))
    taken = client.take_snapshot().snapshot
    client.set_parameters("chaos", [rtcf.parse_parameter("rate:=3.9")])
    client.restore_snapshot(taken)
    client.restart_runner("rt_runner")
    assert _rate(client) == 3.7


def test_errors_name_the_mismatch(daemon: Daemon, client: rtcf.Client, tmp_path: Path) -> None:
    file = tmp_path / "a.rtcf"
    assert "No such file" in daemon.ctl("restore", str(file)).stderr
    client.load(_chaos())
    assert daemon.ctl("snapshot", str(file)).returncode == 0
    assert "No such file" in daemon.ctl("snapshot", str(tmp_path / "none" / "a")).stderr
    client.unload(["chaos"])
    done = daemon.ctl("restore", str(file))
    assert done.returncode == 1
    assert "the graph has no component /chaos" in done.stderr
    file.write_bytes(file.read_bytes()[:-1] + b"?")
    assert "the snapshot is damaged" in daemon.ctl("restore", str(file)).stderr
    file.write_text("rt_runner:\n")
    assert "the file is not a snapshot" in daemon.ctl("restore", str(file)).stderr


def test_a_stopped_loop_is_paused_where_the_snapshot_was(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(_chaos())
    client.step(25)
    taken = client.take_snapshot()
    assert taken.iteration == 25
    client.stop()
    assert any("paused" in note for note in client.restore_snapshot(taken.snapshot).notes)
    client.step(1)
    assert client.take_snapshot().iteration == 26
