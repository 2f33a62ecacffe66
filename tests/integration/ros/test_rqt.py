"""The wire-level actions of rqt_console, rqt_logger_level, rqt_reconfigure and rqt_graph.

rqt itself is not in Debian 12; the modules by which it queries nodes are.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from ros_processes import Master, Node
from rtcf.v1 import runner_pb2

_WARN = 4


@pytest.fixture
def loop(tmp_path: Path, master: Master) -> Iterator[tuple[Daemon, rtcf.Client, str]]:
    """Yield a daemon, its client and the name of its node; the loop logs, reads and is tunable."""
    daemon = Daemon(tmp_path, with_ros(master.uri, "/t/.*"))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=50.0))
        client.load(rtcf.component("rtcf_test_ros", "Text", name="text", ns="/t"))
        client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", ns="/k"))
        node = client.get_status("rt_runner").runners[0].ros.node
        services = {"/k/knobs/set_parameters", "/t/text/set_parameters"}
        wait_for(lambda: services <= master.services(), "the services")
        yield daemon, client, node
    daemon.end()


def lines(peer: Node, key: str) -> list[Any]:
    """Return the values that a peer has printed under a key."""
    return [record[key] for record in peer.records() if key in record]


def test_rqt_graph_sees_nodes_and_topics(
    loop: tuple[Daemon, rtcf.Client, str], master: Master
) -> None:
    _, _, node = loop
    listener, sender = master.node("sizes", "/t/said"), master.node("text", "/t/heard", "5")
    listener.wait_until_connected()
    sender.wait_until_connected()
    drawing = master.node("graph")
    (drawn,) = wait_for(lambda: lines(drawing, "edges"), "the graph")
    assert lines(drawing, "bad") == [[]]
    edges = {(start, topic, end) for start, topic, end in drawn}
    assert [edge for edge in edges if edge[0] == node and edge[1] == "/t/said"]
    assert [edge for edge in edges if edge[2] == node and edge[1] == "/t/heard"]
    listener.end()
    sender.end()


def test_rqt_reconfigure_shows_and_changes_parameters(
    loop: tuple[Daemon, rtcf.Client, str], master: Master
) -> None:
    daemon, _, _ = loop
    peer = master.node("tune", "/k/knobs", '{"rate": 2.5, "mode": "run"}')

    def shows(**wanted: Any) -> bool:
        values = lines(peer, "values")
        return bool(values) and {name: values[-1][name] for name in wanted} == wanted

    wait_for(lambda: shows(rate=2.5, mode="run"), "the change to be shown")
    assert lines(peer, "found") == [["/k/knobs", "/t/text"]]
    assert wait_for(lambda: lines(peer, "described"), "the description")[0] == {
        "enabled": "bool", "count": "int", "rate": "double", "label": "str", "mode": "str",
    }  # fmt: skip
    # Changes by other clients appear in its window.
    daemon.ctl("set", "/k/knobs", "rate:=7", "count:=3")
    wait_for(lambda: shows(rate=7.0, count=3), "another's change to be shown")
    peer.end()


def test_rqt_console_and_rqt_logger_level_work_together(
    loop: tuple[Daemon, rtcf.Client, str], master: Master
) -> None:
    _, client, node = loop
    console = master.node("console", "/s")
    console.wait_until_connected()
    # rosout, which forwards the records.
    wait_for(lambda: "/rosout" in master.listeners(node, "/rosout"), "rosout's connection")
    client.load(rtcf.component("rtcf_test_ros", "Speaker", name="s"))
    client.start()
    wait_for(lambda: _WARN in lines(console, "level"), "a warning out of the cycle")
    assert "each cycle" not in lines(console, "msg")
    # It lists the nodes with these services, and their loggers.
    assert f"{node}/set_logger_level" in master.run("rosservice", "list", "-n").split()
    loggers = master.call(f"{node}/get_loggers")["loggers"]
    assert {"name": "ros.rtcf.s", "level": "info"} in loggers
    master.call(f"{node}/set_logger_level", "{logger: ros.rtcf.s, level: debug}")
    wait_for(lambda: "each cycle" in lines(console, "msg"), "the debug record")
    console.end()
