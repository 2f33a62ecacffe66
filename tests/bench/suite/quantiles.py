"""Quantiles and medians of samples."""

import statistics
from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

Samples = npt.NDArray[np.float64]

median = statistics.median


def summary(samples: Samples, scale: float = 1.0) -> list[float]:
    """Return p50, p99, p99.9 and maximum, each times `scale`. Quantiles are samples."""
    found = np.quantile(samples, [0.5, 0.99, 0.999, 1.0], method="inverted_cdf")
    return [float(value) * scale for value in found]


def median_of(summaries: Iterable[Sequence[float]]) -> list[float]:
    """Return the medians of several runs' summaries, element by element."""
    return [median(values) for values in zip(*summaries, strict=True)]
