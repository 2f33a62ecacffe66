"""The highest frequency at which Fig. 1 runs without missing cycles."""

from paper_graph import run_rtcf
from result import Result
from setting import Setting

_LADDER_HZ = (1000, 2000, 5000, 10_000, 20_000, 30_000, 40_000, 50_000, 60_000, 80_000, 100_000)
_SECONDS = 2.0
_ALLOWED = 0.001  # of all cycles: on a shared host some are taken from anybody


def run(setting: Setting) -> Result:
    """Climb until more than 1 cycle in 1000 is missed."""
    result = Result("frequency", "Fig. 1, missed cycles by frequency", ["Hz", "missed", "share"])
    highest = 0
    for frequency in _LADDER_HZ:
        found = run_rtcf(setting, _SECONDS, frequency)
        share = found.missed / (len(found.durations_ns) + found.missed)
        result.rows.append([frequency, found.missed, share])
        if share > _ALLOWED:
            break
        highest = frequency
    result.notes.append(f"highest stable frequency: {highest} Hz (at most {_ALLOWED:.1%} missed)")
    return result
