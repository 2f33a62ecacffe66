"""The statistics at the end of a loop, as RTCF 2021 prints them."""

from rtcf.v1 import runner_pb2


def lines(statistics: runner_pb2.RunnerStatistics, warmup_cycles: int) -> list[str]:
    """Return the figures of a loop since its start; none of a loop that has run no cycle."""
    if not statistics.duration.count:
        return []
    return [
        f"Performed {statistics.duration.count} iterations (first {warmup_cycles} ignored) since "
        "last start.",
        f"Calculation duration: {_shown(statistics.duration)}.",
        f"Wake-up latency: {_shown(statistics.latency)}, {statistics.overruns} overruns, "
        f"{statistics.missed} missed cycles.",
    ]


def _shown(figures: runner_pb2.Distribution) -> str:
    mean, most, least = (ns / 1000 for ns in (figures.mean_ns, figures.max_ns, figures.min_ns))
    return f"Mean {mean:.1f} us, Max {most:.1f} us, Min {least:.1f} us"
