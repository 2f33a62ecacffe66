"""Measures of a step response: rise time, settling time, overshoot and final error."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

_SHORTEST = 0.1  # stay within the tolerance, as a fraction of the record


@dataclass(frozen=True)
class StepResponse:
    """The measures of a step response; times are in seconds."""

    rise_time: float
    """The time from 10 % to 90 % of the step."""
    settling_time: float
    """The time, since the first sample, after which the value stays within the tolerance.

    Infinite if the value does not settle: see step_response().
    """
    overshoot: float
    """The maximum distance beyond the target, as a fraction of the step; 0 without overshoot."""
    final_error: float
    """The target minus the last value, in units of the value."""
    unsettled: str = ""
    """Why the settling time is infinite; empty if it is finite."""


def step_response(
    time: npt.ArrayLike,
    value: npt.ArrayLike,
    target: float,
    initial: float = 0.0,
    tolerance: float = 0.02,
) -> StepResponse:
    """Measure the response to a step from `initial` to `target` at the first sample.

    time       increasing times, in seconds
    value      the response, of the same length as `time`
    tolerance  of the settling time, as a fraction of the step

    The rise time is infinite if the value never reaches 90 % of the step. The value settles if its
    last stay within the tolerance lasts to the last sample, at least a tenth of the record, and
    more than twice as long as each earlier stay. A limit cycle, or a record that ends while the
    value crosses the target, has no such stay: the settling time is infinite.

    Raises ValueError for invalid arguments.
    """
    seconds, values = np.asarray(time, dtype=float), np.asarray(value, dtype=float)
    if seconds.ndim != 1 or seconds.shape != values.shape or seconds.size < 2:
        raise ValueError(
            "time and value must be two lists of the same length, with at least 2 samples"
        )
    if not (np.isfinite(seconds).all() and np.isfinite(values).all()):
        raise ValueError("time and value must be finite in all samples")
    if not (np.diff(seconds) > 0).all():
        raise ValueError("time must increase from sample to sample")
    if not np.isfinite(target - initial) or target == initial:
        raise ValueError("a step needs a finite target other than its initial value")
    if not 0 < tolerance < 1:
        raise ValueError("tolerance must be a fraction of the step between 0 and 1")
    share = (values - initial) / (target - initial)
    since = seconds - seconds[0]
    settling_time, unsettled = _settling(since, np.abs(share - 1) <= tolerance)
    return StepResponse(
        rise_time=_first(since, share, 0.9) - _first(since, share, 0.1)
        if share.max() >= 0.9
        else float("inf"),
        settling_time=settling_time,
        overshoot=max(0.0, float(share.max()) - 1),
        final_error=float(target - values[-1]),
        unsettled=unsettled,
    )


def _settling(time: npt.NDArray[np.float64], inside: npt.NDArray[np.bool_]) -> tuple[float, str]:
    """Return the begin of the last stay inside, or infinity and why it does not count."""
    if not inside[-1]:
        return float("inf"), "the last value is outside the tolerance"
    edges = np.flatnonzero(np.diff(inside)) + 1
    begins = np.append(0, edges) if inside[0] else edges
    begins, ends = begins[::2], begins[1::2]
    earlier = float((time[ends] - time[begins[:-1]]).max(initial=0.0))
    begin = float(time[begins[-1]])
    stay = float(time[-1]) - begin
    if stay < _SHORTEST * time[-1]:
        return float("inf"), (
            f"the value is within the tolerance for the last {stay:.3g} s only: measure for longer"
        )
    if stay < 2.0 * earlier:
        return float("inf"), (
            f"the value leaves the tolerance again: it stays for {stay:.3g} s at the end, and has "
            f"stayed for {earlier:.3g} s before"
        )
    return begin, ""


def _first(
    time: npt.NDArray[np.float64], share: npt.NDArray[np.floating[Any]], level: float
) -> float:
    """Return when `share` first reaches `level`, by linear interpolation between samples."""
    after = int(np.argmax(share >= level))
    if after == 0:
        return float(time[0])
    part = (level - share[after - 1]) / (share[after] - share[after - 1])
    return float(time[after - 1] + part * (time[after] - time[after - 1]))
