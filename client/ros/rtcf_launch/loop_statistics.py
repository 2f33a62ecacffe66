"""The statistics at the end of a loop, as RTCF 2021 prints them."""

from rtcf.v1 import runner_pb2


def lines(statistics: runner_pb2.RunnerStatistics, warmup_cycles: int) -> list[str]:
    """Return the lines for a loop since its start; none if it has run no cycle."""
    if not statistics.duration.count:
        return []
    return [
        f"Performed {statistics.duration.count} iterations (first {warmup_cycles} ignored) since "
        "last start.",
        f"Calculation duration: {_shown(statistics.duration)}.",
        f"Wake-up latency: {_shown(statistics.latency)}, {statistics.overruns} overruns, "
        f"{statistics.missed} missed cycles.",
    ]


def _shown(distribution: runner_pb2.Distribution) -> str:
    mean, most, least = (
        ns / 1000 for ns in (distribution.mean_ns, distribution.max_ns, distribution.min_ns)
    )
    return f"Mean {mean:.1f} us, Max {most:.1f} us, Min {least:.1f} us"
