"""The kernel's counters of one thread: from perf where permitted, from /proc everywhere."""

import os
import platform
import shutil
import signal
import subprocess
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from daemon_process import DEADLINE_S

_CLOCK_NANOSLEEP = {"x86_64": 230, "aarch64": 115}
_SLEEPING = 1  # prev_state of a thread that yields the CPU voluntarily


@dataclass(frozen=True)
class ThreadCounters:
    """Counters from /proc: proc(5), task/TID/stat and status."""

    page_faults: int
    voluntary_switches: int

    def __sub__(self, earlier: "ThreadCounters") -> "ThreadCounters":
        """Return the difference to earlier counters."""
        return ThreadCounters(
            self.page_faults - earlier.page_faults,
            self.voluntary_switches - earlier.voluntary_switches,
        )


def read_counters(pid: int, thread: int) -> ThreadCounters:
    """Return the present counters."""
    folder = Path(f"/proc/{pid}/task/{thread}")
    text = (folder / "stat").read_text()
    fields = text[text.rindex(")") + 2 :].split()  # from the third field on
    switches = status_field(folder, "voluntary_ctxt_switches")
    return ThreadCounters(int(fields[7]) + int(fields[9]), int(switches))


def status_field(folder: Path, name: str) -> str:
    """Return one field of a `status` of /proc."""
    lines = (folder / "status").read_text().splitlines()
    return next(line.split(":")[1].strip() for line in lines if line.startswith(f"{name}:"))


class Perf:
    """perf stat on one thread during the block."""

    def __init__(self, pid: int, thread: int, folder: Path) -> None:
        others = [name for name in os.listdir(f"/proc/{pid}/task") if int(name) != thread]
        preempted_by_own = " || ".join(f"next_pid == {name}" for name in others)
        wait = _CLOCK_NANOSLEEP[platform.machine()]
        self._folder = folder
        self._command = [
            *("perf", "stat", "-x", ",", "-o", str(folder / "perf"), "-t", str(thread)),
            *("-D", "-1", "--control", f"fifo:{folder / 'control'},{folder / 'answer'}"),
            *("-e", "page-faults", "-e", "raw_syscalls:sys_enter"),
            *("-e", "raw_syscalls:sys_enter", "--filter", f"id != {wait}"),
            *("-e", "sched:sched_switch", "--filter"),
            f"prev_state != {_SLEEPING} && ({preempted_by_own})",
        ]
        self.page_faults = self.system_calls = self.other_system_calls = 0
        self.preempted_by_own = 0

    @staticmethod
    def error(thread: int) -> str:
        """Return the reason why perf cannot count; empty if it can."""
        if shutil.which("perf") is None:
            return "there is no perf (package linux-perf)"
        events = "page-faults,raw_syscalls:sys_enter,sched:sched_switch"
        done = subprocess.run(
            ["perf", "stat", "-x", ",", "-e", events, "-t", str(thread), "true"],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == 0 and "<not supported>" not in done.stderr:
            return ""
        return next(iter(done.stderr.split("\n")), "perf fails")

    def __enter__(self) -> "Perf":
        for name in ("control", "answer"):
            os.mkfifo(self._folder / name)
        self._process = subprocess.Popen(self._command)
        self._control = (self._folder / "control").open("w")
        self._answer = (self._folder / "answer").open()
        self._say("enable")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._say("disable")
        self._process.send_signal(signal.SIGINT)
        self._process.wait(DEADLINE_S)
        self._control.close()
        self._answer.close()
        lines = (self._folder / "perf").read_text().splitlines()
        counts = [int(line.split(",")[0]) for line in lines if line[:1].isdigit()]
        self.page_faults, self.system_calls, self.other_system_calls, self.preempted_by_own = counts

    def _say(self, word: str) -> None:
        self._control.write(f"{word}\n")
        self._control.flush()
        assert self._answer.readline().strip("\0\n") == "ack"
