"""Introspection of a loop for ROS peers, besides its topics, and the services they may call."""

import itertools
import re
import subprocess
import sys
from pathlib import Path

import fig_1
import pytest
import rtcf
import yaml
from daemon_process import BUILD_TREE, DEADLINE_S, Daemon, wait_for, with_ros
from pages import SUPPORT
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration, state

PEER = SUPPORT / "introspection_peer.py"
SERVICES = {
    "/rt_runner/activate_rt_loop",
    "/rt_runner/deactivate_rt_loop",
    "/rt_runner/get_introspection_information",
    "/rt_runner/get_loop",
    "/rt_runner/load_component",
    "/rt_runner/load_orocos_component",
    "/rt_runner/unload_component",
    "/rt_runner/unload_orocos_component",
}


@pytest.fixture
def settings(master: Master) -> str:
    """Return settings with a ROS node for the loops of `daemon`."""
    return _with_ros(master.uri, fig_1.WHITELIST)


def _with_ros(master_uri: str, whitelist: str) -> str:
    """Return settings for a node that offers its services where RTCF 2021 does."""
    return with_ros(master_uri, whitelist) + "ns = '/rt_runner'\n"


def _node(client: rtcf.Client) -> str:
    """Return the name of the registered node, which reports the loop's health."""
    wait_for(lambda: client.get_status("rt_runner").runners[0].ros.connected, "the ROS node")
    return str(client.get_status("rt_runner").runners[0].ros.node).removeprefix("/")


def _wait_for_services(master: Master) -> None:
    wait_for(lambda: master.services() >= SERVICES, "the services of the runner")


def _call(master: Master, service: str, request: str = "") -> dict[str, object]:
    """Call a service by rosservice; return its answer."""
    done = subprocess.run(
        ["/usr/bin/rosservice", "call", f"/rt_runner/{service}", *([request] if request else [])],
        env=_environment(master),
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, object] = yaml.safe_load(done.stdout)
    return answer


def _environment(master: Master) -> dict[str, str]:
    return master.environment() | {"PYTHONPATH": str(BUILD_TREE / "python")}


def _peer(master: Master, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, str(PEER), *arguments],
        env=_environment(master),
        stdout=subprocess.PIPE,
        text=True,
    )


def _lines(peer: "subprocess.Popen[str]") -> list[str]:
    out, _ = peer.communicate(timeout=DEADLINE_S)
    assert peer.returncode == 0, out
    return out.splitlines()


def test_every_cycle_is_published_with_stamp_and_duration(
    client: rtcf.Client, master: Master
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=2000.0))
    fig_1.load(client)
    _wait_for_services(master)
    peers = [
        _peer(master, "cycles", "/rt_runner/cycles", "6000"),
        _peer(master, "info", "/rt_runner/iteration_info", "6000"),
    ]
    for peer in peers:
        assert peer.stdout is not None
        assert peer.stdout.readline() == "connected\n"
    client.start()
    cycles, infos = ([list(map(int, line.split())) for line in _lines(peer)] for peer in peers)
    client.stop()
    assert [each[0] for each in cycles] == list(range(6000))  # complete, from the first one on
    stamps = [each[1] for each in cycles]
    assert all(later > earlier for earlier, later in itertools.pairwise(stamps))
    assert all(duration > 0 for _, _, _, duration in cycles)
    # RTCF 2021's stamp is the time at which the cycle began.
    assert infos == [[stamp + latency, duration] for _, stamp, latency, duration in cycles]


