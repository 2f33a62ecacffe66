"""Actions on rtcfd and its surroundings while a loop runs at 2 kHz: no cycle is missed."""

import datetime
import threading
import time
from typing import Any

import rtcf
import versions
from loop_2khz import FREQUENCY_HZ, Loop
from machine import wait_for
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

YEAR = datetime.timedelta(days=365)
WATCHDOG_S = 3


def set_clock(loop: Loop, by: datetime.timedelta) -> None:
    now = datetime.datetime.now(tz=datetime.UTC) + by
    loop.machine.run("date", "--utc", "--set", now.isoformat())


class Lease:
    """A component leased until the end of this object."""

    def __init__(self) -> None:
        self.ended: list[Any] = []
        self._loaded = threading.Event()
        opening = control_pb2.OpenLease(
            component=rtcf.component("rtcf_examples", "Identity", name="held"),
            run_id="test", holder="the test", on_lost=control_pb2.ON_LEASE_LOST_STOP,
        )  # fmt: skip
        self._client = rtcf.Client()
        self._lease = self._client.lease_component(opening)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        assert self._loaded.wait(90)

    def _listen(self) -> None:
        try:
            for message in self._lease:
                if message.WhichOneof("kind") == "loaded":
                    self._loaded.set()
                if message.WhichOneof("kind") == "ended":
                    self.ended.append(message.ended)
        except rtcf.RtcfError as error:
            self.ended.append(error)

    def end(self) -> None:
        self._lease.end()
        self._thread.join(90)
        self._client.close()


def test_a_wall_clock_set_back_and_forward_by_a_year(loop: Loop) -> None:
    loop.drop_in(f"WatchdogSec={WATCHDOG_S}")
    held = None
    try:
        loop.systemctl("restart", "rtcfd")
        daemon = loop.pid
        held = Lease()
        with rtcf.Client() as client:
            # Timeouts that would expire at once, or never, if they followed the wall clock.
            client.set_runner(
                runner_pb2.RunnerSettings(orphan_timeout_s=5.0, stall_timeout_ms=1000)
            )
        before = loop.now()
        for jump in (-YEAR, YEAR):
            year = datetime.datetime.now(tz=datetime.UTC).year
            set_clock(loop, jump)
            assert abs(datetime.datetime.now(tz=datetime.UTC).year - year) == 1
            # Both the watchdog and the timeouts expire several times.
            loop.must_have_gone_on(before, seconds=4 * WATCHDOG_S)
            before = loop.now()
            assert loop.pid == daemon
            assert loop.unit_property("NRestarts") == "0"
            assert held.ended == []
            with rtcf.Client() as client:
                assert client.get_component("held").holder == "the test"
                state = client.get_component("held").state
                assert state == graph_pb2.COMPONENT_STATE_RUNNING
                # Statistics count durations, independent of the wall clock.
                statistics = client.get_statistics()
                assert 0 < statistics.duration.max_ns < 1e9
                assert statistics.latency.max_ns < 1e9
                assert client.get_status().uptime_ns < 3600e9
        held.end()
        assert [each.why for each in held.ended] == [control_pb2.LeaseEnded.WHY_ASKED]
        # The watchdog still expires in time.
        set_clock(loop, -YEAR)
        loop.kill("STOP", daemon)
        wait_for(lambda: loop.pid not in (0, daemon), "another rtcfd", 10 * WATCHDOG_S)
        wait_for(lambda: loop.unit_property("ActiveState") == "active", "its start")
        loop.must_have_gone_on(before)
        # The timeout of a loop without rtcfd still expires in time, too.
        loop.drop_in("Restart=no")
        executor = before.executor
        loop.kill("KILL", loop.pid)
        gone = time.monotonic()
        set_clock(loop, YEAR)
        wait_for(
            lambda: loop.machine.run("kill", "-0", str(executor), check=False).returncode != 0,
            "the end of a loop that nobody supervises",
        )
        assert time.monotonic() - gone > 4.0
    finally:
        loop.drop_in("")


def test_a_restart_and_a_kill_of_rtcfd(loop: Loop) -> None:
    before, daemon = loop.now(), loop.pid
    loop.systemctl("restart", "rtcfd")
    assert loop.pid != daemon
    loop.must_have_gone_on(before)
    daemon = loop.pid
    loop.kill("KILL", daemon)
    wait_for(lambda: loop.pid not in (0, daemon), "another rtcfd")
    loop.must_have_gone_on(before)


def test_a_reload_and_a_reexecution_of_systemd(loop: Loop) -> None:
    before = loop.now()
    loop.configure("[limits]\nclients = 99\n")
    loop.systemctl("reload", "rtcfd")
    loop.systemctl("daemon-reexec")
    loop.systemctl("daemon-reload")
    loop.must_have_gone_on(before)


def test_many_clients(loop: Loop) -> None:
    before = loop.now()
    clients = [rtcf.Client() for _ in range(100)]
    answers = [client.get_status().version for client in clients]
    for client in clients:
        client.close()
    assert len(answers) == 100
    loop.must_have_gone_on(before)


def test_continuous_graph_changes(loop: Loop) -> None:
    before = loop.now()
    with rtcf.Client() as client:
        for _ in range(20):
            client.load(rtcf.component("rtcf_examples", "Identity", name="I"))
            client.unload(["I"])
    loop.must_have_gone_on(before)


def test_an_upgrade_and_rtcfd_of_the_next_protocol(loop: Loop) -> None:
    """The last test: packages of a higher version remain installed."""
    machine = loop.machine
    files = versions.make_higher(machine, "/payload/debs", "/upgrade")
    before, daemon = loop.now(), loop.pid
    machine.shell(f"apt-get install --yes --quiet {files}")
    assert loop.pid == daemon
    loop.must_have_gone_on(before)
    loop.systemctl("restart", "rtcfd")
    loop.must_have_gone_on(before)
    assert "restart pending: its executor is of rtcf" in loop.told().status
    with rtcf.Client() as client:
        client.load(rtcf.component("rtcf_examples", "Identity", name="I"))
    loop.must_have_gone_on(before)
    assert loop.now().iteration > FREQUENCY_HZ
