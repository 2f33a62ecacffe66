"""The kernel's view of the real-time thread: no page faults, and a single wait per cycle.

These tests measure no durations, so that they hold on any kernel.
"""

import os
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import fig_1
import pytest
import rtcf
from daemon_process import Daemon, wait_for, with_ros
from kernel_counters import Perf, read_counters, status_field
from ros_processes import Master
from rtcf.v1 import runner_pb2
from values import iteration, port_value, wait_until_after

FREQUENCY_HZ = 2000.0
CYCLES = 10_000
SETTLED = 1000  # cycles after which all one-time effects are over
LOCKED_KB = 64 * 1024


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory, master: Master) -> Iterator["Mapped"]:
    """Yield Fig. 1 running with its ROS topics, a subscriber and a publisher."""
    folder = tmp_path_factory.mktemp("mapped")
    daemon = Daemon(folder, with_ros(master.uri, fig_1.WHITELIST))
    daemon.start()
    with rtcf.Client(daemon.socket) as client:
        client.set_runner(runner_pb2.RunnerSettings(frequency_hz=FREQUENCY_HZ))
        fig_1.load(client)
        nodes = (master.node("record", "/R1_H1R2"), master.node("latch", "/G2_R2", "0.5"))
        for node in nodes:
            node.wait_until_connected()
        client.start()
        wait_until_after(client, SETTLED)
        status = client.get_status().runners[0]
        yield Mapped(client, status.pid, status.realtime_tid)
        client.stop()
        sent = iteration(client)
        # The mappings were active all the time: the value of every cycle has arrived, except those
        # lost and counted where a busy machine delayed the receiving thread.
        lost = client.get_status().runners[0].tap_dropped
        assert lost < sent
        nodes[0].wait_for_values(sent - lost)
        assert len(nodes[0].values()) <= sent
        for node in nodes:
            node.end()
    daemon.end()


@dataclass(frozen=True)
class Mapped:
    """The running loop, its executor and its thread."""

    client: rtcf.Client
    pid: int
    thread: int

    def run(self, cycles: int) -> int:
        """Run it for some cycles; return their number."""
        first = iteration(self.client)
        return wait_until_after(self.client, first + cycles) - first


def test_the_loop_has_no_page_fault_and_waits_once_per_cycle(mapped: Mapped) -> None:
    at_most = iteration(mapped.client)
    before = read_counters(mapped.pid, mapped.thread)
    cycles = mapped.run(CYCLES)
    counted = read_counters(mapped.pid, mapped.thread) - before
    at_most = iteration(mapped.client) - at_most
    assert counted.page_faults == 0
    # The kernel counts no wait whose time has passed already, which happens on a busy machine.
    assert cycles * 0.5 < counted.voluntary_switches <= at_most + 1


def test_perf_counts_one_system_call_a_cycle(mapped: Mapped, tmp_path: Path) -> None:
    if error := Perf.error(mapped.thread):
        # The other tests of this file, which need no permission, must suffice.
        warnings.warn(f"perf may not count here: {error}", stacklevel=1)
        assert mapped.run(CYCLES) >= CYCLES
        return
    at_most = iteration(mapped.client)
    with Perf(mapped.pid, mapped.thread, tmp_path) as perf:
        cycles = mapped.run(CYCLES)
    at_most = iteration(mapped.client) - at_most
    assert perf.page_faults == 0
    assert perf.other_system_calls == 0
    assert cycles - 1 <= perf.system_calls <= at_most + 1
    assert perf.preempted_by_own == 0


def test_no_thread_of_rtcf_can_preempt_the_loop(mapped: Mapped) -> None:
    policies = {}
    for thread in map(int, os.listdir(f"/proc/{mapped.pid}/task")):
        with suppress(ProcessLookupError):  # the thread has ended
            policies[thread] = os.sched_getscheduler(thread)
    realtime = os.sched_getscheduler(mapped.thread)
    assert len(policies) > 1
    assert {policy for thread, policy in policies.items() if thread != mapped.thread} == {
        os.SCHED_OTHER
    }
    # Without that right the loop runs degraded and reports it.
    degraded = mapped.client.get_status().runners[0].degraded
    assert realtime == os.SCHED_FIFO or any("SCHED_FIFO" in line for line in degraded)


def test_the_executor_locks_at_most_64_mb(mapped: Mapped) -> None:
    folder = Path(f"/proc/{mapped.pid}")
    for field in ("VmLck", "VmRSS"):
        assert int(status_field(folder, field).split()[0]) <= LOCKED_KB, field


def seal(client: rtcf.Client) -> None:
    """Restrict the running loop to the system call that waits."""
    client.load(rtcf.component("rtcf_test", "Sealed"))
    wait_for(lambda: port_value(client, "Sealed", "sealed") == 1.0, "the seal")


def test_a_loop_restricted_to_waiting_continues(mapped: Mapped) -> None:
    seal(mapped.client)
    assert mapped.run(CYCLES) >= CYCLES
    status = mapped.client.get_status().runners[0]
    assert (status.pid, status.realtime_tid) == (mapped.pid, mapped.thread)
    folder = Path(f"/proc/{mapped.pid}/task/{mapped.thread}")
    assert status_field(folder, "Seccomp") == "2"  # SECCOMP_MODE_FILTER


def test_a_system_call_of_a_component_ends_a_restricted_loop(
    daemon: Daemon, client: rtcf.Client
) -> None:
    client.load(rtcf.component("rtcf_test", "Counter"))
    client.start()
    seal(client)
    client.load(
        rtcf.component(
            "rtcf_faults", "Sleeps", name="bad", remaps=["out:=/bad"], parameters=["after:=100"]
        )
    )
    wait_for(lambda: "killed by SIGSYS" in daemon.log(), "the end of the executor")
