"""rtcfd as a client sees it: its socket, its start and end, its runners."""

import os
import re
import signal
import socket
import stat
from pathlib import Path

import pytest
import rtcf
from daemon_process import is_gone, wait_for
from daemon_under_test import DaemonUnderTest
from peer_executor import CHATTER
from rtcf.v1 import runner_pb2


def test_serves_the_default_runner_stopped(client: rtcf.Client) -> None:
    status = client.get_status()
    assert [runner.runner for runner in status.runners] == ["rt_runner"]
    assert status.runners[0].state == runner_pb2.RUNNER_STATE_STOPPED
    assert status.runners[0].settings.frequency_hz == 1000.0
    assert not is_gone(status.runners[0].pid)


def test_socket_permissions_depend_on_the_kind_of_daemon(
    stopped_daemon: DaemonUnderTest,
) -> None:
    stopped_daemon.start()
    assert stat.S_IMODE(stopped_daemon.socket.stat().st_mode) == 0o600
    assert stopped_daemon.end() == 0
    stopped_daemon.start_service()
    assert stat.S_IMODE(stopped_daemon.socket.stat().st_mode) == 0o660
    assert stat.S_IMODE((stopped_daemon.folder / "run" / "executors").stat().st_mode) == 0o700
    assert stat.S_IMODE((stopped_daemon.folder / "run" / "stop").stat().st_mode) == 0o750


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_signal_ends_it_with_its_executors(
    daemon: DaemonUnderTest, number: signal.Signals
) -> None:
    executor = daemon.executor_pid()
    assert daemon.end(number) == 0
    assert is_gone(executor)
    assert not daemon.socket.exists()
    assert not Path(f"{daemon.socket}.d").exists()


def test_a_stale_socket_is_replaced(stopped_daemon: DaemonUnderTest) -> None:
    with socket.socket(socket.AF_UNIX) as stale:
        stale.bind(str(stopped_daemon.socket))
    stopped_daemon.start()
    assert stopped_daemon.executor_pid()


def test_a_socket_in_use_is_rejected(daemon: DaemonUnderTest, tmp_path: Path) -> None:
    folder = tmp_path / "second"
    folder.mkdir()
    second = DaemonUnderTest(folder)
    second.socket = daemon.socket
    second.start("--runtime-dir", str(tmp_path / "other"))
    assert second.process is not None
    assert second.process.wait() == 1
    assert "answers at" in second.log()
    assert daemon.executor_pid()


