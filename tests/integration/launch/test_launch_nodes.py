"""rt_runner and rt_launcher as processes: their choice of a daemon, their reaction to the end of
each other, and their exit statuses."""

import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import rosgraph
import rtcf
import yaml
from daemon_process import Daemon, wait_for, with_ros
from launch_processes import Launching, Process, left_over
from parameter_rule import CASES
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration, parameter_values, wait_until_after

DONE, REFUSED, USAGE, FAILED, LOST = range(5)

_RUNNER_OF_A_TREE = """
import sys
from pathlib import Path
from rtcf_launch.runner_node import main
sys.exit(main([], Path(sys.argv[1])))
"""

_NEVER_SERVES = """#!/usr/bin/python3
import sys, time
from pathlib import Path
Path(sys.argv[0]).with_name("began").touch()
sys.stdin.read()
time.sleep(0.2)  # as an end in order takes
Path(sys.argv[0]).with_name("ended").touch()
"""


@pytest.fixture
def system(tmp_path: Path, master: Master) -> Iterator[Daemon]:
    """Yield a daemon that plays the system's daemon."""
    # Its executors wait for its restart, like the system's.
    orphans = "[runner]\norphan_timeout_s = 60.0\n"
    daemon = Daemon(tmp_path, orphans + with_ros(master.uri, ""))
    daemon.start()
    yield daemon
    daemon.end()


@pytest.fixture
def launching(tmp_path: Path, master: Master, system: Daemon) -> Iterator[Launching]:
    """Yield a starter of nodes that find `system` as the system's daemon."""
    launching = Launching(master, tmp_path, system.socket)
    launching.forget()
    yield launching
    launching.end()


@pytest.fixture
def alone(tmp_path: Path, master: Master) -> Iterator[Launching]:
    """Yield a starter of nodes without a system daemon."""
    launching = Launching(master, tmp_path)
    launching.forget()
    yield launching
    launching.end()


def launcher(launching: Launching, name: str, *words: str) -> Process:
    """Start a launcher of an Identity."""
    return launching.node(
        "rt_launcher", "rtcf_examples", "Identity", f"__name:={name}", "out:=~out", *words
    )


def loaded(launching: Launching, name: str, *words: str) -> Process:
    process = launcher(launching, name, *words)
    process.wait_for_output("loaded into runner")
    return process


def is_running(client: rtcf.Client) -> bool:
    (status,) = client.get_status("rt_runner").runners
    return bool(status.state == runner_pb2.RUNNER_STATE_RUNNING)


def test_the_system_daemon_is_used_if_permitted_and_released(
    launching: Launching, system: Daemon, master: Master
) -> None:
    runner = launching.node("rt_runner", "_frequency:=321", ROS_HOSTNAME="127.0.0.1")
    runner.wait_for_output("system daemon at")
    runner.wait_for_output("the loop runs with 0 components")
    with rtcf.Client(system.socket) as client:
        (status,) = client.get_status("rt_runner").runners
        assert status.settings.frequency_hz == 321.0
        assert "rt_runner /rt_runner" in status.holder
        for reason in status.degraded:
            # The node names its own parameters as remedies.
            what = reason.partition(" (rtcfctl")[0]
            runner.wait_for_output(f"!! rt_runner IS NOT REAL TIME: {what}")
        # The node of the loop has the name of the launch's runner.
        graph = rosgraph.Master("/test", master.uri)
        wait_for(lambda: client.get_status("rt_runner").runners[0].ros.connected, "the ROS node")
        assert "127.0.0.1" in graph.lookupNode(status.ros.node)
        assert runner.end() == DONE
        (status,) = client.get_status("rt_runner").runners
        assert (status.settings.frequency_hz, status.holder) == (1000.0, "")


