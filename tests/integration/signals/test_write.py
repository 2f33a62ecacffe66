"""Values written by hand to inputs without a writer; the loop reads them as if from outside."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import graph_pb2, runner_pb2


def port(client: rtcf.Client, name: str) -> graph_pb2.PortInfo:
    """Return a port with its value."""
    component, _, wanted = name.rpartition(".")
    ports: Iterable[graph_pb2.PortInfo] = client.get_component(component).ports
    return next(each for each in ports if each.name == wanted)


def reads(client: rtcf.Client, name: str, value: str) -> None:
    """Wait until the text of a port's value contains a text."""
    wait_for(lambda: value in port(client, name).value, f"{value} in {name}")


@pytest.fixture
def passing(daemon: Daemon, client: rtcf.Client) -> Iterator[Daemon]:
    """Yield a daemon with a running loop, whose component forwards each new value."""
    client.load(rtcf.component("rtcf_examples", "Identity", name="a"))
    remaps = ["in:=/out", "out:=/passed"]
    client.load(rtcf.component("rtcf_examples", "Identity", name="b", remaps=remaps))
    client.load(rtcf.component("rtcf_test", "Chaos", name="chaos", ns="/c"))
    client.load(rtcf.component("rtcf_test", "Mixer", name="mixer", ns="/m"))
    client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/t"))
    client.start()
    yield daemon
    client.stop()


def test_a_value_is_new_in_one_cycle_and_passes_through_the_graph(
    passing: Daemon, client: rtcf.Client
) -> None:
    done = passing.ctl("write", "a.in", "1.5")
    assert (done.returncode, done.stdout, done.stderr) == (0, "/a.in written\n", "")
    reads(client, "b.out", "1.5")
    assert passing.ctl("get", "b.out").stdout == "1.5\n"
    assert port(client, "a.in").age_ns >= 0


def test_numbers_texts_lists_and_messages_are_written(passing: Daemon, client: rtcf.Client) -> None:
    for name, text, value in (
        ("m/mixer.in1", "-7", "-7"),
        ("m/mixer.level", "1e3", "1000"),
        ("t/text.heard", "5 words, of which none is a number", "5 words, of which none"),
        ("c/chaos.list", "[1, 2.5, .nan]", "2.5"),
        ("c/chaos.frame", "{position: {x: 0.25}, orientation: {w: 1}}", "0.25"),
        ("c/chaos.frame", "[[0, 0.75, 0], [0, 0, 0, 1]]", "0.75"),
    ):
        done = passing.ctl("write", name, text)
        assert (done.returncode, done.stderr) == (0, ""), text
        reads(client, name, value)
    client.write("c/chaos.list", np.array([[4.5, 3.0], [2.0, 1.0]]))
    reads(client, "c/chaos.list", "4.5")
    client.write("c/chaos.frame", {"position": {"z": 8.125}, "orientation": {"w": 1.0}})
    reads(client, "c/chaos.frame", "8.125")
    client.write("m/mixer.in2", 12)
    reads(client, "m/mixer.in2", "12")
    reads(client, "t/text.length", str(len("5 words, of which none is a number")))


def test_a_stopped_loop_reads_the_value_in_its_first_cycle(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Identity", name="a"))
    client.write("a.in", 2.5)
    client.write("a.in", 3.5)
    client.step(1)
    reads(client, "a.out", "3.5")
    # It is new in that cycle only, and again if the same value is written once more.
    for _ in range(2):
        assert port(client, "a.out").age_ns == 0
        client.step(2)
        assert port(client, "a.out").age_ns > 0
        client.write("a.in", 3.5)
        client.step(1)


def test_an_unmapped_input_can_be_written_until_a_component_writes_it(
    client: rtcf.Client,
) -> None:
    client.set_runner(
        runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="", blacklist=".*"))
    )
    client.load(rtcf.component("rtcf_examples", "Identity", name="a"))
    client.start()
    client.write("a.in", 2.5)
    reads(client, "a.out", "2.5")
    client.load(rtcf.component("rtcf_examples", "Wave", name="w", remaps=["wave:=/in"]))
    with pytest.raises(rtcf.RefusedError, match=r"^/a\.in reads /w\.wave: "):
        client.write("a.in", 1.0)
    client.unload(["w"])
    client.write("a.in", 4.5)
    reads(client, "a.out", "4.5")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("b.in", "1", "/b.in reads /a.out: write to an input that no component feeds"),
        ("a.out", "1", "/a has no input out; it has in"),
        ("nobody.in", "1", "nobody"),
        ("a.in", "much", '/a.in takes std_msgs/Float64: data: "much" is not a valid float64'),
        ("a.in", "{date: 1}", "no field date; did you mean \"data\"? (fields: data)"),
        ("m/mixer.in1", "1.5", '"1.5" is not a valid int32'),
        ("m/mixer.in1", "3000000000", '"3000000000" is not a valid int32'),
        ("a.in", "[1, 2", "invalid YAML: "),
        (
            "c/chaos.frame",
            "1",
            "is not a message: name its fields, as in {position: …, orientation",
        ),
        ("c/chaos.list", "{x: &a [1], y: *a}", "invalid YAML: an alias (*)"),
        pytest.param("a.in", "x" * 70_000, "is too long, at most 65536: write JSON", id="too long"),
    ],
)  # fmt: skip
def test_errors_are_one_line(passing: Daemon, name: str, value: str, said: str) -> None:
    done = passing.ctl("write", name, value)
    assert (done.returncode, done.stdout) == (1, "")
    assert said in done.stderr and done.stderr.count("\n") == 1


