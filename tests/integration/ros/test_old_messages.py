"""Messages from before a start or a subscription are values, and no commands."""

import math
import os
import signal
import time

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


def test_a_latched_message_that_comes_again_by_a_new_connection_is_old(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.load(rtcf.component("rtcf_examples", "Identity", name="id", remaps=["in:=/chart"]))
    client.start()
    _map(client, "/chart")
    first = master.node("told", "/chart")
    first.wait_until_connected()
    first.tell("7.0")
    wait_for(lambda: port_value(client, "/id", "out") == 7.0, "the message")
    other = master.node("latch", "/chart", "8.0")
    wait_for(lambda: port_value(client, "/id", "out") == 8.0, "a message of another node")
    first.tell("drop")
    wait_for(lambda: port_value(client, "/id", "in") == 7.0, "the first message again")
    _run_on(client)
    assert port_value(client, "/id", "out") == 8.0
    first.tell("9.0")
    wait_for(lambda: port_value(client, "/id", "out") == 9.0, "a new message of the first node")
    first.end()
    other.end()


def test_the_first_message_of_a_latching_node_is_new_long_after_the_subscription(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.load(rtcf.component("rtcf_examples", "Identity", name="id", remaps=["in:=/chart"]))
    client.start()
    silent = master.node("told", "/chart")
    wait_for(lambda: "/chart" in master.topics()[0], "the publisher")
    _map(client, "/chart")
    silent.wait_until_connected()
    time.sleep(2.5)  # longer than a latched message takes
    silent.tell("7.0")
    wait_for(lambda: port_value(client, "/id", "out") == 7.0, "the first message")
    silent.end()


def test_a_latched_message_of_a_node_that_answers_late_is_old(
    ros_daemon: tuple[Daemon, rtcf.Client], master: Master
) -> None:
    _, client = ros_daemon
    client.load(rtcf.component("rtcf_examples", "Identity", name="id", remaps=["in:=/chart"]))
    client.start()
    early = master.node("latch", "/chart", "7.0")
    wait_for(lambda: "/chart" in master.topics()[0], "the publisher")
    os.kill(early.pid, signal.SIGSTOP)
    try:
        _map(client, "/chart")
        wait_for(lambda: "/chart" in master.topics()[1], "the subscription")
        time.sleep(3.0)
    finally:
        os.kill(early.pid, signal.SIGCONT)
    wait_for(lambda: port_value(client, "/id", "in") == 7.0, "the message")
    _run_on(client)
    assert math.isnan(port_value(client, "/id", "out"))
    early.end()
