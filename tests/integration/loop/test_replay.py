"""`rtcfctl replay`: the outputs of a loop for a recording, identical in each replay."""

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

import fig_1
import pytest
import rosbag
import rospy
import rtcf
from daemon_process import Daemon, wait_for
from rtcf import reasons
from rtcf.v1 import control_pb2, runner_pb2
from rtcf_shared.mcap_writer import MAGIC
from std_msgs.msg import Float64, String

START_NS = 1_700_000_000_000_000_000
PERIOD_NS = 1_000_000


@pytest.fixture
def daemon(tmp_path: Path) -> Iterator[Daemon]:
    """Yield a daemon without ROS, whose loop is Fig. 1 with its mapped connections."""
    daemon = Daemon(tmp_path, f"[runner.ros]\nenabled = false\nwhitelist = '{fig_1.WHITELIST}'\n")
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=1e9 / PERIOD_NS))
        fig_1.load(client)
    yield daemon
    if not daemon.ended:
        daemon.end()


def _write(path: Path, messages: list[tuple[str, int, object]]) -> Path:
    with rosbag.Bag(str(path), "w") as bag:
        for topic, after_ns, message in messages:
            bag.write(topic, message, rospy.Time(0, START_NS + after_ns))
    return path


def _read(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    content: dict[str, list[tuple[int, bytes]]] = {}
    with rosbag.Bag(str(path)) as bag:
        for topic, raw, time in bag.read_messages(raw=True):
            content.setdefault(topic, []).append((time.to_nsec(), raw[1]))
    return content


def _simulate(inputs: dict[int, float], cycles: int) -> Iterator[float]:
    """Yield R3's output in each cycle; `inputs` are the new values at R2.in4, by cycle."""
    r1 = r3 = None
    for cycle in range(cycles):
        h1 = fig_1.mimo_sum(r3, r1)
        f1 = fig_1.mimo_sum(h1, None)
        r1 = fig_1.mimo_sum(h1, None)
        r2 = fig_1.mimo_sum(f1, h1, r1, inputs.get(cycle))
        r3 = fig_1.mimo_sum(f1, r2)
        yield r3


def test_each_message_is_read_by_the_next_cycle(daemon: Daemon, tmp_path: Path) -> None:
    # On a cycle, just after one, just before one, two for the same cycle, many at once.
    messages: list[tuple[str, int, object]] = [
        ("/other", 0, String("is read by nobody")),
        ("/G2_R2", 3 * PERIOD_NS, Float64(0.1)),
        ("/G2_R2", 7 * PERIOD_NS + 1, Float64(0.2)),
        ("/G2_R2", 11 * PERIOD_NS - 1, Float64(0.3)),
        ("/G2_R2", 20 * PERIOD_NS + 1, Float64(9.0)),
        ("/G2_R2", 20 * PERIOD_NS + 2, Float64(0.4)),
        *(("/G2_R2", k * PERIOD_NS, Float64(k / 7.0)) for k in range(30, 5000)),
    ]
    expected = {3: 0.1, 8: 0.2, 11: 0.3, 21: 0.4} | {k: k / 7.0 for k in range(30, 5000)}
    bag = _write(tmp_path / "in.bag", messages)
    outputs = [tmp_path / "one.bag", tmp_path / "two.bag"]
    for output in outputs:
        done = daemon.ctl("replay", str(bag), "--write", str(output), "-o", "json")
        assert (done.returncode, done.stderr) == (0, "")
        summary = json.loads(done.stdout)
        assert summary["cycles"] == 5000
        assert summary["injected"] == len(messages) - 1
        assert summary["outputs"] == 10000
        assert summary["unread"] == ["/other"]
        # Between the two, the loop gets other values than at its start.
        assert daemon.ctl("step", "17").returncode == 0
    first, second = (_read(output) for output in outputs)
    assert first == second
    assert set(first) == {"/R1_H1R2", "/R3_G2H1"}
    times = [START_NS + k * PERIOD_NS for k in range(5000)]
    values = [Float64().deserialize(data).data for _, data in first["/R3_G2H1"]]
    assert [time for time, _ in first["/R3_G2H1"]] == times
    assert values == list(_simulate(expected, 5000))


def test_the_output_can_be_parsed(daemon: Daemon, tmp_path: Path) -> None:
    bag = _write(tmp_path / "in.bag", [("/x", 0, Float64(1)), ("/x", 2_500_000, Float64(1))])
    done = daemon.ctl("replay", str(bag))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "replayed 0.003 s in 3 cycles: 0 messages in, 6 out",
        "read by no component: /x",
        "not in the bag: /G2_R2",
    ]
    status = json.loads(daemon.ctl("status", "-o", "json").stdout)
    assert status["runners"][0]["state"] == "stopped"


def test_a_gap_as_of_a_clock_that_was_set_is_rejected(daemon: Daemon, tmp_path: Path) -> None:
    bag = tmp_path / "gap.bag"
    with rosbag.Bag(str(bag), "w") as writing:
        for second in (5, 1_700_000_000, 1_700_000_001):
            writing.write("/G2_R2", Float64(second), rospy.Time(second, 0))
    done = daemon.ctl("replay", str(bag))
    assert (done.returncode, done.stdout) == (1, "")
    (line,) = done.stderr.splitlines()
    assert "has no message for 1699999995 s after 1970-01-01 00:00:05 UTC" in line
    assert f"`rosbag filter {bag} PART.bag 't.secs >= 1700000000'`" in line
    part = tmp_path / "part.bag"
    subprocess.run(["rosbag", "filter", bag, part, "t.secs >= 1700000000"], check=True)
    assert daemon.ctl("replay", str(part)).stdout.startswith("replayed 1.000 s in 1001 cycles")
    assert daemon.ctl("replay", str(part), "--gap", "0.5").returncode == 1


