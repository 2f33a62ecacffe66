"""Deaths of executors: reports, components taken out, recovery."""

import os
import signal

import pytest
import rtcf
from daemon_process import is_gone, wait_for
from daemon_under_test import DaemonUnderTest
from flight_writer import FlightWriter
from rtcf import reasons
from rtcf.v1 import graph_pb2, runner_pb2
from rtcfd.executor.flight_recorder import FlightRecorder, Note
from rtcfd.executor.watched_process import End
from rtcfd.recovery.verdict import judge


def die(client: rtcf.Client, name: str, how: str) -> None:
    """Make the executor die in a component's update."""
    with pytest.raises(rtcf.RefusedError):
        client.set_parameters(name, [rtcf.parse_parameter(f"die:={how}")])


def recovered(daemon: DaemonUnderTest, times: int = 1) -> None:
    wait_for(lambda: daemon.log().count("executor restarted in") >= times, "the recovery")


@pytest.fixture
def running(client: rtcf.Client) -> rtcf.Client:
    client.load(rtcf.component("demo", "Fine", name="bad"))
    client.load(rtcf.component("demo", "Fine", name="good"))
    client.load(rtcf.component("demo", "Fine", name="extra", optional=True))
    client.start()
    return client


def state(client: rtcf.Client) -> runner_pb2.RunnerStatus:
    status: runner_pb2.RunnerStatus = client.get_status().runners[0]
    return status


