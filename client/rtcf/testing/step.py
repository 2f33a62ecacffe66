"""What tests of controllers measure: the response to a step, in the usual terms of control."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class StepResponse:
    """How a value followed a step; times are in seconds since the first sample."""

    rise_time: float
    """From 10 % to 90 % of the step."""
    settling_time: float
    """After it the value stays within the tolerance; infinite if the last sample is outside."""
    overshoot: float
    """How far the value goes beyond the target, as a share of the step; 0 if it does not."""
    final_error: float
    """The target less the last value, in units of the value."""


def step_response(
    time: npt.ArrayLike,
    value: npt.ArrayLike,
    target: float,
    initial: float = 0.0,
    tolerance: float = 0.02,
) -> StepResponse:
    """Measure how a value follows a step from `initial` to `target` at the first sample.

    `time` (s, increasing) and `value` are of one length; `tolerance` is a share of the step. A
    value that never reaches 90 % has an infinite rise time. ValueError: what cannot be measured,
    in one line.
    """
    seconds, values = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    if seconds.ndim != 1 or seconds.shape != values.shape or seconds.size < 2:
        raise ValueError(
            "time and value have to be two lists of the same length, of at least 2 samples"
        )
    if not (np.isfinite(seconds).all() and np.isfinite(values).all()):
        raise ValueError("time and value have to be finite in all samples")
    if not (np.diff(seconds) > 0).all():
        raise ValueError("time has to increase from sample to sample")
    if not np.isfinite(target - initial) or target == initial:
        raise ValueError("a step needs a finite target that is not its initial value")
    if not 0 < tolerance < 1:
        raise ValueError("tolerance has to be a share of the step between 0 and 1")
    share = (values - initial) / (target - initial)
    outside = np.flatnonzero(np.abs(share - 1) > tolerance)
    since = seconds - seconds[0]
    settled = 0 if outside.size == 0 else int(outside[-1]) + 1
    return StepResponse(
        rise_time=_first(since, share, 0.9) - _first(since, share, 0.1)
        if share.max() >= 0.9
        else float("inf"),
        settling_time=float(since[settled]) if settled < since.size else float("inf"),
        overshoot=max(0.0, float(share.max()) - 1),
        final_error=float(target - values[-1]),
    )


def _first(
    time: npt.NDArray[np.float64], share: npt.NDArray[np.floating[Any]], level: float
) -> float:
    """When `share` reaches `level` first, between two samples by a straight line."""
    after = int(np.argmax(share >= level))
    if after == 0:
        return float(time[0])
    part = (level - share[after - 1]) / (share[after] - share[after - 1])
    return float(time[after - 1] + part * (time[after] - time[after - 1]))
