"""A bounded vector of parameters: elements and their number, on all ways in."""

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rtcf
import yaml
from block_bench import PATH
from daemon_process import BUILD_TREE, Daemon, wait_for
from launch_processes import Launching
from rtcf.testing import Bench
from rtcf.v1 import graph_pb2
from rtcf_launch.master import Master
from values import parameter_values, port_value, state

GRAPH = """\
components:
  - {package: rtcf_test, type: Weights, name: w, parameters: {filter: {taps: TAPS}}}
"""
LAUNCH = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <rosparam>{mode: wait_for_components, num_components_expected: 1, frequency: 500.0}</rosparam>
  </node>
  <node name="w" pkg="rtcf" type="rt_launcher" args="rtcf_test Weights" output="screen">
    <rosparam>{filter: {taps: TAPS, taps_size: 2}}</rosparam>
  </node>
</launch>
"""


def graph(taps: str) -> list[graph_pb2.ComponentSpec]:
    """Return the components of a graph file with this list."""
    return list(rtcf.read_graphs(GRAPH.replace("TAPS", taps), "graph")[0].components)


def used(client: rtcf.Client) -> tuple[float | None, float | None]:
    """Return the number and the sum of the elements that the component uses in the next cycle."""
    client.step(1)
    return port_value(client, "w", "count"), port_value(client, "w", "sum")


def apply(daemon: Daemon, file: Path, taps: str) -> None:
    file.write_text(GRAPH.replace("TAPS", taps))
    applied = daemon.ctl("apply", str(file))
    assert applied.returncode == 0, applied.stderr


def kill_executor(client: rtcf.Client) -> None:
    """Kill the executor, and wait until the next one has the component."""
    pid = state(client).pid
    os.kill(pid, signal.SIGKILL)
    wait_for(lambda: state(client).pid not in (0, pid), "an executor")
    wait_for(lambda: client.get_order() == ["/w"], "the component")


def test_an_element_does_not_change_the_size(daemon: Daemon, client: rtcf.Client) -> None:
    taps = ("--param", "filter/taps_0:=4", "--param", "filter/taps_1:=2")
    load = ("load", "rtcf_test", "Weights", "--name", "w")
    assert daemon.ctl(*load, *taps).returncode == 0
    assert used(client) == (3, 6.25), "the last element has its default"
    client.unload(["w"])
    assert daemon.ctl(*load, *taps, "--param", "filter/taps_size:=2").returncode == 0
    assert used(client) == (2, 6.0)
    replaced = daemon.ctl(
        *("replace", "w", "rtcf_test", "Weights", "--name", "w"),
        *("--param", "filter/taps_0:=1"),
    )
    assert replaced.returncode == 0, replaced.stderr
    assert used(client) == (2, 3.0), "a successor has the other values"


def test_a_tuned_element_is_saved_and_restored_alone(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "saved.yaml"
    client.load(rtcf.component("rtcf_test", "Weights", name="w"))
    assert daemon.ctl("set", "w", "filter/taps_0:=2").returncode == 0
    assert daemon.ctl("save", str(file)).returncode == 0
    (component,) = yaml.safe_load(file.read_text())["components"]
    assert component["parameters"] == {"filter/taps_0": 2.0}
    client.unload(["w"])
    assert daemon.ctl("apply", str(file)).returncode == 0
    assert used(client) == (3, 2.5)
    assert "nothing to change" in daemon.ctl("apply", str(file)).stdout
    kill_executor(client)
    assert used(client) == (3, 2.5)


def test_a_list_survives_the_death_of_all(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    apply(daemon, tmp_path / "graph.yaml", "[1, 2]")
    assert daemon.ctl("set", "w", "filter/taps_0:=4").returncode == 0
    assert used(client) == (2, 6.0)
    daemon.end()
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert used(again) == (2, 6.0)


def test_a_list_that_was_edited_changes_what_was_not_tuned(client: rtcf.Client) -> None:
    before, after = graph("[1, 2]"), graph("[1, 3, 4, 5]")
    client.apply(before, "rt_runner")
    client.set_parameters("w", [rtcf.parse_parameter("filter/taps_0:=7")])
    client.apply(after, "rt_runner", given_before=before)
    assert used(client) == (4, 19.0), "the tuned element stays"
    client.undo_parameters("w")
    assert used(client) == (2, 9.0), "elements and size, as before"
    client.apply(after, "rt_runner")
    client.set_parameters("w", [rtcf.parse_parameter("filter/taps_size:=1")])
    client.apply(after, "rt_runner", given_before=after)
    assert used(client) == (1, 1.0), "a size can be tuned, too"


def test_size_and_elements_change_in_the_same_cycle(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Weights", name="w"))
    changed = daemon.ctl("set", "w", "filter/taps_0:=0.75", "filter/taps_size:=1")
    assert changed.returncode == 0, changed.stderr
    assert used(client) == (1, 0.75)
    assert daemon.ctl("set", "w", "filter/taps_1:=9").returncode == 0
    assert used(client) == (1, 0.75), "behind the end"
    assert daemon.ctl("set", "w", "filter/taps_size:=2").returncode == 0
    assert used(client) == (2, 9.75)
    assert daemon.ctl("undo", "w").returncode == 0
    assert used(client) == (1, 0.75)
    assert daemon.ctl("replace", "w", "rtcf_test", "Weights").returncode == 0
    assert used(client) == (1, 0.75), "a successor has the size too"


def test_a_replacement_has_its_list(client: rtcf.Client) -> None:
    client.apply(graph("[1, 2]"), "rt_runner")
    (spec,) = graph("[5, 6, 7]")
    client.replace("w", spec)
    assert used(client) == (3, 18.0)
    (before,), (after,) = graph("[5, 6, 7]"), graph("[5, 6]")
    client.set_parameters("w", [rtcf.parse_parameter("filter/taps_0:=1")])
    client.replace("w", after, given_before=before)
    assert used(client) == (2, 7.0)
    client.replace("w", after, reset_parameters=True)
    assert used(client) == (2, 11.0)


def test_a_dry_run_and_a_new_runner_take_a_list(client: rtcf.Client) -> None:
    components = graph("[1, 2]")
    for _ in range(2):
        (load,) = client.apply(components, "more", dry_run=True).differences
        assert load.component == "/w"
    client.apply(components, "more")
    assert not client.apply(components, "more", dry_run=True).differences
    assert parameter_values(client, "/w", "more")["filter/taps_size"] == 2


@pytest.fixture
def late(tmp_path: Path) -> Iterator[Daemon]:
    """Start rtcfd with the list [1, 2] in graphs.d; its component is left out, as its package is
    installed after the start."""
    packages, graphs = tmp_path / "packages", tmp_path / "graphs.d"
    graphs.mkdir()
    text = GRAPH.replace("TAPS", "[1, 2]").replace("rtcf_test", "rtcf_late")
    (graphs / "w.yaml").write_text(text)
    daemon = Daemon(tmp_path, arguments=["--path", str(packages), "--graphs-dir", str(graphs)])
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            assert client.get_order() == []
        library = packages / "rtcf_late" / "late.so"
        library.parent.mkdir(parents=True)
        shutil.copy(BUILD_TREE / "lib" / "rtcf" / "rtcf_test" / "rtcf_test_behaved.so", library)
        yield daemon
    finally:
        daemon.end()


def test_the_list_of_a_component_that_was_left_out_is_its_vector(late: Daemon) -> None:
    (spec,) = rtcf.read_graphs(late.ctl("save").stdout, "saved")[0].components
    assert {each.name: each.length for each in spec.lists} == {"filter/taps": 2}
    assert late.ctl("release", "w").returncode == 0
    with rtcf.Client(late.socket) as client:
        assert used(client) == (2, 3.0)
    late.end(signal.SIGKILL)
    late.start()
    assert "differs" not in late.log()
    assert late.ctl("set", "w", "filter/taps_size:=1").returncode == 0
    with rtcf.Client(late.socket) as client:
        kill_executor(client)
        assert used(client) == (1, 1.0)


def test_a_component_that_is_left_out_is_tuned_as_others(late: Daemon) -> None:
    assert late.ctl("set", "w", "filter/taps_size:=1").returncode == 0
    (change, *_) = late.ctl("history", "w").stdout.splitlines()[1:]
    assert change.split()[-2:] == ["2", "1"], "before and after"
    assert late.ctl("release", "w").returncode == 0
    with rtcf.Client(late.socket) as client:
        assert used(client) == (1, 1.0)


def test_the_state_of_an_adopted_executor_has_no_list(late: Daemon) -> None:
    file = late.folder / "graphs.d" / "w.yaml"
    file.write_text(file.read_text().replace("[1, 2]", "[1, 2, 3]"))  # as many as by default
    late.end()
    late.start()  # loads it, and saves nothing
    late.end(signal.SIGKILL)
    late.start()
    assert "differs" not in late.log()
    assert late.ctl("load", "rtcf_test", "Weights", "--name", "other").returncode == 0
    saved = [each.read_text() for each in (late.folder / "state").rglob("*.json")]
    (text,) = (each for each in saved if "rtcf_late" in each)
    assert '"filter/taps_size"' in text
    assert '"lists"' not in text


def test_a_successor_of_another_package_has_the_whole_list(late: Daemon) -> None:
    shutil.rmtree(late.folder / "packages" / "rtcf_late")
    replaced = late.ctl("replace", "w", "rtcf_test", "Weights")
    assert replaced.returncode == 0, replaced.stderr
    with rtcf.Client(late.socket) as client:
        assert used(client) == (2, 3.0)


def test_a_component_that_is_left_out_is_replaced_with_a_list(late: Daemon) -> None:
    (spec,) = graph("[5, 6, 7]")
    with rtcf.Client(late.socket) as client:
        client.replace("w", spec)
        assert used(client) == (3, 18.0)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("filter/taps_size:=9", "filter/taps_size = 9 is above its maximum 8"),
        ("filter/taps_size:=-1", "filter/taps_size = -1 is below its minimum 0"),
        ("filter/taps_size:=1.5", "filter/taps_size takes an int"),
        ("filter/taps_size:=0", "filter/taps has no element"),
        ("filter/taps_7:=-11", "filter/taps_7 = -11 is below its minimum -10"),
        ("filter/taps_8:=1", "has no parameter filter/taps_8"),
        ("filter/taps:=1", "has no parameter filter/taps;"),
    ],
)
def test_an_invalid_change_changes_nothing(
    daemon: Daemon, client: rtcf.Client, change: str, words: str
) -> None:
    client.load(rtcf.component("rtcf_test", "Weights", name="w"))
    rejected = daemon.ctl("set", "w", "filter/taps_0:=7", change)
    assert rejected.returncode != 0
    assert words in rejected.stderr
    assert used(client) == (3, 1.0)


def test_a_graph_file_has_a_list_of_any_length(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "graph.yaml"
    for taps, expected in (
        ("[1.0]", (1, 1.0)),
        ("[1.0, 2.0, 3.0, 4.0]", (4, 10.0)),
        ("[1, 1, 1, 1, 1, 1, 1, 1]", (8, 8.0)),
        ("[2.0, 2.0]", (2, 4.0)),
    ):
        apply(daemon, file, taps)
        assert used(client) == expected
        assert "nothing to change" in daemon.ctl("apply", str(file)).stdout
    saved = daemon.ctl("save").stdout
    (component,) = yaml.safe_load(saved)["components"]
    given = {"filter/taps_0": 2.0, "filter/taps_1": 2.0, "filter/taps_size": 2}
    assert component["parameters"] == given
    client.unload(["w"])
    file.write_text(saved)
    assert daemon.ctl("apply", str(file)).returncode == 0
    assert used(client) == (2, 4.0)


@pytest.mark.parametrize(
    ("taps", "words"),
    [
        (
            "[1, 2, 3, 4, 5, 6, 7, 8, 9]",
            "filter/taps is a list of length 9: it takes at most 8 elements",
        ),
        ("[]", "filter/taps has no element"),
        ("[1, -11]", "filter/taps_1 = -11 is below its minimum -10"),
        ("[1, [2]]", "has no parameter filter/taps_1_0"),
        ("[1], taps_size: 2", "is a list of length 1, but filter/taps_size is set"),
        ("[1], taps_size: 1.5", "filter/taps_size takes an int"),
        ("[1], tap: []", "filter/tap is an empty list: only a vector can be empty"),
    ],
)
def test_an_invalid_list_changes_nothing(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path, taps: str, words: str
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH.replace("TAPS", taps))
    for present in ([], graph("[2, 2]")):
        client.apply(present, "rt_runner")
        done = daemon.ctl("apply", str(file))
        assert done.returncode != 0
        assert words in done.stderr
        assert len(client.get_order()) == len(present)
    assert used(client) == (2, 4.0)


def test_a_bench_takes_a_list() -> None:
    with Bench("rtcf_test/Weights", path=PATH, filter={"taps": np.array([3.0, 1.0])}) as bench:
        result = bench.run(steps=1)
        assert (result["count"].tolist(), result["sum"].tolist()) == ([2], [4.0])
        bench.set(filter={"taps": [5.0]})
        assert bench.run(steps=1)["sum"].tolist() == [5.0]
        bench.set(filter={"taps_0": 6.0})
        assert bench.run(steps=1)["count"].tolist() == [1]
        with pytest.raises(rtcf.RtcfError, match="at most 8"):
            bench.set(filter={"taps": [0.0] * 9})
        with pytest.raises(rtcf.RtcfError, match="filter/taps has no element"):
            bench.set(filter={"taps": []})


@pytest.mark.parametrize("taps", [[1.0, 2.0, 3.0, 4.0, 5.0], [0.5, 0.25, 0.25]])
def test_a_list_of_a_launch_file_overrides_a_size(launching: Launching, taps: list[float]) -> None:
    launching.launch_text(LAUNCH.replace("TAPS", f"{taps}"))
    server = Master(launching.master.uri, "/test")
    with launching.client() as (client, runner):
        wait_for(lambda: client.get_order(runner) == ["/w"], "the component")
        # The value of the parameter server, 2, would come a moment later.
        wait_for(
            lambda: server.parameter("/w/filter/taps_size") == len(taps),
            "the size on the parameter server",
        )
        found = parameter_values(client, "/w", runner)
    assert found["filter/taps_size"] == len(taps)
    assert [found[f"filter/taps_{i}"] for i in range(len(taps))] == taps
