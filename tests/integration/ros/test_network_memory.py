"""Unread data from and to ROS peers stays out of the loop's locked memory."""

import os
import signal
import socket
import struct
import xmlrpc.client
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import rosgraph
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import port_value, state, wait_until_after

MOST_LOCKED_KB = 64 * 1024


# Each peer needs a descriptor; the unit permits even more.
_MANY_DESCRIPTORS = ("prlimit", "--nofile=4096:", "--")


@pytest.fixture
def text(tmp_path: Path, master: Master) -> Iterator[rtcf.Client]:
    """Yield a client of a loop with a string of 200 kB out and one in, both on ROS."""
    daemon = Daemon(tmp_path, with_ros(master.uri, "/t/said|/t/heard"), wrapper=_MANY_DESCRIPTORS)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=100.0))
        client.load(
            rtcf.component("rtcf_test_ros", "Text", name="text", ns="/t",
                           parameters=["size:=200000"])
        )  # fmt: skip
        client.start()
        wait_for(lambda: "/t/said" in master.topics()[0], "the topic that it writes")
        wait_for(lambda: "/t/heard" in master.topics()[1], "the topic that it reads")
        yield client
    daemon.end()


def _locked_kb(client: rtcf.Client) -> int:
    status = Path(f"/proc/{state(client).pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmLck")).split()[1])


class _Subscriber:
    """A peer that subscribes a topic and then reads nothing."""

    def __init__(self, host: str, port: int, topic: str) -> None:
        self._socket = socket.create_connection((host, port), 30.0)
        fields = {"callerid": "/idle", "topic": topic, "md5sum": "*", "type": "*"}
        lines = [f"{name}={value}".encode() for name, value in fields.items()]
        header = b"".join(struct.pack("<I", len(line)) + line for line in lines)
        self._socket.sendall(struct.pack("<I", len(header)) + header)

    def wait_until_accepted(self) -> None:
        assert self._socket.recv(4)

    def close(self) -> None:
        self._socket.close()


def _address(client: rtcf.Client, master: Master, topic: str) -> tuple[str, int]:
    uri = rosgraph.Master("/test", master.uri).lookupNode(state(client).ros.node)
    node: Any = xmlrpc.client.ServerProxy(uri)
    code, _, protocol = node.requestTopic("/idle", topic, [["TCPROS"]])
    assert code == 1
    return protocol[1], protocol[2]


def _counted(client: rtcf.Client, count: int) -> bool:
    return bool(state(client).ros.too_large == count)


def test_a_message_that_is_too_large_is_counted_and_uses_no_memory(
    text: rtcf.Client, master: Master
) -> None:
    before = _locked_kb(text)
    for count in (1, 2):
        sender = master.node("text", "/t/heard", "100000000")
        wait_for(partial(_counted, text, count), "the count")
        sender.end()
    assert _locked_kb(text) <= min(before + 4096, MOST_LOCKED_KB)
    # Smaller messages still arrive.
    sender = master.node("text", "/t/heard", "5000")
    wait_for(lambda: port_value(text, "/t/text", "length") == 5000, "the message")
    sender.end()


def test_subscribers_that_read_nothing_use_no_locked_memory(
    text: rtcf.Client, master: Master
) -> None:
    before = _locked_kb(text)
    host, port = _address(text, master, "/t/said")
    peers = [_Subscriber(host, port, "/t/said") for _ in range(20)]
    for peer in peers:
        peer.wait_until_accepted()
    # More than the capacity of all queues: 20 kB per cycle for each of them.
    wait_until_after(text, state(text).iteration + 500)
    assert _locked_kb(text) <= min(before + 8192, MOST_LOCKED_KB)
    listener = master.node("sizes", "/t/said")
    listener.wait_for_values(10)
    listener.end()
    for peer in peers:
        peer.close()


