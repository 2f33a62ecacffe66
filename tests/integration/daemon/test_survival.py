"""Loops and their graphs survive the deaths of rtcfd and of executors at any time."""

import contextlib
import functools
import json
import os
import random
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, is_gone, stopped, wait_for
from rtcf import direct_stop
from rtcf.v1 import runner_pb2
from rtcfd.common.build_id import build_id
from rtcfd.executor import left_over
from values import state

# The system's timeout, which is longer than a private daemon's.
SETTINGS = "[runner]\norphan_timeout_s = 60\n[runner.ros]\nenabled = false\n"
LONGEST_WAIT_S = 0.2  # before a death


@pytest.fixture
def settings() -> str:
    """Return settings of an rtcfd whose executors outlive it for a minute."""
    return SETTINGS


def count(client: rtcf.Client) -> int:
    ports = {port.name: port for port in client.get_component("steady").ports}
    return int(ports["out"].value.removeprefix("data: "))


def test_an_executor_that_no_rtcfd_has_configured_gets_settings_and_graph(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=250.0))
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        pid = state(client).pid
    command = Path(f"/proc/{pid}/cmdline").read_text().split("\0")[:-1]
    daemon.end()
    wait_for(lambda: is_gone(pid), "the end of the executor")
    # As if rtcfd had died between the start of its executor and the first request.
    socket = Path(next(word for word in command if word.endswith(".sock")))
    for word in command:
        if word.startswith(f"{daemon.folder}/"):
            Path(word).parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with subprocess.Popen(command) as executor:
        try:
            wait_for(socket.exists, "the socket")
            daemon.start()
            with rtcf.Client(daemon.socket) as client:
                after = state(client)
                assert after.pid == executor.pid
                assert after.settings.frequency_hz == 250.0
                assert client.get_order() == ["/steady"]
            assert "is kept" not in daemon.log()
            assert "left out" not in daemon.log()
            daemon.end()
        finally:
            executor.kill()


