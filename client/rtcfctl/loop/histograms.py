"""The picture of `rtcfctl stats --plot`: two histograms, as Fig. 2 of the paper shows them."""

import io
from collections.abc import Sequence
from pathlib import Path

import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared import durable

_FORMATS = (".svg", ".png", ".pdf")


def draw(found: runner_pb2.RunnerStatistics, file: Path) -> None:
    """Write it.  Raises ValueError of a file name, and RtcfError."""
    if file.suffix not in _FORMATS:
        raise ValueError(f"{file}: a picture is {', '.join(_FORMATS)}")
    if not found.duration.count:
        raise rtcf.RtcfError(f"{found.runner} has run no cycle: there is nothing to draw")
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        raise rtcf.RtcfError(
            "nothing here draws histograms: sudo apt install python3-matplotlib"
        ) from None
    figure, axes = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained")
    figure.suptitle(f"{found.runner}, {found.iterations} cycles")
    panels: tuple[tuple[str, Sequence[runner_pb2.Bucket], runner_pb2.Distribution], ...] = (
        ("(a) calculation duration [µs]", found.duration_buckets, found.duration),
        ("(b) wake-up latency [µs]", found.latency_buckets, found.latency),
    )
    for axis, (label, buckets, figures) in zip(axes, panels, strict=True):
        ends = [each.upper_ns / 1e3 for each in buckets]
        counts = [each.count for each in buckets]
        axis.hist(ends, bins=100, weights=counts, log=True, color="#2b7bba")
        limit = figures.p999_ns / 1e3
        axis.axvline(limit, color="black", linestyle="--", label=f"99.9 %: {limit:.1f} µs")
        axis.set_xlabel(label)
        axis.set_ylabel("cycles")
        axis.legend()
    picture = io.BytesIO()
    figure.savefig(picture, dpi=150, format=file.suffix.removeprefix("."))
    pyplot.close(figure)
    try:
        durable.write_named(file, picture.getvalue())
    except OSError as error:
        raise rtcf.RtcfError(f"{file}: {error.strerror or error}") from None