def test_a_stamped_number_has_the_time_of_the_cycle_that_wrote_it(
    daemon: Daemon, client: rtcf.Client, master: Master
) -> None:
    done = daemon.ctl(
        *("runner", "set", "--frequency", "500", "--whitelist", "/c/.*", "--stamped", "/c/out")
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert state(client).settings.ros.stamped == "/c/out"
    client.load(rtcf.component("rtcf_test", "Counter", name="counter", ns="/c"))
    _wait_for_services(master)
    peers = [
        _peer(master, "cycles", "/rt_runner/cycles", "1000"),
        _peer(master, "stamped", "/c/out", "1000"),
    ]
    for peer in peers:
        assert peer.stdout is not None
        assert peer.stdout.readline() == "connected\n"
    client.start()
    cycles, values = ([list(map(int, line.split())) for line in _lines(peer)] for peer in peers)
    assert values == [[stamp, iteration + 1] for iteration, stamp, _, _ in cycles]
    # As a user reads it: the value is in the same field as in a message of std_msgs, with a time.
    for field in ("data", "header/stamp", "header/seq"):
        shown = subprocess.run(
            ["/usr/bin/rostopic", "echo", "-n1", f"/c/out/{field}"],
            env=_environment(master),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=True,
        )
        assert re.search("[1-9]", shown.stdout), f"{field}: {shown.stdout}"


def test_rostopic_knows_the_types_of_the_cycles(daemon: Daemon, master: Master) -> None:
    _wait_for_services(master)
    for topic, kind in (("iteration_info", "IterationInfo"), ("cycles", "Cycle")):
        done = subprocess.run(
            ["/usr/bin/rostopic", "info", f"/rt_runner/{topic}"],
            env=_environment(master),
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=True,
        )
        assert f"Type: rtcf_msgs/{kind}" in done.stdout


def test_a_peer_of_rtcf_2021_loads_queries_and_unloads(
    daemon: Daemon, client: rtcf.Client, master: Master
) -> None:
    _wait_for_services(master)
    load = (
        "{component_name: {data: Sum}, component_type: {data: Mimo},"
        " component_pkg: {data: rtcf_examples}, ns: {data: /arm}, is_first: {data: true},"
        " topics_ignore_for_graph: {data: '/nothing'},"
        " mappings: [{from_topic: {data: out1}, to_topic: {data: total}}]}"
    )
    assert _call(master, "load_orocos_component", load) == {"success": {"data": True}}
    told = _call(master, "get_introspection_information")["runner_info"]
    assert isinstance(told, dict)
    assert told["component_order"] == ["/arm/Sum"]
    (component,) = told["components"]
    assert (component["name"], component["package"]) == ("/arm/Sum", "rtcf_examples")
    assert {
        "port_type": 1, "name_remapped": "/arm/total", "name_unresolved": "out1",
        "msg_type": "std_msgs/Float64", "connected_to_ROS": False,
    } in component["output_ports"]  # fmt: skip
    assert len(component["input_ports"]) == 4
    assert told["connections"] == []  # no input reads its outputs
    assert _call(master, "load_orocos_component", load.replace("Sum", "Next").replace(
        "from_topic: {data: out1}", "from_topic: {data: in1}"
    )) == {"success": {"data": True}}  # fmt: skip
    told = _call(master, "get_introspection_information")["runner_info"]
    assert isinstance(told, dict)
    assert told["connections"] == [{
        "name": "/arm/total", "type": "std_msgs/Float64", "publishing_components": ["/arm/Sum"],
        "subscribing_components": ["/arm/Next"], "connected_to_ROS": False,
    }]  # fmt: skip
    unload = "{component_name: {data: Sum}, ns: {data: /arm}}"
    assert _call(master, "unload_orocos_component", unload) == {"success": {"data": True}}
    # RTCF 2021's response has no field for the reason.
    assert _call(master, "unload_orocos_component", unload) == {"success": {"data": False}}
    wait_for(lambda: "service call failed: " in daemon.log(), "the reason")


def test_the_rt_launcher_of_rtcf_2021_names_a_component_by_its_full_name(
    client: rtcf.Client, master: Master
) -> None:
    _wait_for_services(master)
    for name, ns in (("/x", "/"), ("/arm/left/y", "/arm/left")):
        load = (
            f"{{component_name: {{data: {name}}}, component_type: {{data: Identity}},"
            f" component_pkg: {{data: rtcf_examples}}, ns: {{data: {ns}}},"
            " is_first: {data: false}, topics_ignore_for_graph: {data: ''}, mappings: []}"
        )
        assert _call(master, "load_orocos_component", load) == {"success": {"data": True}}
        assert client.get_component(name).spec.ns == ns
        unload = f"{{component_name: {{data: {name}}}, ns: {{data: {ns}}}}}"
        assert _call(master, "unload_orocos_component", unload) == {"success": {"data": True}}
    assert _call(
        master, "load_component", "{name: /leg/z, package: rtcf_examples, type: Identity}"
    ) == {"success": True, "message": ""}
    assert client.get_component("/leg/z").full_name == "/leg/z"


def test_diagnostics_report_the_health_of_loop_and_components(
    client: rtcf.Client, master: Master
) -> None:
    client.load(rtcf.component("rtcf_faults", "Throws", name="Bomb", parameters=["after:=2000"]))
    client.load(rtcf.component("rtcf_examples", "Mimo", name="Sum"))
    client.start()
    node = _node(client)
    peer = _peer(master, "diagnostics", f"{node}: loop", "2")
    statuses = [line.split("|") for line in _lines(peer)]
    # name, level, message, then key=value
    loop = [each for each in statuses if each[0] == f"{node}: loop"]
    bomb = [each for each in statuses if each[0] == f"{node}: /Bomb"]
    names = {each[0] for each in statuses}
    assert names == {f"{node}: loop", f"{node}: /Bomb", f"{node}: /Sum"}
    assert loop[-1][1] == "2"
    assert "/Bomb: update() threw" in loop[-1][2]
    assert bomb[-1][1] == "2"
    keys = {pair.partition("=")[0] for pair in loop[-1][3:]}
    assert {"state", "frequency wanted (Hz)", "iteration", "overruns", "missed cycles",
            "values lost on the way to topics", "log records lost",
            "cycle messages lost", "real time"} <= keys  # fmt: skip
    assert "state=faulted" in loop[-1]


def test_diagnostics_report_an_error_for_a_loop_that_is_too_slow(
    client: rtcf.Client, master: Master
) -> None:
    # It sleeps for at least 100 µs in each cycle of 50 µs.
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=20000.0))
    client.load(rtcf.component("rtcf_faults", "Sleeps", name="slow", parameters=["after:=0"]))
    client.start()
    name = f"{_node(client)}: loop"
    statuses = [line.split("|") for line in _lines(_peer(master, "diagnostics", name, "2"))]
    loop = [each for each in statuses if each[0] == name]
    assert "Hz instead of 20000 Hz" in loop[-1][2]