def test_a_runner_prints_its_settings(alone: Launching) -> None:
    cpu = max(os.sched_getaffinity(0))
    chosen = alone.node(
        "rt_runner", "__name:=chosen", "_frequency:=250", f"_cpu:={cpu}", "_priority:=42",
        "_overrun:=Catch_Up",
    )  # fmt: skip
    plain = alone.node("rt_runner", "__name:=plain")
    chosen.wait_for_output(
        f"runner chosen at 250 Hz, CPU {cpu}, priority 42, overrun catch_up: starting"
    )
    plain.wait_for_output(
        "runner plain at 1000 Hz, a CPU with the fewest loops, priority 80, overrun skip: starting"
    )
    # 1 kHz may be a thousand times the rate for which the components were written.
    plain.wait_for_output("no ~frequency is set; RTCF 2021 took 1 Hz then")
    assert chosen.end() == DONE
    assert plain.end() == DONE
    assert "no ~frequency" not in chosen.output()


def test_a_private_daemon_is_used_if_the_systems_has_another_master(
    tmp_path: Path, master: Master
) -> None:
    daemon = Daemon(tmp_path, with_ros("http://localhost:1", ""))
    daemon.start()
    launching = Launching(master, tmp_path, daemon.socket)
    launching.forget()
    runner = launching.node("rt_runner")
    runner.wait_for_output("the loop runs with 0 components")
    assert "private daemon at" in runner.output()
    assert "another ROS master: http://localhost:1, not" in runner.output()
    assert runner.end() == DONE
    daemon.end()


def test_launchers_come_and_go_and_a_killed_one_stops_the_loop(
    launching: Launching, system: Daemon
) -> None:
    runner = launching.node("rt_runner", "_num_components_expected:=2")
    first, second = loaded(launching, "first"), loaded(launching, "second")
    with rtcf.Client(system.socket) as client:
        wait_for(lambda: is_running(client), "the loop")
        # A launcher ends in order: its component leaves, the loop continues.
        assert first.end(signal.SIGTERM) == DONE
        assert client.get_order() == ["/second"]
        wait_until_after(client, iteration(client) + 10)
        first = loaded(launching, "first")
        # A launcher dies: the loop stops, and starts again once all components have returned.
        first.end(signal.SIGKILL)
        runner.wait_for_output(f"/first: rt_launcher /first (pid {first.pid}) has died")
        runner.wait_for_output("the loop is stopped")
        wait_for(lambda: client.get_order() == ["/second"], "the unload of the component")
        assert not is_running(client)
        first = loaded(launching, "first", "_on_lease_lost:=keep")
        wait_for(lambda: is_running(client), "the loop")
        first.end(signal.SIGKILL)
        wait_for(lambda: client.get_component("first").holder == "", "the component to be kept")
        assert is_running(client)
        assert second.end() == DONE
        assert runner.end() == DONE
        # The kept component is like any other component of that runner.
        assert client.get_order() == ["/first"]


def test_a_launch_outlives_the_restart_of_its_daemon(launching: Launching, system: Daemon) -> None:
    runner = launching.node("rt_runner", "_num_components_expected:=1")
    first = loaded(launching, "first")
    runner.wait_for_output("the loop runs")
    with rtcf.Client(system.socket) as client:
        before = iteration(client)
    system.end(signal.SIGKILL)
    system.start()
    runner.wait_for_output("rtcfd is back, the runner is kept")
    first.wait_for_output("rtcfd is back, the component is kept")
    with rtcf.Client(system.socket) as client:
        wait_until_after(client, before + 10)
    assert first.end() == DONE
    assert runner.end() == DONE


def test_a_restarted_runner_returns_to_the_system_daemon(
    launching: Launching, system: Daemon
) -> None:
    runner = launching.node("rt_runner", "_frequency:=321")
    runner.wait_for_output("the loop runs")
    runner.end(signal.SIGKILL)
    again = launching.node("rt_runner", "_frequency:=123")
    again.wait_for_output("the loop runs")
    assert "system daemon at" in again.output()
    assert again.end() == DONE
    with rtcf.Client(system.socket) as client:
        (status,) = client.get_status("rt_runner").runners
        assert status.settings.frequency_hz == 1000.0


