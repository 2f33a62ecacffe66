"""Launch files with roslaunch: those of the examples, and larger ones."""

import itertools
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import fig_1
import pytest
import rosgraph
import rtcf
from daemon_process import wait_for, wait_until_it_is
from launch_processes import Launching, Process, left_over
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import is_among, iteration, parameter_values

RUNNER_SERVICES = (
    "activate_rt_loop", "deactivate_rt_loop", "get_introspection_information", "get_loop",
    "load_orocos_component", "unload_orocos_component", "load_component", "unload_component",
)  # fmt: skip
# roscore's own topics.
ROSCORE_TOPICS = {"/rosout", "/rosout_agg"}


@pytest.fixture
def launching(tmp_path: Path, master: Master) -> Iterator[Launching]:
    launching = Launching(master, tmp_path)
    yield launching
    launching.end()


def running(client: rtcf.Client, runner: str) -> bool:
    (status,) = client.get_status(runner).runners
    return bool(status.state == runner_pb2.RUNNER_STATE_RUNNING)


def wait_until_running(client: rtcf.Client, runner: str) -> None:
    wait_for(lambda: running(client, runner), f"the loop of {runner}")


def press_ctrl_c(launch: Process) -> None:
    """End roslaunch in order: it kills no process, and none remains."""
    begin = time.monotonic()
    launch.end(signal.SIGINT)
    # For information only, not a limit: the machine may be busy.
    print(f"Ctrl-C took {time.monotonic() - begin:.2f} s")
    output = launch.output()
    assert "escalating" not in output
    socket = output.partition("private daemon at ")[2].partition(",")[0]
    wait_for(lambda: not left_over(socket), "the private daemon to end")
    wait_for(lambda: not Path(socket).parent.exists(), "the removal of its folder")


def topics(master: Master) -> dict[str, str]:
    """Return the types of the topics of the loops and their peers."""
    graph = rosgraph.Master("/test", master.uri)
    published, subscribed, _ = graph.getSystemState()
    mapped = {topic for topic, _ in published} | {topic for topic, _ in subscribed}
    types: dict[str, str] = dict(graph.getTopicTypes())
    own = ("/rt_runner/", "/rtcfd/", "/diagnostics", "/left/rt_runner/", "/right/rt_runner/")
    return {
        topic: types[topic]
        for topic in mapped - ROSCORE_TOPICS
        if not topic.startswith(own) and "parameter_" not in topic
    }


def services(master: Master, node: str) -> set[str]:
    """Return the services of a node."""
    state = rosgraph.Master("/test", master.uri).getSystemState()
    return {name for name, providers in state[2] if node in providers}


def parameters(master: Master) -> set[str]:
    """Return the parameters of nodes, without roscore's and roslaunch's."""
    names = rosgraph.Master("/test", master.uri).getParamNames()
    return {name for name in names if not name.startswith(("/ros", "/run_id"))}


def nodes(master: Master) -> set[str]:
    """Return the nodes that publish or subscribe, without roscore's."""
    state = rosgraph.Master("/test", master.uri).getSystemState()
    found = {node for part in state for _, users in part for node in users}
    return {node for node in found if node != "/rosout"}


def node_of_the_loop(master: Master) -> str:
    """Return the node's name, once it has topics."""
    wait_for(lambda: "/rt_runner/cycles" in master.topics()[0], "the node of the loop")
    state = rosgraph.Master("/test", master.uri).getSystemState()
    (node,) = next(users for topic, users in state[0] if topic == "/rt_runner/cycles")
    return str(node)


