"""Triggers: a search of every cycle for a hit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rtcf.streams.condition import Condition, ConditionError

from rtcf_scope.chunk import column_of

MOST_CYCLES = 200_000  # in one shot
CYCLE = ("~latency", "~duration")  # signals of the cycle itself, µs
KINDS = ("edge", "level", "window", "nan", "condition")
_SLOPES = {"edge": ("rising", "falling", "either"), "level": ("above", "below"),
           "window": ("leaves", "enters"), "nan": ("",), "condition": ("",)}  # fmt: skip


class TriggerError(ValueError):
    """A trigger is invalid."""


@dataclass(frozen=True)
class Trigger:
    """The settings of a trigger."""

    signal: str
    kind: str  # one of KINDS
    slope: str
    low: float  # the level, for kinds with a single one
    high: float
    before: int  # cycles shown before the hit
    after: int  # cycles shown from the hit on
    holdoff: int  # cycles after a shot without hits
    single: bool  # disarm after one shot
    condition: Condition | None = None  # replaces `signal`
    hysteresis: float = 0.0  # how far an edge must have been from the level, on its other side

    @property
    def signals(self) -> list[str]:
        """The signals that the trigger uses."""
        return [self.signal] if self.condition is None else self.condition.signals


def parse(request: Any) -> Trigger:
    """Return the trigger of a page's request; raises TriggerError."""
    try:
        kind = str(request["kind"])
        if kind not in KINDS:
            raise TriggerError(f"trigger kind {kind!r}: must be one of {', '.join(KINDS)}")
        slope = str(request.get("slope") or _SLOPES[kind][0])
        if slope not in _SLOPES[kind]:
            raise TriggerError(f"{kind} {slope!r}: must be one of {', '.join(_SLOPES[kind])}")
        condition = Condition(str(request["condition"])) if kind == "condition" else None
        trigger = Trigger(
            str(request["signal"]) if condition is None else "", kind, slope,
            float(request.get("low", 0.0)), float(request.get("high", 0.0)),
            int(request["before"]), int(request["after"]), int(request.get("holdoff", 0)),
            bool(request.get("single", False)), condition, float(request.get("hysteresis", 0.0)),
        )  # fmt: skip
    except ConditionError as error:
        raise TriggerError(str(error)) from None
    except (KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        raise TriggerError("a trigger needs signal, kind, before and after") from None
    except TriggerError:
        raise
    except ValueError as error:
        raise TriggerError(f"invalid number in the trigger: {error}") from None
    for signal in trigger.signals:
        if signal not in CYCLE and not column_of(signal):
            raise TriggerError(f"{signal[:80]!r} is not a signal: name one as in /wave.phase")
    if not np.isfinite([trigger.low, trigger.high, trigger.hysteresis]).all():
        raise TriggerError("the levels of a trigger must be finite")
    if trigger.hysteresis < 0:
        raise TriggerError("the hysteresis of a trigger must be at least 0")
    if kind == "window" and not trigger.low < trigger.high:
        raise TriggerError(
            f"window from {trigger.low:g} to {trigger.high:g}: low must be below high"
        )
    if trigger.before < 0 or trigger.after < 1 or trigger.holdoff < 0:
        raise TriggerError("before and holdoff must be at least 0, after must be at least 1 cycle")
    if trigger.before + trigger.after > MOST_CYCLES:
        raise TriggerError(f"a trigger shows at most {MOST_CYCLES} cycles")
    return trigger


class Search:
    """The search for hits in one stream of cycles; keeps the last value between calls."""

    def __init__(self, trigger: Trigger) -> None:
        self._trigger = trigger
        self._last = np.nan
        self._sides = {1.0: 0, -1.0: 0}  # of the level, by slope: see _edges
        self._was_true = True  # a condition hits only after it was false

    def hits(self, *columns: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the indices of hits in `columns`, the values of the trigger's signals.

        The values continue those of the previous call.
        """
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
            # NaN is not inside; there is no value before the first one.
            inside, inside_before = _inside(values, low, high), _inside(before, low, high)
            if trigger.slope == "leaves":
                found = ~inside & inside_before
            else:
                found = inside & ~inside_before & ~np.isnan(before)
        else:
            found = np.zeros(len(values), bool)
            for sign, slope in ((1.0, "rising"), (-1.0, "falling")):
                if trigger.slope in (slope, "either"):
                    found |= self._edges(values, sign)
        return np.flatnonzero(found)

    def _edges(self, values: NDArray[np.float64], sign: float) -> NDArray[np.bool_]:
        """Return where values rise (sign 1) or fall (-1) to the level, after they were beyond the
        hysteresis on its other side: a Schmitt trigger. NaN is on no side.
        """
        away = sign * (values - self._trigger.low)
        sides = np.where(away >= 0.0, 1, np.where(away < -self._trigger.hysteresis, -1, 0))
        sides = np.append(self._sides[sign], np.where(np.isnan(values), 2, sides))
        # Between level and hysteresis, the side is that of the value before.
        places = np.maximum.accumulate(np.where(sides != 0, np.arange(len(sides)), 0))
        held = sides[places]
        self._sides[sign] = int(held[-1])
        edges: NDArray[np.bool_] = (held[1:] == 1) & (held[:-1] == -1)
        return edges

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
