"""The node of a launch's loop in ROS tools, and launches whose roscore restarts."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_process import DEADLINE_S, wait_for
from launch_processes import Launching, Process
from ros_processes import Master

DONE = 0


@pytest.fixture
def own_master(tmp_path: Path) -> Iterator[Master]:
    """Yield a private master, which the test may end."""
    master = Master(tmp_path)
    master.start()
    yield master
    master.end()


@pytest.fixture
def launching(tmp_path: Path, own_master: Master) -> Iterator[Launching]:
    launching = Launching(own_master, tmp_path)
    yield launching
    launching.end()


def running(launching: Launching, master: Master, *words: str) -> tuple[Process, Process]:
    """Start a runner and a component with a topic; return once ROS shows both."""
    runner = launching.node("rt_runner", "_ros_mapping_whitelist:=.*", *words)
    launcher = launching.node(
        "rt_launcher", "rtcf_compat", "PaperExample", "__name:=it", "out_port:=/out"
    )
    launcher.wait_for_output("loaded into runner")
    wait_for(lambda: "/out" in master.topics()[0], "the topic")
    wait_for(lambda: "/rt_runner/get_loop" in master.services(), "the services")
    return runner, launcher


def test_the_runners_node_has_the_loops_topics_services_and_loggers(
    launching: Launching, own_master: Master
) -> None:
    runner, launcher = running(launching, own_master)
    told = own_master.run("/usr/bin/rosnode", "info", "/rt_runner")
    for name in ("/out [std_msgs/Float32]", "/rt_runner/cycles", "/rt_runner/deactivate_rt_loop"):
        assert f" * {name}" in told, told
    nodes = set(own_master.run("/usr/bin/rosnode", "list").split())
    assert nodes == {"/rosout", "/rt_runner", "/rt_runner/launch", "/it"}
    # The call of rqt_logger_level.
    loggers = {
        each["name"]: each["level"] for each in own_master.call("/rt_runner/get_loggers")["loggers"]
    }
    assert loggers["ros.rtcf.it"] == "info"
    debug = "{logger: ros.rtcf.it, level: debug}"
    own_master.call("/rt_runner/set_logger_level", debug)
    loggers = {
        each["name"]: each["level"] for each in own_master.call("/rt_runner/get_loggers")["loggers"]
    }
    assert loggers["ros.rtcf.it"] == "debug"
    assert (launcher.end(), runner.end()) == (DONE, DONE)
    assert "/rt_runner" not in own_master.run("/usr/bin/rosnode", "list").split()


def test_rosnode_kill_of_the_runner_ends_the_launch(
    launching: Launching, own_master: Master
) -> None:
    runner, launcher = running(launching, own_master)
    own_master.run("/usr/bin/rosnode", "kill", "/rt_runner")
    assert runner.wait() == DONE
    assert "asked to end: " in runner.output()
    assert launcher.wait() != DONE  # its runner ended


def test_a_launchers_logger_level_applies_to_its_records(
    launching: Launching, own_master: Master
) -> None:
    runner, launcher = running(launching, own_master)
    own_master.call("/rt_runner/launch/set_logger_level", "{logger: ros.rtcf, level: error}")
    with launching.client() as (client, name):
        client.stop(name)
        client.start(name)
        client.stop(name)
    assert (launcher.end(), runner.end()) == (DONE, DONE)
    assert "the loop is stopped" not in runner.output()


def test_a_launch_returns_after_a_restart_of_roscore(
    launching: Launching, own_master: Master
) -> None:
    runner, launcher = running(launching, own_master)
    own_master.end()
    own_master.start()
    runner.wait_for_output("registered again at the ROS master")
    nodes = {"/rt_runner", "/rt_runner/launch", "/it"}
    wait_for(lambda: nodes <= set(own_master.run("/usr/bin/rosnode", "list").split()), "the nodes")
    for node in nodes:
        assert "xmlrpc reply from" in own_master.run("/usr/bin/rosnode", "ping", "-c", "1", node)
    wait_for(lambda: "/rt_runner/get_loop" in own_master.services(), "the services")
    told = launching.tool("component_list")
    assert (told.stdout, told.stderr) == ("/it\n", "")
    late = launching.node("rt_launcher", "rtcf_examples", "Identity", "__name:=late", "out:=~out")
    late.wait_for_output("loaded into runner rt_runner")
    assert launching.tool("component_list").stdout == "/it\n/late\n"
    assert (late.end(), launcher.end(), runner.end()) == (DONE, DONE, DONE)


def test_tools_of_another_machine_ask_the_service(launching: Launching, own_master: Master) -> None:
    runner, launcher = running(launching, own_master)
    # The other machine's file system and host name are unavailable here.
    parameters = own_master.parameter("/rt_runner/rtcf_runner")
    own_master.run("/usr/bin/rosparam", "set", "/rt_runner/rtcf_runner/host", "elsewhere")
    own_master.run("/usr/bin/rosparam", "set", "/rt_runner/rtcf_runner/socket", "/nonexistent")
    told = launching.tool("component_order")
    assert (told.returncode, told.stdout, told.stderr) == (
        0, "Real-time execution order is:\n1. /it\n\nTotal: 1\n", "",
    )  # fmt: skip
    far = launching.node("rt_launcher", "rtcf_examples", "Identity", "__name:=far")
    assert far.wait() == 1
    assert "runner /rt_runner is on elsewhere, this launcher on " in far.output()
    assert "start both on one machine" in far.output()
    own_master.run("/usr/bin/rosparam", "set", "/rt_runner/rtcf_runner/host", parameters["host"])
    assert (launcher.end(), runner.end()) == (DONE, DONE)


def test_tools_name_missing_nodes_and_components(launching: Launching, own_master: Master) -> None:
    told = launching.tool("component_list")
    assert (told.returncode, told.stdout) == (3, "")
    assert told.stderr.startswith(
        "component_list: no /rt_runner/get_introspection_information at the ROS master "
    )
    own_master.end()
    told = launching.tool("component_list")
    own_master.start()
    assert (told.returncode, told.stdout) == (3, "")
    assert "no ROS master answers at" in told.stderr
    runner, launcher = running(launching, own_master)
    for tool, what in (("component_info", "component"), ("connection_info", "connection")):
        told = launching.tool(tool, "none")
        found = f"Given {what} not found!\n" if what == "component" else "No connections found!\n"
        assert (told.returncode, told.stdout) == (1, found)
    table = subprocess.run(
        ["/usr/bin/rosrun", "rtcf", "component_list", "--table"],
        env={k: v for k, v in launching.environment.items() if k != "RTCF_SOCKET"},
        capture_output=True, text=True, timeout=DEADLINE_S, check=True,
    )  # fmt: skip
    assert "rt_launcher /it" in table.stdout
    assert (launcher.end(), runner.end()) == (DONE, DONE)