def test_an_unsuitable_bag_is_rejected_in_one_line(daemon: Daemon, tmp_path: Path) -> None:
    text = tmp_path / "text.bag"
    text.write_text("no bag")
    recording = tmp_path / "recording.mcap"
    recording.write_bytes(MAGIC)
    bag = recording.with_suffix(".bag")
    bag.write_bytes(b"\x89")
    empty = _write(tmp_path / "empty.bag", [])
    other = _write(tmp_path / "other.bag", [("/G2_R2", 0, String("?"))])
    good = _write(tmp_path / "good.bag", [("/G2_R2", 0, Float64(1))])
    for arguments, words in [
        ([str(tmp_path / "none.bag")], "none.bag cannot be read: No such file"),
        ([str(text)], "text.bag is not a bag"),
        ([str(bag)], f"{bag} is not a bag"),
        ([str(recording)], f"replay reads bags: `rtcfctl convert {recording} {bag}`, then replay"),
        ([str(empty)], "empty.bag has no messages"),
        ([str(other)], "/G2_R2 is recorded as std_msgs/String"),
        ([str(good), "--write", str(good)], "is the recording itself"),
        ([str(good), "--write", str(tmp_path / "no" / "x.bag")], "x.bag cannot be written"),
    ]:
        done = daemon.ctl("replay", *arguments)
        assert (done.returncode, done.stdout) == (1, ""), arguments
        assert words in done.stderr
        assert done.stderr.count("\n") == 1
    assert daemon.ctl("start").returncode == 0
    done = daemon.ctl("replay", str(good))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "runs in real time: stop it first" in done.stderr


def test_a_full_disk_leaves_no_partial_bag(daemon: Daemon, tmp_path: Path) -> None:
    messages: list[tuple[str, int, object]] = [
        ("/G2_R2", k * PERIOD_NS, Float64(1)) for k in range(3000)
    ]
    bag = _write(tmp_path / "in.bag", messages)
    disk = tmp_path / "disk"
    disk.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", disk], check=True)
    try:
        output = disk / "out.bag"
        output.write_text("of before")
        done = daemon.ctl("replay", str(bag), "--write", str(output))
        assert done.returncode == 1
        assert done.stderr.splitlines() == [
            f"rtcfctl: {output} cannot be written: No space left on device"
        ]
        assert [each.name for each in disk.iterdir()] == ["out.bag"]
        assert output.read_text() == "of before"
    finally:
        subprocess.run(["umount", disk], check=True)


def test_the_last_message_is_read_between_two_cycles_too(daemon: Daemon, tmp_path: Path) -> None:
    for after_ns, cycles in ((2 * PERIOD_NS, 3), (2 * PERIOD_NS + 1, 4)):
        messages: list[tuple[str, int, object]] = [
            ("/G2_R2", 0, Float64(1.5)),
            ("/G2_R2", after_ns, Float64(2.5)),
        ]
        done = daemon.ctl("replay", str(_write(tmp_path / "in.bag", messages)), "-o", "json")
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["cycles"] == cycles
        assert daemon.ctl("get", "R2.in4").stdout.strip() == "2.5"


def test_graph_changes_are_rejected_during_a_replay(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client, client.replay() as replay:
        replay.run(control_pb2.ReplayRequest(begin=True, start_ns=START_NS))
        begun = replay.run(control_pb2.ReplayRequest(until_ns=START_NS + 9 * PERIOD_NS))
        assert begun.cycles == 10
        with pytest.raises(rtcf.RefusedError, match="a replay of rt_runner is under way"):
            client.unload(["H1"])
        client.stop()
        with pytest.raises(rtcf.RefusedError, match="was stopped, and this replay with it"):
            replay.run(control_pb2.ReplayRequest(until_ns=START_NS + 20 * PERIOD_NS))
        client.unload(["H1"])


def test_a_replay_ends_with_its_client(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        with client.replay() as replay:
            replay.run(control_pb2.ReplayRequest(begin=True, start_ns=START_NS))
            with pytest.raises(reasons.ReplayRunsError):
                client.unload(["H1"])
        wait_for(lambda: _unloads(client, "H1"), "the end of the replay")


def test_a_client_leaving_a_stopped_replay_ends_no_other_loop(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        with client.replay() as replay:
            replay.run(control_pb2.ReplayRequest(begin=True, start_ns=START_NS))
            client.stop()
            client.start()
        client.set_breaks([rtcf.parse_port("H1.in1")], True)  # queued behind the following calls
        assert client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_replay_starts_only_once_and_first(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        with client.replay() as replay, pytest.raises(reasons.RequestMalformedError):
            replay.run(control_pb2.ReplayRequest(until_ns=START_NS))
        with client.replay() as replay:
            replay.run(control_pb2.ReplayRequest(begin=True, start_ns=START_NS))
            with pytest.raises(reasons.RequestMalformedError):
                replay.run(control_pb2.ReplayRequest(begin=True, start_ns=START_NS))


def _unloads(client: rtcf.Client, component: str) -> bool:
    try:
        client.unload([component])
    except reasons.ReplayRunsError:
        return False
    return True
