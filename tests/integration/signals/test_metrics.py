"""`rtcfctl metrics` and `rtcfctl stats --plot`: statistics for Prometheus, and as a plot."""

import importlib
import json
import re
import socket
import subprocess
import sys
import urllib.request
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pytest
import rtcf
from daemon_process import Daemon, wait_for
from pages import TREE
from rtcfctl.main import main
from values import iteration

# Some releases of Debian have this module without type hints.
_PARSER: Any = importlib.import_module("prometheus_client.parser")

Samples = dict[tuple[str, frozenset[tuple[str, str]]], float]


def samples(text: str) -> Samples:
    """Parse with an independent reader of the format."""
    return {
        (sample.name, frozenset(sample.labels.items())): sample.value
        for family in _PARSER.text_string_to_metric_families(text)
        for sample in family.samples
    }


def labels(**words: str) -> frozenset[tuple[str, str]]:
    return frozenset(words.items())


@pytest.fixture
def counted(daemon: Daemon, client: rtcf.Client) -> Daemon:
    """Return a daemon whose loop has run for some cycles."""
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    wait_for(lambda: iteration(client) > 200, "200 cycles")
    client.stop()
    return daemon


def test_all_metrics_match_the_loop(counted: Daemon, client: rtcf.Client) -> None:
    done = counted.ctl("metrics")
    assert done.returncode == 0, done.stderr
    found = samples(done.stdout)
    statistics = client.get_statistics(buckets=True)
    ours = labels(runner="rt_runner")
    assert found["rtcf_up", labels()] == 1
    assert found["rtcf_cycles_total", ours] == statistics.iterations
    assert found["rtcf_runner_state", labels(runner="rt_runner", state="stopped")] == 1
    assert found["rtcf_runner_state", labels(runner="rt_runner", state="running")] == 0
    assert found["rtcf_cycle_duration_seconds_count", ours] == statistics.duration.count
    mean_s = found["rtcf_cycle_duration_seconds_sum", ours] / statistics.duration.count
    assert mean_s == pytest.approx(statistics.duration.mean_ns / 1e9)
    steps = sorted(
        (float(dict(names)["le"]), value)
        for (name, names), value in found.items()
        if name == "rtcf_wake_up_latency_seconds_bucket"
    )
    assert [value for _, value in steps] == sorted(value for _, value in steps)
    assert steps[-1] == (float("inf"), statistics.latency.count)
    for bound, value in steps[:-1]:
        below = sum(
            each.count for each in statistics.latency_buckets if each.upper_ns <= bound * 1e9
        )
        assert value == below
    component = {"runner": "rt_runner", "component": "/Counter"}
    longest = found["rtcf_component_update_seconds", labels(**component, quantile="1")]
    assert longest == pytest.approx(statistics.components[0].duration.max_ns / 1e9)
    assert found["rtcf_component_faults_total", labels(**component)] == 0


def test_buckets_match_the_values(counted: Daemon, client: rtcf.Client) -> None:
    statistics = client.get_statistics(buckets=True)
    for buckets, all_of_it in (
        (statistics.duration_buckets, statistics.duration),
        (statistics.latency_buckets, statistics.latency),
    ):
        ends = [each.upper_ns for each in buckets]
        assert ends == sorted(set(ends))
        assert sum(each.count for each in buckets) == all_of_it.count
        assert all(each.count for each in buckets)
        assert all_of_it.max_ns <= ends[-1] * 1.001
    assert not client.get_statistics().duration_buckets, "buckets are sent only on request"


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


def test_metrics_are_served_and_report_a_missing_rtcfd(counted: Daemon) -> None:
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
def test_an_invalid_port_is_rejected(daemon: Daemon, place: str) -> None:
    done = daemon.ctl("metrics", "--listen", place)
    assert done.returncode == 2
    assert done.stderr == f"rtcfctl: --listen {place}: use PORT or ADDRESS:PORT\n"


@pytest.mark.parametrize(
    ("name", "begin"),
    [("loop.png", b"\x89PNG"), ("loop.svg", b"<?xml"), ("loop.pdf", b"%PDF")],
)
def test_a_plot_is_drawn(counted: Daemon, tmp_path: Path, name: str, begin: bytes) -> None:
    plots = tmp_path / "plots"
    plots.mkdir()
    (plots / name).write_text("old")
    done = counted.ctl("stats", "--plot", str(plots / name))
    assert done.returncode == 0, done.stderr
    assert (plots / name).read_bytes().startswith(begin)
    assert [each.name for each in plots.iterdir()] == [name]


@pytest.fixture
def outlier(daemon: Daemon, client: rtcf.Client) -> Daemon:
    """Return a daemon whose loop had one cycle that took far longer than the others."""
    client.load(
        rtcf.component("rtcf_faults", "Stumbles", name="slow", parameters=["spin_us:=60000"])
    )
    client.start()
    wait_for(lambda: iteration(client) > 500, "500 cycles")
    client.set_parameters("slow", [rtcf.parse_parameter("turn:=1")])
    wait_for(lambda: client.get_statistics().duration.max_ns > 50e6, "the slow cycle")
    client.stop()
    return daemon


