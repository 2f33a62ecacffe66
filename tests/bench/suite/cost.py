"""Elapsed and CPU time of an action.

On a busy machine the elapsed time includes waits for a CPU. The CPU time of all
processes that take part does not.
"""

import resource
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from quantiles import median

_LOOP = "rtcf-loop"


@dataclass(frozen=True)
class Cost:
    """Durations of one action, ms."""

    clock: float
    cpu: float  # of this process, its child processes and the servers


def cost_of(action: Callable[[], object], servers: Iterable[int]) -> Cost:
    """Measure `action`. `servers` are running processes that take part in it."""
    pids = list(servers)
    cpu, clock = _cpu_ms(pids), time.monotonic()
    action()
    elapsed = (time.monotonic() - clock) * 1e3
    return Cost(elapsed, _cpu_ms(pids) - cpu)


def median_cost(costs: Iterable[Cost]) -> Cost:
    """Return the medians of elapsed time and CPU time, each computed separately."""
    found = list(costs)
    return Cost(median(cost.clock for cost in found), median(cost.cpu for cost in found))


def busy_with_others() -> float:
    """Return the share of the last minute in which a task waited for a CPU, 0 to 1."""
    try:
        text = Path("/proc/pressure/cpu").read_text()
    except OSError:
        return 0.0  # a kernel without pressure stall information
    fields = dict(field.split("=") for field in text.splitlines()[0].split()[1:])
    return float(fields["avg60"]) / 100


def _cpu_ms(servers: list[int]) -> float:
    total = time.process_time() * 1e3
    called = resource.getrusage(resource.RUSAGE_CHILDREN)
    total += (called.ru_utime + called.ru_stime) * 1e3
    for pid in servers:
        total += _process_cpu_ms(pid)
        # The loop computes all the time. A thread that ends meanwhile counts for its process.
        for thread in Path(f"/proc/{pid}/task").iterdir():
            total -= _loop_cpu_ms(thread)
    return total


def _process_cpu_ms(pid: int) -> float:
    """Return the CPU time of a process, ended threads included."""
    # clock_getcpuclockid(3), which Python lacks.
    clock = (~pid << 3) | 2
    return time.clock_gettime_ns(clock) / 1e6


def _loop_cpu_ms(thread: Path) -> float:
    """Return the CPU time of a running loop's thread; 0 for any other thread."""
    try:
        if (thread / "comm").read_text().strip() != _LOOP:
            return 0.0
        # sched_debug(5) of the kernel's documentation: ns on the CPU, ns waiting, time slices.
        return int((thread / "schedstat").read_text().split()[0]) / 1e6
    except (FileNotFoundError, ProcessLookupError):
        return 0.0  # the thread has ended
