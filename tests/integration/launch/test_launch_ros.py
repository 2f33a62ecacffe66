"""rt_runner and rt_launcher as ROS nodes, and how a launcher finds its runner."""

import rosgraph
from daemon_process import wait_for
from launch_processes import Launching, Process
from ros_processes import Master

DONE, _, USAGE, _, LOST = range(5)


def identity(launching: Launching, name: str, *words: str) -> Process:
    return launching.node(
        "rt_launcher", "rtcf_examples", "Identity", f"__name:={name}", "out:=~out", *words
    )


def running(launching: Launching, *words: str) -> Process:
    runner = launching.node("rt_runner", *words)
    runner.wait_for_output("the loop runs")
    return runner


def nodes(master: Master) -> set[str]:
    return set(master.run("/usr/bin/rosnode", "list").split())


def test_nodes_can_be_listed_pinged_and_killed_as_usual(
    launching: Launching, master: Master
) -> None:
    runner = running(launching)
    launcher = identity(launching, "mine", "__ns:=/arm")
    launcher.wait_for_output("loaded into runner")
    wait_for(lambda: {"/rt_runner", "/arm/mine"} <= nodes(master), "the nodes")
    assert "xmlrpc reply from" in master.run("/usr/bin/rosnode", "ping", "-c", "1", "/rt_runner")
    told = master.run("/usr/bin/rosnode", "info", "/arm/mine")
    assert f"Pid: {launcher.pid}" in told
    assert master.call("/arm/mine/get_loggers")["loggers"] == [
        {"name": "ros.rtcf", "level": "info"}
    ]
    master.run("/usr/bin/rosnode", "kill", "/arm/mine")
    assert launcher.wait() == DONE
    assert "asked to end: " in launcher.output()
    with launching.client() as (client, name):
        assert client.get_order(name) == []
    assert "/arm/mine" not in nodes(master)
    assert runner.end() == DONE
    assert "/rt_runner" not in nodes(master)


def test_a_second_node_with_the_same_name_replaces_the_first(launching: Launching) -> None:
    runner = running(launching)
    first = identity(launching, "it")
    first.wait_for_output("loaded into runner")
    second = identity(launching, "it")
    assert first.wait() == DONE
    assert "new node registered with same name" in first.output()
    second.wait_for_output("loaded into runner")
    successor = launching.node("rt_runner")
    assert runner.wait() == DONE
    assert second.wait() == LOST
    successor.wait_for_output("the loop runs")
    assert successor.end() == DONE


def test_a_dead_runners_parameters_block_no_launcher_and_waits_are_explained(
    launching: Launching, master: Master
) -> None:
    rosgraph.Master("/test", master.uri).setParam("/left/rt_runner/frequency", 100)
    named = identity(launching, "named", "_runner:=/left/rt_runner")
    near = identity(launching, "near", "__ns:=/left")
    near.wait_for_output("no rt_runner runs at this ROS master")
    runner = running(launching)
    near.wait_for_output("loaded into runner rt_runner")
    named.wait_for_output(
        "for runner /left/rt_runner: it has parameters but does not run (running: /rt_runner; "
        "select one with ~runner)"
    )
    assert (near.end(), named.end(), runner.end()) == (DONE, DONE, DONE)


def test_a_single_runner_is_used_by_default_but_not_one_of_several(
    launching: Launching,
) -> None:
    runner = running(launching, "__name:=control", "__ns:=/arm")
    launcher = identity(launching, "one", "__ns:=/leg")
    launcher.wait_for_output("loaded into runner arm_control")
    other = running(launching, "__name:=other")
    undecided = identity(launching, "two")
    assert undecided.wait() == USAGE
    assert (
        "several runners run: /arm/control, /other: select one with ~runner" in undecided.output()
    )
    assert (launcher.end(), runner.end(), other.end()) == (DONE, DONE, DONE)


def test_component_parameters_are_passed_and_misspelled_ones_reported(
    launching: Launching,
) -> None:
    runner = running(launching, "_freqency:=5")
    runner.wait_for_output("rt_runner has no parameter ~freqency; did you mean ~frequency?")
    launcher = launching.node(
        "rt_launcher", " rtcf_examples ", " waves::Wave", "__name:=wave", "_amplitud:=2.0",
        "_every:=0.5", "_rtcf_every:=2",
    )  # fmt: skip
    launcher.wait_for_output("loaded into runner")
    assert "declares no parameter ~amplitud; did you mean ~amplitude?" in launcher.output()
    with launching.client() as (client, name):
        wait_for(lambda: client.get_component("/wave", name).spec.every == 2, "the component")
    assert (launcher.end(), runner.end()) == (DONE, DONE)


def tuned(launching: Launching, master: Master) -> tuple[Process, Process]:
    """Return runner and launcher of a /wave; dynparam has set its amplitude to 4, rosparam its
    rate to 3."""
    runner = running(launching)
    launcher = launching.node("rt_launcher", "rtcf_examples", "Wave", "__name:=wave")
    launcher.wait_for_output("loaded into runner")
    wait_for(lambda: master.parameter("/wave/shape") == "sine", "the parameter server")
    master.run("rosrun", "dynamic_reconfigure", "dynparam", "set", "/wave", "amplitude", "4.0")
    wait_for(lambda: master.parameter("/wave/amplitude") == 4.0, "the parameter server")
    master.run("rosparam", "set", "/wave/rate", "3.0")
    with launching.client() as (client, name):

        def values() -> list[float]:
            parameters = client.get_component("/wave", name).parameters
            return [each.value.double_value for each in parameters[:2]]

        wait_for(lambda: values() == [4.0, 3.0], "the loop to follow the change")
    return runner, launcher


def test_the_end_of_a_launch_removes_tuned_values_but_not_written_ones(
    launching: Launching, master: Master
) -> None:
    runner, launcher = tuned(launching, master)
    assert launcher.end() == DONE
    wait_for(lambda: master.parameter("/wave") == {"rate": 3.0}, "the removal of the tuned value")
    assert runner.end() == DONE
    assert master.parameter("/wave") == {"rate": 3.0}


def test_an_orderly_end_of_the_runner_restores_earlier_parameters(
    launching: Launching, master: Master
) -> None:
    rosgraph.Master("/test", master.uri).setParam("/wave/amplitude", 2.0)
    runner, launcher = tuned(launching, master)
    assert runner.end() == DONE
    assert launcher.wait() == LOST
    wait_for(lambda: master.parameter("/wave") == {"amplitude": 2.0, "rate": 3.0}, "the old value")
