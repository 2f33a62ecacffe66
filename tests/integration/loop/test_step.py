"""Stepping: cycles on a simulated clock without real time, reproducible to the last bit."""

import contextlib
import itertools
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import BUILD_TREE, Daemon, wait_for
from rtcf.v1 import runner_pb2
from values import iteration, number, port_value, state, wait_until_after

CYCLES = 10_000


def _values(client: rtcf.Client) -> dict[str, str]:
    """Return the text of each value in the graph, exact to the last bit."""
    return {
        f"{component.full_name}.{port.name}": port.value
        for component in map(client.get_component, fig_1.ORDER)
        for port in component.ports
        if port.HasField("value")
    }


def _fresh_run(folder: Path) -> dict[str, str]:
    folder.mkdir()
    daemon = Daemon(folder)
    daemon.start()
    try:
        with rtcf.Client(daemon.socket) as client:
            fig_1.load(client)
            client.step(CYCLES)
            assert iteration(client) == CYCLES
            return _values(client)
    finally:
        daemon.end()


def test_two_runs_and_the_simulation_give_the_same_bits(tmp_path: Path) -> None:
    first = _fresh_run(tmp_path / "1")
    second = _fresh_run(tmp_path / "2")
    assert first == second
    wanted = next(itertools.islice(fig_1.simulate(), CYCLES - 1, None))
    for name, value in wanted.items():
        assert number(first[f"/{name}.out1"]) == value


def test_each_step_continues_after_the_previous_one(daemon: Daemon, client: rtcf.Client) -> None:
    fig_1.load(client)
    wanted = list(itertools.islice(fig_1.simulate(), 45))
    for cycle in range(40):
        client.step(1)
        assert iteration(client) == cycle + 1
        assert port_value(client, "R3", "out1") == wanted[cycle]["R3"]
    done = daemon.ctl("step", "5")
    assert (done.returncode, done.stdout, done.stderr) == (0, "stepped 5 cycles\n", "")
    assert port_value(client, "R3", "out1") == wanted[44]["R3"]
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_STEPPING
    client.stop()
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_STOPPED


def test_time_advances_by_a_period_each_cycle(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=10.0))
    client.load(rtcf.component("rtcf_examples", "Mimo", name="source", remaps=["out1:=/x"]))
    client.load(rtcf.component("rtcf_examples", "Identity", name="sink", remaps=["in:=/x"]))
    client.step(10)
    client.unload(["source"])
    client.step(10)
    (out,) = (port for port in client.get_component("sink").ports if port.name == "out")
    assert out.age_ns == 1_000_000_000


def test_a_start_in_real_time_keeps_the_ages_of_stepped_values(client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_examples", "Mimo", name="source", remaps=["out1:=/x"]))
    client.load(rtcf.component("rtcf_examples", "Identity", name="sink", remaps=["in:=/x"]))
    client.step(10)
    client.unload(["source"])
    client.step(1000)
    begin_ns = time.monotonic_ns()
    client.start()
    wait_until_after(client, 10)
    client.stop()
    passed_ns = time.monotonic_ns() - begin_ns
    (out,) = (port for port in client.get_component("sink").ports if port.name == "out")
    assert 1_000_000_000 < out.age_ns <= 1_000_000_000 + passed_ns


def test_the_highest_frequency_can_be_stepped_and_run(client: rtcf.Client) -> None:
    """At any pace: late cycles are counted, and the loop continues."""
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=50_000.0, max_overruns=0))
    client.load(rtcf.component("rtcf_examples", "Mimo", name="source", remaps=["out1:=/x"]))
    client.load(rtcf.component("rtcf_examples", "Identity", name="sink", remaps=["in:=/x"]))
    client.step(1000)
    client.unload(["source"])
    client.step(10)
    assert iteration(client) == 1010
    (out,) = (port for port in client.get_component("sink").ports if port.name == "out")
    assert out.age_ns == 10 * 20_000
    client.start()
    wait_until_after(client, 1000)
    client.stop()
    status = state(client)
    assert (status.state, status.settings.frequency_hz) == (
        runner_pb2.RUNNER_STATE_STOPPED,
        50_000.0,
    )


@pytest.mark.parametrize("cycles", ["0", "-1", "x", str(2**64)])
def test_an_invalid_number_of_cycles_is_a_usage_error(daemon: Daemon, cycles: str) -> None:
    assert daemon.ctl("step", cycles).returncode == 2


def test_a_running_loop_cannot_be_stepped(daemon: Daemon, client: rtcf.Client) -> None:
    client.start()
    done = daemon.ctl("step", "1")
    assert (done.returncode, done.stdout) == (1, "")
    assert "stop it first" in done.stderr
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_long_step_reports_its_progress_and_can_be_stopped(client: rtcf.Client) -> None:
    fig_1.load(client)
    lines: list[str] = []

    def stop_soon(line: str) -> None:
        lines.append(line)
        if len(lines) == 20:
            client.stop()

    client.step(10**9, on_progress=stop_soon)
    assert any("of 1000000000 cycles" in line for line in lines)
    assert 0 < iteration(client) < 10**9


def test_a_stopped_step_reports_its_cycles(daemon: Daemon, client: rtcf.Client) -> None:
    fig_1.load(client)
    with subprocess.Popen(
        ["rtcfctl", "-v", "step", str(10**9)],
        env=daemon.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None and process.stdout is not None
        assert any("of 1000000000 cycles" in line for line in process.stderr)
        client.stop()
        said = process.stdout.read()
        ended = process.stderr.read()
        assert process.wait() == 1
    assert re.fullmatch(r"stepped [1-9]\d* of 1000000000 cycles\n", said)
    assert ended.splitlines()[-1] == "rtcfctl: step ended early: the loop was stopped"


@contextlib.contextmanager
def endless_step(daemon: Daemon, client: rtcf.Client) -> Iterator["subprocess.Popen[bytes]"]:
    """Yield the client of a running step, and wait for its end."""
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    with subprocess.Popen(
        [BUILD_TREE / "bin" / "rtcfctl", "step", str(10**15)],
        env=daemon.environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as caller:
        wait_for(lambda: iteration(client) > 1000, "cycles")
        yield caller


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_step_pauses_if_its_client_disconnects(
    daemon: Daemon, client: rtcf.Client, number: signal.Signals
) -> None:
    with endless_step(daemon, client) as caller:
        caller.send_signal(number)
    # The next change succeeds, and no cycle runs any more.
    client.load(rtcf.component("rtcf_test", "Counter", name="other"))
    before = iteration(client)
    client.unload(["other"])
    assert iteration(client) == before
    assert client.get_status("rt_runner").runners[0].state == runner_pb2.RUNNER_STATE_STEPPING
    client.step(5)
    assert iteration(client) == before + 5


def test_a_step_pauses_if_the_daemon_dies(daemon: Daemon, client: rtcf.Client) -> None:
    with endless_step(daemon, client):
        daemon.end(signal.SIGKILL)
    daemon.start()
    with rtcf.Client(daemon.socket) as again:
        again.load(rtcf.component("rtcf_test", "Counter", name="other"))
        before = iteration(again)
        again.unload(["other"])
        assert iteration(again) == before