def test_the_papers_evaluation_runs_and_the_tools_find_it(
    launching: Launching, master: Master
) -> None:
    launch = launching.roslaunch("rtcf_examples", "paper_evaluation.launch", "frequency:=500.0")
    launch.wait_for_output("the loop runs with 5 components")
    launch.wait_for_output("/H1: rtcf_examples/Mimo loaded into runner rt_runner")
    wanted = dict.fromkeys(("/R3_G2H1", "/R1_H1R2", "/G2_R2"), "std_msgs/Float64")
    wait_until_it_is(wanted, lambda: topics(master), "the topics")
    loop = node_of_the_loop(master)
    assert loop == "/rt_runner"
    ours = {"/rt_runner/launch", "/H1", "/F1", "/R1", "/R2", "/R3"}
    wait_until_it_is({loop, "/G1", "/G2"} | ours, lambda: nodes(master), "the nodes")

    assert launching.tool("component_order", "--table").stdout.split() == fig_1.ORDER
    assert launching.tool("component_list").stdout.split() == sorted(fig_1.ORDER)
    listed = launching.tool("component_list", "--table").stdout
    assert all(name in listed for name in fig_1.ORDER) and "rt_launcher /R2" in listed
    assert "rtcf_examples/Mimo" in launching.tool("component_info", "R2").stdout
    assert "/R1_H1R2" in launching.tool("connection_list").stdout.split()
    info = launching.tool("connection_info", "R1_H1R2", "--table")
    assert "written by /R1.out1" in info.stdout and "published" in info.stdout
    unknown = launching.tool("connection_info", "R1_H1R3", "--table")
    assert (unknown.returncode, unknown.stderr) == (
        1,
        "connection_info: no connection /R1_H1R3; did you mean /R1_H1R2?\n",
    )
    with launching.client() as (client, runner):
        # G2 works: its value has arrived in the loop.
        wait_for(
            lambda: next(
                p for p in client.get_component("R2", runner).ports if p.name == "in4"
            ).HasField("value"),
            "an answer of G2",
        )  # fmt: skip
    press_ctrl_c(launch)


def test_listing_2_of_the_paper_runs(launching: Launching, master: Master) -> None:
    launch = launching.roslaunch("rtcf_examples", "paper_example.launch")
    launch.wait_for_output("the loop runs with 2 components")
    wait_until_it_is({"/ros/in", "/ros/out"}, lambda: set(topics(master)), "the topics")
    order = launching.tool("component_order").stdout.splitlines()
    assert order[1:3] == ["1. /example1", "2. /example2"]
    with launching.client() as (client, runner):
        assert client.get_component("example1", runner).spec.first
    press_ctrl_c(launch)


def test_logs_are_on_screen_and_a_killed_launcher_and_master_are_survived(
    tmp_path: Path,
) -> None:
    master = Master(tmp_path)
    master.start()
    launching = Launching(master, tmp_path)
    try:
        launch = launching.roslaunch("rtcf_examples", "logging.launch")
        launch.wait_for_output("/wave: configured: amplitude 1, rate 1 Hz")
        launch.wait_for_output("/wave: up through zero in cycle")
        launch.wait_for_output("the loop runs with 1 components")
        os.kill(launch.children()["wave"], signal.SIGKILL)
        # Its death stops the loop; once roslaunch has restarted it, the loop is complete.
        started = "the loop runs with 1 components"
        wait_for(lambda: launch.output().count(started) == 2, "the restart of the launcher")
        master.end()
        press_ctrl_c(launch)
        assert "/wave: stopped" in launch.output()
    finally:
        launching.end()


def test_private_parameters_set_declared_parameters(launching: Launching, master: Master) -> None:
    launch = launching.roslaunch("rtcf_examples", "parameters.launch")
    with launching.client() as (client, runner):
        wait_until_running(client, runner)

        left = {"amplitude": 2.5, "rate": 0.5, "shape": "sine", "silent": False}
        right = {"amplitude": 1.0, "rate": 2.0, "shape": "square", "silent": False}
        assert parameter_values(client, "/left/generator", runner) == left
        assert parameter_values(client, "/right/generator", runner) == right
    wait_until_it_is({"/left/wave", "/right/wave"}, lambda: set(topics(master)), "the topics")
    press_ctrl_c(launch)


# Ten components in four namespaces: a position loop around a velocity loop around a current
# loop, twice, and a sum of both. The arrows are names; `~` is a private name.
TEN: dict[str, dict[str, str]] = {
    "/drive": {"in1": "/l/effort", "in2": "/r/effort", "out1": "/state"},
    "/l/position": {"in1": "/target", "in2": "/state", "out1": "wanted"},
    "/l/velocity": {"in1": "wanted", "in2": "/state", "in3": "effort", "out1": "current"},
    "/l/current": {"in1": "current", "in2": "felt", "out1": "effort"},
    "/l/sensor": {"in1": "effort", "out1": "felt"},
    "/r/position": {"in1": "/target", "in2": "/state", "out1": "wanted"},
    "/r/velocity": {"in1": "wanted", "in2": "/state", "in3": "effort", "out1": "current"},
    "/r/current": {"in1": "current", "in2": "felt", "out1": "effort"},
    "/r/sensor": {"in1": "effort", "out1": "felt"},
    "/watch/total": {"in1": "/l/effort", "in2": "/r/effort", "in3": "/state", "out1": "sum"},
}
TEN_ORDER = ["/drive", "/l/position", "/l/velocity", "/l/current", "/l/sensor",
             "/r/position", "/r/velocity", "/r/current", "/r/sensor", "/watch/total"]  # fmt: skip


