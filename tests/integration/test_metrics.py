"""`rtcfctl metrics` and `rtcfctl stats --plot`: figures for Prometheus, and as a picture."""

import importlib
import socket
import subprocess
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from values import iteration

# Untyped, in some releases.
_PARSER: Any = importlib.import_module("prometheus_client.parser")

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


def samples(text: str) -> Samples:
    """Read what an independent reader of the format reads."""
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in _PARSER.text_string_to_metric_families(text)
        for sample in family.samples
    }


def labels(**words: str) -> frozenset[tuple[str, str]]:
    return frozenset(words.items())


@pytest.fixture
def counted(daemon: Daemon, client: rtcf.Client) -> Daemon:
    """Give a loop that has run for some cycles."""
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    wait_for(lambda: iteration(client) > 200, "200 cycles")
    client.stop()
    return daemon


def test_all_figures_are_those_of_the_loop(counted: Daemon, client: rtcf.Client) -> None:
    done = counted.ctl("metrics")
    assert done.returncode == 0, done.stderr
    found = samples(done.stdout)
    figures = client.get_statistics(buckets=True)
    ours = labels(runner="rt_runner")
    assert found["rtcf_up", labels()] == 1
    assert found["rtcf_cycles_total", ours] == figures.iterations
    assert found["rtcf_runner_state", labels(runner="rt_runner", state="stopped")] == 1
    assert found["rtcf_runner_state", labels(runner="rt_runner", state="running")] == 0
    assert found["rtcf_cycle_duration_seconds_count", ours] == figures.duration.count
    mean_s = found["rtcf_cycle_duration_seconds_sum", ours] / figures.duration.count
    assert mean_s == pytest.approx(figures.duration.mean_ns / 1e9)
    steps = sorted(
        (float(dict(names)["le"]), value)
        for (name, names), value in found.items()
        if name == "rtcf_wake_up_latency_seconds_bucket"
    )
    assert [value for _, value in steps] == sorted(value for _, value in steps)
    assert steps[-1] == (float("inf"), figures.latency.count)
    for bound, value in steps[:-1]:
        below = sum(each.count for each in figures.latency_buckets if each.upper_ns <= bound * 1e9)
        assert value == below
    component = {"runner": "rt_runner", "component": "/Counter"}
    longest = found["rtcf_component_update_seconds", labels(**component, quantile="1")]
    assert longest == pytest.approx(figures.components[0].duration.max_ns / 1e9)
    assert found["rtcf_component_faults_total", labels(**component)] == 0


def test_buckets_are_those_values_that_there_were(counted: Daemon, client: rtcf.Client) -> None:
    figures = client.get_statistics(buckets=True)
    for buckets, all_of_it in (
        (figures.duration_buckets, figures.duration),
        (figures.latency_buckets, figures.latency),
    ):
        ends = [each.upper_ns for each in buckets]
        assert ends == sorted(set(ends))
        assert sum(each.count for each in buckets) == all_of_it.count
        assert all(each.count for each in buckets)
        assert all_of_it.max_ns <= ends[-1] * 1.001
    assert not client.get_statistics().duration_buckets, "where nobody asks"


@contextmanager
def served(daemon: Daemon, port: int) -> Iterator[str]:
    with subprocess.Popen(
        ["rtcfctl", "metrics", "--listen", str(port)],
        env=daemon.environment(), stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
        return port


def test_they_are_served_and_say_when_rtcfd_is_gone(counted: Daemon) -> None:
    port = free_port()
    with served(counted, port) as address:
        assert address == f"http://127.0.0.1:{port}/metrics"

        def asked() -> Samples:
            with urllib.request.urlopen(address) as answer:
                return samples(answer.read().decode())

        first = asked()
        assert first["rtcf_up", labels()] == 1
        assert first["rtcf_cycles_total", labels(runner="rt_runner")] > 0
        refused = counted.ctl("metrics", "--listen", str(port))
        assert refused.returncode == 1
        assert refused.stderr == f"rtcfctl: 127.0.0.1:{port}: Address already in use\n"
        counted.end()
        assert asked() == {("rtcf_up", labels()): 0}
        counted.start()
        wait_for(lambda: asked()[("rtcf_up", labels())] == 1, "rtcfd")


@pytest.mark.parametrize("place", ["", "x", "0", "65536", "localhost", "1.2.3.4:", "²"])
def test_what_is_no_port_is_refused(daemon: Daemon, place: str) -> None:
    done = daemon.ctl("metrics", "--listen", place)
    assert done.returncode == 2
    assert done.stderr == f"rtcfctl: --listen {place}: a port, or ADDRESS:PORT\n"


@pytest.mark.parametrize(
    ("name", "begin"),
    [("loop.png", b"\x89PNG"), ("loop.svg", b"<?xml"), ("loop.pdf", b"%PDF")],
)
def test_a_picture_is_drawn(counted: Daemon, tmp_path: Path, name: str, begin: bytes) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    (pictures / name).write_text("old")
    done = counted.ctl("stats", "--plot", str(pictures / name))
    assert done.returncode == 0, done.stderr
    assert (pictures / name).read_bytes().startswith(begin)
    assert [each.name for each in pictures.iterdir()] == [name]


def test_pictures_that_cannot_be_are_refused(daemon: Daemon, tmp_path: Path) -> None:
    for words, code, said in (
        (("loop.gif",), 2, "loop.gif: a picture is .svg, .png, .pdf"),
        (("loop.png", "--watch"), 2, "--plot draws one picture: give it without --watch"),
        (("loop.png",), 1, "rt_runner has run no cycle: there is nothing to draw"),
    ):
        done = daemon.ctl("stats", "--plot", *words)
        assert done.returncode == code
        assert done.stderr == f"rtcfctl: {said}\n"