def test_a_plot_shows_an_outlier_and_the_others(
    outlier: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    statistics = client.get_statistics(buckets=True)
    plot = tmp_path / "loop.svg"
    assert outlier.ctl("stats", "--plot", str(plot)).returncode == 0
    root = ElementTree.parse(plot).getroot()
    texts = {each.text or "" for each in root.iter() if each.tag.endswith("text")}
    for panel, found in (("calculation", statistics.duration), ("wake-up", statistics.latency)):
        bars = ids(root, f"{panel} bar ")
        assert sum(int(each.get("id", "").split()[-1]) for each in bars) == found.count
        # On a linear axis all but one cycle are in the first bar.
        lefts = {round(min(across(each))) for each in bars}
        assert len(lefts) == len(bars) >= 4
        marks = {
            each.get("id", "").rpartition("mark ")[2]: min(across(each))
            for each in ids(root, f"{panel} mark ")
        }
        assert list(marks) == ["50 %", "99 %", "99.9 %", "max"]
        assert marks["50 %"] <= marks["99 %"] <= marks["99.9 %"] <= marks["max"]
    (median,) = ids(root, "calculation mark 50 %")
    (longest,) = ids(root, "calculation mark max")
    assert min(across(longest)) - min(across(median)) > 100
    assert any(re.fullmatch(r"max: 6\d{4} µs", each) for each in texts), texts
    assert {"1", "10", "100", "10 000"} <= texts  # cycles and µs, as readable numbers


def ids(root: Element, begin: str) -> list[Element]:
    """Return the parts of a plot whose name starts with a text."""
    return [each for each in root.iter() if each.get("id", "").startswith(begin)]


def across(part: Element) -> list[float]:
    """Return the horizontal positions of a part of a plot."""
    numbers = [
        float(number)
        for each in part.iter()
        for number in re.findall(r"-?\d+(?:\.\d+)?", each.get("d", ""))
    ]
    return numbers[0::2]


def test_bars_in_the_terminal_show_an_outlier_and_the_others(
    outlier: Daemon, client: rtcf.Client
) -> None:
    statistics = client.get_statistics()
    done = outlier.ctl("stats", "--plot")
    assert done.returncode == 0, done.stderr
    assert all(len(line) <= 80 for line in done.stdout.split("\n\n", 2)[2].splitlines())
    for title, found in (
        ("calculation duration", statistics.duration), ("wake-up latency", statistics.latency),
    ):  # fmt: skip
        after = done.stdout.partition(f"\n{title} (µs), ")[2]
        count = f"{found.count:,}".replace(",", " ")
        assert after.startswith(f"{count} cycles, logarithmic bars\n")
        bars = re.findall(
            r"^ *([\d.]+) to +([\d.]+) ([█▏▎▍▌▋▊▉]*) +(\d[\d ]*?)(?:  (.*))?$",
            after.partition("\n\n")[0], re.MULTILINE,
        )  # fmt: skip
        counts = [int(each[3].replace(" ", "")) for each in bars]
        assert sum(counts) == found.count
        assert 4 <= len(bars) <= 24
        # Similar counts may have bars of the same length.
        assert len(bars[counts.index(max(counts))][2]) == max(len(each[2]) for each in bars)
        assert all(each[2] for each, count in zip(bars, counts, strict=True) if count)
        for name, value_ns in (
            ("50 %", found.p50_ns), ("99 %", found.p99_ns), ("99.9 %", found.p999_ns),
            ("max", found.max_ns),
        ):  # fmt: skip
            ((low, high, _, _, _),) = [each for each in bars if name in each[4].split(", ")]
            assert float(low) * 0.95 < value_ns / 1e3 < float(high) * 1.05
    # A single line stands between them and the outlier.
    assert "…" in done.stdout


def test_json_has_the_buckets(counted: Daemon) -> None:
    told = json.loads(counted.ctl("stats", "--plot", "-o", "json").stdout)
    assert sum(each["count"] for each in told["duration_buckets"]) == told["duration"]["count"]


def test_impossible_plots_are_rejected(daemon: Daemon, tmp_path: Path) -> None:
    for words, code, said in (
        (("loop.gif",), 2, "loop.gif: use one of .svg, .png, .pdf"),
        (("loop.png", "--watch"), 2, "--plot cannot be used with --watch"),
        ((), 1, "rt_runner has run no cycles: nothing to draw"),
        (("loop.png",), 1, "rt_runner has run no cycles: nothing to draw"),
    ):
        done = daemon.ctl("stats", "--plot", *words)
        assert done.returncode == code
        assert done.stderr == f"rtcfctl: {said}\n"


def test_a_missing_package_ends_the_service_for_good(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    modules: Any = sys.modules
    monkeypatch.setitem(modules, "prometheus_client", None)
    assert main(["metrics", "--listen", "9464"]) == 2
    assert capsys.readouterr().err == (
        "rtcfctl: prometheus_client not found: sudo apt install python3-prometheus-client\n"
    )
    unit = (TREE / "systemd" / "rtcf-metrics.service").read_text().splitlines()
    assert "RestartPreventExitStatus=2" in unit
