"""Executors that do not answer a starting rtcfd, which keeps looking for them."""

import asyncio
import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import is_gone, stopped, wait_for
from daemon_under_test import DaemonUnderTest
from peer_executor import Peer
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import control_pb2, errors_pb2, runner_pb2
from rtcfd.common.errors import Silent
from rtcfd.executor import executor, left_over, stop_socket
from rtcfd.executor.command import ExecutorCommand
from rtcfd.executor.executor import Executor, end_left_over
from rtcfd.runners import runners
from rtcfd.state.desired import Desired, RunnerLeaseTerms
from rtcfd_in_process import Refused, Rtcfd, until


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Simulate executors that do not answer twice and are gone at the third attempt; return the
    list of attempts."""
    looks: list[str] = []

    async def adopt(runner: str, *_: Any) -> None:
        looks.append(runner)
        if len(looks) < 3:
            raise Silent("it does not answer", errors_pb2.REASON_EXECUTOR_SILENT)

    monkeypatch.setattr(Executor, "adopt", adopt)
    monkeypatch.setattr(runners, "_LOOK_AGAIN_S", 0.01)
    return looks


def test_a_launchs_runner_is_removed_when_its_silent_executor_dies(
    rtcfd: Callable[[], Rtcfd], looks: list[str]
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        desired = Desired("arm")
        desired.hold = RunnerLeaseTerms(
            "token", "a launch", runner_pb2.RunnerSettings(), added=True
        )
        daemon.runners.adopt([desired])
        await daemon.runners.bring_up()
        assert [runner.name for runner in daemon.runners.all()] == ["arm"]
        await until(lambda: not daemon.runners.all(), "its removal")
        assert looks == ["arm"] * 3
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_the_silent_executor_of_an_unknown_runner_is_retried_until_it_dies(
    rtcfd: Callable[[], Rtcfd], looks: list[str]
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.runners.bring_up(["stranger"])
        assert [runner.name for runner in daemon.runners.all()] == ["stranger"]
        await until(lambda: not daemon.runners.all(), "its end")
        assert looks == ["stranger"] * 3
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


class Silence:
    """Executors that do not answer `hello` until `over` is set."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, direct_stop: wire.DirectStop | None
    ) -> None:
        self.over = asyncio.Event()
        hello = Peer.hello

        async def silent(peer: Peer, request: wire.Hello, id_: int) -> wire.Response:
            await self.over.wait()
            response = await hello(peer, request, id_)
            if direct_stop is not None:
                response.hello.direct_stop.CopyFrom(direct_stop)
            return response

        monkeypatch.setattr(Peer, "hello", silent)
        monkeypatch.setattr(executor, "QUERY_TIMEOUT_S", 0.3)
        monkeypatch.setattr(runners, "_LOOK_AGAIN_S", 0.01)


async def successor(
    rtcfd: Callable[[], Rtcfd],
    monkeypatch: pytest.MonkeyPatch,
    direct_stop: wire.DirectStop | None = None,
) -> tuple[Rtcfd, Silence]:
    """Leave a running loop to a second rtcfd, whose `hello` the executor does not answer."""
    first, second = rtcfd(), rtcfd()
    await first.start()
    await first.call("Start", control_pb2.StartRequest())
    await first.runners.leave()
    return second, Silence(monkeypatch, direct_stop)


def peer_of(daemon: Rtcfd) -> Peer:
    """Return the running executor."""
    peer = daemon.peer("rt_runner")
    assert peer is not None
    return peer


