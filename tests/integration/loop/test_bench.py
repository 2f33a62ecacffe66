"""rtcf.testing.Bench: components and graphs under test, without real time."""

from __future__ import annotations

import math
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fig_1
import numpy as np
import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, clean_environment
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pages import TREE
from rtcf import reasons
from rtcf.testing import Bench

PATH = [BUILD_TREE / "lib" / "rtcf"]
MASKED: Any = np.ma


def run_pytest(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(folder)],
        cwd=folder, capture_output=True, text=True, timeout=120, check=False,
        env={**clean_environment(), "PYTHONPATH": str(BUILD_TREE / "python")},
    )  # fmt: skip


@pytest.fixture(scope="module")
def mimo() -> Iterator[Bench]:
    with Bench("rtcf_examples/Mimo", path=PATH) as bench:
        yield bench


@settings(max_examples=20)
@given(
    values=arrays.arrays(float, 50, elements=st.floats(-1e6, 1e6)),
    sent=arrays.arrays(bool, 50, elements=st.booleans()),
)
def test_each_cycle_reads_its_row_except_masked_values(mimo: Bench, values: Any, sent: Any) -> None:
    response = mimo.run({"in1": 2.0, "in2": MASKED.array(values, mask=~sent)})
    assert response["out1"].tolist() == [
        2.0 + value if there else 2.0 for value, there in zip(values, sent, strict=True)
    ]
    assert response.written["out1"].all()
    assert response.time[:2].tolist() == [0.0, 0.001]


def test_two_equal_runs_give_identical_bits() -> None:
    with Bench("rtcf_examples/Wave", path=PATH, frequency_hz=2000, amplitude=2.5) as bench:
        assert bench.parameters == {
            "amplitude": 2.5, "rate": 1.0, "shape": "sine", "silent": False
        }  # fmt: skip
        first = bench.run(steps=3100)["wave"]
        assert bench.run(steps=3100)["wave"].tobytes() == first.tobytes()
        expected = 2.5 * np.sin(2 * math.pi * np.arange(1, 3101) / 2000)
        assert np.allclose(first, expected, atol=1e-9)
        assert bench.state == {"phase": pytest.approx(0.55, abs=1e-9), "above": False}
        assert [
            each for each in bench.logs if each == "/Wave: configured: amplitude 2.5, rate 1 Hz"
        ]
        bench.set(silent=True)
        assert not bench.run(steps=10)["wave"].any()


def test_many_cycles_go_in_several_requests(mimo: Bench) -> None:
    rows = np.arange(30_000.0)
    response = mimo.run({"in1": rows, "in2": -rows})
    assert not response["out2"].any()
    assert len(response["out2"]) == len(rows)


