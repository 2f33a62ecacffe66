"""A restart of rtcfd by systemd: loops continue, and the present settings apply."""

import asyncio
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import rtcf
from daemon_process import DEADLINE_S, is_gone, wait_for
from daemon_under_test import DaemonUnderTest
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2
from rtcfd_in_process import Refused, Rtcfd

RUNNING = runner_pb2.RUNNER_STATE_RUNNING
GRAPH = """\
components:
  - {name: a, package: demo, type: Fine}
"""


@pytest.fixture
def service(stopped_daemon: DaemonUnderTest) -> DaemonUnderTest:
    """A loop with one component, in an rtcfd run like systemd does."""
    stopped_daemon.start_service()
    with stopped_daemon.client() as client:
        client.load(rtcf.component("demo", "Fine", name="a"))
        client.start()
    return stopped_daemon


class SlowLoad:
    """A client whose load takes until a file exists."""

    def __init__(self, service: DaemonUnderTest, until: Path) -> None:
        self._service = service
        self._until = until
        self._under_way = threading.Event()
        self._outcome: list[str] = []
        self._thread = threading.Thread(target=self._load)
        self._thread.start()
        assert self._under_way.wait(DEADLINE_S)

    def outcome(self) -> list[str]:
        """Return the loaded component, or the error."""
        self._thread.join(DEADLINE_S)
        return self._outcome

    def _load(self) -> None:
        spec = rtcf.component("demo", "Slow", name="s", parameters=[f"until:={self._until}"])
        with self._service.client() as client:
            try:
                result = client.load(spec, on_progress=lambda _: self._under_way.set())
                self._outcome.append(str(result.component))
            except rtcf.RtcfError as error:
                self._outcome.append(str(error))


def restart(service: DaemonUnderTest) -> None:
    assert service.end(signal.SIGUSR1) == 0
    service.start_service()


def test_the_next_rtcfd_adopts_the_loop(service: DaemonUnderTest) -> None:
    pid = service.executor_pid()
    restart(service)
    restart(service)
    with service.client() as client:
        status = client.get_status().runners[0]
        assert (status.pid, status.state, status.status) == (pid, RUNNING, "")
    assert "leaving all loops to the next rtcfd" in service.log()
    assert "stopping all loops" not in service.log()
    assert "the executor's is kept" not in service.log()


def test_a_stop_still_ends_the_loop(service: DaemonUnderTest) -> None:
    pid = service.executor_pid()
    restart(service)
    assert service.end() == 0
    wait_for(lambda: is_gone(pid), "its end")
    assert list((service.folder / "run").iterdir()) == []


def test_changed_defaults_apply_but_chosen_settings_stay(
    service: DaemonUnderTest,
) -> None:
    with service.client() as client:
        client.set_runner(runner_pb2.RunnerSettings(priority=70))
    assert service.end(signal.SIGUSR1) == 0
    service.settings.write_text("[runner]\nfrequency_hz = 500\npriority = 60\n")
    service.start_service()
    with service.client() as client:
        status = client.get_status().runners[0]
        assert status.state == RUNNING
        assert status.settings.frequency_hz == 500.0
        assert status.settings.priority == 70
        assert not status.chosen.HasField("frequency_hz")
    assert "changed while rtcfd was away: rt_runner: frequency_hz 1000 -> 500" in service.log()


def test_a_newly_set_priority_replaces_the_derived_one(
    service: DaemonUnderTest,
) -> None:
    with service.client() as client:
        assert client.get_status().runners[0].settings.priority == 80
    assert service.end(signal.SIGUSR1) == 0
    service.settings.write_text("[runner]\npriority = 60\n")
    service.start_service()
    with service.client() as client:
        status = client.get_status().runners[0]
        assert (status.state, status.settings.priority) == (RUNNING, 60)
        assert not status.chosen.HasField("priority")
        # A value set for this runner wins over the file.
        client.set_runner(runner_pb2.RunnerSettings(priority=70, frequency_hz=4000.0))
        assert client.get_status().runners[0].settings.priority == 70