TEN_RUNNER = """
<node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
  <rosparam>
    mode: wait_for_trigger
    frequency: 1000.0
    ros_queue: 100000
    ros_mapping_whitelist: /.*
    ros_mapping_blacklist: /state|/r/effort|/[lr]/(wanted|current|felt)|.*/(in|out)[0-9]
  </rosparam>
</node>
"""


TEN_PARAMETERS = {
    *(f"/rt_runner/{name}" for name in (
        "mode", "frequency", "ros_queue", "ros_mapping_whitelist", "ros_mapping_blacklist",
        "rtcf_runner/host", "rtcf_runner/launch", "rtcf_runner/pid",
        "rtcf_runner/runner", "rtcf_runner/socket", "rtcf_runner/token")),
    "/drive/is_first",
    *(f"/{ns}/{base}/topics_ignore_for_graph" for ns in "lr" for base in ("velocity", "current")),
}  # fmt: skip


def ten_components() -> str:
    parts = ["<launch>", TEN_RUNNER]
    for name, wires in TEN.items():
        ns, _, base = name.rpartition("/")
        parts.append(f'<group ns="{ns}">' if ns else "<group>")
        parts.append(
            f'<node name="{base}" pkg="rtcf" type="rt_launcher" args="rtcf_examples Mimo" '
            'output="screen">'
        )
        if base == "drive":
            parts.append('<param name="is_first" value="true"/>')
        if base == "velocity":
            parts.append(f'<param name="topics_ignore_for_graph" value="{ns}/effort"/>')
        if base == "current":
            parts.append(
                f'<rosparam param="topics_ignore_for_graph">[{ns}/felt, /nothing]</rosparam>'
            )
        for port in fig_1.PORTS:
            parts.append(f'<remap from="{port}" to="{wires.get(port, "~" + port)}"/>')
        parts.append("</node></group>")
    return "\n".join([*parts, "</launch>"])


def simulate_ten() -> Iterator[float]:
    """Yield the values of /watch/total; all inputs are new in each cycle except the target.

    The target arrives before the start: it is never new, and the components do not add it.
    """
    add = fig_1.mimo_sum
    effort: dict[str, float | None] = {"l": None, "r": None}
    felt: dict[str, float | None] = {"l": None, "r": None}
    while True:
        state = add(effort["l"], effort["r"])
        for side in ("l", "r"):
            wanted = add(None, state)
            current = add(wanted, state, effort[side])
            effort[side] = add(current, felt[side])
            felt[side] = add(effort[side], None)
        yield add(effort["l"], effort["r"], state)


def test_ten_components_in_nested_loops_and_namespaces_compute_correctly(
    launching: Launching, master: Master
) -> None:
    launch = launching.launch_text(ten_components())
    with launching.client() as (client, runner):
        wait_for(lambda: len(client.list_components(runner)) == 10, "ten components")
        assert client.get_order(runner) == TEN_ORDER
        record = master.node("record", "/watch/sum")
        latched = master.node("latch", "/target", "0.1")
        record.wait_until_connected()
        latched.wait_until_connected()

        def target_is_there() -> bool:
            ports = client.get_component("/l/position", runner).ports
            return bool(next(port for port in ports if port.name == "in1").HasField("value"))

        wait_for(target_is_there, "the target")
        wanted = dict.fromkeys(("/target", "/l/effort", "/watch/sum"), "std_msgs/Float64")
        wait_until_it_is(wanted, lambda: topics(master), "the topics")
        loop = node_of_the_loop(master)
        # The runner, ten launchers, and two nodes of this test.
        wait_until_it_is(13, lambda: len(nodes(master) - {loop}), "the number of nodes")
        own = {
            *(f"/rt_runner/{name}" for name in RUNNER_SERVICES),
            *(f"{loop}/{name}" for name in ("get_loggers", "set_logger_level")),
        }
        wait_until_it_is(own, lambda: services(master, loop), "the services")
        wait_until_it_is(TEN_PARAMETERS, lambda: parameters(master), "the parameters")
        # The mode is wait_for_trigger.
        assert not running(client, runner)
        assert master.call("/rt_runner/activate_rt_loop")["success"] is True
        wait_for(lambda: iteration(client, runner) >= 500, "500 cycles")
        assert master.call("/rt_runner/deactivate_rt_loop")["success"] is True
        assert not running(client, runner)
        cycles = iteration(client, runner)
        # Half a second of values waits for a thread that a busy machine may delay longer.
        lost = client.get_status(runner).runners[0].tap_dropped
        record.wait_for_values(cycles - lost)
        assert is_among(record.values(), itertools.islice(simulate_ten(), cycles))
        assert len(record.values()) > cycles / 2
        for node in (record, latched):
            node.end()
    press_ctrl_c(launch)