def test_a_whole_graph_file_runs(tmp_path: Path, daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        fig_1.load(client)
    file = tmp_path / "fig1.yaml"
    assert daemon.ctl("save", str(file)).returncode == 0
    with Bench(str(file), path=PATH) as bench:
        response = bench.run({"/R2.in4": [0.5, 1.5]})
        sums: list[float] = []
        r1 = r3 = None
        for value in (0.5, 1.5):
            h1 = fig_1.mimo_sum(r3, r1)
            f1 = fig_1.mimo_sum(h1, None)
            r1 = fig_1.mimo_sum(h1, None)
            r2 = fig_1.mimo_sum(f1, h1, r1, value)
            r3 = fig_1.mimo_sum(f1, r2)
            sums.append(r3)
        assert response["/R3.out1"].tolist() == sums
        with pytest.raises(ValueError, match="connected to an output|no input"):
            bench.run({"/H1.in1": 1.0}, steps=1)
        with pytest.raises(ValueError, match="needs one component"):
            print(bench.state)


def test_the_error_of_a_failing_component_is_raised() -> None:
    with Bench("rtcf_faults/Throws", path=PATH) as bench:
        for _ in range(2):
            with pytest.raises(reasons.LoopFailedError, match="/Throws"):
                bench.run(steps=100)


def test_a_component_that_crashes_is_named() -> None:
    with (
        Bench("rtcf_faults/NullDereference", path=PATH) as bench,
        pytest.raises(
            rtcf.RtcfError, match=r"SIGSEGV .* while /NullDereference\.update was running"
        ),
    ):
        bench.run(steps=100)


@pytest.mark.parametrize(
    ("inputs", "steps", "said"),
    [
        ({"in9": 1.0}, 5, 'no input in9; did you mean "in4"'),
        ({"in1.x": 1.0}, 5, "no field x"),
        ({"in1": [1.0, 2.0]}, 5, "in1: 2 rows for 5 cycles"),
        ({"in1": np.zeros((5, 2))}, 5, "2 values per cycle instead of 1"),
        ({"in1": "full"}, 5, "in1: values must be numbers"),
        ({"in1": 1.0}, None, "set steps to at least 1, or pass an array"),
        ({}, 0, "set steps to at least 1, or pass an array"),
    ],
)
def test_unsuitable_inputs_are_rejected_and_the_bench_continues(
    mimo: Bench, inputs: dict[str, Any], steps: int | None, said: str
) -> None:
    with pytest.raises(ValueError, match=".") as error:
        mimo.run(inputs, steps)
    assert said in str(error.value)
    assert mimo.run(steps=1)["out1"].tolist() == [1.0]


def test_an_output_that_was_not_written_is_named(mimo: Bench) -> None:
    with pytest.raises(KeyError, match='no output out was written; did you mean "out'):
        mimo.run(steps=1)["out"]


@pytest.mark.parametrize(
    ("what", "arguments", "said"),
    [
        ("Mimo", {}, '"Mimo" is neither PACKAGE/TYPE nor a graph file'),
        ("nowhere.yaml", {}, "nowhere.yaml: No such file or directory"),
        ("rtcf_examples/Mimi", {}, "Mimi"),
        ("rtcf_examples/Wave", {"amplitude": None}, "amplitude: None is not a bool, int, float or"),
        ("rtcf_examples/Wave", {"amplitude": [1]}, "no parameter amplitude_0; it has amplitude"),
        (
            "rtcf_examples/Wave",
            {"amplitude": []},
            "amplitude is an empty list: only a vector can be",
        ),
        ("rtcf_examples/Wave", {"amplitude": -1.0}, "amplitude"),
        ("rtcf_examples/Wave", {"path": ["nowhere"]}, "nowhere: no such folder"),
        ("fig.yaml", {"kp": 1.0}, "fig.yaml: set parameters in the graph file"),
    ],
)
def test_untestable_arguments_are_rejected(what: str, arguments: dict[str, Any], said: str) -> None:
    all_arguments: dict[str, Any] = {"path": PATH, **arguments}
    with pytest.raises((ValueError, rtcf.RtcfError)) as error:
        Bench(what, **all_arguments)
    assert said in str(error.value)


def test_benches_of_the_plugin_end_with_their_test(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["rtcf.testing.plugin"]\n')
    (tmp_path / "test_it.py").write_text(
        "def test_it(bench):\n"
        f"    response = bench('rtcf_examples/Mimo', path={[str(each) for each in PATH]}).run(\n"
        "        {'in1': [1.0, 2.0]})\n"
        "    assert response['out1'].tolist() == [1.0, 2.0]\n"
        "def test_that_fails(bench):\n"
        f"    bench('rtcf_examples/Mimo', path={[str(each) for each in PATH]}).run(steps=1)\n"
        "    assert False\n"
    )
    done = run_pytest(tmp_path)
    assert "1 failed, 1 passed" in done.stdout, done.stdout + done.stderr
    assert "ready; runners: none" in done.stdout, "rtcfd's output is part of the failure"


def test_the_example_test_of_the_docs_passes(tmp_path: Path) -> None:
    page = (TREE / "docs" / "components.md").read_text()
    code = re.search(r"### From Python.*?```python\n(.*?)```", page, re.DOTALL)
    assert code is not None
    (tmp_path / "test_mimo.py").write_text(code[1])
    (tmp_path / "build" / "lib").mkdir(parents=True)
    (tmp_path / "build" / "lib" / "rtcf").symlink_to(PATH[0])
    done = run_pytest(tmp_path)
    assert "2 passed" in done.stdout, done.stdout + done.stderr