def test_missing_real_time_rights_are_warned_of_once(client: rtcf.Client, master: Master) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10.0, lock_memory=False))
    _wait_for_services(master)  # the node has its name then
    name = f"{_node(client)}: loop"
    peer = _peer(master, "diagnostics", name, "0")
    assert _lines(peer)  # it is connected, and the loop is stopped
    client.start()
    wait_for(lambda: iteration(client) > 30, "three seconds")
    statuses = [line.split("|") for line in _lines(_peer(master, "diagnostics", name, "0"))]
    loop = [each for each in statuses if each[0] == name][-1]
    assert "not in real time: " in loop[2]


def test_services_load_run_and_unload_as_rtcfctl_does(
    daemon: Daemon, client: rtcf.Client, master: Master
) -> None:
    _wait_for_services(master)
    sum_1 = "{name: Sum, ns: arm, package: rtcf_examples, type: Mimo, remaps: ['out1:=total']}"
    assert _call(master, "load_component", sum_1) == {"success": True, "message": ""}
    sum_2 = (
        "{name: Second, package: rtcf_examples, type: Mimo, is_first: true,"
        " remaps: ['in1:=/arm/total', 'in2:=loop', 'out1:=/arm/in3'],"
        " topics_ignore_for_graph: '/nothing'}"
    )
    assert _call(master, "load_component", sum_2)["success"] is True
    assert daemon.ctl("order").stdout.split() == ["/Second", "/arm/Sum"]

    assert _call(master, "activate_rt_loop")["success"] is True
    wait_for(lambda: iteration(client) > 10, "the loop")
    told = _call(master, "get_loop")
    assert (told["runner"], told["state"], told["frequency"]) == ("rt_runner", "running", 1000.0)
    assert told["component_order"] == ["/Second", "/arm/Sum"]
    components = told["components"]
    assert isinstance(components, list)
    assert [
        (each["name"], each["package"], each["type"], each["is_first"]) for each in components
    ] == [
        ("/Second", "rtcf_examples", "Mimo", True),
        ("/arm/Sum", "rtcf_examples", "Mimo", False),
    ]
    (in1,) = (port for port in components[0]["ports"] if port["name"] == "in1")
    assert in1 == {
        "direction": 0, "name": "in1", "mapped_name": "/arm/total", "type": "std_msgs/Float64",
        "connected": True, "mapped": False, "broken": True,
    }  # fmt: skip
    connections = told["connections"]
    assert isinstance(connections, list)
    (total,) = (each for each in connections if each["name"] == "/arm/total")
    assert (total["writer"], total["readers"]) == ("/arm/Sum", ["/Second"])

    assert _call(master, "deactivate_rt_loop")["success"] is True
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_STOPPED
    assert _call(master, "unload_component", "{name: Sum, ns: /arm}")["success"] is True
    assert _call(master, "unload_component", "{name: /Second}")["success"] is True
    assert daemon.ctl("order").stdout.split() == []


