"""The whole executor under RealtimeSanitizer: load, topics, hot swaps, parameters and faults;
its real-time thread makes no blocking call."""

import random
import re
from collections.abc import Iterator
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from rtsan import reports, sanitized_daemon
from values import iteration, wait_until_after

CHANGES = 150


@pytest.fixture
def ros_daemon(tmp_path: Path, master: Master) -> Iterator[Daemon]:
    daemon = sanitized_daemon(tmp_path, with_ros(master.uri, ".*"))
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


@pytest.fixture
def sanitized(tmp_path: Path) -> Iterator[Daemon]:
    daemon = sanitized_daemon(tmp_path, NO_ROS)
    daemon.start()
    yield daemon
    if not daemon.ended:
        daemon.end()


def mixer(name: str, *remaps: str) -> graph_pb2.ComponentSpec:
    own = [f"{port}:=/{name}_{port}" for port in ("in1", "in2", "level", "out", "half", "updates")]
    return rtcf.component("rtcf_test", "Mixer", name=name, remaps=[*own, *remaps])


def change(client: rtcf.Client, chance: random.Random) -> None:
    """Make a random change to the graph outside Fig. 1."""
    name = chance.choice("abc")
    port = [control_pb2.PortName(component=name, port="in1")]
    match chance.randrange(8):
        case 0 | 1:
            client.load(mixer(name, f"in1:=/{chance.choice('abc')}_out"))
        case 2:
            client.unload([name])
        case 3:
            client.replace(name, mixer(name))
        case 4:
            client.set_parameters(name, [rtcf.parse_parameter(f"offset:={chance.randrange(12)}")])
        case 5:
            client.set_breaks(port, chance.random() < 0.7)
        case 6:
            client.get_component(name)
        case _:
            frequency = chance.choice([500.0, 1000.0, 2000.0])
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))


def test_load_topics_and_changes_are_realtime_safe(ros_daemon: Daemon, master: Master) -> None:
    chance = random.Random(3)
    refused = 0
    with rtcf.Client(ros_daemon.socket) as client:
        fig_1.load(client)
        client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
        client.load(rtcf.component("rtcf_test", "Witness"))
        nodes = [master.node("record", "/R3_G2H1"), master.node("latch", "/G2_R2", "0.5")]
        client.start()
        for node in nodes:
            node.wait_until_connected()
        for _ in range(CHANGES):
            try:
                change(client, chance)
            except rtcf.RefusedError:
                refused += 1
        batch = ["count:=3", "rate:=0.5", "label:=a longer one than before", "mode:=idle"]
        client.set_parameters("knobs", [rtcf.parse_parameter(each) for each in batch])
        wait_until_after(client, iteration(client) + 100)
        nodes[0].wait_for_values(100)
        assert 0 < refused < CHANGES
        client.stop()
        client.step(1000)
        assert client.get_status("rt_runner").runners[0].pid
        for node in nodes:
            node.end()
    assert ros_daemon.end() == 0
    assert reports(ros_daemon) == []


def test_survived_faults_are_realtime_safe(sanitized: Daemon) -> None:
    with rtcf.Client(sanitized.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(max_overruns=0, frequency_hz=5000.0))
        client.load(rtcf.component("rtcf_test", "Witness"))
        client.load(rtcf.component("rtcf_faults", "NotFinite", name="nan", remaps=["out:=/n"]))
        client.start()
        wait_for(lambda: client.get_component("nan").fault, "the fault")
        wait_until_after(client, iteration(client) + 1000)
        client.unload(["nan"])
        client.load(
            rtcf.component("rtcf_faults", "NotFiniteStops", name="stops", remaps=["out:=/n"])
        )
        wait_for(lambda: "is not finite" in client.get_status("rt_runner").runners[0].status, "it")
        wait_for(lambda: "hook safe" in sanitized.log(), "the safe hook")
    assert sanitized.end() == 0
    assert reports(sanitized) == []


@pytest.mark.parametrize("optional", [True, False])
def test_only_the_throw_of_an_exception_is_reported(sanitized: Daemon, optional: bool) -> None:
    with rtcf.Client(sanitized.socket) as client:
        client.load(rtcf.component("rtcf_test", "Witness"))
        client.load(rtcf.component("rtcf_faults", "Throws", name="bad", optional=optional))
        client.start()
        wait_for(lambda: client.get_component("bad").fault, "the fault")
    assert sanitized.end() == 0
    found = reports(sanitized)
    assert found, "throwing allocates, which must be reported"
    for each in found:
        stack = " ".join(frame.function for frame in each.frames)
        # Allocated at the throw, freed at the end of the catch block.
        assert re.search(
            r"Throws::fault\(\)|__cxa_|~runtime_error\(\)|"
            r"^free \S* ?(rtcf::executor::Cycle::)?update<",
            stack,
        ), stack


def test_violations_of_a_component_are_reported(sanitized: Daemon) -> None:
    with rtcf.Client(sanitized.socket) as client:
        client.load(rtcf.component("rtcf_faults", "Sleeps"))
        client.start()
        wait_until_after(client, 50)
    assert sanitized.end() == 0
    found = reports(sanitized)
    assert found
    assert not any(each.of_executor for each in found)
