"""Parameters in groups: `gains/p`, on all ways in."""

import json
from pathlib import Path

import numpy as np
import pytest
import rtcf
import yaml
from block_bench import PATH
from daemon_process import Daemon, wait_for
from launch_processes import Launching
from ros_processes import Master
from rtcf.testing import Bench
from values import parameter_values, port_value

DEFAULTS = {
    "gains/p": 1.0,
    "gains/filter/order": 2,
    "gains/k_0": 0.25,
    "gains/k_1": 0.5,
    "gains/k_2": 0.125,
    "offset": 10.0,
}
GRAPH = """\
components:
  - package: rtcf_test
    type: Grouped
    parameters:
      gains: {p: 5.0, filter: {order: 3}, k: [1.0, 2.0, 3.0]}
"""
LAUNCH = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <rosparam>{mode: wait_for_components, num_components_expected: 1, frequency: 500.0}</rosparam>
  </node>
  <node name="grouped" pkg="rtcf" type="rt_launcher" args="rtcf_test Grouped" output="screen">
    <rosparam>
      gains: {p: 5, filter: {order: 3}, k: [1.0, 2.0, 3.0, 4.0], d: 7}
      joints: [left, right]
    </rosparam>
    <param name="offset" value="1"/>
  </node>
</launch>
"""


def test_a_group_is_set_at_the_load_and_while_the_loop_runs(
    daemon: Daemon, client: rtcf.Client
) -> None:
    loaded = daemon.ctl(
        "load", "rtcf_test", "Grouped", "--param", "gains/p:=2", "--param", "gains/k_1:=1.5"
    )
    assert loaded.returncode == 0, loaded.stderr
    client.start()
    wait_for(lambda: port_value(client, "Grouped", "sum") == 15.875, "the values of the load")
    assert daemon.ctl("set", "Grouped", "gains/filter/order:=4").returncode == 0
    wait_for(lambda: port_value(client, "Grouped", "sum") == 17.875, "the new value")
    assert daemon.ctl("get", "Grouped.gains/filter/order").stdout == "4\n"
    assert "gains/filter/order" in daemon.ctl("history", "Grouped").stdout
    assert daemon.ctl("undo", "Grouped").returncode == 0
    assert parameter_values(client, "Grouped")["gains/filter/order"] == 2
    for change, words in (
        ("gains/p:=-1", "gains/p = -1 is below its minimum 0"),
        ("gains:=1", "has no parameter gains; it has gains/p, gains/filter/order"),
        ("gains/q:=1", "has no parameter gains/q"),
    ):
        rejected = daemon.ctl("set", "Grouped", "offset:=0", change)
        assert rejected.returncode != 0
        assert words in rejected.stderr
    assert parameter_values(client, "Grouped")["offset"] == 10.0


def test_a_graph_file_has_groups_as_mappings(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    applied = daemon.ctl("apply", str(file))
    assert applied.returncode == 0, applied.stderr
    given: dict[str, float] = {"gains/p": 5.0, "gains/filter/order": 3}
    given |= {f"gains/k_{i}": i + 1.0 for i in range(3)}
    assert parameter_values(client, "Grouped") == {**DEFAULTS, **given}
    saved = daemon.ctl("save").stdout
    assert yaml.safe_load(saved)["components"][0]["parameters"] == given
    file.write_text(GRAPH.replace("order", "ordr"))
    rejected = daemon.ctl("apply", str(file))
    assert rejected.returncode != 0
    assert "gains/filter/ordr" in rejected.stderr
    assert "gains/filter/order" in rejected.stderr


def test_a_graph_file_that_resets_tuned_values_is_in_the_history(
    daemon: Daemon, client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    assert daemon.ctl("apply", str(file)).returncode == 0
    assert daemon.ctl("set", "Grouped", "gains/p:=42.0", "offset:=7.0").returncode == 0
    file.write_text(GRAPH.replace("[1.0, 2.0, 3.0]", "[9.0]"))
    assert daemon.ctl("apply", str(file)).returncode == 0
    given = {"gains/p": 5.0, "gains/filter/order": 3, "gains/k_0": 9.0}
    assert parameter_values(client, "Grouped") == {**DEFAULTS, **given}
    changes = {
        each.parameter: (each.before.double_value, each.value.double_value)
        for each in client.get_history("Grouped")
        if each.how == "apply" and each.HasField("before")
    }
    assert changes == {
        "gains/p": (42.0, 5.0),
        "gains/k_0": (1.0, 9.0),
        "gains/k_1": (2.0, 0.5),
        "gains/k_2": (3.0, 0.125),
        "offset": (7.0, 10.0),
    }
    assert daemon.ctl("undo", "Grouped").returncode == 0
    tuned = {"gains/p": 42.0, "offset": 7.0, "gains/k_0": 1.0, "gains/k_1": 2.0, "gains/k_2": 3.0}
    assert parameter_values(client, "Grouped") == {**DEFAULTS, **given, **tuned}


def test_a_bench_takes_groups_and_arrays() -> None:
    with Bench(
        "rtcf_test/Grouped", path=PATH, gains={"p": 2, "k": np.array([1.0, 2.0, 3.0])}
    ) as bench:
        assert bench.run(steps=1)["sum"].tolist() == [20.0]
        bench.set(gains={"filter": {"order": 9}}, offset=0)
        assert bench.run(steps=1)["sum"].tolist() == [17.0]
        with pytest.raises(ValueError, match="gains/p: None is not a bool"):
            bench.set(gains={"p": None})
        with pytest.raises(ValueError, match="gains is empty"):
            bench.set(gains={})


def test_a_group_is_a_namespace_on_the_parameter_server(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.load(rtcf.component("rtcf_test", "Grouped", name="c", ns="/arm"))
    client.start()
    wait_for(lambda: "/arm/c/set_parameters" in master.services(), "the service")
    wait_for(lambda: master.parameter("/arm/c/gains/k_2") == 0.125, "the parameter server")
    assert master.parameter("/arm/c/gains/filter") == {"order": 2}
    master.run("rosparam", "set", "/arm/c/gains", "{p: 3, filter: {order: 5}}")
    wait_for(lambda: parameter_values(client, "/arm/c")["gains/filter/order"] == 5, "the loop")
    assert parameter_values(client, "/arm/c") == {
        **DEFAULTS,
        "gains/p": 3.0,
        "gains/filter/order": 5,
    }
    wait_for(lambda: master.parameter("/arm/c/gains/k_2") == 0.125, "the rest of the group")
    change = {"gains/p": 4.0, "gains/k_0": 2.0}
    master.run("rosrun", "dynamic_reconfigure", "dynparam", "set", "/arm/c", json.dumps(change))
    expected: dict[str, float] = {**DEFAULTS, **change}
    expected["gains/filter/order"] = 5
    assert parameter_values(client, "/arm/c") == expected
    wait_for(lambda: master.parameter("/arm/c/gains/p") == 4.0, "the parameter server")
    client.unload(["/arm/c"])
    others = {"p": 3, "filter": {"order": 5}}  # values of another node
    wait_for(lambda: master.parameter("/arm/c/gains") == others, "the end of its parameters")


def test_a_launch_file_has_groups_and_arrays(launching: Launching, tmp_path: Path) -> None:
    file = tmp_path / "grouped.launch"
    file.write_text(LAUNCH)
    launch = launching.roslaunch(str(file))
    with launching.client() as (client, runner):
        wait_for(lambda: client.get_order(runner) == ["/grouped"], "the component")
        found = parameter_values(client, "/grouped", runner)
    given: dict[str, float] = {"gains/p": 5.0, "gains/filter/order": 3, "offset": 1.0}
    given |= {f"gains/k_{i}": i + 1.0 for i in range(3)}
    assert found == given
    launch.wait_for_output("~gains/k has 4 values: the component takes 3")
    assert "~gains/d, ~joints" in launch.output()