def test_a_crash_in_an_update_is_named_and_its_component_quarantined(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    die(running, "/bad", "SIGSEGV")
    recovered(daemon)
    assert running.get_order() == ["/extra", "/good"]
    status = state(running)
    assert status.state == runner_pb2.RUNNER_STATE_FAULTED
    assert "was killed by SIGSEGV" in status.status
    assert "at address 0x10 while /bad.update was running in cycle" in status.status
    assert (
        "`rtcfctl -r rt_runner release /bad` loads /bad again, `rtcfctl -r rt_runner unload /bad` "
        "removes it; `rtcfctl -r rt_runner start --without /bad` starts the loop without it"
    ) in status.status
    assert status.status.count("was killed by SIGSEGV") == 1
    left_out = running.get_component("bad")
    assert left_out.state == graph_pb2.COMPONENT_STATE_LEFT_OUT
    assert "/bad.update" in left_out.fault
    assert "/bad" in daemon.saved()["quarantined"]
    assert daemon.saved()["running"] is False

    with pytest.raises(reasons.ComponentLeftOutError, match="left out of its loop: /bad"):
        running.start()
    assert running.start(without=["bad"]).order == ["/extra", "/good"]
    assert state(running).state == runner_pb2.RUNNER_STATE_RUNNING
    running.release(["bad"])
    assert running.get_order() == ["/bad", "/extra", "/good"]
    assert daemon.saved()["quarantined"] == {}
    assert state(running).status == ""


def test_the_advice_follows_the_graph(daemon: DaemonUnderTest, running: rtcf.Client) -> None:
    die(running, "/bad", "SIGSEGV")
    recovered(daemon)
    running.unload(["bad"])
    status = state(running).status
    assert "--without" not in status
    assert "release" not in status
    assert status.endswith("`rtcfctl -r rt_runner start` starts the loop")
    running.start()
    assert state(running).status == ""


def test_a_component_that_is_left_out_is_named_with_remedies_after_a_reboot(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    die(running, "/bad", "SIGSEGV")
    recovered(daemon)
    restart_both(daemon)
    with daemon.client() as again:
        status = state(again).status
    assert status.startswith("/bad is left out: was killed by SIGSEGV")
    for words in ("release /bad", "unload /bad", "start --without /bad"):
        assert f"`rtcfctl -r rt_runner {words}`" in status


def test_a_quarantine_outlives_rtcfd(daemon: DaemonUnderTest, running: rtcf.Client) -> None:
    die(running, "/bad", "SIGFPE")
    recovered(daemon)
    daemon.end()
    daemon.start()
    with daemon.client() as again:
        assert again.get_order() == ["/extra", "/good"]
        assert "/bad is left out" in state(again).status
        again.unload(["bad"])
        assert state(again).status == ""
    assert daemon.saved()["quarantined"] == {}


def test_a_quarantined_component_can_be_replaced(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    die(running, "/bad", "SIGSEGV")
    recovered(daemon)
    running.replace("bad", rtcf.component("demo", "Logs"))
    assert running.get_order() == ["/bad", "/extra", "/good"]
    assert running.get_component("bad").spec.type == "Logs"


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ("stall", "because a cycle made no progress while /bad.update was running"),
        ("exit", "ended with exit status 3 while /bad.update in cycle"),
    ],
)
def test_other_causes_of_death_by_a_component(
    daemon: DaemonUnderTest, running: rtcf.Client, how: str, text: str
) -> None:
    die(running, "/bad", how)
    recovered(daemon)
    assert text in daemon.log()
    assert running.get_order() == ["/extra", "/good"]


def test_a_crash_of_a_new_component_does_not_take_the_old_one_out(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    with pytest.raises(rtcf.RefusedError, match="while /bad.configure was running"):
        running.replace("bad", rtcf.component("demo", "Crashes"))
    recovered(daemon)
    assert running.get_order() == ["/bad", "/extra", "/good"]
    assert running.get_component("bad").spec.type == "Fine"
    assert daemon.saved()["quarantined"] == {}


def test_a_kill_from_outside_takes_no_component_out(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    die(running, "/bad", "SIGKILL")
    recovered(daemon)
    assert "was killed by SIGKILL" in daemon.log()
    assert running.get_order() == ["/bad", "/extra", "/good"]
    assert "with all its components" in state(running).status


def test_start_restarts_an_executor_that_was_asked_to_end(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    os.kill(daemon.executor_pid(), signal.SIGTERM)
    wait_for(lambda: state(running).state == runner_pb2.RUNNER_STATE_DOWN, "its end")
    assert "ended with exit status 0" in state(running).status
    assert "no loop to stop" in running.stop().notes[0]
    with pytest.raises(rtcf.RefusedError) as refused:
        running.load(rtcf.component("demo", "Fine"))
    assert refused.value.code == "UNAVAILABLE"
    assert running.start().order == ["/bad", "/extra", "/good"]
    assert state(running).status == ""


def test_a_loop_continues_without_an_optional_culprit(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    running.set_runner(runner_pb2.RunnerSettings(on_crash=runner_pb2.ON_CRASH_RESUME))
    die(running, "/extra", "SIGSEGV")
    recovered(daemon)
    assert running.get_order() == ["/bad", "/good"]
    status = state(running)
    assert status.state == runner_pb2.RUNNER_STATE_RUNNING
    assert status.status.count("was killed by SIGSEGV") == 1
    assert "; its loop goes on; `rtcfctl -r rt_runner release /extra` loads" in status.status
    assert status.status.endswith("`rtcfctl -r rt_runner unload /extra` removes it")
    assert daemon.saved()["running"] is True


def test_a_loop_is_held_without_a_required_culprit(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    running.set_runner(runner_pb2.RunnerSettings(on_crash=runner_pb2.ON_CRASH_RESUME))
    die(running, "/bad", "SIGSEGV")
    recovered(daemon)
    assert state(running).state == runner_pb2.RUNNER_STATE_FAULTED


def test_a_loop_is_held_if_a_required_component_cannot_be_restored(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    daemon.package("gone", types={"Gone": "fine"})
    running.load(rtcf.component("gone", "Gone"))
    running.set_runner(runner_pb2.RunnerSettings(on_crash=runner_pb2.ON_CRASH_RESUME))
    (daemon.packages / "gone" / "main.so").unlink()
    die(running, "/extra", "SIGSEGV")
    recovered(daemon)
    status = state(running)
    assert status.state != runner_pb2.RUNNER_STATE_RUNNING
    assert "not resumed: left out of its loop: /Gone" in status.status
    assert daemon.saved()["running"] is False


def test_many_crashes_hold_the_loop_and_end_the_restarts(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    running.set_runner(runner_pb2.RunnerSettings(on_crash=runner_pb2.ON_CRASH_RESUME))
    for times in range(1, 6):
        die(running, "/extra", "SIGSEGV")
        recovered(daemon, times)
        expected = (
            runner_pb2.RUNNER_STATE_RUNNING if times <= 3 else runner_pb2.RUNNER_STATE_FAULTED
        )
        assert state(running).state == expected, times
        running.release(["extra"])
        running.start()
    die(running, "/extra", "SIGSEGV")
    wait_for(lambda: "the last of 6 in 60 s" in daemon.log(), "the last restart")
    assert state(running).state == runner_pb2.RUNNER_STATE_DOWN
    running.start()
    assert running.get_order() == ["/bad", "/good"]


def restart_both(daemon: DaemonUnderTest) -> None:
    """Start rtcfd again after it and its executor were killed."""
    pid = daemon.executor_pid()
    daemon.end(signal.SIGKILL)
    wait_for(lambda: is_gone(pid), "the end of the executor")
    daemon.start()


@pytest.mark.parametrize(
    ("policy", "stopped", "expected"),
    [
        (runner_pb2.ON_BOOT_HOLD, False, runner_pb2.RUNNER_STATE_STOPPED),
        (runner_pb2.ON_BOOT_RESUME, False, runner_pb2.RUNNER_STATE_RUNNING),
        (runner_pb2.ON_BOOT_RESUME, True, runner_pb2.RUNNER_STATE_STOPPED),
        (runner_pb2.ON_BOOT_START, False, runner_pb2.RUNNER_STATE_RUNNING),
        (runner_pb2.ON_BOOT_START, True, runner_pb2.RUNNER_STATE_STOPPED),
    ],
    ids=["hold", "resume", "resume what was stopped", "start", "start what was stopped"],
)
def test_a_loop_after_a_restart_of_both(
    daemon: DaemonUnderTest,
    running: rtcf.Client,
    policy: runner_pb2.OnBoot,
    stopped: bool,
    expected: int,
) -> None:
    running.set_runner(runner_pb2.RunnerSettings(on_boot=policy))
    if stopped:
        running.stop()
    restart_both(daemon)
    with daemon.client() as again:
        assert state(again).state == expected


def test_an_incomplete_loop_starts_at_boot_only_if_it_ran_incomplete(
    daemon: DaemonUnderTest, running: rtcf.Client
) -> None:
    daemon.package("gone", types={"Gone": "fine"})
    running.load(rtcf.component("gone", "Gone"))
    running.set_runner(runner_pb2.RunnerSettings(on_boot=runner_pb2.ON_BOOT_RESUME))
    (daemon.packages / "gone" / "main.so").unlink()
    restart_both(daemon)
    with daemon.client() as again:
        status = state(again)
        assert status.state == runner_pb2.RUNNER_STATE_FAULTED
        assert "not resumed: left out of its loop: /Gone; /Gone is left out: " in status.status
        assert "`rtcfctl -r rt_runner start --without /Gone` starts the loop" in status.status
        again.start(without=["Gone"])
    restart_both(daemon)
    with daemon.client() as again:
        assert state(again).state == runner_pb2.RUNNER_STATE_RUNNING


def test_a_flight_recorder_is_read_through_proc_and_after_its_end() -> None:
    writer = FlightWriter()
    recorder = FlightRecorder(os.getpid(), writer.descriptor)
    writer.loop(4711, True)
    writer.update(writer.name(3, "/arm/H1"))
    writer.hook(writer.name(4, "/x"), 2)
    writer.crash(signal.SIGSEGV, 1, address=0xDEAD)
    os.close(writer.descriptor)
    assert recorder.read() == Note(
        4711, True, "/arm/H1", "/x", "configure", signal.SIGSEGV, 1, False, 0xDEAD
    )
    writer.put(56, 7)
    assert recorder.read().cycle_hook == "safe"
    writer.update(99)
    assert recorder.read().updating == ""
    recorder.close()


def test_an_invalid_flight_recorder_is_rejected() -> None:
    writer = FlightWriter()
    writer.put(0, 0)
    with pytest.raises(ValueError, match="not a flight recorder"):
        FlightRecorder(os.getpid(), writer.descriptor)


@pytest.mark.parametrize(
    ("end", "note", "text", "culprit"),
    [
        (End(-11), None, "was killed by SIGSEGV", ""),
        (End(-11), Note(updating="/a", signal=11, thread=3), "belongs to no component", ""),
        (End(-6), Note(updating="/a", signal=6, thread=1), "/a.update was running", "/a"),
        (End(-6), Note(signal=6, thread=1), "in its loop", ""),
        (
            End(-6),
            Note(updating="/a", signal=6, thread=1, stalled=True, cycle_hook="safe"),
            "made no progress while /a.safe was running",
            "/a",
        ),
        (
            End(-8),
            Note(updating="/a", hooking="/b", hook="start", signal=8, thread=2),
            "/b.start was running",
            "/b",
        ),
        (End(), Note(updating="/a", signal=11, thread=1), "SIGSEGV", "/a"),
        (End(), Note(updating="/a"), "with unknown exit status", ""),
        (End(0), Note(hooking="/b", hook="stop"), "exit status 0 while /b.stop was running", "/b"),
        (End(1), Note(updating="/a", hooking="/b", hook="stop"), "/a.update in cycle 0 and", ""),
        (End(-9), Note(updating="/a"), "was killed by SIGKILL", ""),
        (End(-9), Note(), "while no component was running", ""),
    ],
)  # fmt: skip
def test_only_the_component_of_the_dead_thread_is_blamed(
    end: End, note: Note | None, text: str, culprit: str
) -> None:
    verdict = judge(end, note)
    assert text in str(verdict)
    assert verdict.culprit == culprit
