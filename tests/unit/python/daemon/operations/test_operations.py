"""Order of operations: queued ones can be withdrawn, started ones finish; a stop is final."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rtcf
from daemon_process import BUILD_TREE, DEADLINE_S, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2, runner_pb2
from rtcfd.common.errors import Unavailable
from rtcfd_in_process import Machine, Rtcfd

RUNNING, STOPPED = runner_pb2.RUNNER_STATE_RUNNING, runner_pb2.RUNNER_STATE_STOPPED


class Held:
    """Delays in the peer executors; see peer_executor.py."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()

    def waits(self, kind: str) -> Callable[[], bool]:
        """Return a function that tells whether an executor waits there."""
        return (self.folder / f"{kind} waits").exists

    @contextlib.contextmanager
    def back(self, kind: str) -> Iterator[None]:
        (self.folder / kind).touch()
        try:
            yield
        finally:
            (self.folder / kind).unlink()


class Call(threading.Thread):
    """A call by a separate client, in the background."""

    def __init__(self, daemon: DaemonUnderTest, do: Callable[[rtcf.Client], Any]) -> None:
        super().__init__()
        self._daemon, self._do = daemon, do
        self.error = ""
        self.start()

    def run(self) -> None:
        with self._daemon.client() as client:
            try:
                self._do(client)
            except rtcf.RtcfError as error:
                self.error = str(error)

    def end(self) -> str:
        self.join(DEADLINE_S)
        assert not self.is_alive()
        return self.error


@pytest.fixture
def held(stopped_daemon: DaemonUnderTest, tmp_path: Path) -> Held:
    held = Held(tmp_path / "held")
    stopped_daemon.environment["PEER_HELD"] = str(held.folder)
    return held


@pytest.fixture
def service(held: Held, stopped_daemon: DaemonUnderTest) -> DaemonUnderTest:
    stopped_daemon.start_service()
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
    return stopped_daemon


def status(daemon: DaemonUnderTest) -> runner_pb2.RunnerStatus:
    with daemon.client() as client:
        found: runner_pb2.RunnerStatus = client.get_status("rt_runner").runners[0]
        return found


def busy_with(daemon: DaemonUnderTest, what: str) -> None:
    """Wait until the status shows a running operation, which takes a while."""
    wait_for(lambda: what in status(daemon).status, what)


def ask_and_leave(
    daemon: DaemonUnderTest, method: str, request: Any, until: Callable[[], Any] | None = None
) -> None:
    """Interrupt a client, as Ctrl-C does, once `until` is true or its call is surely queued."""
    before = daemon.log().count("its caller disconnected")
    with daemon.client() as client:
        ask = getattr(client._stub, method)
        call = ask.future(request) if hasattr(ask, "future") else ask(request)
        # Calls of one connection are received in order.
        client.get_status()
        if until is not None:
            wait_for(until, "the call to begin")
        call.cancel()
    wait_for(
        lambda: daemon.log().count("its caller disconnected") > before, "the caller to be missed"
    )


def test_a_queued_call_is_withdrawn_when_its_client_leaves(
    service: DaemonUnderTest, held: Held
) -> None:
    with held.back("set_parameters"):
        call = Call(service, lambda c: c.set_parameters("a", [rtcf.parse_parameter("kp:=2.0")]))
        busy_with(service, "a change of parameters")
        ask_and_leave(service, "Start", control_pb2.StartRequest())
    assert call.end() == ""
    assert status(service).state == STOPPED
    assert "the start is done" not in service.log()


def test_a_stop_withdraws_a_queued_start(service: DaemonUnderTest, held: Held) -> None:
    with held.back("set_parameters"):
        call = Call(service, lambda c: c.set_parameters("a", [rtcf.parse_parameter("kp:=2.0")]))
        busy_with(service, "a change of parameters")
        starting = Call(service, lambda c: c.start())
        with service.client() as client:
            wait_for(lambda: client.stop() and not starting.is_alive(), "the start to fail")
    assert "withdrawn: the loop was stopped after the request" in starting.end()
    assert call.end() == ""
    assert status(service).state == STOPPED
    assert service.saved()["running"] is False


