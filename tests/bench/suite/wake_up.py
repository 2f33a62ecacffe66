"""Wake-up latency: rtcf's loop against cyclictest, idle and under load."""

import numpy as np
from paper_graph import run_rtcf
from processes import Failed, load, missing, output_of
from quantiles import Samples, median_of, summary
from result import Result
from setting import FREQUENCY_HZ, PRIORITY, Setting

_ROUNDS = 3
_SECONDS = 5.0


def cyclictest(setting: Setting, seconds: float) -> Samples:
    """Return cyclictest's latencies in ns at rtcf's frequency, priority and CPU."""
    cycles = int(seconds * FREQUENCY_HZ)
    command = [
        *("cyclictest", "--mlockall", "--threads=1", f"--affinity={setting.cpu}"),
        *(f"--priority={PRIORITY}", f"--interval={1_000_000 // FREQUENCY_HZ}"),
        *(f"--loops={cycles}", "--nsecs", "--verbose"),
    ]
    samples = []
    for line in output_of(command, seconds).splitlines():
        fields = line.split(":")
        if len(fields) == 3 and all(field.strip().isdigit() for field in fields):
            samples.append(float(fields[2]))
    if len(samples) < cycles // 2:
        raise Failed("cyclictest printed no samples")
    return np.array(samples)


def run(setting: Setting) -> Result:
    """Compare in alternating runs. `make bench-rt` has the budgets."""
    result = Result(
        "wake_up",
        f"wake-up latency at {FREQUENCY_HZ} Hz, SCHED_FIFO {PRIORITY}: rtcf and cyclictest",
        ["µs", "p50", "p99", "p99.9", "max", "missed"],
    )
    result.skipped = missing("cyclictest", "stress-ng")
    if result.skipped:
        return result
    for kind in ("idle", "stress-ng"):
        ours: list[list[float]] = []
        theirs: list[list[float]] = []
        missed = 0
        try:
            with load(kind):
                for _ in range(_ROUNDS):
                    own = run_rtcf(setting, _SECONDS)
                    missed += own.missed
                    ours.append(summary(own.latencies_ns, 1e-3))
                    theirs.append(summary(cyclictest(setting, _SECONDS), 1e-3))
        except Failed as failure:
            result.skipped = str(failure)
            return result
        result.rows += [
            [f"cyclictest, {kind}", *median_of(theirs), None],
            [f"rtcf, {kind}", *median_of(ours), missed],
        ]
    result.notes.append(f"medians of {_ROUNDS} interleaved runs of {_SECONDS:g} s each")
    return result
