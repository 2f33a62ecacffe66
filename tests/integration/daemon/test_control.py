"""The client library: graphs, errors, crashes, restarts, several runners; without ROS."""

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import DEADLINE_S, Daemon, wait_for, wait_until_it_is
from fig_1 import mimo
from rtcf.v1 import graph_pb2, runner_pb2
from values import iteration, state


def test_fig_1_runs_in_its_order(client: rtcf.Client) -> None:
    fig_1.load(client)
    assert client.get_order() == fig_1.ORDER
    client.start()
    wait_for(lambda: iteration(client) > 100, "100 cycles")
    statistics = client.get_statistics()
    assert [each.component for each in statistics.components] == fig_1.ORDER
    assert statistics.duration.count > 0
    ports = {port.name: port for port in client.get_component("R3").ports}
    assert ports["out1"].mapped_name == "/R3_G2H1"
    assert ports["out1"].HasField("value")
    client.stop()
    assert client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_STOPPED


def test_a_loop_that_is_stopped_during_a_replacement_is_reported_as_stopped(
    client: rtcf.Client, tmp_path: Path
) -> None:
    file = tmp_path / "plugged in"
    client.load(mimo("A", {}))
    client.start()
    slow = rtcf.component(
        "rtcf_test", "ConfiguresOnceThereIs", name="A", parameters=[f"file:={file}"]
    )
    with ThreadPoolExecutor() as pool:
        began = threading.Event()

        def said(line: str) -> None:
            if "configur" in line:
                began.set()

        replacing = pool.submit(client.replace, "A", slow, on_progress=said)
        try:
            assert began.wait(DEADLINE_S)
            stopping = pool.submit(client.stop)
            wait_until_it_is(
                runner_pb2.RUNNER_STATE_STOPPED, lambda: state(client).state, "the state"
            )
            assert not replacing.done()
        finally:
            file.touch()
        stopping.result()
        replacing.exception()
    assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED


def test_a_cycle_is_refused_with_the_command_that_breaks_it(client: rtcf.Client) -> None:
    client.load(mimo("A", {"in1": "/b", "out1": "/a"}))
    with pytest.raises(rtcf.RefusedError, match=r"rtcfctl break") as refused:
        client.load(mimo("B", {"in1": "/a", "out1": "/b"}))
    assert refused.value.code == "FAILED_PRECONDITION"
    assert "/A.in1" in str(refused.value)
    assert client.get_order() == ["/A"]
    client.set_breaks([rtcf.parse_port("A.in1")], True)
    client.load(mimo("B", {"in1": "/a", "out1": "/b"}))
    assert client.get_order() == ["/A", "/B"]


@pytest.mark.parametrize(
    ("spec", "code", "text"),
    [
        (mimo("A", {}), "ALREADY_EXISTS", "/A"),
        (
            mimo("B", {"in1": "/A/out1", "out1": "/A/out1"}),
            "FAILED_PRECONDITION",
            r"/A\.out1.*/B\.out1",
        ),
        (
            rtcf.component("rtcf_examples", "PaperExample", remaps=["in_port:=/A/out1"]),
            "FAILED_PRECONDITION",
            r"std_msgs/Float.*std_msgs/Float",
        ),
        (
            rtcf.component("rtcf_examples", "PaperExample", parameters=["test_param:=x"]),
            "INVALID_ARGUMENT",
            "test_param",
        ),
        (rtcf.component("rtcf_examples", "Mimo", ignore="("), "INVALID_ARGUMENT", r"\("),
    ],
    ids=["duplicate name", "second writer", "type mismatch", "bad value", "bad expression"],
)
def test_a_refused_load_changes_nothing(
    client: rtcf.Client, spec: graph_pb2.ComponentSpec, code: str, text: str
) -> None:
    client.load(mimo("A", {}))
    generation = client.get_status().runners[0].generation
    with pytest.raises(rtcf.RefusedError, match=text) as refused:
        client.load(spec)
    assert refused.value.code == code
    assert "\n" not in str(refused.value)
    assert client.get_order() == ["/A"]
    assert client.get_status().runners[0].generation == generation


def test_a_dead_executor_comes_back_with_its_graph(daemon: Daemon, client: rtcf.Client) -> None:
    fig_1.load(client)
    client.start()
    wait_for(lambda: iteration(client) > 0, "a cycle")
    os.kill(client.get_status().runners[0].pid, signal.SIGKILL)
    # The executor may be down too shortly to be observed.
    wait_for(lambda: "executor restarted in" in daemon.log(), "its recovery")
    assert "was killed by SIGKILL" in daemon.log()
    client.start()
    assert client.get_order() == fig_1.ORDER
    wait_for(lambda: iteration(client) > 100, "100 cycles")


def test_a_restart_of_rtcfd_brings_the_graph_back_held(daemon: Daemon, client: rtcf.Client) -> None:
    fig_1.load(client)
    client.start()
    pid = client.get_status().runners[0].pid
    assert daemon.end() == 0
    assert not os.path.exists(f"/proc/{pid}")
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        assert again.get_order() == fig_1.ORDER
        assert again.get_status().runners[0].state == runner_pb2.RUNNER_STATE_STOPPED


def test_runners_are_independent(client: rtcf.Client) -> None:
    client.add_runner("arm", runner_pb2.RunnerSettings(frequency_hz=100.0))
    fig_1.load(client)
    client.load(mimo("H1", {}), "arm")
    client.start()
    client.start("arm")
    os.kill(client.get_status("arm").runners[0].pid, signal.SIGKILL)
    # It is down, and soon restarts without running.
    wait_for(
        lambda: client.get_status("arm").runners[0].state != runner_pb2.RUNNER_STATE_RUNNING,
        "its end",
    )
    before = client.get_status("rt_runner").runners[0]
    assert before.state == runner_pb2.RUNNER_STATE_RUNNING
    wait_for(
        lambda: client.get_status("rt_runner").runners[0].iteration > before.iteration, "a cycle"
    )
