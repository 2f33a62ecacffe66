"""Fig. 1 of the paper at 2 kHz: rtcf alternating with LinuxCNC HAL."""

from paper_graph import HAL_SUM, hal_components, run_hal, run_rtcf
from processes import Failed, missing
from quantiles import median_of, summary
from result import Budget, Result
from setting import FREQUENCY_HZ, Setting

_ROUNDS = 5
_SECONDS = 4.0


def run(setting: Setting) -> Result:
    """Compare the calculation durations, medians of interleaved runs."""
    result = Result(
        "against_hal",
        f"Fig. 1 at {FREQUENCY_HZ} Hz, calculation duration: rtcf and LinuxCNC HAL alternating",
        ["µs", "p50", "p99", "p99.9", "max"],
    )
    result.skipped = missing("halrun", "halcompile")
    if result.skipped:
        return result
    rtcf: list[list[float]] = []
    hal: list[list[float]] = []
    sums: list[list[float]] = []
    try:
        with hal_components(setting):
            for _ in range(_ROUNDS):
                rtcf.append(summary(run_rtcf(setting, _SECONDS).durations_ns, 1e-3))
                hal.append(summary(run_hal(_SECONDS).durations_ns, 1e-3))
                sums.append(summary(run_hal(_SECONDS, HAL_SUM).durations_ns, 1e-3))
    except Failed as failure:
        result.skipped = str(failure)
        return result
    ours, theirs = median_of(rtcf), median_of(hal)
    result.rows = [
        ["rtcf", *ours],
        ["LinuxCNC HAL", *theirs],
        ["LinuxCNC HAL, plain sums", *median_of(sums)],
    ]
    result.budgets = [
        Budget("p50, HAL's as the limit", ours[0], theirs[0], "µs"),
        Budget("p99.9, HAL's as the limit", ours[2], theirs[2], "µs"),
    ]
    result.notes += [
        f"medians of {_ROUNDS} runs each; HAL's durations exclude its recorder",
        "rtcf and HAL sum only new values; plain sums add all values, new or old",
    ]
    return result