def test_a_stop_ends_a_start_in_progress(service: DaemonUnderTest, held: Held) -> None:
    with held.back("start"):
        starting = Call(service, lambda c: c.start())
        busy_with(service, "the start")
        with service.client() as client:
            client.stop()
    assert "was stopped after this request" in starting.end()
    assert status(service).state == STOPPED
    assert service.saved()["running"] is False


def test_a_stop_without_its_client_is_executed_and_saved(
    service: DaemonUnderTest, held: Held
) -> None:
    with service.client() as client:
        client.start()
    with held.back("stop"):
        ask_and_leave(service, "Stop", control_pb2.StopRequest(), held.waits("stop"))
        wait_for(lambda: service.saved()["running"] is False, "the state on disk")
    wait_for(lambda: status(service).state == STOPPED, "the end of the loop")


@pytest.mark.parametrize("kind", ["stop", "get_statistics"])
def test_calls_cut_off_by_the_end_of_an_executor_get_its_reason(
    service: DaemonUnderTest, held: Held, kind: str
) -> None:
    with service.client() as client:
        client.start()
        with held.back(kind):
            notes: list[str] = []
            asks: dict[str, Callable[[rtcf.Client], object]] = {
                "stop": lambda c: notes.extend(c.stop().notes),  # the loop has ended: no error
                "get_statistics": lambda c: c.get_statistics(),
            }
            call = Call(service, asks[kind])
            wait_for(held.waits(kind), f"the {kind}")
            with pytest.raises(rtcf.RefusedError):
                client.set_parameters("/a", [rtcf.parse_parameter("die:=SIGSEGV")])
            error = call.end()
    assert (error == "") == (kind == "stop")
    known = error or "\n".join(notes)
    assert "runner rt_runner: its executor" in known
    assert "was killed by SIGSEGV" in known
    assert "while /a.update was running" in known


@pytest.mark.parametrize("when", ["during the recovery", "after the recovery"])
def test_a_loop_is_stopped_in_order_after_a_crash(
    service: DaemonUnderTest, held: Held, when: str
) -> None:
    with service.client() as client:
        client.start()
        with held.back("serve"):
            with pytest.raises(rtcf.RefusedError):
                client.set_parameters("/a", [rtcf.parse_parameter("die:=SIGSEGV")])
            if when == "during the recovery":
                wait_for(held.waits("serve"), "the recovery")
                stop = Call(service, lambda c: c.stop())
                wait_for(lambda: service.saved()["running"] is False, "the stop")
        wait_for(lambda: "executor restarted in" in service.log(), "the recovery")
        if when == "during the recovery":
            assert stop.end() == ""
        else:
            assert status(service).state == runner_pb2.RUNNER_STATE_FAULTED
            client.stop()
    after = status(service)
    assert after.state == runner_pb2.RUNNER_STATE_STOPPED
    assert "held" not in after.status
    assert "/a is left out: " in after.status


def test_the_answer_to_a_start_does_not_hide_the_end_of_the_loop(
    service: DaemonUnderTest, held: Held
) -> None:
    with held.back("brief"), service.client() as client:
        client.start()
    wait_for(lambda: service.saved()["running"] is False, "the state on disk")
    service.environment.clear()
    service.end(signal.SIGUSR1)
    ready = [line for line in service.start_service().log().splitlines() if " ready; " in line]
    assert "rt_runner stopped" in ready[-1]


def test_a_runner_is_released_if_its_holder_dies_during_the_lease(
    service: DaemonUnderTest, held: Held
) -> None:
    with service.client() as client:
        client.unload(["a"])
        with held.back("serve"):
            opening = control_pb2.OpenHold(runner="rt_runner", token="t", holder="somebody")
            lease = client.hold_runner(opening)
            next(iter(lease))
            wait_for(lambda: status(service).holder == "somebody", "the hold")
            lease.drop()
        wait_for(lambda: not status(service).holder, "the release of the runner")
    wait_for(lambda: service.saved()["hold"] is None, "the state on disk")