def wait_until_shown(master: Master, runner: str) -> None:
    """Wait for the topic and the services of a runner."""
    own = {f"{runner}/{name}" for name in RUNNER_SERVICES}
    wait_for(lambda: f"{runner}/iteration_info" in master.topics()[0], "its cycles")
    wait_for(lambda: own <= master.services(), "its services")


TWO_RUNNERS = """
<launch>
  <group ns="left">
    <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
      <param name="num_components_expected" value="1"/>
      <param name="frequency" value="100"/>
    </node>
    <node name="same" pkg="rtcf" type="rt_launcher" args="rtcf_examples Identity"/>
  </group>
  <node name="other" pkg="rtcf" type="rt_runner" output="screen">
    <param name="num_components_expected" value="1"/>
    <param name="frequency" value="200"/>
  </node>
  <node name="same" pkg="rtcf" type="rt_launcher" args="rtcf_examples Identity">
    <param name="runner" value="other"/>
  </node>
</launch>
"""


def test_a_launch_file_can_have_several_runners(launching: Launching, master: Master) -> None:
    launch = launching.launch_text(TWO_RUNNERS)
    for node, frequency, component in (
        ("/left/rt_runner", 100.0, "/left/same"),
        ("/other", 200.0, "/same"),
    ):
        with launching.client(node) as (client, runner):
            wait_until_running(client, runner)
            (status,) = client.get_status(runner).runners
            assert status.settings.frequency_hz == frequency
            assert client.get_order(runner) == [component]
            # Its introspection is under its node's name, as for any node.
            wait_until_shown(master, node)
    order = launching.tool("component_order", "-r", "/left/rt_runner").stdout
    assert "1. /left/same\n" in order
    press_ctrl_c(launch)


REQUIRED = """
<launch>
  <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
    <param name="num_components_expected" value="1"/>
    <param name="on_fault" value="stay"/>
  </node>
  <node name="bad" pkg="rtcf" type="rt_launcher" args="rtcf_faults Throws" output="screen"
        required="true"/>
</launch>
"""


def test_a_required_component_that_fails_ends_the_launch(launching: Launching) -> None:
    launch = launching.launch_text(REQUIRED)
    launch.wait()
    output = launch.output()
    assert "threw: the encoder jumped" in output
    assert "exit code 3" in output


def test_the_arm_is_launched_from_its_graph_file(launching: Launching, master: Master) -> None:
    launch = launching.roslaunch("rtcf_arm", "arm.launch", "daemon:=private")
    launch.wait_for_output("the loop runs with 32 components")
    with launching.client() as (client, runner):
        assert client.get_status(runner).runners[0].settings.frequency_hz == 1000
        client.set_parameters("operator", [rtcf.parse_parameter("mode:=tour")], runner)
        wait_for(lambda: "/joint_states" in topics(master), "the topics")
        assert topics(master)["/command"] == "sensor_msgs/JointState"
    press_ctrl_c(launch)


def test_launchers_join_the_components_of_a_graph_file(
    launching: Launching, tmp_path: Path
) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text("components: [{package: rtcf_examples, type: Wave, name: wave}]\n")
    launch = launching.launch_text(
        f"""<launch>
          <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen">
            <param name="graph" value="{file}"/>
            <param name="num_components_expected" value="2"/>
            <param name="daemon" value="private"/>
          </node>
          <node name="mimo" pkg="rtcf" type="rt_launcher" args="rtcf_examples Mimo"/>
        </launch>"""
    )
    launch.wait_for_output("the loop runs with 2 components")
    with launching.client() as (client, runner):
        names = {each.full_name for each in client.list_components(runner)}
        assert names == {"/wave", "/mimo"}
    press_ctrl_c(launch)


def test_a_rejected_graph_file_ends_the_launch(launching: Launching, tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text("components: [{package: rtcf_examples, type: Wav}]\n")
    launch = launching.launch_text(
        f"""<launch>
          <node name="rt_runner" pkg="rtcf" type="rt_runner" output="screen" required="true">
            <param name="graph" value="{file}"/>
            <param name="daemon" value="private"/>
          </node>
        </launch>"""
    )
    launch.wait_for_output("~graph is rejected: ")
    assert "Wav" in launch.output().partition("~graph is rejected: ")[2]
    launch.wait(60.0)