def test_a_thousand_peers_use_little_locked_memory(text: rtcf.Client, master: Master) -> None:
    host, port = _address(text, master, "/t/said")
    stopped = master.node("sizes", "/t/said")
    stopped.wait_for_values(5)
    os.kill(stopped.pid, signal.SIGSTOP)
    most = 0
    with ExitStack() as peers:
        subscribers = [_Subscriber(host, port, "/t/said") for _ in range(1000)]
        for peer in subscribers:
            peers.callback(peer.close)
            peer.wait_until_accepted()
        most = max(most, _locked_kb(text))
        for count in (1, 2, 3):
            sender = master.node("text", "/t/heard", "100000000")
            wait_for(partial(_counted, text, count), "the count")
            sender.end()
            wait_until_after(text, state(text).iteration + 50)
            most = max(most, _locked_kb(text))
        print(f"\nVmLck at most {most / 1024:.1f} of {MOST_LOCKED_KB // 1024} MB")
        assert most <= MOST_LOCKED_KB
        # The loop and reading subscribers are served as before.
        listener = master.node("sizes", "/t/said")
        listener.wait_for_values(10)
        listener.end()
        os.kill(stopped.pid, signal.SIGCONT)
        stopped.wait_for_values(len(stopped.values()) + 5)
        stopped.end()
    wait_until_after(text, state(text).iteration + 100)
    assert _locked_kb(text) <= MOST_LOCKED_KB


def test_subscribers_that_read_nothing_displace_no_other(text: rtcf.Client, master: Master) -> None:
    text.stop()
    large = runner_pb2.RosSettings(largest_message_kb=1024)
    text.set_runner(runner_pb2.RunnerSettings(ros=large))
    text.set_parameters("/t/text", [rtcf.parse_parameter("size:=1000000")])
    text.start()
    host, port = _address(text, master, "/t/said")
    listener = master.node("sizes", "/t/said")
    listener.wait_for_values(5)
    with ExitStack() as peers:
        # Each of them holds a different message, until there is no room for more.
        for _ in range(250):
            peer = _Subscriber(host, port, "/t/said")
            peers.callback(peer.close)
            peer.wait_until_accepted()
            wait_until_after(text, state(text).iteration + 2)
        seen = len(listener.values())
        listener.wait_for_values(seen + 20)
        late = master.node("sizes", "/t/said")
        late.wait_for_values(10)
        late.end()
    listener.end()
    assert "slow subscribers" not in state(text).ros.problem


def test_a_peer_that_announces_a_huge_header_or_call_is_disconnected(
    text: rtcf.Client, master: Master
) -> None:
    host, port = _address(text, master, "/t/said")
    with socket.create_connection((host, port), 30.0) as peer:
        peer.sendall(struct.pack("<I", 900_000_000))
        assert peer.recv(1) == b""
    uri = rosgraph.Master("/test", master.uri).lookupNode(state(text).ros.node)
    host, port = uri.rstrip("/").rpartition("/")[2].split(":")
    with socket.create_connection((host, int(port)), 30.0) as peer:
        peer.sendall(b"POST /RPC2 HTTP/1.1\r\nContent-Length: 500000000\r\n\r\n")
        piece = bytes(1024 * 1024)
        with pytest.raises(OSError):
            for _ in range(400):
                peer.sendall(piece)
    assert _locked_kb(text) <= MOST_LOCKED_KB
    assert state(text).state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_stopped_listener_loses_the_oldest_messages_and_continues(
    text: rtcf.Client, master: Master
) -> None:
    listener = master.node("sizes", "/t/said")
    listener.wait_for_values(5)
    os.kill(listener.pid, signal.SIGSTOP)
    wait_until_after(text, state(text).iteration + 300)
    locked = _locked_kb(text)
    os.kill(listener.pid, signal.SIGCONT)
    seen = len(listener.values())
    listener.wait_for_values(seen + 20)
    assert locked <= MOST_LOCKED_KB
    listener.end()
