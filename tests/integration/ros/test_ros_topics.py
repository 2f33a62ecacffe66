"""Connections as ROS topics: selection, decimation, size, age."""

from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from holding_master import HoldingMaster
from ros_processes import Master, Node
from rtcf.v1 import runner_pb2
from values import iteration, port_value


def ros(client: rtcf.Client) -> runner_pb2.RosStatus:
    """Return the state of the ROS node."""
    status: runner_pb2.RosStatus = client.get_status("rt_runner").runners[0].ros
    return status


def test_whitelist_and_blacklist_change_while_the_loop_runs(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = ros_daemon
    client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/w"))
    client.start()

    def mapped() -> tuple[set[str], set[str]]:
        published, subscribed = master.topics()
        ports = {"/w/said", "/w/length", "/w/age"}
        return published & ports, subscribed & {"/w/heard"}

    cases: list[tuple[list[str], tuple[set[str], set[str]]]] = [
        (["--whitelist", "/w/.*"], ({"/w/said", "/w/length", "/w/age"}, {"/w/heard"})),
        (["--blacklist", "/w/(age|heard)"], ({"/w/said", "/w/length"}, set())),
        (["--whitelist", "/w/age|/w/said", "--blacklist", ""], ({"/w/age", "/w/said"}, set())),
        (["--whitelist", ""], (set(), set())),
    ]
    for options, topics in cases:
        result = daemon.ctl("runner", "set", *options)
        assert (result.returncode, result.stderr) == (0, "")

        def as_wanted(wanted: tuple[set[str], set[str]] = topics) -> bool:
            return mapped() == wanted

        wait_for(as_wanted, f"{topics} after {options}")
    status = client.get_status("rt_runner").runners[0]
    assert status.state == runner_pb2.RUNNER_STATE_RUNNING


def test_messages_of_variable_size_flow_both_ways_up_to_the_limit(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = ros_daemon
    client.set_runner(runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="/v/.*")))
    client.load(
        rtcf.component("rtcf_test_ros", "Text", name="text", ns="/v", parameters=["size:=3000"])
    )
    client.start()
    listener = master.node("sizes", "/v/said")
    listener.wait_for_values(10)
    assert set(listener.values()) == {3000.0}
    sender = master.node("text", "/v/heard", "5000")
    wait_for(lambda: port_value(client, "/v/text", "length") == 5000, "the message")
    assert port_value(client, "/v/text", "age") >= 0
    sender.end()
    assert ros(client).too_large == 0

    # Larger than the limit: counted and reported once, in both directions.
    daemon.ctl("runner", "set", "--largest-message", "1")
    wait_for(lambda: ros(client).too_large > 20, "messages that are too large")
    wait_for(lambda: "/v/said: " in daemon.log(), "the report")
    assert "messages larger than 1 KiB not published" in daemon.log()
    sender = master.node("text", "/v/heard", "5001")
    wait_for(lambda: "/v/heard: 1 messages larger than 1 KiB not received" in daemon.log(), "it")
    assert port_value(client, "/v/text", "length") == 5000
    sender.end()
    assert "larger than 1 KiB" in daemon.ctl("status").stdout
    # Of exactly that size, and slightly smaller.
    daemon.ctl("runner", "set", "--largest-message", "1000")
    daemon.ctl("set", "/v/text", f"size:={1000 * 1024 - 4}")
    wait_for(lambda: listener.values()[-1] == 1000.0 * 1024 - 4, "the largest message")
    listener.end()


def test_the_age_of_an_input_shows_a_silent_peer(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.set_runner(runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="/a/heard")))
    client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/a"))
    client.start()
    wait_for(lambda: port_value(client, "/a/text", "age") == -1, "a cycle without a value")
    sender = master.node("text", "/a/heard", "3")
    wait_for(lambda: port_value(client, "/a/text", "length") == 3, "the message")
    sender.end()
    wait_for(lambda: port_value(client, "/a/text", "age") > 5e8, "half a second without messages")
    # A new peer's message is a new value again.
    sender = master.node("text", "/a/heard", "4")
    wait_for(lambda: port_value(client, "/a/text", "length") == 4, "the next message")
    sender.end()


