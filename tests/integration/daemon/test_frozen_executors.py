"""Executors that a signal has frozen: stops hold, and rtcfctl ends them or names the way out."""

import contextlib
import signal
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
import rtcf
from daemon_process import NO_ROS, Daemon, is_gone, stopped, wait_for
from rtcf.v1 import runner_pb2
from values import state

STOPPED = runner_pb2.RUNNER_STATE_STOPPED


@pytest.fixture
def settings() -> str:
    """Return settings of an rtcfd whose executors outlive it for a minute."""
    return "[runner]\norphan_timeout_s = 60\n" + NO_ROS


def begin(daemon: Daemon, client: rtcf.Client) -> int:
    """Run a loop; return the pid of its executor."""
    hooks = f"file:={daemon.folder / 'hooks'}"
    client.load(rtcf.component("rtcf_test", "Witness", name="steady", parameters=[hooks]))
    client.start()
    wait_for(lambda: state(client).iteration > 10, "cycles")
    return int(state(client).pid)


@contextmanager
def frozen(daemon: Daemon) -> Iterator[int]:
    """Freeze the executor of a running loop, and restart rtcfd; yield the executor's pid."""
    with rtcf.Client(daemon.socket) as client:
        pid = begin(daemon, client)
    daemon.end(signal.SIGKILL)
    with contextlib.suppress(ProcessLookupError), stopped(pid):
        daemon.start()
        with rtcf.Client(daemon.socket) as client:
            wait_for(lambda: "its loop may be running" in state(client).status, "its silence")
            assert f"`kill -CONT {pid}` lets its loop go on" in state(client).status
        yield pid


@pytest.mark.parametrize("dies", [False, True])
def test_a_stop_of_a_loop_that_is_not_adopted_yet_holds(daemon: Daemon, dies: bool) -> None:
    with frozen(daemon) as pid:
        done = daemon.ctl("stop")
        assert (done.returncode, done.stdout) == (1, ""), done.stderr
        assert f"(pid {pid}) is frozen" in done.stderr
        if dies:  # the executor itself has the stop
            daemon.end(signal.SIGKILL)
            daemon.start()
    with rtcf.Client(daemon.socket) as client:
        wait_for(lambda: state(client).pid == pid, "the adoption")
        wait_for(lambda: state(client).state == STOPPED, "the stop")
        client.start()
        assert state(client).state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_removed_runner_leaves_no_frozen_executor(daemon: Daemon) -> None:
    with frozen(daemon) as pid:
        removed = daemon.ctl("runner", "remove", "rt_runner")
        assert removed.returncode == 0, removed.stderr
        assert is_gone(pid)
    with rtcf.Client(daemon.socket) as client:
        added = client.add_runner("rt_runner", runner_pb2.RunnerSettings())
        assert (added.pid != pid, added.state) == (True, STOPPED)


def test_a_restart_replaces_a_frozen_executor(daemon: Daemon) -> None:
    with frozen(daemon) as pid:
        restarted = daemon.ctl("runner", "restart", "rt_runner")
        assert restarted.returncode == 0, restarted.stderr
        assert is_gone(pid)
    # In order: after it was resumed, it ended by itself.
    ends = ["safe", "stop", "cleanup"]
    hooks = (daemon.folder / "hooks").read_text().split()
    assert [each for each in hooks if each in ends] == ends
    with rtcf.Client(daemon.socket) as client:
        assert (state(client).pid != pid, state(client).state) == (True, STOPPED)
        assert client.get_order() == ["/steady"]


def test_a_request_to_a_frozen_executor_names_the_way_out(
    daemon: Daemon, client: rtcf.Client
) -> None:
    pid = begin(daemon, client)
    with stopped(pid):
        for command in (["load", "rtcf_test", "Knobs"], ["list"], ["stats"], ["info", "steady"]):
            done = daemon.ctl(*command)
            assert done.returncode == 1, done.stdout
            assert f"(pid {pid}) is frozen, by a signal or a debugger" in done.stderr
            assert f"`kill -CONT {pid}` lets its loop go on" in done.stderr
    # The change has not even begun.
    assert client.get_order() == ["/steady"]
