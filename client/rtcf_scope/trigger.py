"""Finds the cycle that a trigger waits for, looking at every one."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_CYCLES = 200_000  # of one shot
KINDS = ("edge", "level", "window", "nan")
_SLOPES = {"edge": ("rising", "falling", "either"), "level": ("above", "below"),
           "window": ("leaves", "enters"), "nan": ("",)}  # fmt: skip


class TriggerError(ValueError):
    """A trigger that cannot be; says why."""


@dataclass(frozen=True)
class Trigger:
    """What to wait for; `low` is the level where there is one alone."""

    signal: str
    kind: str
    slope: str
    low: float
    high: float
    before: int  # cycles that are shown before the hit
    after: int  # from the hit on
    holdoff: int  # cycles after a shot in which nothing hits
    single: bool


def parse(told: Any) -> Trigger:
    """Return the trigger that a page asks for; raises TriggerError."""
    try:
        kind = str(told["kind"])
        if kind not in KINDS:
            raise TriggerError(f"trigger on {kind!r}: one of {', '.join(KINDS)}")
        slope = str(told.get("slope") or _SLOPES[kind][0])
        if slope not in _SLOPES[kind]:
            raise TriggerError(f"{kind} {slope!r}: one of {', '.join(_SLOPES[kind])}")
        trigger = Trigger(
            str(told["signal"]), kind, slope,
            float(told.get("low", 0.0)), float(told.get("high", 0.0)),
            int(told["before"]), int(told["after"]), int(told.get("holdoff", 0)),
            bool(told.get("single", False)),
        )  # fmt: skip
    except (KeyError, TypeError, AttributeError, OverflowError):
        raise TriggerError("a trigger has signal, kind, before and after") from None
    except TriggerError:
        raise
    except ValueError as error:
        raise TriggerError(f"a trigger's numbers: {error}") from None
    if not np.isfinite([trigger.low, trigger.high]).all():
        raise TriggerError("a trigger's level is a number")
    if kind == "window" and not trigger.low < trigger.high:
        raise TriggerError(f"a window from {trigger.low:g} to {trigger.high:g}: low is below high")
    if trigger.before < 0 or trigger.after < 1 or trigger.holdoff < 0:
        raise TriggerError("a trigger shows at least one cycle, and none less than none before it")
    if trigger.before + trigger.after > MOST_CYCLES:
        raise TriggerError(f"{MOST_CYCLES} cycles are the most that a trigger shows")
    return trigger


class Search:
    """A trigger at work on one stream of values."""

    def __init__(self, trigger: Trigger) -> None:
        self._trigger = trigger
        self._last = np.nan

    def hits(self, values: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the places at which it hits, in values that follow those of the last call."""
        trigger = self._trigger
        before: NDArray[np.float64] = np.concatenate((np.array([self._last]), values[:-1]))
        before = before[: len(values)]
        if len(values):
            self._last = float(values[-1])
        low, high = trigger.low, trigger.high
        if trigger.kind == "nan":
            found = ~np.isfinite(values)
        elif trigger.kind == "level":
            found = values >= low if trigger.slope == "above" else values <= low
        elif trigger.kind == "window":
            # A value that is no number is not inside, and none was there before the first one.
            inside, inside_before = _inside(values, low, high), _inside(before, low, high)
            if trigger.slope == "leaves":
                found = ~inside & inside_before
            else:
                found = inside & ~inside_before & ~np.isnan(before)
        else:
            rising = (before < low) & (values >= low)
            falling = (before > low) & (values <= low)
            found = {"rising": rising, "falling": falling, "either": rising | falling}[
                trigger.slope
            ]
        return np.flatnonzero(found)


def _inside(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (values >= low) & (values <= high)
    return inside
