"""The system's data on a loop's real-time thread and its process, from proc(5)."""

from dataclasses import dataclass
from pathlib import Path

import rtcf
from daemon_process import wait_for
from rtcf.v1 import runner_pb2

_NO_LOCK = "memory is not locked"


@dataclass(frozen=True)
class Usage:
    """Resource usage since the start of the thread."""

    page_faults: int
    preempted: int  # involuntary context switches
    slept: int  # voluntary context switches


class RealtimeThread:
    """The thread of a loop that has just started; counts from its construction on."""

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
        """Check that it had no page fault, and caused no late cycle itself.

        It does not count late or interrupted cycles and changes that are due to the machine or
        its host: these are few, and random.
        """
        found = self._client.get_statistics(self._runner)
        if self._locked:
            assert self.usage().page_faults == self._before.page_faults
        assert found.adoption.p50_ns < self._period_ns, f"changes took too long: {found.adoption}"
        if found.duration.count > 2000:
            assert found.duration.p99_ns < self._period_ns, found.duration

    def usage(self) -> Usage:
        """Return the resource usage so far."""
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
    """Return the resident memory of a process, in KiB."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:"))
