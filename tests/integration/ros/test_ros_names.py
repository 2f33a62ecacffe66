"""Names at a master shared by several loops, and names that remain there after their end."""

import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import rosgraph
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import runner_pb2
from two_machines import two_machines

_SERVICE = "deactivate_rt_loop"


def _start(stack: ExitStack, folder: Path, settings: str, **arguments: object) -> Daemon:
    folder.mkdir()
    daemon = Daemon(folder, settings, **arguments)  # type: ignore[arg-type]
    daemon.start()
    stack.callback(lambda: daemon.ended or daemon.end())
    return daemon


def _ros(daemon: Daemon) -> runner_pb2.RosStatus:
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Knobs", name="knobs")) if not list(
            client.list_components()
        ) else None
        status: runner_pb2.RosStatus = client.get_status("rt_runner").runners[0].ros
        return status


def _connected(daemon: Daemon) -> runner_pb2.RosStatus:
    return wait_for(  # type: ignore[no-any-return]
        lambda: (ros := _ros(daemon)).connected and ros, "the node at its master"
    )


def _all_names(master_uri: str) -> list[list[object]]:
    state: list[list[object]] = rosgraph.Master("/test", master_uri).getSystemState()
    return state


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    """Yield a stack that ends everything that a test starts."""
    with ExitStack() as stack:
        yield stack


def test_two_daemons_of_one_machine_do_not_take_each_others_names(
    stack: ExitStack, tmp_path: Path, master: Master
) -> None:
    settings = with_ros(master.uri, "")
    one = _start(stack, tmp_path / "a", settings)
    first = _connected(one).node
    other = _start(stack, tmp_path / "b", settings)
    second = _connected(other).node
    assert first != second
    both = {f"{node}/{_SERVICE}" for node in (first, second)}
    wait_for(lambda: both <= master.services(), "the services of both")
    # Neither was asked to shut down.
    assert [_ros(daemon).problem for daemon in (one, other)] == ["", ""]
    assert [_ros(daemon).connected for daemon in (one, other)] == [True, True]


def test_a_namespace_in_use_is_not_taken_over(
    stack: ExitStack, tmp_path: Path, master: Master
) -> None:
    settings = with_ros(master.uri, "") + "ns = '/shared'\n"
    one = _start(stack, tmp_path / "a", settings)
    wait_for(lambda: f"/shared/{_SERVICE}" in master.services(), "the services")
    owner = _connected(one).node
    other = _start(stack, tmp_path / "b", settings)
    node = _connected(other).node
    wait_for(lambda: f"{node}/{_SERVICE}" in master.services(), "the services elsewhere")
    assert "/shared" in _ros(other).problem
    assert owner in _ros(other).problem
    for name, providers in rosgraph.Master("/test", master.uri).getSystemState()[2]:
        if name == f"/shared/{_SERVICE}":
            assert providers == [owner]


def test_each_of_two_machines_at_one_master_stops_its_own_loop(tmp_path: Path) -> None:
    with two_machines() as (left, right), ExitStack() as stack:
        uri = left.start_master(tmp_path)
        daemons = []
        for machine in (left, right):
            daemons.append(
                _start(
                    stack,
                    tmp_path / machine.name,
                    with_ros(uri, ""),
                    wrapper=machine.enter,
                    environment={"ROS_HOSTNAME": machine.address},
                )
            )
            _connected(daemons[-1])
            daemons[-1].ctl("start")
        nodes = [_connected(daemon).node for daemon in daemons]
        assert nodes[0].startswith("/rtcfd/left/")
        assert nodes[1].startswith("/rtcfd/right/")

        def named(tool: str) -> set[str]:
            return set(left.run("env", f"ROS_MASTER_URI={uri}", tool, "list").split())

        topics = {f"{node}/iteration_info" for node in nodes}
        wait_for(lambda: topics <= named("rostopic"), "the topics of both")
        wait_for(lambda: f"{nodes[1]}/{_SERVICE}" in named("rosservice"), "the service")
        call = ("rosservice", "call", f"{nodes[1]}/{_SERVICE}")
        assert "True" in left.run("env", f"ROS_MASTER_URI={uri}", *call)
        with rtcf.Client(daemons[0].socket) as client:
            running = client.get_status("rt_runner").runners[0].state
            assert running == runner_pb2.RUNNER_STATE_RUNNING
        with rtcf.Client(daemons[1].socket) as client:
            stopped = client.get_status("rt_runner").runners[0].state
            assert stopped == runner_pb2.RUNNER_STATE_STOPPED


def test_no_name_remains_at_a_running_master(
    stack: ExitStack, tmp_path: Path, master: Master
) -> None:
    # roscore's own nodes register after the master has started.
    wait_for(lambda: "/rosout/set_logger_level" in master.services(), "rosout's registrations")
    wait_for(lambda: "/rosout" in master.topics()[1], "rosout's registrations")
    before = _all_names(master.uri)
    parameters = rosgraph.Master("/test", master.uri)
    names = parameters.getParamNames()
    clean = 0
    for attempt in range(5):
        daemon = _start(stack, tmp_path / str(attempt), with_ros(master.uri, ".*"))
        with rtcf.Client(daemon.socket) as client:
            for number in range(8):
                client.load(rtcf.component("rtcf_test", "Knobs", name=f"knobs_{number}"))
            client.start()
        _connected(daemon)
        # Immediately, as an interrupted launch does, in the middle of its registrations.
        daemon.press_ctrl_c()
        if "may be left at the ROS master, which did not answer in time" in daemon.log():
            # The machine was too busy, and the log gives advice; this may not happen each time.
            master.run("sh", "-c", "yes | rosnode cleanup")
            for name in set(parameters.getParamNames()) - set(names):
                parameters.deleteParam(name)
            continue
        clean += 1
        assert _all_names(master.uri) == before, json.dumps(_all_names(master.uri))
        assert parameters.getParamNames() == names
    assert clean


@pytest.mark.parametrize(
    ("host", "reason"),
    [
        ("192.0.2.1", "192.0.2.1, which is not an address of this machine: "),
        ("nowhere.invalid", "nowhere.invalid, which has no address: "),
    ],
)
def test_an_address_that_peers_cannot_reach_is_reported(
    tmp_path: Path, master: Master, host: str, reason: str
) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, ""), environment={"ROS_HOSTNAME": host})
    daemon.start()
    problem = wait_for(lambda: _connected(daemon).problem, "the report")
    assert f" advertises {reason}correct ROS_IP or ROS_HOSTNAME" in problem
    for shown in (daemon.ctl("status").stdout, daemon.ctl("doctor", "--seconds", "0").stdout):
        assert problem in shown
    assert daemon.log().count(problem) == 1
    daemon.end()


def test_an_empty_ros_hostname_counts_as_not_set(tmp_path: Path, master: Master) -> None:
    daemon = Daemon(tmp_path, with_ros(master.uri, ""), environment={"ROS_HOSTNAME": ""})
    daemon.start()
    node = _connected(daemon).node
    uri = urlsplit(rosgraph.Master("/test", master.uri).lookupNode(node))
    assert uri.hostname == socket.gethostname().lower()
    daemon.end()
