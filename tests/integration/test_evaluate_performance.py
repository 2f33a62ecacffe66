"""`rosrun rtcf evaluate_performance_rosbag`: numbers and a plot of a bag."""

import json
import subprocess
from pathlib import Path

import genpy
import pytest
import rosbag
from rtcf_msgs.msg import IterationInfo
from std_msgs.msg import Float64

PROGRAM = Path(__file__).parents[2] / "client" / "ros" / "evaluate_performance_rosbag.py"
PERIOD_NS = 500_000
TOPIC = "/rt_runner/iteration_info"


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(PROGRAM), *arguments], capture_output=True, text=True, timeout=60.0, check=False
    )


def _info(iteration: int, duration_ns: int, latency_ns: int) -> IterationInfo:
    stamp = genpy.Time()
    stamp.secs, stamp.nsecs = divmod(1_700_000_000_000_000_000 + iteration * PERIOD_NS, 10**9)
    return IterationInfo(  # type: ignore[no-untyped-call]
        stamp=stamp, iteration=iteration, duration_ns=duration_ns, latency_ns=latency_ns
    )


def _record(file: Path, infos: list[IterationInfo], topic: str = TOPIC) -> Path:
    with rosbag.Bag(str(file), "a" if file.exists() else "w") as bag:
        for info in infos:
            bag.write(topic, info, info.stamp)
    return file


def test_numbers_of_a_bag_are_exact(tmp_path: Path) -> None:
    # 1000 durations of 1 to 1000 µs; each second cycle begins 2 µs late.
    infos = [_info(i, (i + 1) * 1000, 2000 * (i % 2)) for i in range(1000)]
    done = _run(str(_record(tmp_path / "a.bag", infos)), "2000", "--json")
    assert done.stderr == ""
    assert json.loads(done.stdout) == {
        "cycles": 1000,
        "lost": 0,
        "overruns": 501,  # 500 µs and more
        "duration_us": {
            "min": 1.0, "mean": 500.5, "p50": 501.0, "p99": 991.0, "p999": 1000.0, "max": 1000.0,
        },
        "jitter_us": {"min": 2.0, "mean": 2.0, "p50": 2.0, "p99": 2.0, "p999": 2.0, "max": 2.0},
    }  # fmt: skip
    # The plot stands beside the bag.
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_lost_messages_and_restarts_of_the_loop_are_told_apart(tmp_path: Path) -> None:
    iterations = [0, 1, 2, 5, 6, 0, 1, 2]
    infos = [_info(iteration, 1000, 0) for iteration in iterations]
    with rosbag.Bag(str(tmp_path / "a.bag"), "w") as bag:
        for at, info in enumerate(infos):
            bag.write(TOPIC, info, genpy.Time(100, at))
    done = _run(str(tmp_path / "a.bag"), "2000", "--json")
    numbers = json.loads(done.stdout)
    assert (numbers["cycles"], numbers["lost"]) == (8, 2)
    # Neither is jitter.
    assert numbers["jitter_us"]["max"] == 0.0


def test_people_get_a_table(tmp_path: Path) -> None:
    bag = _record(tmp_path / "a.bag", [_info(i, 1000, 0) for i in range(10)])
    done = _run(str(bag), "2000", "--png", str(tmp_path / "b.png"))
    assert done.stdout.splitlines() == [
        f"{TOPIC}: 10 cycles, 0 messages lost, 0 overruns",
        "µs                           min      mean       p50       p99      p999       max",
        "calculation duration       1.000     1.000     1.000     1.000     1.000     1.000",
        "scheduling jitter          0.000     0.000     0.000     0.000     0.000     0.000",
        str(tmp_path / "b.png"),
    ]


def test_one_of_several_loops_is_chosen(tmp_path: Path) -> None:
    bag = _record(tmp_path / "a.bag", [_info(i, 1000, 0) for i in range(10)])
    _record(bag, [_info(i, 2000, 0) for i in range(10)], "/other/iteration_info")
    refused = _run(str(bag), "2000")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "--topic" in refused.stderr
    done = _run(str(bag), "2000", "--topic", "/other/iteration_info", "--json")
    assert json.loads(done.stdout)["duration_us"]["max"] == 2.0


def test_bad_input_is_refused_in_one_line(tmp_path: Path) -> None:
    other = tmp_path / "other.bag"
    with rosbag.Bag(str(other), "w") as bag:
        bag.write("/x", Float64(data=1.0), genpy.Time(1, 0))
    no_bag = tmp_path / "no.bag"
    no_bag.write_text("this is no bag")
    short = _record(tmp_path / "short.bag", [_info(0, 1000, 0)])
    good = _record(tmp_path / "good.bag", [_info(i, 1000, 0) for i in range(10)])
    for arguments, status, said in (
        ((str(tmp_path / "none.bag"), "2000"), 1, "No such file"),
        ((str(no_bag), "2000"), 1, str(no_bag)),
        ((str(other), "2000"), 1, "rosbag record /rt_runner/iteration_info"),
        ((str(short), "2000"), 1, "too few"),
        ((str(good), "2000", "--topic", "/x"), 1, "/x"),
        ((str(good), "2000", "--png", str(tmp_path / "nowhere" / "a.png")), 1, "cannot write"),
    ):
        done = _run(*arguments)
        assert (done.returncode, done.stdout) == (status, ""), arguments
        assert said in done.stderr, arguments
        assert done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("frequency", ["0", "-1", "nan", "fast"])
def test_bad_frequency_is_wrong_usage(tmp_path: Path, frequency: str) -> None:
    done = _run(str(tmp_path / "a.bag"), frequency)
    assert done.returncode == 2
    assert "FREQUENCY" in done.stderr
