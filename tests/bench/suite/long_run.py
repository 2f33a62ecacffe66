"""The paper's run of Fig. 1 under load, and a plot like the paper's Fig. 2."""

from pathlib import Path

from paper_graph import PaperRun, run_rtcf
from processes import load, missing
from quantiles import summary
from result import Result
from setting import FREQUENCY_HZ, Setting

_SHORT_S = 20.0


def run(setting: Setting) -> Result:
    """Run for HOURS, or some seconds, under stress-ng; plot the distributions."""
    seconds = setting.hours * 3600 or _SHORT_S
    result = Result(
        "long_run",
        f"Fig. 1 at {FREQUENCY_HZ} Hz for {seconds:g} s under stress-ng --cpu 48 --io 48",
        ["µs", "p50", "p99", "p99.9", "max"],
    )
    result.skipped = missing("stress-ng")
    if result.skipped:
        return result
    with load("stress-ng"):
        found = run_rtcf(setting, seconds, samples=setting.output / "long_run.samples")
    result.rows = [
        ["calculation duration", *summary(found.durations_ns, 1e-3)],
        ["wake-up latency", *summary(found.latencies_ns, 1e-3)],
    ]
    file = setting.output / "fig2.png"
    draw(found, file)
    result.notes = [
        f"{len(found.durations_ns)} cycles, {found.missed} missed; plot: {file}",
        "the paper, 3 h on a desktop with PREEMPT_RT: calculation p99.9 10.3, max 18.8; "
        "jitter p99.9 1.8, max 6.1",
    ]
    return result


def draw(found: PaperRun, file: Path) -> None:
    """Plot both distributions, counts on a logarithmic scale as in the paper."""
    import matplotlib  # takes a second and is needed here only

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(2, 1, figsize=(7, 6), layout="constrained")
    for axis, samples, title in (
        (axes[0], found.durations_ns, "calculation duration"),
        (axes[1], found.latencies_ns, "wake-up latency"),
    ):
        in_us = samples / 1000
        axis.hist(in_us, bins=200, log=True, color="tab:blue")
        for label, value, style in zip(
            ("p50", "p99", "p99.9", "max"), summary(in_us), ("-", "-.", "--", ":"), strict=True
        ):
            axis.axvline(value, color="tab:red", linestyle=style, label=f"{label} {value:.1f} µs")
        axis.set_xlabel(f"{title} [µs]")
        axis.set_ylabel("cycles")
        axis.legend()
    figure.suptitle(f"Fig. 1 at {FREQUENCY_HZ} Hz under load, {len(found.durations_ns)} cycles")
    figure.savefig(file, dpi=120)
    pyplot.close(figure)
