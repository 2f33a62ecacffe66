"""Cycles with cold caches: rtcf alternating with LinuxCNC HAL, from the deadline to the end."""

from paper_graph import HAL_SUM, hal_components, run_hal, run_rtcf
from processes import Failed, missing, swept_caches
from quantiles import median_of, summary
from result import Budget, Result
from setting import Setting

_ROUNDS = 3
_SECONDS = 10.0
_FREQUENCY_HZ = 200  # so that 5 ms of other memory traffic lie between two cycles
_CHAIN = 150  # HAL's shared memory has no place for more
_GRAPHS = {"Fig. 1": 0, f"chain of {_CHAIN}": _CHAIN}


def run(setting: Setting) -> Result:
    """Compare the times from deadline to end: nothing that prepares a cycle is left out."""
    result = Result(
        "cold_caches",
        f"deadline to end of the cycle at {_FREQUENCY_HZ} Hz, caches swept between the cycles",
        ["µs", "p50", "p99", "p99.9", "max"],
    )
    result.skipped = missing("halrun", "halcompile", "stress-ng")
    if result.skipped:
        return result
    try:
        with hal_components(setting), swept_caches(setting.cpu):
            for graph, length in _GRAPHS.items():
                _compare(setting, result, graph, length)
    except Failed as failure:
        result.skipped = str(failure)
    result.notes.append(f"medians of {_ROUNDS} runs each; HAL's times include its recorder")
    return result


def _compare(setting: Setting, result: Result, graph: str, length: int) -> None:
    rtcf: list[list[float]] = []
    hal: list[list[float]] = []
    sums: list[list[float]] = []
    for _ in range(_ROUNDS):
        own = run_rtcf(setting, _SECONDS, _FREQUENCY_HZ, length=length)
        rtcf.append(summary(own.durations_ns + own.latencies_ns, 1e-3))
        hal.append(summary(run_hal(_SECONDS, frequency_hz=_FREQUENCY_HZ, length=length).ends_ns, 1e-3))
        plain = run_hal(_SECONDS, HAL_SUM, _FREQUENCY_HZ, length)
        sums.append(summary(plain.ends_ns, 1e-3))
    ours, theirs = median_of(rtcf), median_of(hal)
    result.rows += [
        [f"{graph}, rtcf", *ours],
        [f"{graph}, LinuxCNC HAL", *theirs],
        [f"{graph}, LinuxCNC HAL, plain sums", *median_of(sums)],
    ]
    result.budgets += [
        Budget(f"{graph}, cold, p50, limit: HAL's", ours[0], theirs[0], "µs"),
        Budget(f"{graph}, cold, p99.9, limit: HAL's", ours[2], theirs[2], "µs"),
    ]
