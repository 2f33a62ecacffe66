"""Finds the cycle that a trigger waits for, looking at every one."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rtcf.streams.condition import Condition, ConditionError

from rtcf_scope.chunk import column_of

MOST_CYCLES = 200_000  # of one shot
CYCLE = ("~latency", "~duration")  # what is known of each cycle itself
KINDS = ("edge", "level", "window", "nan", "condition")
_SLOPES = {"edge": ("rising", "falling", "either"), "level": ("above", "below"),
           "window": ("leaves", "enters"), "nan": ("",), "condition": ("",)}  # fmt: skip


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
    condition: Condition | None = None  # in place of the signal

    @property
    def signals(self) -> list[str]:
        """The signals that it looks at."""
        return [self.signal] if self.condition is None else self.condition.signals


def parse(told: Any) -> Trigger:
    """Return the trigger that a page asks for; raises TriggerError."""
    try:
        kind = str(told["kind"])
        if kind not in KINDS:
            raise TriggerError(f"trigger on {kind!r}: one of {', '.join(KINDS)}")
        slope = str(told.get("slope") or _SLOPES[kind][0])
        if slope not in _SLOPES[kind]:
            raise TriggerError(f"{kind} {slope!r}: one of {', '.join(_SLOPES[kind])}")
        condition = Condition(str(told["condition"])) if kind == "condition" else None
        trigger = Trigger(
            str(told["signal"]) if condition is None else "", kind, slope,
            float(told.get("low", 0.0)), float(told.get("high", 0.0)),
            int(told["before"]), int(told["after"]), int(told.get("holdoff", 0)),
            bool(told.get("single", False)), condition,
        )  # fmt: skip
    except ConditionError as error:
        raise TriggerError(str(error)) from None
    except (KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise TriggerError("a trigger has signal, kind, before and after") from None
    except TriggerError:
        raise
    except ValueError as error:
        raise TriggerError(f"a trigger's numbers: {error}") from None
    for signal in trigger.signals:
        if signal not in CYCLE and not column_of(signal):
            raise TriggerError(f"{signal[:80]!r} is no signal: these are named as in /wave.phase")
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
    """A trigger at work on one stream of cycles."""

    def __init__(self, trigger: Trigger) -> None:
        self._trigger = trigger
        self._last = np.nan
        self._was_true = True  # as far as is known: it hits where it becomes true

    def hits(self, *columns: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the places at which it hits, in the values of its signals, which follow those of
        the last call."""
        trigger, values = self._trigger, columns[0]
        if trigger.condition is not None:
            return self._becomes_true(trigger.condition, columns)
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

    def _becomes_true(
        self, condition: Condition, columns: Sequence[NDArray[np.float64]]
    ) -> NDArray[np.int64]:
        true = condition.over(list(columns), len(columns[0]))
        before = np.append(self._was_true, true)[:-1]
        if len(true):
            self._was_true = bool(true[-1])
        return np.flatnonzero(true & ~before)


def _inside(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (values >= low) & (values <= high)
    return inside
