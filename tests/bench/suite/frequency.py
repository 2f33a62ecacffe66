"""The highest frequency at which Fig. 1 runs without missing cycles."""

from paper_graph import run_rtcf
from quantiles import median
from result import Result
from setting import Setting

_LADDER_HZ = (2000, 5000, 10_000, 20_000, 30_000, 40_000, 50_000, 60_000, 80_000, 100_000)
_EASY_HZ = 1000  # cycles missed here are due to other load
_ROUNDS = 3
_SECONDS = 1.0
_ALLOWED = 0.005


def run(setting: Setting) -> Result:
    """Raise the frequency until the share of missed cycles exceeds that at an easy one."""
    result = Result(
        "frequency", "Fig. 1, share of missed cycles", ["Hz", "missed", f"at {_EASY_HZ} Hz"]
    )
    highest = _EASY_HZ
    for frequency in _LADDER_HZ:
        rungs, references = [], []
        for _ in range(_ROUNDS):
            references.append(_missed(setting, _EASY_HZ))
            rungs.append(_missed(setting, frequency))
        share, reference = median(rungs), median(references)
        result.rows.append([frequency, share, reference])
        if share > reference + _ALLOWED:
            break
        highest = frequency
    result.notes.append(
        f"highest stable frequency: {highest} Hz (at most {_ALLOWED:.1%} more missed than at "
        f"{_EASY_HZ} Hz, where other load causes the misses; medians of {_ROUNDS} runs)"
    )
    return result


def _missed(setting: Setting, frequency_hz: int) -> float:
    found = run_rtcf(setting, _SECONDS, frequency_hz)
    return found.missed / (len(found.durations_ns) + found.missed)