def test_a_leased_load_interrupted_by_the_end_of_rtcfd_stays_leased(
    service: DaemonUnderTest, held: Held
) -> None:
    with held.back("load"), service.client() as client:
        spec = rtcf.component("demo", "Fine", name="leased")
        lease = client.lease_component(control_pb2.OpenLease(component=spec, holder="somebody"))
        wait_for(lambda: "/leased" in service.saved()["leased"], "the settings on disk")
        service.end(signal.SIGUSR1)
        lease.drop()
    service.start_service()
    assert [each["name"] for each in service.saved()["components"]] == ["a"]
    with service.client() as client:
        wait_for(lambda: len(client.list_components()) == 1, "the end of the lease")


def test_a_start_during_a_restart_waits_for_the_end_of_the_executor(
    service: DaemonUnderTest, held: Held
) -> None:
    before = service.executor_pid()
    with held.back("gone"):
        restarting = Call(service, lambda c: c.restart_runner("rt_runner"))
        wait_for(lambda: "being restarted" in status(service).status, "the restart")
        starting = Call(service, lambda c: c.start())
    assert (restarting.end(), starting.end()) == ("", "")
    assert status(service).state == RUNNING
    assert status(service).pid != before
    assert "its loop is down" not in service.log()


@pytest.mark.parametrize("method", ["RemoveRunner", "RestartRunner"])
def test_a_started_operation_finishes_without_its_client(
    service: DaemonUnderTest, held: Held, method: str
) -> None:
    before = service.executor_pid()
    with held.back("exit"):
        request = getattr(control_pb2, f"{method}Request")(runner="rt_runner")
        ask_and_leave(service, method, request, held.waits("exit"))
    with service.client() as client:
        if method == "RemoveRunner":
            wait_for(lambda: not client.get_status().runners, "the removal of the runner")
            assert not (service.state / "rt_runner.json").exists()
        else:
            wait_for(lambda: status(service).pid not in (0, before), "another executor")
            assert status(service).state == STOPPED


def test_a_rejected_graph_leaves_no_runner_behind(service: DaemonUnderTest, held: Held) -> None:
    spec = rtcf.component("demo", "Refused")
    request = control_pb2.ApplyRequest(runner="arm", components=[spec])
    with held.back("apply"):
        ask_and_leave(service, "Apply", request, held.waits("apply"))
    with service.client() as client:
        wait_for(lambda: len(client.get_status().runners) == 1, "the removal of the new runner")
    assert not (service.state / "arm.json").exists()


# -- a loop stopped in order stays stopped ----------------------------------------------


def started(service: DaemonUnderTest, on_boot: "runner_pb2.OnBoot") -> None:
    with service.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(on_boot=on_boot))
        client.start()


@pytest.mark.parametrize("on_boot", [runner_pb2.ON_BOOT_RESUME, runner_pb2.ON_BOOT_START])
def test_a_loop_ended_by_an_administrator_stays_stopped(
    service: DaemonUnderTest, on_boot: "runner_pb2.OnBoot"
) -> None:
    started(service, on_boot)
    service.end()
    assert service.saved()["running"] is False
    service.start_service()
    assert status(service).state == STOPPED


def test_a_loop_that_ran_until_the_shutdown_runs_again(
    service: DaemonUnderTest, tmp_path: Path
) -> None:
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "systemctl").write_text("#!/bin/sh\necho stopping\n")
    (folder / "systemctl").chmod(0o755)
    service.end()
    service.environment |= {"PATH": f"{folder}:{os.environ['PATH']}", "NOTIFY_SOCKET": "@nobody"}
    service.start_service()
    started(service, runner_pb2.ON_BOOT_RESUME)
    service.end()
    assert service.saved()["running"] is True
    service.start_service()
    assert status(service).state == RUNNING


