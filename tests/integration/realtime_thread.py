"""What the system says about a loop's real-time thread and its process, by proc(5)."""

from dataclasses import dataclass
from pathlib import Path

import rtcf
from daemon_process import wait_for
from rtcf.v1 import runner_pb2

_NO_LOCK = "memory is not locked"


@dataclass(frozen=True)
class Usage:
    """What it has used since its start."""

    page_faults: int
    preempted: int  # how often the CPU was taken from it
    slept: int  # how often it gave the CPU up


class RealtimeThread:
    """The thread of a loop that has just started; what it does from here on is counted."""

    def __init__(self, client: rtcf.Client, runner: str = "rt_runner") -> None:
        self._client = client
        self._runner = runner
        status = wait_for(lambda: self._once_running(), "the loop's thread")
        self.process = int(status.pid)
        self.id = int(status.realtime_tid)
        self._locked = not any(_NO_LOCK in line for line in status.degraded)
        self._period_ns = 1e9 / status.settings.frequency_hz
        client.reset_statistics(runner)
        self._before = self.usage()

    def _once_running(self) -> runner_pb2.RunnerStatus | None:
        status: runner_pb2.RunnerStatus = self._client.get_status(self._runner).runners[0]
        return status if status.realtime_tid and status.iteration else None

    def check(self) -> None:
        """See that it has taken no page fault, and that no cycle was late of its own doing.

        Cycles and changes that the machine, or the machine's host, began late or interrupted are
        not its doing: they are few, and come when they like.
        """
        found = self._client.get_statistics(self._runner)
        if self._locked:
            assert self.usage().page_faults == self._before.page_faults
        assert found.adoption.p50_ns < self._period_ns, f"changes took too long: {found.adoption}"
        if found.duration.count > 2000:
            assert found.duration.p99_ns < self._period_ns, found.duration

    def usage(self) -> Usage:
        """Return what it has used so far."""
        folder = Path(f"/proc/{self.process}/task/{self.id}")
        text = (folder / "stat").read_text()
        fields = text[text.rindex(")") + 2 :].split()
        status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
        return Usage(
            page_faults=int(fields[7]) + int(fields[9]),
            preempted=int(status["nonvoluntary_ctxt_switches"]),
            slept=int(status["voluntary_ctxt_switches"]),
        )


def resident_kb(process: int) -> int:
    """Return the memory of a process, in KiB."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
