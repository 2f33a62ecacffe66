"""Components whose hooks use ROS, through rtcf/ros.hpp."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from holding_master import HoldingMaster
from ros_processes import Master
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from values import iteration, port_value


def user(hook: str = "configure") -> graph_pb2.ComponentSpec:
    """Return RosUser as /arm/user, with its topic /arm/ear remapped to /voice."""
    return rtcf.component(
        "rtcf_test_ros",
        "RosUser",
        name="user",
        ns="/arm",
        remaps=["ear:=/voice", "~said:=/answer"],
        parameters=[f"in:={hook}"],
    )


@pytest.fixture
def lonely(tmp_path: Path) -> Iterator[tuple[Daemon, rtcf.Client, Master]]:
    """Yield a daemon, its client and its master, which is not running."""
    master = Master(tmp_path)
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        yield daemon, client, master
    daemon.end()


def test_hooks_have_node_handles_with_the_components_names(tmp_path: Path, master: Master) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            master.run("rosparam", "set", "/arm/user/gain", "2.5")
            client.load(user())
            client.start()
            wait_for(lambda: port_value(client, "/arm/user", "gain") == 2.5, "the parameter")
            # Subscribed under the remapped name, with its callback called.
            sender = master.node("latch", "/voice", "7.25")
            wait_for(lambda: port_value(client, "/arm/user", "heard") == 7.25, "the message")
            sender.end()
            # Advertised in the same way.
            listener = master.node("record", "/answer")
            listener.wait_for_values(1)
            assert listener.values() == [2.5]
            listener.end()
            client.unload(["/arm/user"])
            wait_for(lambda: "/answer" not in master.topics()[0], "the end of its publication")
            wait_for(lambda: "/voice" not in master.topics()[1], "the end of its subscription")
    finally:
        daemon.end()


def test_handles_of_many_hooks_need_few_calls_to_a_slow_master(
    tmp_path: Path, master: Master
) -> None:
    way = HoldingMaster(master.port)
    daemon = Daemon(tmp_path, with_ros(way.uri, ""))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            wait_for(lambda: _ros(client).connected, "the node")
            before = way.calls(b"getPid")  # by which the node checks the master
            client.apply(
                rtcf.component(
                    "rtcf_test_ros", "RosUser", name=f"user{index}", parameters=["in:=handle"]
                )
                for index in range(40)
            )
            asked = way.calls(b"getPid") - before
            print(f"\n{asked} calls for 40 handles")
            assert asked < 20
    finally:
        daemon.end()
        way.close()


def test_a_component_that_needs_ros_is_rejected_without_a_master(
    lonely: tuple[Daemon, rtcf.Client, Master],
) -> None:
    daemon, client, master = lonely
    result = daemon.ctl("load", "rtcf_test_ros", "RosUser", "--name", "user")
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    for word in ("/user", "configure", "no ROS master answers at", master.uri, "roscore", "--wait"):
        assert word in line
    assert list(client.list_components()) == []


def test_load_waits_for_a_master_if_requested(
    lonely: tuple[Daemon, rtcf.Client, Master],
) -> None:
    daemon, client, master = lonely
    load = subprocess.Popen(
        ["rtcfctl", "load", "rtcf_test_ros", "RosUser", "--name", "user", "--wait"],
        env=daemon.environment(),
        stderr=subprocess.PIPE,
        text=True,
    )
    wait_for(lambda: "no ROS master" in _ros(client).problem, "the node to look for a master")
    # Other changes continue meanwhile.
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
    assert load.poll() is None
    master.start()
    try:
        assert load.wait(60.0) == 0
        assert {each.full_name for each in client.list_components()} == {"/user", "/knobs"}
    finally:
        load.kill()
        client.unload(["/user"])
        master.end()


def test_a_lease_waits_for_a_master_if_requested(
    lonely: tuple[Daemon, rtcf.Client, Master],
) -> None:
    _, client, master = lonely
    lease = client.lease_component(control_pb2.OpenLease(component=user(), wait=True))
    messages = iter(lease)
    said = next(each.waiting for each in messages if "waiting for a ROS" in each.waiting)
    assert master.uri in said
    assert list(client.list_components()) == []
    master.start()
    try:
        # Other messages may follow: details of the load, and log records.
        assert any(each.WhichOneof("kind") == "loaded" for each in messages)
        assert [each.full_name for each in client.list_components()] == ["/arm/user"]
        lease.end()
        wait_for(lambda: not list(client.list_components()), "the unload of the component")
    finally:
        master.end()


def test_a_master_call_that_fails_in_a_hook_fails_the_hook(
    lonely: tuple[Daemon, rtcf.Client, Master],
) -> None:
    daemon, client, master = lonely
    master.start()
    client.load(user("careless"))
    client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
    master.end()
    result = daemon.ctl("start")
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    for word in ("/arm/user", "start", "no ROS master answers at", "getParam"):
        assert word in line
    status = client.get_status("rt_runner").runners[0]
    assert status.state == runner_pb2.RUNNER_STATE_STOPPED
    client.unload(["/arm/user"])
    client.start()
    wait_for(lambda: iteration(client) > 10, "the loop without it")


def _ros(client: rtcf.Client) -> runner_pb2.RosStatus:
    status: runner_pb2.RosStatus = client.get_status("rt_runner").runners[0].ros
    return status