def test_a_loop_continues_without_rtcfd_and_is_adopted_unchanged(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        client.load(rtcf.component("rtcf_test", "Knobs", name="knobs", parameters=["rate:=2.5"]))
        client.set_parameters("knobs", [rtcf.parse_parameter("count:=7")])
        client.start()
        wait_for(lambda: state(client).iteration > 100, "100 cycles")
        before = state(client)
    daemon.end(signal.SIGKILL)
    daemon.start()
    assert "adopted: loop running, iteration " in daemon.log()
    assert "the executor's is kept" not in daemon.log()
    with rtcf.Client(daemon.socket) as client:
        after = state(client)
        assert (after.pid, after.state) == (before.pid, runner_pb2.RUNNER_STATE_RUNNING)
        assert after.iteration > before.iteration
        assert after.missed == before.missed or after.overruns > before.overruns
        assert client.get_order() == ["/knobs", "/steady"]
        # One count per cycle: no cycle is missing, and none ran twice.
        since = state(client).iteration
        counted = count(client)
        assert since - 1 <= counted <= state(client).iteration + 1
        client.load(rtcf.component("rtcf_test", "Counter", name="new", remaps=["out:=/new"]))
        wait_for(lambda: count(client) > counted, "a cycle")
    assert daemon.end() == 0
    wait_for(lambda: is_gone(before.pid), "its end")


def test_a_frozen_executor_is_adopted_when_it_resumes(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        client.start()
        before = state(client)
    daemon.end(signal.SIGKILL)
    # As on a suspended machine, or in a debugger.
    with stopped(before.pid):
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            wait_for(lambda: "its loop may be running" in state(client).status, "its silence")
    with rtcf.Client(daemon.socket) as client:
        wait_for(lambda: state(client).pid == before.pid, "the adoption")
        assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
        assert client.get_order() == ["/steady"]


def test_the_status_reports_that_a_graph_is_being_restored(daemon: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "plugged in"
    file.touch()
    with rtcf.Client(daemon.socket) as client:
        client.load(
            rtcf.component(
                "rtcf_test", "ConfiguresOnceThereIs", name="slow", parameters=[f"file:={file}"]
            )
        )
        file.unlink()
        os.kill(state(client).pid, signal.SIGKILL)
        said = "its components are being restored: 1"
        wait_for(lambda: said in state(client).status, "the operation")
        file.touch()
        wait_for(lambda: client.get_order() == ["/slow"], "the component")
        wait_for(lambda: said not in state(client).status, "the end of it")


def folders(daemon: Daemon) -> list[Path]:
    return [Path(f"{daemon.socket}.d") / each for each in ("executors", "stop")]


@pytest.mark.parametrize("all_of_them", [False, True])
def test_a_loop_with_a_removed_socket_is_adopted_without_a_second_executor(
    daemon: Daemon, all_of_them: bool
) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        client.start()
        before = state(client)
        for folder in folders(daemon):
            for each in [folder] if all_of_them else list(folder.iterdir()):
                shutil.rmtree(each) if each.is_dir() else each.unlink()
        if not all_of_them:
            # It can be stopped without rtcfd as usual.
            daemon.end(signal.SIGKILL)
            wait_for(lambda: list(folders(daemon)[1].iterdir()), "the socket for stops")
        else:
            daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        wait_for(lambda: state(client).pid == before.pid, "the adoption")
        assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING
    assert left_over.runners(folders(daemon)[0]) == ["rt_runner"]
    wait_for(lambda: list(folders(daemon)[1].iterdir()), "the socket for stops")
    assert [each.error for each in direct_stop.stop_all(str(daemon.socket))] == [None]
    with rtcf.Client(daemon.socket) as client:
        assert state(client).pid == before.pid
        assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED


def test_an_unreachable_executor_is_not_replaced(daemon: Daemon) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        client.start()
        before = state(client)
    daemon.end(signal.SIGKILL)
    with stopped(before.pid):
        shutil.rmtree(folders(daemon)[0])
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            remedy = f"`kill -CONT {before.pid}` lets its loop go on"
            wait_for(lambda: remedy in state(client).status, "its line")
            with pytest.raises(
                rtcf.RefusedError, match=f".pid {before.pid}. exists, but its socket"
            ):
                client.start()
    with rtcf.Client(daemon.socket) as client:
        wait_for(lambda: state(client).pid == before.pid, "the adoption")
        assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_change_waiting_for_its_executor_reports_it(daemon: Daemon, tmp_path: Path) -> None:
    file = tmp_path / "plugged in"
    slow = rtcf.component(
        "rtcf_test", "ConfiguresOnceThereIs", name="slow", parameters=[f"file:={file}"]
    )
    with rtcf.Client(daemon.socket) as client, ThreadPoolExecutor() as pool:
        client.load(rtcf.component("rtcf_test", "Knobs", name="knobs"))
        loading = pool.submit(client.load, slow)
        wait_for(lambda: "busy with the load of" in state(client).status, "the load")
        setting = subprocess.Popen(
            ["rtcfctl", "-v", "set", "knobs", "count:=7"],
            env=daemon.environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert setting.stderr is not None
        assert "still waiting after" in setting.stderr.readline()
        file.touch()
        _, rest = setting.communicate()
        assert setting.returncode == 0, rest
        loading.result()


def test_the_crash_of_an_adopted_executor_is_explained_by_its_flight_recorder(
    daemon: Daemon,
) -> None:
    with rtcf.Client(daemon.socket) as client:
        client.load(
            rtcf.component(
                "rtcf_faults", "NullDereference", name="bad", parameters=["after:=2000000"]
            )
        )
        client.start()
    daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        with contextlib.suppress(rtcf.RefusedError):  # the answer may arrive first
            client.set_parameters("bad", [rtcf.parse_parameter("after:=0")])
        wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
        assert "was killed by SIGSEGV" in state(client).status
        assert "while /bad.update was running" in state(client).status
        assert client.get_order() == []


def test_a_private_rtcfd_ends_its_executors(tmp_path: Path) -> None:
    daemon = Daemon(tmp_path)
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Witness"))
        client.start()
        pid = state(client).pid
    daemon.end(signal.SIGKILL)
    wait_for(lambda: is_gone(pid), "its end")


@pytest.mark.parametrize("loop", ["running", "stopped"])
def test_an_orphan_ends_in_order_after_its_timeout(tmp_path: Path, loop: str) -> None:
    daemon = Daemon(tmp_path, "[runner]\norphan_timeout_s = 1.5\n[runner.ros]\nenabled = false\n")
    daemon.start()
    hooks = tmp_path / "hooks"
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Witness", parameters=[f"file:={hooks}"]))
        if loop == "running":
            client.start()
            wait_for(lambda: state(client).iteration > 10, "some cycles")
        pid = state(client).pid
    daemon.end(signal.SIGKILL)
    wait_for(lambda: is_gone(pid), "its end")
    in_loop = ["start", "update", "safe", "stop"] if loop == "running" else []
    assert hooks.read_text().split() == ["configure", *in_loop, "cleanup"]


class Churn:
    """Changes a graph at random. Its expected content is the set of acknowledged changes, and
    perhaps the change in progress when the other side died."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.known: dict[str, float] = {}
        self.perhaps: dict[str, float] = {}
        self._next = 0

    def run(self, client: rtcf.Client, over: threading.Event) -> None:
        """Make changes until one fails, or `over` is set."""
        while not over.is_set():
            self.perhaps = dict(self.known)
            try:
                self._change(client)
            except rtcf.RtcfError:
                return
            self.known = self.perhaps

    def _change(self, client: rtcf.Client) -> None:
        choice = self.random.random()
        names = sorted(self.known)
        if not names or (choice < 0.4 and len(names) < 8):
            name, rate = f"k{self._next}", self.random.uniform(0.0, 9.0)
            self._next += 1
            self.perhaps[f"/{name}"] = rate
            remaps = [f"{port}:=/{name}/{port}" for port in ("product", "length")]
            client.load(
                rtcf.component(
                    "rtcf_test", "Knobs", name=name, remaps=remaps, parameters=[f"rate:={rate}"]
                )
            )
        elif choice < 0.7:
            name, rate = self.random.choice(names), self.random.uniform(0.0, 9.0)
            self.perhaps[name] = rate
            client.set_parameters(name, [rtcf.parse_parameter(f"rate:={rate}")])
        else:
            name = self.random.choice(names)
            del self.perhaps[name]
            client.unload([name])

    def accept(self, found: dict[str, float]) -> None:
        """Check the present graph."""
        assert found in (self.known, self.perhaps)
        self.known = found


def rates(client: rtcf.Client) -> dict[str, float]:
    found = {}
    for each in client.list_components():
        values = {parameter.name: parameter.value.double_value for parameter in each.parameters}
        if "rate" in values:
            found[each.full_name] = values["rate"]
    return found


def saved_rates(daemon: Daemon) -> dict[str, float]:
    """Return the rates in the state on disk."""
    file = daemon.socket.with_name("state") / "rt_runner.json"
    found = {}
    for each in json.loads(file.read_text())["components"]:
        for parameter in each.get("parameters", []):
            if parameter["name"] == "rate":
                found[f"/{each['name']}"] = float(parameter["value"]["double_value"])
    return found


def churn_until(churn: Churn, client: rtcf.Client, death: Callable[[], None]) -> None:
    """Change the graph until `death`, which happens at a random time."""
    over = threading.Event()

    def die() -> None:
        death()
        over.set()

    timer = threading.Timer(churn.random.uniform(0.0, LONGEST_WAIT_S), die)
    timer.start()
    churn.run(client, over)
    timer.join()


@pytest.mark.parametrize("times", [5, pytest.param(100, marks=pytest.mark.long)])
def test_no_kill_of_rtcfd_stops_a_loop_or_loses_its_graph(daemon: Daemon, times: int) -> None:
    churn = Churn(seed=times)
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        client.start()
        first = state(client)
    iteration = first.iteration
    for _ in range(times):
        with rtcf.Client(daemon.socket) as client:
            churn_until(churn, client, lambda: os.kill(daemon.pid, signal.SIGKILL))
        daemon.end(signal.SIGKILL)
        assert saved_rates(daemon) in (churn.known, churn.perhaps)
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            now = state(client)
            assert (now.pid, now.state) == (first.pid, runner_pb2.RUNNER_STATE_RUNNING)
            assert now.iteration > iteration
            iteration = now.iteration
            churn.accept(rates(client))
            # The answer may precede the write of the adopted state to disk.
            wait_for(lambda: saved_rates(daemon) == churn.known, "the saved graph")
    assert "is corrupt" not in daemon.log()


def revive(client: rtcf.Client, dead: int) -> None:
    """Wait for another executor with the graph; after many deaths `start` is needed."""

    def is_up() -> bool:
        status = state(client)
        if "tries again" in status.status:
            client.start()
        return status.pid not in (0, dead) and "/steady" in client.get_order()

    wait_for(is_up, "another executor with its graph")


@pytest.mark.parametrize("times", [5, pytest.param(100, marks=pytest.mark.long)])
def test_no_kill_of_an_executor_loses_its_graph(daemon: Daemon, times: int) -> None:
    churn = Churn(seed=times)
    with rtcf.Client(daemon.socket) as client:
        client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
        for _ in range(times):
            client.start()
            pid = state(client).pid
            churn_until(churn, client, functools.partial(os.kill, pid, signal.SIGKILL))
            revive(client, pid)
            churn.accept(rates(client))
            assert saved_rates(daemon) == churn.known
    assert "quarantined" in (daemon.socket.with_name("state") / "rt_runner.json").read_text()


def test_a_loop_of_another_build_of_the_same_version_is_named(tmp_path: Path) -> None:
    program = tmp_path / "rtcf-executor"
    shutil.copy(BUILD_TREE / "bin" / "rtcf-executor", program)
    daemon = Daemon(tmp_path, SETTINGS, arguments=["--executor", str(program)])
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.start()
        assert "restart pending" not in state(client).status
    daemon.end(signal.SIGKILL)
    # As by an upgrade of the package: another file under the same name.
    content = program.read_bytes()
    present = bytes.fromhex(build_id(program))
    program.unlink()
    program.write_bytes(content.replace(present, bytes(len(present))))
    program.chmod(0o755)
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            assert "adopted: loop running" in daemon.log()
            said = state(client).status
            assert "restart pending: its executor is of another build of rtcf " in said
            client.restart_runner("rt_runner")
            assert "restart pending" not in state(client).status
    finally:
        daemon.end()
