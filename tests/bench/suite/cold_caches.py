"""Cycles with cold caches: rtcf alternating with LinuxCNC HAL, from the deadline to the end."""

from paper_graph import HAL_MIMO, HAL_SUM, hal_components, run_hal, run_rtcf
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
        for component, found in ((HAL_MIMO, hal), (HAL_SUM, sums)):
            theirs = run_hal(_SECONDS, component, _FREQUENCY_HZ, length)
            found.append(summary(theirs.ends_ns, 1e-3))
    ours, limit = median_of(rtcf), median_of(hal)
    result.rows += [
        [f"{graph}, rtcf", *ours],
        [f"{graph}, LinuxCNC HAL", *limit],
        [f"{graph}, LinuxCNC HAL, plain sums", *median_of(sums)],
    ]
    result.budgets += [
        Budget(f"{graph}, cold, p50, limit: HAL's", ours[0], limit[0], "µs"),
        Budget(f"{graph}, cold, p99.9, limit: HAL's", ours[2], limit[2], "µs"),
    ]