@pytest.mark.parametrize("stopped_before", [False, True])
def test_a_loop_stopped_while_its_executor_is_silent_is_stopped_at_its_adoption(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch, stopped_before: bool
) -> None:
    # An earlier direct stop, before the loop was started again, is not the one that is owed.
    before = wire.DirectStop(count=1, at_ns=time.monotonic_ns(), uid=0, pid=1)

    async def play() -> None:
        second, silence = await successor(rtcfd, monkeypatch, before if stopped_before else None)
        await second.start()
        with pytest.raises(Refused, match="its loop stops when its executor answers again"):
            await second.call("Stop", control_pb2.StopRequest())
        peer, runner = peer_of(second), second.runners.get("rt_runner")
        assert peer.running
        silence.over.set()
        await until(lambda: runner.up and not peer.running, "the stop")
        assert not runner.loop.wanted
        await until(lambda: not runner.operations.busy(), "the end of the adoption")
        assert not peer.running and not runner.loop.running and not runner.loop.wanted
        saved = second.saved("rt_runner")
        assert saved is not None and saved["running"] is False
        await second.call("Start", control_pb2.StartRequest())
        assert peer.running and runner.loop.wanted
        await second.runners.close(in_order=True)

    asyncio.run(play())


def test_a_silent_executor_can_confirm_a_stop_at_its_stop_socket(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    async def play() -> None:
        second, silence = await successor(rtcfd, monkeypatch)
        peer, shared = peer_of(second), second.runners._shared

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            assert await reader.readline() == b"stop\n"
            peer.running = False
            writer.write(b"stopped\n")
            writer.close()

        shared.command = dataclasses.replace(shared.command, stop_folder=tmp_path)
        server = await asyncio.start_unix_server(serve, tmp_path / "rt_runner")
        await second.start()
        answer = await second.call("Stop", control_pb2.StopRequest())
        (note,) = answer.result.notes
        assert note.startswith("the loop was stopped at its executor, because ")
        server.close()
        runner = second.runners.get("rt_runner")
        silence.over.set()
        await until(lambda: runner.up, "its adoption")
        assert not peer.running and not runner.loop.wanted
        await second.runners.close(in_order=True)

    asyncio.run(play())


def test_a_silent_executor_that_cannot_be_recognised_is_not_removed(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def play() -> None:
        second, silence = await successor(rtcfd, monkeypatch)
        await second.start()
        error = rf"is served by process {os.getpid()}, .* `kill -KILL {os.getpid()}`"
        with pytest.raises(Refused, match=error):
            await second.call("RemoveRunner", control_pb2.RemoveRunnerRequest(runner="rt_runner"))
        with pytest.raises(Refused, match=error):
            await second.call("RestartRunner", control_pb2.RestartRunnerRequest(runner="rt_runner"))
        runner = second.runners.get("rt_runner")
        silence.over.set()
        await until(lambda: runner.up, "its adoption")
        await second.runners.close(in_order=True)

    asyncio.run(play())


def test_the_failed_addition_of_a_runner_leaves_a_silent_executor_alone(
    rtcfd: Callable[[], Rtcfd], monkeypatch: pytest.MonkeyPatch
) -> None:
    async def play() -> None:
        second, silence = await successor(rtcfd, monkeypatch)
        with pytest.raises(Refused, match="its loop may be running"):
            await second.call("AddRunner", control_pb2.AddRunnerRequest(runner="rt_runner"))
        assert second.runners.all() == []
        assert peer_of(second).running
        silence.over.set()
        await second.machine.kill_all()

    asyncio.run(play())


@pytest.mark.parametrize(
    ("answer", "stopped"),
    [
        (b"stopped\n", True),
        (b"stopped: not saved yet: the disk does not answer\n", True),
        (b"late: a component does not return from update()\n", False),
        (b"refused: stop requires the right `operate`\n", False),
        (b"", False),
    ],
)
def test_only_a_confirmed_direct_stop_counts(tmp_path: Path, answer: bytes, stopped: bool) -> None:
    async def play() -> None:
        requests: list[bytes] = []

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            requests.append(await reader.readline())
            writer.write(answer)
            writer.close()

        path = tmp_path / "stop"
        assert not await stop_socket.stop(path, 30.0)  # nobody listens
        server = await asyncio.start_unix_server(serve, path)
        assert await stop_socket.stop(path, 30.0) == stopped
        assert requests == [b"stop\n"]
        server.close()

    asyncio.run(play())


def test_a_direct_stop_reaches_an_executor_that_answers_later(tmp_path: Path) -> None:
    async def play() -> None:
        requests: list[bytes] = []
        continues = asyncio.Event()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await continues.wait()
            requests.append(await reader.readline())
            writer.close()

        path = tmp_path / "stop"
        server = await asyncio.start_unix_server(serve, path)
        assert not await stop_socket.stop(path, 0.01)
        continues.set()
        await until(lambda: requests == [b"stop\n"], "the request")
        server.close()

    asyncio.run(play())


def left_behind(socket: Path, code: str) -> "subprocess.Popen[str]":
    """Run a process that looks like an executor."""
    process = subprocess.Popen(
        [sys.executable, "-c", code, "--runner", "arm", "--socket", str(socket)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


WAITS = "print('ready', flush=True); import signal; signal.pause()"
IGNORES = (
    "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    "print('ready', flush=True)\n"
    "while True: signal.pause()"
)


@pytest.mark.parametrize(
    ("code", "freeze", "end"),
    [
        (WAITS, False, signal.SIGTERM),
        (WAITS, True, signal.SIGTERM),
        (IGNORES, False, signal.SIGKILL),
        (IGNORES, True, signal.SIGKILL),
    ],
)
def test_an_executor_that_was_not_adopted_is_ended(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    code: str,
    freeze: bool,
    end: signal.Signals,
) -> None:
    if end == signal.SIGKILL:
        monkeypatch.setattr(executor, "EXIT_TIMEOUT_S", 0.05)
    command = ExecutorCommand(Path("/nowhere"), tmp_path)
    process = left_behind(command.socket("arm"), code)
    if freeze:
        process.send_signal(signal.SIGSTOP)
    asyncio.run(end_left_over("arm", command))
    assert process.wait() == -end


def test_a_process_that_has_taken_the_pid_is_not_signalled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ExecutorCommand(Path("/nowhere"), tmp_path)
    stranger = left_behind(tmp_path / "another.sock", WAITS)
    found = [stranger.pid, None]
    monkeypatch.setattr(left_over, "process", lambda _: found.pop(0))
    asyncio.run(end_left_over("arm", command))
    assert found == []
    assert stranger.poll() is None
    stranger.kill()
    assert stranger.wait() == -signal.SIGKILL


@pytest.mark.parametrize("request_", ["remove", "restart"])
def test_remove_and_restart_end_a_frozen_executor_that_was_not_adopted(
    stopped_daemon: DaemonUnderTest, request_: str
) -> None:
    daemon = stopped_daemon.start()
    with daemon.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(orphan_timeout_s=60.0))
        client.load(rtcf.component("demo", "Fine", name="a"))
        client.start()
    pid = daemon.executor_pid()
    daemon.end(signal.SIGKILL)
    os.kill(pid, signal.SIGSTOP)
    daemon.start()
    with daemon.client() as client:

        def line() -> str:
            return str(client.get_status("rt_runner").runners[0].status)

        remedy = "it is frozen, by a signal or a debugger: `rtcfctl runner restart rt_runner` "
        remedy += f"ends it, `kill -CONT {pid}` lets its loop go on"
        wait_for(lambda: line().endswith(remedy), "its line")
        if request_ == "remove":
            client.remove_runner("rt_runner")
            assert list(client.get_status().runners) == []
        else:
            client.restart_runner("rt_runner")
            assert client.get_order() == ["/a"]
            status = client.get_status().runners[0]
            assert (status.pid != pid, status.state) == (True, runner_pb2.RUNNER_STATE_STOPPED)
        assert is_gone(pid)


def test_a_request_to_a_frozen_executor_fails_before_it_is_sent(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    pid = daemon.executor_pid()
    error = rf"\(pid {pid}\) is frozen, by a signal or a debugger: .* `kill -CONT {pid}`"
    with stopped(pid):
        with pytest.raises(rtcf.RefusedError, match=error):
            client.load(rtcf.component("demo", "Fine"))
        with pytest.raises(rtcf.RefusedError, match=error):
            client.start()
        with pytest.raises(rtcf.RefusedError, match=error):
            client.list_components()
    assert client.get_order() == []
    assert client.get_status().runners[0].state == runner_pb2.RUNNER_STATE_STOPPED
