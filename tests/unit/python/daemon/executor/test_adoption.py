"""Executors outlive rtcfd; its successor adopts them."""

import asyncio
import json
import os
import signal
import socket
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import rtcf
from daemon_process import is_gone, wait_for
from daemon_under_test import DaemonUnderTest
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from rtcfd import VERSION
from rtcfd.common.runner_settings import defaults
from rtcfd.executor.link import PORTS_PROTOCOL, PROTOCOL
from rtcfd.recovery.follow import follow_components, follow_settings
from rtcfd.state.desired import Desired
from rtcfd_in_process import Rtcfd, SlowPeer, until

LONG = runner_pb2.RunnerSettings(orphan_timeout_s=60.0)


@pytest.fixture
def left(daemon: DaemonUnderTest, client: rtcf.Client) -> int:
    """Run a loop with two components, and kill its rtcfd; return the executor's pid."""
    client.set_runner(LONG)
    client.load(rtcf.component("demo", "Fine", name="a", parameters=["kp:=2.0"]))
    client.load(rtcf.component("demo", "Fine", name="b"))
    client.start()
    pid = daemon.executor_pid()
    daemon.end(signal.SIGKILL)
    return pid


def test_a_loop_continues_when_rtcfd_dies_and_is_adopted(
    daemon: DaemonUnderTest, left: int
) -> None:
    assert not is_gone(left)
    daemon.start()
    assert daemon.executor_pid() == left
    assert "adopted: loop running, iteration " in daemon.log()
    assert "the executor's is kept" not in daemon.log()
    with daemon.client() as client:
        status = client.get_status().runners[0]
        assert (status.state, status.status) == (runner_pb2.RUNNER_STATE_RUNNING, "")
        assert client.get_order() == ["/a", "/b"]
        client.load(rtcf.component("demo", "Fine", name="c"))
    assert daemon.end() == 0
    # Not our child: its parent reaps it at any time.
    wait_for(lambda: is_gone(left), "its end")


def test_the_executors_graph_replaces_the_saved_one(daemon: DaemonUnderTest, left: int) -> None:
    saved = daemon.saved()
    saved["components"] = [each for each in saved["components"] if each["name"] == "a"]
    saved["components"][0]["parameters"] = []
    saved["settings"] = {"frequency_hz": 500.0}
    saved["running"] = False
    (daemon.state / "rt_runner.json").write_text(json.dumps(saved))
    daemon.start()
    log = daemon.log()
    assert "/b was not in the saved graph: the executor's is kept" in log
    assert "/a differs from the saved graph: parameter kp: the executor's is kept" in log
    assert "frequency_hz 500 -> 1000: the executor's is kept" in log
    after = daemon.saved()
    assert [each["name"] for each in after["components"]] == ["a", "b"]
    assert after["components"][0]["parameters"][0]["value"] == {"double_value": 2.0}
    assert after["settings"]["frequency_hz"] == 1000.0
    assert after["running"] is True


def test_left_out_components_stay_out_of_the_loop_but_in_the_state(
    daemon: DaemonUnderTest, left: int
) -> None:
    saved = daemon.saved()
    saved["components"].append({**saved["components"][0], "name": "x"})
    saved["left_out"]["/x"] = "no such library"
    (daemon.state / "rt_runner.json").write_text(json.dumps(saved))
    daemon.start()
    with daemon.client() as client:
        assert client.get_order() == ["/a", "/b"]
        assert "/x is left out: no such library" in client.get_status().runners[0].status
        (x,) = [each for each in client.list_components() if each.full_name == "/x"]
        assert x.state == graph_pb2.COMPONENT_STATE_LEFT_OUT
        client.release(["x"])
        assert client.get_order() == ["/a", "/b", "/x"]
        with pytest.raises(rtcf.RefusedError, match="/x is not left out"):
            client.release(["x"])