def test_launchers_end_when_their_runner_dies(alone: Launching) -> None:
    runner = alone.node("rt_runner", "_num_components_expected:=1")
    first = loaded(alone, "first")
    runner.wait_for_output("the loop runs with 1 components")
    match = re.search(r"private daemon at (\S+)/control.sock", runner.output())
    assert match is not None
    socket = Path(match[1], "control.sock")
    runner.end(signal.SIGKILL)
    # rtcfd ends with it, in order, and reports that to the launcher.
    assert first.wait() == LOST
    wait_for(lambda: not socket.parent.exists(), "the private daemon to end")
    # The dead runner's parameters on the parameter server mislead no launcher.
    waiting = launcher(alone, "waiting")
    again = alone.node("rt_runner", "_num_components_expected:=1")
    waiting.wait_for_output("loaded into runner")
    again.wait_for_output("the loop runs with 1 components")
    assert waiting.end() == DONE
    assert again.end() == DONE


def test_a_fault_ends_the_runner_and_the_launcher_of_the_culprit(alone: Launching) -> None:
    runner = alone.node("rt_runner", "_num_components_expected:=1")
    bad = alone.node("rt_launcher", "rtcf_faults", "Throws", "__name:=bad")
    assert runner.wait() == FAILED
    assert "the loop has ended" in runner.output() and "the encoder jumped" in runner.output()
    assert bad.wait() == FAILED
    assert "the encoder jumped" in bad.output()


def test_a_rejected_component_ends_its_launcher(alone: Launching) -> None:
    runner = alone.node("rt_runner", "_num_components_expected:=3")
    runner.wait_for_output("waiting for 3 components")
    cases = {
        ("rtcf_examples", "Mino"): (REFUSED, 'did you mean "Mimo"'),
        ("rtcf_exmples", "Mimo"): (REFUSED, 'no package "rtcf_exmples"'),
        ("rtcf_examples", "Wave", "_amplitude:=11"): (REFUSED, "amplitude"),
        ("rtcf_examples", "Wave", "_is_first:=3"): (USAGE, "~is_first must be true or false"),
        ("rtcf_examples",): (USAGE, "name a package and a component"),
    }
    started = [
        (alone.node("rt_launcher", *words, f"__name:=bad{i}"), words)
        for i, words in enumerate(cases)
    ]
    for process, words in started:
        status, message = cases[words]
        assert process.wait() == status, process.output()
        assert message in process.output()
    assert runner.end() == DONE


def test_a_rejected_runner_prints_the_reason_in_one_line(alone: Launching) -> None:
    cases = {
        ("_ros_latch:=*.ros.*", "__name:=a"): (REFUSED, "*.ros.*"),
        ("_frequency:=fast", "__name:=b"): (USAGE, '~frequency must be a number, not "fast"'),
        ("_daemon:=system", "__name:=c"): (REFUSED, "rtcfd is not running at /nonexistent"),
        ("__master:=http://localhost:1", "__name:=d"): (REFUSED, "no ROS master answers"),
        ("word", "__name:=e"): (USAGE, "unexpected argument word"),
        ("__log:=/proc/no/f.log", "__name:=f"): (REFUSED, "cannot write rtcfd's log /proc/no/f"),
    }
    started = [(alone.node("rt_runner", *words), words) for words in cases]
    for process, words in started:
        status, message = cases[words]
        assert process.wait() == status, process.output()
        (line,) = (each for each in process.output().splitlines() if message in each)
        assert "Traceback" not in process.output(), line


def test_an_invalid_expression_falls_back_as_in_rtcf_2021(alone: Launching) -> None:
    runner = alone.node(
        "rt_runner", "_ros_mapping_whitelist:=*.ros.*", "_ros_mapping_blacklist:=(",
    )  # fmt: skip
    runner.wait_for_output("the loop runs")
    assert "~ros_mapping_whitelist: bad regular expression '*.ros.*': " in runner.output()
    assert "; falling back to '.*'\n" in runner.output()
    assert "~ros_mapping_blacklist: bad regular expression '(': " in runner.output()
    with alone.client() as (client, name):
        ros = client.get_status(name).runners[0].settings.ros
        assert (ros.whitelist, ros.blacklist) == (".*", "")
    assert runner.end() == DONE