def test_decimation_publishes_each_nth_value(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    daemon, client = ros_daemon
    result = daemon.ctl(
        "runner", "set", "--whitelist", "/d/.*", "--decimation", "10", "--decimate", "/d/age"
    )
    assert result.returncode == 0
    client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/d"))
    # The topics exist before the first cycle, so that all values are counted.
    wait_for(lambda: "/d/age" in master.topics()[0], "the topics")
    counter = master.node("count", "/d/age")
    counter.wait_until_connected()
    every = master.node("sizes", "/d/said")
    every.wait_until_connected()
    client.step(200)
    every.wait_for_values(200)
    counter.wait_for_values(20)
    assert len(counter.values()) == 20
    counter.end()
    every.end()


def test_a_latched_topic_sends_its_last_value_to_late_subscribers(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    settings = runner_pb2.RosSettings(whitelist="/l/.*", latch="/l/said")
    client.set_runner(runner_pb2.RunnerSettings(ros=settings))
    client.load(
        rtcf.component("rtcf_test_ros", "Text", name="text", ns="/l", parameters=["size:=17"])
    )
    wait_for(lambda: client.get_status("rt_runner").runners[0].ros.publications == 3, "the topics")
    client.step(1)
    listener = master.node("sizes", "/l/said")
    listener.wait_for_values(1)
    assert listener.values() == [17.0]
    listener.end()


def test_values_latched_before_the_master_starts_are_sent(tmp_path: Path) -> None:
    master = Master(tmp_path)
    daemon = Daemon(tmp_path, with_ros(master.uri, "/l/.*") + "latch = '/l/said'\n")
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.load(
                rtcf.component(
                    "rtcf_test_ros", "Text", name="text", ns="/l", parameters=["size:=17"]
                )
            )
            wait_for(lambda: "no ROS master" in ros(client).problem, "the node to look for one")
            client.step(1)
            master.start()
            listener = master.node("sizes", "/l/said")
            listener.wait_for_values(1)
            assert listener.values() == [17.0]
            listener.end()
    finally:
        daemon.end()
        master.end()


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--decimation", "0", ["decimation of 0", "1 to 1000000"]),
        ("--largest-message", "65537", ["largest message of 65537", "65536 KiB"]),
        ("--latch", "(a", ["latch", "'(a'"]),
        ("--decimate", "(a", ["decimate", "'(a'"]),
        ("--stamped", "(a", ["stamped", "'(a'"]),
        ("--namespace", "/a b", ["namespace", "/a b"]),
    ],
)
def test_settings_of_topics_are_checked(
    daemon: Daemon, option: str, value: str, words: list[str]
) -> None:
    result = daemon.ctl("runner", "set", option, value)
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert all(word in line for word in words), line


def test_twenty_topics_at_2_khz_lose_nothing(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.set_runner(
        runner_pb2.RunnerSettings(
            frequency_hz=2000.0, ros=runner_pb2.RosSettings(whitelist="/many/.*/out", queue=1000)
        )
    )
    for index in range(20):
        client.load(
            rtcf.component(
                "rtcf_test", "Counter", name=f"c{index}", ns="/many", remaps=["out:=~out"]
            )
        )
    topics = [f"/many/c{index}/out" for index in range(20)]
    wait_for(lambda: set(topics) <= master.topics()[0], "the topics")
    subscribers = master.node("any", *topics)
    subscribers.wait_until_connected()
    client.start()

    def lost_in_6000_cycles() -> int:
        before, begin = client.get_statistics().tap_dropped, iteration(client)
        wait_for(lambda: iteration(client) > begin + 6000, "6000 cycles")
        return int(client.get_statistics().tap_dropped - before)

    # The node buffers half a second of messages. If the machine delays it longer, it tries again;
    # a node that is too slow loses messages each time.
    assert any(lost_in_6000_cycles() == 0 for _ in range(10))
    client.stop()
    subscribers.end()


def test_topics_flow_while_others_are_unregistered(tmp_path: Path, master: Master) -> None:
    way = HoldingMaster(master.port)
    daemon = Daemon(tmp_path, with_ros(way.uri, "/stays/.*|/goes/.*"))
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            client.set_runner(runner_pb2.RunnerSettings(frequency_hz=200.0))
            client.load(rtcf.component("rtcf_test", "Counter", name="counter", ns="/stays"))
            client.start()
            listener = master.node("numbers", "/stays/out")
            listener.wait_for_values(1)
            # The node waits a second for an answer. If the machine is too busy for a look in that
            # time, it tries again. If topics wait, too, no look ever sees them flow.
            assert any(_flows_during_an_unload(client, master, way, listener) for _ in range(10))
            listener.end()
    finally:
        way.close()
        daemon.end()


def _flows_during_an_unload(
    client: rtcf.Client, master: Master, way: HoldingMaster, listener: Node
) -> bool:
    client.load(rtcf.component("rtcf_test", "Counter", name="counter", ns="/goes"))
    wait_for(lambda: "/goes/out" in master.topics()[0], "the topic")
    way.hold()
    client.unload(["/goes/counter"])
    wait_for(lambda: way.holding, "the withdrawal")
    # A cycle's value is its number, so a greater value was received after this point.
    begin = iteration(client)

    def flows() -> bool:
        # In this order: the value has arrived, and the unregistering call is still unanswered.
        return listener.values()[-1] > begin and way.holding

    wait_for(lambda: flows() or not way.holding, "a value, or the end of the wait for the master")
    seen = flows()
    way.let_go()
    wait_for(lambda: "/goes/out" not in master.topics()[0], "the end of the topic")
    return seen


def test_a_stop_whose_node_has_ended_stops(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.set_runner(runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="/es/stop1")))
    client.load(rtcf.component("rtcf_control", "EStop", name="stop", ns="/es",
                               parameters=["start_stopped:=false"]))  # fmt: skip
    button = master.node("released", "/es/stop1")
    button.wait_until_connected()

    def value(port: str) -> str:
        found = {each.name: str(each.value) for each in client.get_component("/es/stop").ports}
        return found[port]

    wait_for(lambda: value("stop1") == "data: 0", "the released button")
    client.write("/es/stop.in", "1.0")
    client.start()
    wait_for(lambda: iteration(client) > 100, "some cycles")
    assert (value("out"), value("state")) == ("data: 1", "data: 0")
    button.kill()
    wait_for(lambda: value("state") == "data: 1", "the stop")