def test_an_interrupted_restore_is_completed(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    client.set_runner(LONG)
    client.load(rtcf.component("demo", "Fine", name="a"))
    daemon.end(signal.SIGKILL)
    saved = daemon.saved()
    saved["components"].append({**saved["components"][0], "name": "x"})
    (daemon.state / "rt_runner.json").write_text(json.dumps(saved))
    daemon.start()
    with daemon.client() as again:
        assert again.get_order() == ["/a", "/x"]


def test_a_change_whose_save_was_lost_is_followed_as_a_whole(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.set_runner(LONG)
    client.load(rtcf.component("demo", "Fine", name="old"))
    before = (daemon.state / "rt_runner.json").read_text()
    client.replace("old", rtcf.component("demo", "Fine", name="new"))
    daemon.end(signal.SIGKILL)
    (daemon.state / "rt_runner.json").write_text(before)
    daemon.start()
    with daemon.client() as again:
        assert again.get_order() == ["/new"]
        assert [each.full_name for each in again.list_components()] == ["/new"]
    assert [each["name"] for each in daemon.saved()["components"]] == ["new"]


def test_a_runner_missing_in_the_state_is_adopted(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    client.add_runner("arm", LONG)
    pid = daemon.executor_pid("arm")
    daemon.end(signal.SIGKILL)
    (daemon.state / "arm.json").unlink()
    daemon.start()
    assert daemon.executor_pid("arm") == pid
    assert "runner arm was not in the saved state" in daemon.log()
    assert (daemon.state / "arm.json").exists()


def test_the_death_of_an_adopted_executor_is_noticed(daemon: DaemonUnderTest, left: int) -> None:
    daemon.start()
    os.kill(left, signal.SIGKILL)
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    assert "with unknown exit status" in daemon.log()
    with daemon.client() as client:
        status = client.get_status().runners[0]
        assert status.pid != left
        assert status.state == runner_pb2.RUNNER_STATE_FAULTED
        assert client.get_order() == ["/a", "/b"]


def test_a_dead_socket_is_removed(daemon: DaemonUnderTest, left: int) -> None:
    os.kill(left, signal.SIGKILL)
    wait_for(lambda: is_gone(left), "its end")
    stale = Path(f"{daemon.socket}.d/executors/old.sock")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(stale))
    daemon.start()
    assert not stale.exists()
    with daemon.client() as client:
        assert [runner.runner for runner in client.get_status().runners] == ["rt_runner"]
        assert client.get_order() == ["/a", "/b"]


@pytest.mark.parametrize("distance", [-1, 1])
def test_an_executor_of_a_neighbouring_protocol_is_adopted(
    stopped_daemon: DaemonUnderTest, distance: int
) -> None:
    stopped_daemon.environment = {
        "PEER_PROTOCOL": str(PROTOCOL + distance), "PEER_VERSION": "0.0.9",
    }  # fmt: skip
    pid = loop_left_behind(stopped_daemon)
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        status = client.get_status().runners[0]
        assert (status.pid, status.state) == (pid, runner_pb2.RUNNER_STATE_RUNNING)
        assert status.version == "0.0.9"
        assert status.status == (
            f"restart pending: its executor is of rtcf 0.0.9, rtcfd {VERSION}; "
            "`rtcfctl runner restart rt_runner` stops the loop and starts a new one"
        )
        client.load(rtcf.component("demo", "Fine", name="b"))
        assert client.get_order() == ["/a", "/b"]


def test_an_executor_without_value_streams_is_not_asked_for_values(
    stopped_daemon: DaemonUnderTest,
) -> None:
    stopped_daemon.environment = {
        "PEER_PROTOCOL": str(PORTS_PROTOCOL - 1), "PEER_VERSION": "0.0.9",
    }  # fmt: skip
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        with pytest.raises(rtcf.RefusedError) as refused:
            client.watch_ports()
        assert "is of rtcf 0.0.9, which sends no values of ports" in str(refused.value)
        assert client.get_status().runners[0].pid


@pytest.mark.parametrize("number", [PROTOCOL - 2, PROTOCOL + 2])
def test_an_executor_of_a_foreign_protocol_is_left_running_and_can_be_replaced(
    stopped_daemon: DaemonUnderTest, number: int
) -> None:
    stopped_daemon.environment = {"PEER_LATER_PROTOCOL": str(number), "PEER_VERSION": "7.8"}
    pid = loop_left_behind(stopped_daemon)
    stopped_daemon.environment = {}
    stopped_daemon.start()
    error = (
        f"executor of rt_runner (pid {pid}) is of rtcf 7.8 and speaks protocol {number}, which "
        f"rtcfd {VERSION} with protocol {PROTOCOL} does not: its loop goes on as it is; "
        "`rtcfctl -r rt_runner stop` ends it, "
        "`rtcfctl runner restart rt_runner` starts one of this version"
    )
    assert error in stopped_daemon.log()
    with stopped_daemon.client() as client:
        status = client.get_status().runners[0]
        assert status.pid == pid
        assert status.status == error
        with pytest.raises(rtcf.RefusedError, match="speaks protocol"):
            client.start()
        with pytest.raises(rtcf.RefusedError, match="speaks protocol"):
            client.load(rtcf.component("demo", "Fine"))
        assert not is_gone(pid)
        client.stop()
        assert not is_gone(pid)
        client.restart_runner("rt_runner")
        assert client.get_order() == ["/a"]
        status = client.get_status().runners[0]
        assert status.pid != pid
        assert (status.version, status.status) == (VERSION, "")
        wait_for(lambda: is_gone(pid), "its end")


def loop_left_behind(daemon: DaemonUnderTest) -> int:
    """Leave a loop with one component behind by killing its rtcfd; return its executor's pid."""
    daemon.start()
    with daemon.client() as client:
        client.set_runner(LONG)
        client.load(rtcf.component("demo", "Fine", name="a"))
        client.start()
    pid = daemon.executor_pid()
    daemon.end(signal.SIGKILL)
    return pid


def test_a_private_rtcfd_ends_its_executors(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    status = client.get_status().runners[0]
    assert status.settings.orphan_timeout_s == 2.0
    daemon.end(signal.SIGKILL)
    wait_for(lambda: is_gone(status.pid), "its end")


def test_only_differing_settings_are_sent() -> None:
    known = defaults(runner_pb2.REALTIME_PREFERRED)
    desired = Desired("r")
    desired.choose(runner_pb2.RunnerSettings(priority=50))
    found = runner_pb2.RunnerSettings()
    found.CopyFrom(desired.complete(known))
    found.frequency_hz += 1e-10
    found.spin_auto, found.spin_us = True, 7
    found.ros.whitelist = "/a"
    assert follow_settings(desired, known, found) == [
        "ros.whitelist '' -> /a",
        "spin_auto false -> true",
    ]
    assert desired.chosen == runner_pb2.RunnerSettings(
        priority=50, spin_auto=True, ros=runner_pb2.RosSettings(whitelist="/a")
    )


def test_an_equal_graph_is_not_reported() -> None:
    spec = rtcf.component(
        "p", "T", name="a", parameters=["kp:=1"], breaks=["y", "x"], remaps=["b:=/b", "a:=/a"]
    )
    desired = Desired("r")
    desired.put("/a", spec)
    info = graph_pb2.ComponentInfo(full_name="/a", spec=desired.components["/a"])
    info.spec.every = 1
    info.spec.breaks[:] = ["x", "y"]
    info.parameters.add(
        name="kp",
        value=graph_pb2.ParameterValue(double_value=1.0),
        default_value=graph_pb2.ParameterValue(double_value=0.0),
    )
    assert follow_components(desired, [info], restored=True) == ([], {})


def test_an_unload_whose_save_was_lost_is_kept() -> None:
    desired = Desired("r")
    for name in ("gone", "absent"):
        desired.put(f"/{name}", rtcf.component("p", "T", name=name))
    desired.left_out["/absent"] = "no such library"
    lines, left_out = follow_components(desired, [], restored=True)
    assert lines == ["/gone was unloaded", "/absent is not in its loop"]
    assert left_out == {"/absent": "no such library"}
    assert list(desired.components) == ["/absent"]


def test_components_not_yet_restored_stay_desired() -> None:
    desired = Desired("r")
    desired.put("/a", rtcf.component("p", "T", name="a"))
    lines, left_out = follow_components(desired, [], restored=False)
    assert lines == ["/a is not in its loop"]
    assert left_out == {"/a": "its executor does not have it"}


def test_a_stop_during_an_adoption_is_kept(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def play() -> None:
        first, second = rtcfd(), rtcfd()
        await first.start()
        await first.call("Start", control_pb2.StartRequest())
        await first.runners.leave()
        calls: list[asyncio.Task[None]] = []
        adopted = asyncio.Event()

        async def answer(peer: SlowPeer, request: wire.Request) -> None:
            kind = request.WhichOneof("kind")
            if kind == "stop":  # it waits for a cycle boundary
                await adopted.wait()
            elif kind == "get_status" and not calls:
                stop = second.call("Stop", control_pb2.StopRequest())
                calls.append(asyncio.create_task(stop))
                runner = second.runners.get("rt_runner")
                await until(lambda: runner.loop.stops, "the stop")
            await Peer.answer(peer, request)

        monkeypatch.setattr(SlowPeer, "answer", answer)
        await second.start()
        adopted.set()
        await asyncio.gather(*calls)
        await second.call("SetRunner", control_pb2.SetRunnerRequest())  # this saves the state
        saved = second.saved("rt_runner")
        assert saved is not None and saved["running"] is False
        assert not second.runners.get("rt_runner").loop.wanted
        await second.runners.close(in_order=False)

    asyncio.run(play())


def test_a_loop_started_after_a_direct_stop_stays_desired(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = wire.DirectStop(count=1, at_ns=time.monotonic_ns(), uid=0, pid=1)
    hello = Peer.hello

    async def hello_with_stop(peer: Peer, request: wire.Hello, id_: int) -> wire.Response:
        response = await hello(peer, request, id_)
        response.hello.direct_stop.CopyFrom(stop)
        return response

    async def play() -> None:
        first, second = rtcfd(), rtcfd()
        await first.start()
        await first.call("Start", control_pb2.StartRequest())
        await first.runners.leave()
        monkeypatch.setattr(Peer, "hello", hello_with_stop)
        await second.start()
        saved = second.saved("rt_runner")
        assert saved is not None and saved["running"] is True
        assert second.runners.get("rt_runner").loop.wanted
        await second.runners.close(in_order=False)

    asyncio.run(play())