def test_an_invalid_ignore_expression_falls_back_as_in_rtcf_2021(alone: Launching) -> None:
    runner = alone.node("rt_runner")
    component = launcher(alone, "it", "_topics_ignore_for_graph:=*.tmp")
    component.wait_for_output("loaded into runner")
    (line,) = [each for each in component.output().splitlines() if "ERROR" in each]
    assert "~topics_ignore_for_graph: " in line
    assert "bad regular expression '*.tmp': " in line
    assert line.endswith("; falling back to '.*'")
    with alone.client() as (client, name):
        (info,) = client.list_components(name)
        assert info.spec.ignore == ".*"
    assert (component.end(), runner.end()) == (DONE, DONE)


def test_remaps_of_the_loops_own_names_cause_a_warning(alone: Launching) -> None:
    runner = alone.node("rt_runner", "~iteration_info:=/ii", "/rosout:=/mine", "/in:=/out", "in:=x")
    runner.wait_for_output("the loop runs")
    assert runner.end() == DONE
    lines = [each for each in runner.output().splitlines() if "remap of " in each]
    assert len(lines) == 2
    for line, names in zip(lines, ("~iteration_info to /ii", "/rosout to /mine"), strict=True):
        assert "WARN" in line and f"remap of {names} ignored: " in line


def test_commands_in_messages_fit_the_launch(alone: Launching) -> None:
    runner = alone.node("rt_runner", "_mode:=wait_for_trigger")
    runner.wait_for_output("waiting for ")
    with alone.client() as (client, _):
        assert f"waiting for `rtcfctl --socket {client.socket} -r rt_runner start`" in (
            runner.output()
        )
    kind = ("rt_launcher", "rtcf_examples", "Identity")
    first = alone.node(*kind, "__name:=first", "in:=/b", "out:=/a")
    first.wait_for_output("loaded into runner")
    second = alone.node(*kind, "__name:=second", "in:=/a", "out:=/b")
    assert second.wait() == REFUSED
    assert "the connections form a loop" in second.output()
    assert "~topics_ignore_for_graph or ~is_first of first" in second.output()
    assert "~topics_ignore_for_graph or ~is_first of second" in second.output()
    assert "rtcfctl" not in second.output()
    assert (first.end(), runner.end()) == (DONE, DONE)


def test_a_launcher_waits_for_its_runner_and_can_be_interrupted(
    alone: Launching,
) -> None:
    waiting = launcher(alone, "waiting")
    waiting.wait_for_output("for runner /rt_runner")
    assert waiting.end() == DONE


def test_an_interrupted_runner_does_not_wait_for_its_private_daemon(
    alone: Launching, tmp_path: Path
) -> None:
    runtime = tmp_path / "runtime"
    runtime.mkdir()
    never_serves = tmp_path / "tree" / "bin" / "rtcfd"
    never_serves.parent.mkdir(parents=True)
    never_serves.write_text(_NEVER_SERVES)
    never_serves.chmod(0o755)
    runner = alone.start(
        *("/usr/bin/python3", "-c", _RUNNER_OF_A_TREE, str(tmp_path / "tree")),
        XDG_RUNTIME_DIR=str(runtime),
        ROS_LOG_DIR=str(tmp_path),
    )
    wait_for(never_serves.with_name("began").exists, "the private daemon")
    assert runner.end(signal.SIGTERM) == DONE
    assert not left_over(f"{runtime}/rtcf-")
    assert not list(runtime.iterdir())
    assert never_serves.with_name("ended").exists()  # in order, not killed


def test_values_of_other_types_follow_one_rule_in_launches(
    alone: Launching, master: Master
) -> None:
    runner = alone.node("rt_runner")
    runner.wait_for_output("the loop runs")
    server = rosgraph.Master("/test", master.uri)
    for name, text, wanted in CASES:
        server.setParam(f"/knobs/{name}", yaml.safe_load(text))
        knobs = alone.node("rt_launcher", "rtcf_test", "Knobs", "__name:=knobs")
        if wanted is None:
            assert knobs.wait() in (REFUSED, USAGE), text
            assert name in knobs.output()
        else:
            knobs.wait_for_output("loaded into runner")
            with alone.client() as (client, _):
                assert parameter_values(client, "/knobs")[name] == wanted, text
            assert knobs.end() == DONE
        server.deleteParam("/knobs")
    assert runner.end() == DONE
