"""Stopping loops whose executors die of the stop, or are frozen: the answer reports the result."""

import contextlib
import re
from pathlib import Path

import pytest
import rtcf
from daemon_process import Daemon, stopped, wait_for
from rtcf.v1 import runner_pb2
from values import iteration, state

SETTINGS = "[runner]\nstall_timeout_ms = 2000\non_crash = 'resume'\n[runner.ros]\nenabled = false\n"


@pytest.fixture
def settings() -> str:
    """Return settings with a stall timeout shorter than the wait for a stop."""
    return SETTINGS


def hang(client: rtcf.Client) -> int:
    """Run a loop until its component hangs; return the executor's pid."""
    client.load(
        rtcf.component(
            "rtcf_faults", "NeverReturns", name="bad", optional=True, parameters=["after:=20"]
        )
    )
    client.start()
    pid = int(state(client).pid)
    wait_for(lambda: iteration(client) >= 20, "the hang")
    return pid


def ended(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def test_a_hanging_update_is_stopped_with_its_executor(daemon: Daemon, client: rtcf.Client) -> None:
    executor = hang(client)
    (note,) = client.stop().notes
    assert "the loop has ended with its executor" in note
    assert "/bad.update" in note
    assert ended(executor)
    wait_for(lambda: "executor restarted in" in daemon.log(), "the recovery")
    # Not even a loop that would continue after a crash of an optional component.
    assert state(client).state != runner_pb2.RUNNER_STATE_RUNNING


def test_a_hanging_update_is_stopped_without_rtcfd(daemon: Daemon, client: rtcf.Client) -> None:
    executor = hang(client)
    with stopped(daemon.pid):
        (note,) = client.stop().notes
        assert note == "the loop has ended with its executor, which died"
        assert ended(executor)


def test_a_frozen_executor_is_named_with_the_command_to_end_it(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Witness", name="steady"))
    client.start()
    wait_for(lambda: iteration(client) > 10, "cycles")
    executor = int(state(client).pid)
    with contextlib.suppress(ProcessLookupError), stopped(executor):
        done = daemon.ctl("stop")
        assert (done.returncode, done.stdout) == (1, ""), done.stderr
        (line,) = done.stderr.splitlines()
        assert f"(pid {executor}) is frozen" in line
        assert "end it with `rtcfctl runner restart rt_runner`" in line
        assert "is frozen" in state(client).status
        restart = daemon.ctl("runner", "restart", "rt_runner")
        assert restart.returncode == 0, restart.stderr
        assert ended(executor)
    # In order: after it was resumed, it ended by itself.
    assert daemon.log().count("hook safe") == 1
    assert state(client).state == runner_pb2.RUNNER_STATE_STOPPED


def test_a_resumed_executor_stops_first(daemon: Daemon, client: rtcf.Client) -> None:
    client.load(rtcf.component("rtcf_test", "Counter", name="steady"))
    client.start()
    wait_for(lambda: iteration(client) > 10, "cycles")
    executor = int(state(client).pid)
    with stopped(executor):
        found = daemon.ctl("stop", "--all")
        assert found.returncode == 1
        assert re.search(r"\(pid \d+\) is frozen", found.stderr), found.stderr
    wait_for(lambda: state(client).state == runner_pb2.RUNNER_STATE_STOPPED, "the stop")