def test_only_changed_graphs_are_applied(
    stopped_daemon: DaemonUnderTest,
) -> None:
    service = stopped_daemon
    service.graphs.mkdir()
    (service.graphs / "a.yaml").write_text(GRAPH)
    service.start_service()
    with service.client() as client:
        client.start()
        client.load(rtcf.component("demo", "Fine", name="by_hand"))
    restart(service)
    with service.client() as client:
        assert client.get_order() == ["/a", "/by_hand"]
    assert service.end(signal.SIGUSR1) == 0
    (service.graphs / "a.yaml").write_text(GRAPH + "  - {name: b, package: demo, type: Fine}\n")
    service.start_service()
    with service.client() as client:
        assert client.get_order() == ["/a", "/b"]
        assert client.get_status().runners[0].state == RUNNING


def test_a_change_in_progress_finishes_first(service: DaemonUnderTest) -> None:
    until = service.folder / "until"
    slow = SlowLoad(service, until)
    assert service.process is not None
    service.process.send_signal(signal.SIGUSR1)
    wait_for(lambda: "leaving all loops" in service.log(), "the signal's effect")
    until.touch()
    assert service.process.wait(DEADLINE_S) == 0
    assert slow.outcome() == ["/s"]
    service.start_service()
    with service.client() as client:
        assert client.get_order() == ["/a", "/s"]
    assert "the executor's is kept" not in service.log()


def test_holders_keep_their_leases_and_return(service: DaemonUnderTest) -> None:
    opening = control_pb2.OpenLease(
        component=rtcf.component("demo", "Fine", name="held"), run_id="run", holder="test",
    )  # fmt: skip
    client = service.client()
    messages = iter(client.lease_component(opening))
    while next(messages).WhichOneof("kind") != "loaded":
        pass
    pid = service.executor_pid()
    assert service.end(signal.SIGUSR1) == 0
    with pytest.raises(rtcf.DaemonUnreachableError):
        list(messages)
    client.close()
    service.start_service()
    opening.attach = True
    with service.client() as again:
        lease = again.lease_component(opening)
        answers = iter(lease)
        assert next(answers).WhichOneof("kind") == "loaded"
        status = again.get_status().runners[0]
        assert (status.pid, status.state) == (pid, RUNNING)
        assert again.get_component("held").holder == "test"
        lease.end()
        assert [each.ended.why for each in answers][-1] == control_pb2.LeaseEnded.WHY_ASKED
    assert "has died" not in service.log()


def test_a_new_executor_frees_a_runner_with_a_hanging_change(service: DaemonUnderTest) -> None:
    pid = service.executor_pid()
    slow = SlowLoad(service, service.folder / "never")
    done = service.ctl("runner", "restart", "rt_runner")
    assert done.stdout.startswith("runner rt_runner restarted"), done.stderr
    (error,) = slow.outcome()
    assert error == "runner rt_runner: its executor is being restarted"
    with service.client() as client:
        status = client.get_status().runners[0]
        assert status.pid not in (0, pid)
        assert status.state == runner_pb2.RUNNER_STATE_STOPPED
        assert client.get_order() == ["/a"]
        state = client.get_component("a").state
        assert state == graph_pb2.COMPONENT_STATE_CONFIGURED


def test_a_stop_after_the_handover_to_the_next_rtcfd_is_rejected(
    rtcfd: Callable[[], Rtcfd],
) -> None:
    async def play() -> None:
        first, second = rtcfd(), rtcfd()
        await first.start()
        await first.call("Start", control_pb2.StartRequest())
        await first.runners.leave()
        with pytest.raises(Refused, match="rtcfd is being restarted"):
            await first.call("Stop", control_pb2.StopRequest())
        saved = second.saved("rt_runner")
        assert saved is not None and saved["running"] is True  # the disk belongs to the next rtcfd
        await second.start()
        assert second.runners.get("rt_runner").loop.running
        await second.call("Stop", control_pb2.StopRequest())
        peer = second.peer("rt_runner")
        assert peer is not None and not peer.running
        await second.runners.close(in_order=True)

    asyncio.run(play())
