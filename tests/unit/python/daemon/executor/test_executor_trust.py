"""Trust in executors: verification of their identity, and attribution of their changes."""

import asyncio
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import wait_for
from daemon_under_test import DaemonUnderTest
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2
from rtcfd.access.calls import Level
from rtcfd.runners import ros_services
from rtcfd_in_process import Rtcfd, called_by, spec, until


def test_a_foreign_process_at_an_executors_socket_is_rejected(
    stopped_daemon: DaemonUnderTest,
) -> None:
    real = stopped_daemon.executor.with_name("real")
    stopped_daemon.executor.rename(real)
    pid_file = stopped_daemon.folder / "pid"
    # Another process, in another session, serves the socket; the started one does not.
    stopped_daemon.executor.write_text(
        f'#!/bin/sh\n[ "$1" = --describe ] && exec {real} "$@"\n'
        f'setsid sh -c \'echo $$ > {pid_file}; exec {real} "$@"\' sh "$@" &\n'
        "exec sleep 60\n"
    )
    stopped_daemon.executor.chmod(0o755)
    daemon = stopped_daemon.start()
    wait_for(pid_file.exists, "the other user's process")
    try:
        refused = pytest.raises(rtcf.RefusedError, match="which is not the executor of rt_runner")
        with daemon.client() as client, refused:
            client.start()
    finally:
        os.kill(int(pid_file.read_text()), signal.SIGKILL)


def test_an_executor_of_another_runner_is_rejected(
    stopped_daemon: DaemonUnderTest,
) -> None:
    real = stopped_daemon.executor.with_name("real")
    stopped_daemon.executor.rename(real)
    stopped_daemon.executor.write_text(
        f'#!/bin/sh\n[ "$1" = --runner ] && {{ shift 2; exec {real} --runner other "$@"; }}\n'
        f'exec {real} "$@"\n'
    )
    stopped_daemon.executor.chmod(0o755)
    daemon = stopped_daemon.start()
    refused = pytest.raises(rtcf.RefusedError, match='served by the executor of runner "other"')
    with daemon.client() as client, refused:
        client.start()


def test_the_log_names_the_user_of_a_parameter_change(daemon: DaemonUnderTest) -> None:
    with daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="x"))
        client.set_parameters("x", [rtcf.parse_parameter("kp:=2.5")])
    wait_for(lambda: "/x: kp = 2.5 set by root" in daemon.log(), "the log")


async def started_by_alice(rtcfd: Rtcfd) -> Peer:
    """Return an executor started by a call of alice; ROS peers have all rights over it."""
    rtcfd.runners._shared.serve_ros = ros_services.serve
    await rtcfd.start()
    restart = control_pb2.RestartRunnerRequest(runner="rt_runner")
    await called_by("alice", rtcfd.call("RestartRunner", restart))
    rtcfd.runners.get("rt_runner").desired.chosen.ros.peers = Level.ADMIN.right
    peer = rtcfd.peer("rt_runner")
    assert peer is not None
    return peer


async def ros_calls(peer: Peer, call: wire.ServiceCall) -> wire.ServiceAnswer:
    """Call a service of the executor's node."""
    answered: asyncio.Future[wire.ServiceAnswer] = asyncio.get_running_loop().create_future()

    async def service_answer(answer: wire.ServiceAnswer, _: int) -> wire.Response:
        answered.set_result(answer)
        return wire.Response(done=wire.Done())

    peer.service_answer = service_answer  # type: ignore[attr-defined]
    peer.send(wire.Response(service_call=call))
    return await answered


def test_a_fault_is_not_attributed_to_the_user_who_started_the_executor(
    rtcfd: Callable[[], Rtcfd],
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        peer = await started_by_alice(daemon)
        events = daemon.runners._shared.events
        begin = events.last
        event = wire.Event(kind=wire.Event.KIND_LOOP_ENDED, message="Pid.update threw")
        peer.send(wire.Response(event=event))

        def told() -> list[control_pb2.Event]:
            return [each for each in events.after(begin, 100)[0] if each.message == event.message]

        for found in await until(told, "the event"):
            assert not found.user
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_ros_can_start_a_loop_after_a_stop(
    rtcfd: Callable[[], Rtcfd],
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        peer = await started_by_alice(daemon)
        stop = wire.DirectStop(count=1, at_ns=time.monotonic_ns(), uid=0, pid=1)
        peer.send(wire.Response(direct_stop=stop))
        answer = await ros_calls(peer, wire.ServiceCall(call=1, start=wire.Start()))
        assert answer.success, answer.message
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_a_load_by_ros_is_not_attributed_to_the_user_who_started_the_executor(
    rtcfd: Callable[[], Rtcfd],
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        peer = await started_by_alice(daemon)
        component = spec("x")
        component.parameters.append(rtcf.parse_parameter("kp:=7.0"))
        answer = await ros_calls(peer, wire.ServiceCall(call=1, load=component))
        assert answer.success, answer.message
        (change,) = daemon.runners.get("rt_runner").desired.history.of("/x")
        assert change.who == "rtcfd"
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_parameter_changes_by_ros_are_recorded_together(
    rtcfd: Callable[[], Rtcfd], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held = tmp_path / "held"
    held.mkdir()
    monkeypatch.setenv("PEER_HELD", str(held))
    names = [f"/x{number}" for number in range(10)]

    async def play() -> int:
        daemon = rtcfd()
        peer = await started_by_alice(daemon)
        for name in ["before", *(name.lstrip("/") for name in names)]:
            load = control_pb2.LoadRequest(runner="rt_runner", component=spec(name))
            await called_by("alice", daemon.call("Load", load))
        saved: list[str] = []
        save = daemon.store.save

        def counted(name: str, *state: Any) -> None:
            saved.append(name)
            save(name, *state)

        monkeypatch.setattr(daemon.store, "save", counted)
        # Many changes through ROS arrive while another change runs.
        (held / "set_parameters").touch()
        parameters = [rtcf.parse_parameter("kp:=2.0")]
        change = control_pb2.SetParametersRequest(
            runner="rt_runner", component="/before", parameters=parameters
        )
        under_way = asyncio.create_task(called_by("alice", daemon.call("SetParameters", change)))
        await until((held / "set_parameters waits").exists, "the change")
        for name in names:
            peer.live[name] = {"kp": rtcf.parse_parameter("kp:=3.0").value}
            changed = wire.ParametersChanged(component=name, parameters=["kp"])
            peer.send(wire.Response(parameters_changed=changed))
        events = daemon.runners._shared.events
        begin = events.last
        last = wire.Event(kind=wire.Event.KIND_LOOP_ENDED, message="all of them are told")
        peer.send(wire.Response(event=last))
        await until(
            lambda: [each for each in events.after(begin, 100)[0] if each.message == last.message],
            "the last word",
        )
        (held / "set_parameters").unlink()
        await under_way
        history = daemon.runners.get("rt_runner").desired.history
        await until(lambda: all(history.of(name) for name in names), "the notes")
        for name in names:
            (noted,) = history.of(name)
            assert (noted.parameter, noted.how) == ("kp", "dynamic_reconfigure")
        # Queued behind all of them.
        await called_by("alice", daemon.call("SetParameters", change))
        count = len(saved)
        await daemon.runners.close(in_order=True)
        return count

    # Saves for the changes before and after and for the loop's end; one for all ROS changes.
    assert asyncio.run(play()) <= 4
