"""Messages from before a start or a subscription are values, and no commands."""

import math

import rtcf
from daemon_process import Daemon, wait_for
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration, port_value, wait_until_after


def _map(client: rtcf.Client, whitelist: str) -> None:
    ros = runner_pb2.RosSettings(whitelist=whitelist)
    client.set_runner(runner_pb2.RunnerSettings(ros=ros))


def _run_on(client: rtcf.Client) -> None:
    wait_until_after(client, iteration(client) + 20)


def test_a_velocity_from_before_the_start_is_not_followed(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.load(
        rtcf.component(
            "rtcf_control", "CommandTimeout", name="ct", ns="/a", remaps=["in:=/velocity"],
            parameters=["timeout:=1000"],
        )
    )  # fmt: skip
    _map(client, "/velocity")
    early = master.node("latch", "/velocity", "3.0")
    wait_for(lambda: port_value(client, "/a/ct", "in") == 3.0, "the message")
    client.start()
    _run_on(client)
    assert port_value(client, "/a/ct", "in") == 3.0
    assert port_value(client, "/a/ct", "out") == 0.0
    early.end()
    late = master.node("latch", "/velocity", "4.0")
    wait_for(lambda: port_value(client, "/a/ct", "out") == 4.0, "the new command")
    late.end()


def test_a_message_latched_before_the_subscription_is_old(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    # Identity passes on new values only.
    client.load(rtcf.component("rtcf_examples", "Identity", name="id", remaps=["in:=/chart"]))
    client.start()
    early = master.node("latch", "/chart", "7.0")
    wait_for(lambda: "/chart" in master.topics()[0], "the publisher")
    for _ in range(2):  # also when it is subscribed anew
        _map(client, "/chart")
        wait_for(lambda: port_value(client, "/id", "in") == 7.0, "the message")
        _run_on(client)
        assert math.isnan(port_value(client, "/id", "out"))
        _map(client, "")
        wait_for(lambda: "/chart" not in master.topics()[1], "the end of the subscription")
    _map(client, "/chart")
    late = master.node("latch", "/chart", "8.0")
    wait_for(lambda: port_value(client, "/id", "out") == 8.0, "a message of a new publisher")
    early.end()
    late.end()


def test_a_heartbeat_from_before_the_start_is_no_beat(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(
            rtcf.component("rtcf_control", "Heartbeat", name="hb", parameters=["timeout:=1000"])
        )
        client.write("hb.beat", 5)
        client.start()
        _run_on(client)
        assert port_value(client, "hb", "stopped") == 1.0
        client.write("hb.beat", 6)
        wait_for(lambda: port_value(client, "hb", "stopped") == 0.0, "the beat")