def test_services_change_the_desired_state(
    daemon: Daemon, client: rtcf.Client, master: Master
) -> None:
    _wait_for_services(master)
    spec = "{name: Sum, package: rtcf_examples, type: Mimo}"
    assert _call(master, "load_component", spec)["success"] is True
    daemon.end()
    daemon.start()
    wait_for(lambda: "/Sum" in daemon.ctl("order").stdout, "the component after a restart")


@pytest.mark.parametrize(
    ("service", "request_text", "why"),
    [
        ("load_component", "{package: nowhere, type: Mimo}", "nowhere"),
        ("load_component", "{package: rtcf_examples, type: Mimoo}", "Mimoo"),
        ("load_component", "{package: rtcf_examples, type: Mimo, remaps: [a]}", "from:=to"),
        ("load_component", "{name: '1', package: rtcf_examples, type: Mimo}", "'1'"),
        ("unload_component", "{name: Nobody}", "/Nobody"),
    ],
)
def test_errors_give_the_reason(
    daemon: Daemon, master: Master, service: str, request_text: str, why: str
) -> None:
    _wait_for_services(master)
    answer = _call(master, service, request_text)
    assert answer["success"] is False
    assert why in str(answer["message"])
    assert daemon.ctl("order").stdout.split() == []


@pytest.mark.parametrize(
    ("access", "loads", "starts"), [("observe", False, False), ("operate", False, True)]
)
def test_ros_peers_have_the_rights_of_the_settings(
    tmp_path: Path, master: Master, access: str, loads: bool, starts: bool
) -> None:
    settings = _with_ros(master.uri, "") + f'peers = "{access}"\n'
    daemon = Daemon(tmp_path, settings)
    daemon.start()
    try:
        _wait_for_services(master)
        load = _call(master, "load_component", "{package: rtcf_examples, type: Mimo}")
        assert load["success"] is loads
        assert "--ros-peers admin" in str(load["message"])
        start = _call(master, "activate_rt_loop")
        assert start["success"] is starts
        assert _call(master, "deactivate_rt_loop")["success"] is starts
        assert _call(master, "get_loop")["state"] == "stopped"
    finally:
        daemon.end()


def test_services_and_topics_return_after_a_restart_of_the_master(
    tmp_path: Path,
) -> None:
    master = Master(tmp_path)
    master.start()
    daemon = Daemon(tmp_path, _with_ros(master.uri, ""))
    daemon.start()
    try:
        _wait_for_services(master)
        master.end()
        master.start()
        _wait_for_services(master)
        topics = {"/rt_runner/cycles", "/rt_runner/iteration_info", "/diagnostics"}
        wait_for(lambda: topics <= master.topics()[0], "the topics")
        assert _call(master, "activate_rt_loop")["success"] is True
    finally:
        daemon.end()
        master.end()


def test_services_end_with_the_daemon(daemon: Daemon, master: Master) -> None:
    _wait_for_services(master)
    daemon.end()
    wait_for(lambda: not master.services() & SERVICES, "the master to be told")