def test_a_missing_executor_is_reported_in_one_line(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.executor.unlink()
    stopped_daemon.start()
    assert stopped_daemon.process is not None
    assert stopped_daemon.process.wait() == 1
    assert stopped_daemon.log() == (
        f"rtcfd: no executor at {stopped_daemon.executor}: install it, "
        "or name one with --executor\n"
    )


def test_a_failed_start_leaves_nothing(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.state = Path("/proc/none")
    stopped_daemon.start()
    assert stopped_daemon.process is not None
    assert stopped_daemon.process.wait() == 1
    assert "cannot make the state folder /proc/none" in stopped_daemon.log()
    assert not stopped_daemon.socket.exists()
    assert not Path(f"{stopped_daemon.socket}.d").exists()


def test_a_failed_start_keeps_the_folder_of_the_running_daemon(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.remove_runner("rt_runner")
    folder = tmp_path / "second"
    folder.mkdir()
    second = DaemonUnderTest(folder)
    second.socket = daemon.socket
    second.start()
    assert second.process is not None
    assert second.process.wait() == 1
    client.add_runner("other", runner_pb2.RunnerSettings())
    assert daemon.executor_pid("other")


def test_two_rtcfds_share_no_state(
    daemon: DaemonUnderTest, client: rtcf.Client, tmp_path: Path
) -> None:
    client.set_runner(runner_pb2.RunnerSettings(frequency_hz=123.0))
    folder = tmp_path / "b"
    folder.mkdir()
    second = DaemonUnderTest(folder)
    second.state = daemon.state
    second.start()
    assert daemon.process is not None
    assert second.process is not None
    assert second.process.wait() == 1
    assert second.log() == (
        f"rtcfd: state folder {daemon.state} is in use by another rtcfd (pid "
        f"{daemon.process.pid}): end that, or choose another --state-dir\n"
    )
    assert daemon.saved()["settings"]["frequency_hz"] == 123.0
    # A killed rtcfd does not block the state either.
    daemon.end(signal.SIGKILL)
    second.start()
    assert "ready;" in second.log()
    assert second.end() == 0


def test_an_executor_that_ends_immediately_shows_in_the_status(
    stopped_daemon: DaemonUnderTest,
) -> None:
    stopped_daemon.executor.write_text("#!/bin/sh\nexit 7\n")
    stopped_daemon.start()
    with stopped_daemon.client() as client:
        status = client.get_status().runners[0]
        assert status.state == runner_pb2.RUNNER_STATE_DOWN
        assert "exit status 7" in status.status
        with pytest.raises(rtcf.RefusedError, match="exit status 7"):
            client.get_order()
        # Changed settings are no attempt to start another one.
        for priority in (70, 71):
            client.set_runner(runner_pb2.RunnerSettings(priority=priority))
        said = client.get_status().runners[0].status
    assert said.startswith(status.status)
    note = "; settings changed since then: `rtcfctl runner restart rt_runner` tries them"
    assert said.count(note) == 1


def test_an_executor_that_does_not_answer_is_stuck(
    daemon: DaemonUnderTest, client: rtcf.Client
) -> None:
    pid = daemon.executor_pid()
    os.kill(pid, signal.SIGSTOP)
    try:
        status = client.get_status().runners[0]
        assert status.state == runner_pb2.RUNNER_STATE_STUCK
        assert f"(pid {pid}) is frozen, by a signal or a debugger" in status.status
    finally:
        os.kill(pid, signal.SIGCONT)


def test_runners_are_added_and_removed(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    added = client.add_runner("arm", runner_pb2.RunnerSettings(frequency_hz=2000.0))
    assert added.settings.frequency_hz == 2000.0
    assert added.settings.priority == 82  # derived from its frequency
    client.load(rtcf.component("demo", "Fine"), "arm")
    assert client.get_order("arm") == ["/Fine"]
    assert client.get_order() == []
    client.remove_runner("arm")
    assert is_gone(added.pid)
    assert [runner.runner for runner in client.get_status().runners] == ["rt_runner"]
    assert not (daemon.state / "arm.json").exists()


def test_a_change_of_settings_keeps_the_rest(client: rtcf.Client) -> None:
    client.set_runner(runner_pb2.RunnerSettings(ros=runner_pb2.RosSettings(whitelist="/a.*")))
    status = client.set_runner(runner_pb2.RunnerSettings(frequency_hz=500.0))
    assert status.settings.frequency_hz == 500.0
    assert status.settings.ros.whitelist == "/a.*"
    assert status.settings.ros.queue == 1000


@pytest.mark.parametrize(
    ("runner", "code", "text"),
    [
        ("nobody", "NOT_FOUND", r'no runner "nobody" \(runners: rt_runner\)'),
        ("rt_runer", "NOT_FOUND", r'did you mean "rt_runner"\?'),
    ],
)
def test_an_unknown_runner_is_rejected(
    client: rtcf.Client, runner: str, code: str, text: str
) -> None:
    with pytest.raises(rtcf.RefusedError, match=text) as refused:
        client.start(runner)
    assert refused.value.code == code


@pytest.mark.parametrize("name", ["1st", "a/b", "../x", "a b", "ä"])
def test_a_bad_runner_name_is_rejected(client: rtcf.Client, name: str) -> None:
    with pytest.raises(rtcf.RefusedError, match="is not valid") as refused:
        client.add_runner(name)
    assert refused.value.code == "INVALID_ARGUMENT"


def test_an_existing_runner_is_rejected(client: rtcf.Client) -> None:
    with pytest.raises(rtcf.RefusedError, match="runner rt_runner exists already") as refused:
        client.add_runner("rt_runner")
    assert refused.value.code == "ALREADY_EXISTS"


@pytest.mark.parametrize("frequency", [0.0, -1.0, 50001.0, float("nan"), float("inf")])
def test_a_bad_frequency_is_rejected_without_changes(client: rtcf.Client, frequency: float) -> None:
    with pytest.raises(rtcf.RefusedError, match=r"0\.1 to 50000 Hz"):
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=frequency))
    assert client.get_status().runners[0].settings.frequency_hz == 1000.0


def test_an_error_of_the_executor_changes_no_settings(client: rtcf.Client) -> None:
    bad = runner_pb2.RunnerSettings(frequency_hz=10.0, ros=runner_pb2.RosSettings(whitelist="("))
    with pytest.raises(rtcf.RefusedError, match="unmatched"):
        client.set_runner(bad)
    with pytest.raises(rtcf.RefusedError, match="unmatched"):
        client.add_runner("other", bad)
    status = client.get_status()
    assert len(status.runners) == 1
    assert status.runners[0].settings.frequency_hz == 1000.0


def test_environment_reaches_the_executor(stopped_daemon: DaemonUnderTest) -> None:
    stopped_daemon.environment = {
        "ROS_MASTER_URI": "http://elsewhere:1",
        "ROS_IP": "10.0.0.1",
        "WATCHDOG_USEC": "",
    }
    stopped_daemon.start()
    environment = Path(f"/proc/{stopped_daemon.executor_pid()}/environ").read_bytes().split(b"\0")
    assert b"ROS_IP=10.0.0.1" in environment
    assert b"ROS_MASTER_URI=http://elsewhere:1" in environment
    with stopped_daemon.client() as client:
        assert client.get_status().runners[0].settings.ros.master_uri == "http://elsewhere:1"


def test_log_records_arrive_with_their_source(daemon: DaemonUnderTest, client: rtcf.Client) -> None:
    client.load(rtcf.component("demo", "Logs"))
    line = wait_for(
        lambda: next((x for x in daemon.log().splitlines() if "from the loop" in x), ""),
        "the record",
    )
    assert line.split(maxsplit=1)[0].endswith(".500")
    assert "WARNING rt_runner /Logs: from the loop (logs.cpp:12, #7)" in line


def test_dropped_log_records_are_counted_and_reported(
    stopped_daemon: DaemonUnderTest,
) -> None:
    stopped_daemon.settings.write_text("[limits]\nlog_records_per_s = 1\n")
    stopped_daemon.start("--config", str(stopped_daemon.settings))
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Chatters"))

    def dropped() -> int:
        counts = re.findall(r"(\d+) log records of its components were dropped", log())
        return sum(map(int, counts))

    log = stopped_daemon.log
    wait_for(lambda: dropped() + len(re.findall(r"line \d+$", log(), re.M)) == CHATTER, "all")
    assert "were dropped: more than 1 a second; see log_records_per_s under [limits]" in log()
    assert dropped() > CHATTER // 2