def test_an_invalid_port_name_is_a_usage_error(daemon: Daemon) -> None:
    done = daemon.ctl("write", "pid", "1")
    assert (done.returncode, done.stderr) == (2, 'rtcfctl: "pid": a port is COMPONENT.PORT\n')


@pytest.fixture
def on_ros(tmp_path: Path, master: Master) -> Iterator[Daemon]:
    """Yield a daemon whose loops subscribe all inputs without a writer in the loop."""
    daemon = Daemon(tmp_path, with_ros(master.uri, ".*"))
    daemon.start()
    yield daemon
    daemon.end()


def subscribed(master: Master, *topics: str) -> None:
    """Wait until topics are subscribed at the master."""
    wait_for(lambda: set(topics) <= master.topics()[1], f"subscriptions of {topics}")


def test_an_input_without_publisher_can_be_written(on_ros: Daemon, master: Master) -> None:
    with rtcf.Client(on_ros.socket) as client:
        client.load(rtcf.component("rtcf_examples", "Identity", name="a"))
        client.load(rtcf.component("rtcf_test", "Chaos", name="chaos", ns="/c"))
        client.load(rtcf.component("rtcf_test", "Mixer", name="mixer", ns="/m"))
        client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/t"))
        client.start()
        topics = ("/in", "/c/frame", "/c/list", "/m/in1", "/t/heard")
        subscribed(master, *topics)
        for name, value, shown in (
            ("a.in", 1.5, "1.5"),
            ("c/chaos.list", [2.5, 3.0], "2.5"),
            # C++ types that are sent as a message.
            ("c/chaos.frame", {"position": {"x": 0.25}, "orientation": {"w": 1.0}}, "0.25"),
            ("m/mixer.in1", -7, "-7"),
            ("t/text.heard", "five words of no number", "five words"),
        ):
            client.write(name, value)
            reads(client, name, shown)
        assert set(topics) <= master.topics()[1]


def test_an_input_with_a_publisher_is_rejected(on_ros: Daemon, master: Master) -> None:
    with rtcf.Client(on_ros.socket) as client:
        client.load(rtcf.component("rtcf_examples", "Identity", name="a", ns="/fed"))
        client.start()
        client.write("fed/a.in", 1.0)
        reads(client, "fed/a.out", "1")
        node = master.node("latch", "/fed/in", "2.5")
        node.wait_until_connected()
        reads(client, "fed/a.out", "2.5")
        with pytest.raises(rtcf.RefusedError, match=r"^/fed/a\.in reads the ROS topic /fed/in: "):
            client.write("fed/a.in", 3.5)
        # Peers that may only observe feed no input.
        observe = runner_pb2.RosSettings(peers=runner_pb2.RIGHT_OBSERVE)
        client.set_runner(runner_pb2.RunnerSettings(ros=observe))
        wait_for(lambda: "/fed/in" not in master.topics()[1], "the end of the subscription")
        client.write("fed/a.in", 4.5)
        reads(client, "fed/a.out", "4.5")
        node.end()


def test_an_input_can_be_written_after_its_publisher_left(on_ros: Daemon, master: Master) -> None:
    with rtcf.Client(on_ros.socket) as client:
        client.load(rtcf.component("rtcf_examples", "Identity", name="a"))
        client.start()
        node = master.node("latch", "/in", "2.5")
        reads(client, "a.out", "2.5")
        node.end()

        def written() -> bool:
            try:
                client.write("a.in", 3.5)
            except rtcf.RefusedError:
                return False
            return True

        wait_for(written, "the end of the publisher's connection")
        reads(client, "a.out", "3.5")
