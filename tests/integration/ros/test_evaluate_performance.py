"""`rosrun rtcf evaluate_performance_rosbag`: statistics and a plot of a bag."""

import json
import subprocess
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import genpy
import pytest
import rosbag
from pages import TREE
from rtcf_msgs.msg import Cycle, IterationInfo
from std_msgs.msg import Float64, Header

PROGRAM = TREE / "client" / "ros" / "evaluate_performance_rosbag.py"
PERIOD_NS = 500_000
TOPIC = "/rt_runner/cycles"


@pytest.fixture(scope="module", autouse=True)
def fonts() -> None:
    """Create matplotlib's font cache first: it prints a message if that takes 5 s."""
    subprocess.run(["/usr/bin/python3", "-c", "import matplotlib.font_manager"], check=True)


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(PROGRAM), *arguments], capture_output=True, text=True, timeout=300.0, check=False
    )


def _stamp(iteration: int, latency_ns: int = 0) -> genpy.Time:
    ns = 1_700_000_000_000_000_000 + iteration * PERIOD_NS + latency_ns
    return genpy.Time(*divmod(ns, 10**9))


def _cycle(iteration: int, duration_ns: int, latency_ns: int) -> Cycle:
    return Cycle(  # type: ignore[no-untyped-call]
        header=Header(stamp=_stamp(iteration)),
        iteration=iteration,
        duration_ns=duration_ns,
        latency_ns=latency_ns,
    )


def _info_2021(iteration: int, duration_ns: int, latency_ns: int) -> IterationInfo:
    return IterationInfo(  # type: ignore[no-untyped-call]
        stamp=_stamp(iteration, latency_ns), duration_ns=duration_ns
    )


def _record(file: Path, cycles: Iterable[Any], topic: str = TOPIC) -> Path:
    with rosbag.Bag(str(file), "a" if file.exists() else "w") as bag:
        for at, cycle in enumerate(cycles):
            bag.write(topic, cycle, genpy.Time(100, at))
    return file


@pytest.mark.parametrize("make", [_cycle, _info_2021])
def test_numbers_of_a_bag_are_exact(tmp_path: Path, make: Callable[..., Any]) -> None:
    # 1000 durations of 1 to 1000 µs; every second cycle starts 2 µs late.
    cycles = [make(i, (i + 1) * 1000, 2000 * (i % 2)) for i in range(1000)]
    done = _run(str(_record(tmp_path / "a.bag", cycles)), "2000", "--json")
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
    # The plot is next to the bag.
    assert (tmp_path / "a.bag.evaluation.png").read_bytes().startswith(b"\x89PNG")


def test_lost_messages_and_restarts_of_the_loop_are_distinguished(tmp_path: Path) -> None:
    iterations = [0, 1, 2, 5, 6, 0, 1, 2]
    cycles = [_cycle(iteration, 1000, 0) for iteration in iterations]
    done = _run(str(_record(tmp_path / "a.bag", cycles)), "2000", "--json")
    numbers = json.loads(done.stdout)
    assert (numbers["cycles"], numbers["lost"]) == (8, 2)
    # Neither counts as jitter.
    assert numbers["jitter_us"]["max"] == 0.0


def test_text_output_is_a_table(tmp_path: Path) -> None:
    bag = _record(tmp_path / "a.bag", [_cycle(i, 1000, 0) for i in range(10)])
    done = _run(str(bag), "2000", "--png", str(tmp_path / "b.png"))
    assert done.stdout.splitlines() == [
        f"{TOPIC}: 10 cycles, 0 messages lost, 0 overruns",
        "µs                           min      mean       p50       p99      p999       max",
        "calculation duration       1.000     1.000     1.000     1.000     1.000     1.000",
        "scheduling jitter          0.000     0.000     0.000     0.000     0.000     0.000",
        str(tmp_path / "b.png"),
    ]


def test_counts_of_one_use_the_singular(tmp_path: Path) -> None:
    # The first cycle takes longer than a period; the third of four was lost.
    cycles = [_cycle(0, PERIOD_NS + 1, 0), _cycle(1, 1000, 0), _cycle(3, 1000, 0)]
    done = _run(str(_record(tmp_path / "a.bag", cycles)), "2000")
    assert done.stdout.splitlines()[0] == f"{TOPIC}: 3 cycles, 1 message lost, 1 overrun"


def test_one_of_several_loops_is_chosen(tmp_path: Path) -> None:
    bag = _record(tmp_path / "a.bag", [_cycle(i, 1000, 0) for i in range(10)])
    _record(bag, [_cycle(i, 2000, 0) for i in range(10)], "/other/cycles")
    # From the same loop.
    _record(bag, [_info_2021(i, 2000, 0) for i in range(10)], "/other/iteration_info")
    refused = _run(str(bag), "2000")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "--topic" in refused.stderr
    done = _run(str(bag), "2000", "--topic", "/other/cycles", "--json")
    assert json.loads(done.stdout)["duration_us"]["max"] == 2.0


def test_bad_input_is_rejected_in_one_line(tmp_path: Path) -> None:
    other = tmp_path / "other.bag"
    with rosbag.Bag(str(other), "w") as bag:
        bag.write("/x", Float64(data=1.0), genpy.Time(1, 0))
    no_bag = tmp_path / "no.bag"
    no_bag.write_text("this is no bag")
    short = _record(tmp_path / "short.bag", [_cycle(0, 1000, 0)])
    good = _record(tmp_path / "good.bag", [_cycle(i, 1000, 0) for i in range(10)])
    for arguments, status, said in (
        ((str(tmp_path / "none.bag"), "2000"), 1, "No such file"),
        ((str(no_bag), "2000"), 1, str(no_bag)),
        ((str(other), "2000"), 1, "rosbag record -e '.*/rt_runner/cycles'"),
        ((str(short), "2000"), 1, "too few"),
        ((str(good), "2000", "--topic", "/x"), 1, "/x"),
        ((str(good), "2000", "--png", str(tmp_path / "nowhere" / "a.png")), 1, "cannot write"),
    ):
        done = _run(*arguments)
        assert (done.returncode, done.stdout) == (status, ""), arguments
        assert said in done.stderr, arguments
        assert done.stderr.count("\n") == 1, done.stderr


@pytest.mark.parametrize("frequency", ["0", "-1", "nan", "fast"])
def test_a_bad_frequency_is_a_usage_error(tmp_path: Path, frequency: str) -> None:
    done = _run(str(tmp_path / "a.bag"), frequency)
    assert done.returncode == 2
    assert "FREQUENCY" in done.stderr