def test_a_fresh_image_starts_its_loop(held: Held, stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.graphs.mkdir()
    (stopped_daemon.graphs / "rt.yaml").write_text(
        "runner: rt_runner\nsettings: {on_boot: start}\n"
        "components:\n  - {package: demo, type: Fine, name: a}\n"
    )
    stopped_daemon.start_service()
    assert status(stopped_daemon).state == RUNNING
    stopped_daemon.end()
    stopped_daemon.start_service()
    assert status(stopped_daemon).state == STOPPED
    # Another boot of the machine.
    stopped_daemon.end()
    file = stopped_daemon.state / "rt_runner.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"ended_boot": "another"}))
    stopped_daemon.start_service()
    assert status(stopped_daemon).state == RUNNING


# -- the daemon itself ------------------------------------------------------------------


def test_an_obstacle_to_one_executor_is_reported_and_others_run(
    held: Held, stopped_daemon: DaemonUnderTest
) -> None:
    obstacle = stopped_daemon.folder / "run" / "executors" / "rt_runner.sock"
    obstacle.mkdir(parents=True)
    stopped_daemon.start_service()
    assert f"{obstacle} is in the way" in status(stopped_daemon).status
    with stopped_daemon.client() as client:
        client.add_runner("other", runner_pb2.RunnerSettings())


def test_systemd_waits_for_a_slow_start(
    held: Held, stopped_daemon: DaemonUnderTest, tmp_path: Path
) -> None:
    import socket

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.settimeout(DEADLINE_S)
        stopped_daemon.environment["NOTIFY_SOCKET"] = str(tmp_path / "notify")
        with held.back("serve"):
            starting = threading.Thread(target=stopped_daemon.start_service)
            starting.start()
            told = listener.recv(1000)
        starting.join()
    assert told.startswith(b"EXTEND_TIMEOUT_USEC=")


def reload(service: DaemonUnderTest) -> str:
    return subprocess.run(
        [str(BUILD_TREE / "bin" / "rtcfd"), "--reload", "--config", str(service.settings)],
        env={key: value for key, value in os.environ.items() if key != "RTCF_SOCKET"},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=DEADLINE_S,
    ).stdout  # fmt: skip


def test_a_reload_reports_the_rights_of_ros_peers(service: DaemonUnderTest) -> None:
    service.settings.write_text(
        f'[daemon]\nsocket = "{service.socket}"\n[runner.ros]\npeers = "tune"\n'
    )
    assert "defaults of runners changed" in reload(service)


def test_a_graph_rejected_by_a_reload_is_tried_again(service: DaemonUnderTest) -> None:
    service.settings.write_text(f'[daemon]\nsocket = "{service.socket}"\n')
    (service.graphs / "rt.yaml").write_text(
        "runner: rt_runner\ncomponents:\n  - {package: late, type: Fine}\n"
    )
    assert 'no package "late"' in reload(service)
    service.package("late", types={"Fine": "fine"})
    assert "applied; differences: 2" in reload(service)


def test_simultaneous_removals_wait_for_the_end_of_the_executor(
    rtcfd: Callable[[], Rtcfd],
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        await daemon.call("AddRunner", control_pb2.AddRunnerRequest(runner="arm"))
        peer = daemon.peer("arm")
        assert peer is not None
        may_stop, stop = asyncio.Event(), peer.stop

        async def slow_stop(*request: Any) -> Any:
            await may_stop.wait()
            return await stop(*request)

        peer.stop = slow_stop  # type: ignore[assignment]
        request = control_pb2.RemoveRunnerRequest(runner="arm")
        calls = [asyncio.create_task(daemon.call("RemoveRunner", request)) for _ in range(2)]
        (answered,), (other,) = await asyncio.wait(calls, return_when=asyncio.FIRST_COMPLETED)
        may_stop.set()
        await other
        assert "runner arm is being ended" in str(answered.exception())
        assert daemon.peer("arm") is None
        assert daemon.saved("arm") is None
        await daemon.call("AddRunner", control_pb2.AddRunnerRequest(runner="arm"))
        await daemon.runners.close(in_order=True)

    asyncio.run(play())


def test_a_runner_being_removed_gets_no_new_executor(
    rtcfd: Callable[[], Rtcfd], machine: Machine
) -> None:
    async def play() -> None:
        daemon = rtcfd()
        await daemon.start()
        await daemon.call("AddRunner", control_pb2.AddRunnerRequest(runner="arm"))
        runner = daemon.runners.get("arm")
        await runner.shut_down()  # the first step of a removal; the state on disk follows
        restart = asyncio.create_task(runner.restart())
        while not restart.done():
            assert not [path for path in machine.peers if "arm" in path]
            await asyncio.sleep(0)
        with pytest.raises(Unavailable, match="runner arm is being ended"):
            restart.result()
        await daemon.runners.close(in_order=True)

    asyncio.run(play())
