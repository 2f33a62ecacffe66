"""The result of an identification: models, gains of a PID controller and its margins."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rtcf_shared.errors import RtcfError
from scipy import signal

from rtcf.identification import fitting, tuning
from rtcf.identification.experiment import Recorded
from rtcf.identification.fitting import Fit
from rtcf.identification.margins import Margins, SampledPlant
from rtcf.identification.models import Resonance, Transfer
from rtcf.identification.tuning import Gains, Notch, RelayPoint

METHODS = ("simc", "lambda", "relay")
MOST_SENSITIVITY = 2.0  # of a proposal, with each model that describes the values
LEAST_FIT = 50.0  # percent, of a model that is used for gains
MOST_SYSTEMATIC = 4.0  # percent of the output, see Fit.systematic
# Likewise, of a plant that integrates or oscillates: dry friction looks like damping, and is none
# for small motions.
MOST_SYSTEMATIC_UNDAMPED = 1.0
_BETTER = 1.0  # percent by which a model must be better to be used
_CREDIBLE = 1.2  # residuals by the smallest ones, of models that a loop must be stable with
# Phase in rad of an oscillation at the crossover that the record contains, of a plant that
# integrates or oscillates: friction makes an integrator look like a plant with a gain at rest.
_LEAST_PHASE = 0.5 * np.pi
_SLOWER = 1.25  # from one attempt to the next
_ATTEMPTS = 40
_NOTCH_Q = 0.5  # turns a resonance into two equal lags
_HIGHEST_NOTCH = 0.49  # of the frequency of the cycles, as Biquads accepts


@dataclass(frozen=True)
class Proposal:
    """Gains by a rule, and the margins of the loop with them and the best model.

    sensitivity  largest one with all models that describe the values: at most MOST_SENSITIVITY
    slower       factor of the rule's times by which the loop was made slower for that
    notch        filter between controller and plant that the gains need, else None
    """

    method: str
    gains: Gains
    margins: Margins
    sensitivity: float
    slower: float
    notch: Notch | None = None


@dataclass(frozen=True)
class Identified:
    """Models of a plant.

    first, second  the fits
    space          the fit of a state space; None if none describes the values
    relay          the oscillation of a relay experiment, else None
    """

    period: float
    first: Fit
    second: Fit
    space: Fit | None
    relay: RelayPoint | None

    @property
    def fits(self) -> dict[str, Fit]:
        """The fits by their names, the simplest model first."""
        found = {"first order": self.first, "second order": self.second}
        return found if self.space is None else found | {"state space": self.space}

    @property
    def best(self) -> Fit:
        """The fit with the smallest residuals; of similar ones the simplest."""
        found = self.first
        for each in self.fits.values():
            if each.percent > found.percent + _BETTER:
                found = each
        return found

    @property
    def resonance(self) -> Resonance | None:
        """The least damped resonance of the best model, if its fit is sufficient."""
        found = self.best.model.resonances if self.best.percent >= LEAST_FIT else []
        return min(found, key=lambda each: each.damping) if found else None

    @property
    def notch(self) -> Notch | None:
        """A notch for the resonance, if Biquads can realise it."""
        found = self.resonance
        if found is None or found.frequency * self.period >= _HIGHEST_NOTCH:
            return None
        return Notch(float(f"{found.frequency:.4g}"), _NOTCH_Q)

    def propose(
        self, method: str, closed_loop_time: float | None = None, notch: Notch | None = None
    ) -> Proposal:
        """Return gains by a method of METHODS, for a stable loop without large sensitivity.

        closed_loop_time  in s, for simc and lambda; None = the default of the rule
        notch             filter between controller and plant

        With each model that describes the values, and with its uncertainty, the loop is stable, and
        its sensitivity is at most MOST_SENSITIVITY: if necessary, the loop is slower than by the
        rule.  Of several rules for a model, the one with the largest integral gain is used: the
        least error after a change of the load.  Raises RtcfError if the method does not apply.
        """
        if self.best.percent < LEAST_FIT:
            raise RtcfError(
                f"no gains: the best model describes {self.best.percent:.1f} % of the output, "
                f"{LEAST_FIT:g} % are needed: set a larger --amplitude, or wider limits"
            )
        most = MOST_SYSTEMATIC_UNDAMPED if self._is_undamped else MOST_SYSTEMATIC
        if self.best.systematic > most:
            raise RtcfError(
                f"no gains: {self.best.systematic:.1f} % of the output is neither noise nor "
                f"described by a model, {most:g} % are permitted: begin at rest, and excite away "
                "from friction, backlash and limits"
            )
        rules = self._rules(method, closed_loop_time)
        plants = self._plants(notch)
        found = [each for rule in rules if (each := _slowed(rule, plants)) is not None]
        if not found:
            raise RtcfError(
                f"no gains: no loop by {method} is stable with a sensitivity of at most "
                f"{MOST_SENSITIVITY:g} for all models that describe the values: record more "
                "cycles, or set a larger --amplitude"
            )
        gains, slower = max(found, key=lambda each: abs(each[0].ki))
        margins = plants[0].margins(gains)
        # Without a crossover, the loop is slower than all frequencies that are searched.
        crossover = margins.crossover if np.isfinite(margins.crossover) else 0.0
        if self._is_undamped and crossover * self._duration < _LEAST_PHASE:
            longer = f"at least {_LEAST_PHASE / crossover:.2g} s" if crossover else "for longer"
            raise RtcfError(
                f"no gains: the loop by {method} would be slower than the record, whose "
                f"{self._duration:.3g} s do not show such slow motions: record {longer}"
            )
        sensitivity = max(each.sensitivity(gains) for each in plants)
        return Proposal(method, gains, margins, sensitivity, slower, notch)

    def require_stable(self, gains: Gains) -> None:
        """Raise RtcfError unless a loop with these gains is as propose() requires it."""
        if not all(_suits(gains, each) for each in self._plants(None)):
            raise RtcfError(
                f"kp = {gains.kp:g}, ki = {gains.ki:g}, kd = {gains.kd:g} are not stable with a "
                f"sensitivity of at most {MOST_SENSITIVITY:g} for all models: not set"
            )

    @property
    def _is_undamped(self) -> bool:
        """Whether the plant integrates during the experiment, or oscillates."""
        model = max((self.first, self.second), key=lambda each: each.percent).model
        assert isinstance(model, Transfer)
        return not model.time_constants or model.time_constants[0] > self._duration

    @property
    def _duration(self) -> float:
        """Length of the record, s."""
        return len(self.first.residuals) * self.period

    def _plants(self, notch: Notch | None) -> list[SampledPlant]:
        """Return the models that describe the values, the best one first."""
        fits = [self.best, *(each for each in self.fits.values() if each is not self.best)]
        sizes = [float(np.linalg.norm(each.residuals)) for each in fits]
        credible = [
            each
            for each, size in zip(fits, sizes, strict=True)
            if each is self.best or size <= _CREDIBLE * min(sizes)
        ]
        models = [each.model for each in credible]
        models += [other for each in credible for other in each.others]
        return [SampledPlant(each, self.period, notch) for each in models]

    def _rules(self, method: str, time: float | None) -> list[Callable[..., Gains]]:
        """Return functions of `slower`."""
        if method == "relay":
            if self.relay is None:
                raise RtcfError("the method relay needs an excitation by --shape relay")
            if time is not None:
                raise ValueError("the method relay has no closed-loop time constant")
            return [functools.partial(tuning.relay_tuning, self.relay)]
        if method not in METHODS:
            raise ValueError(f"method {method}: use one of {', '.join(METHODS)}")
        fits = [self.first] if method == "lambda" else [self.second, self.first]
        if self.second.percent <= self.first.percent + _BETTER:
            fits = [self.first]
        models = [each.model for each in fits if each.percent >= LEAST_FIT]
        if not models:
            raise RtcfError(
                f"no gains by {method}: the model that it needs describes {fits[0].percent:.1f} % "
                f"of the output, {LEAST_FIT:g} % are needed"
            )
        rules: list[Callable[..., Gains]] = []
        for model in models:
            assert isinstance(model, Transfer)
            if method == "lambda":
                pairs = [(tuning.lambda_tuning, model)]
            elif model.time_constants:
                pairs = [(tuning.simc, model)]
            else:
                pairs = [(tuning.simc, model.damped), (tuning.integral_tuning, model)]
            rules += [functools.partial(rule, each, time, period=self.period)
                      for rule, each in pairs]  # fmt: skip
        return rules


def _suits(gains: Gains, plant: SampledPlant) -> bool:
    return plant.sensitivity(gains, MOST_SENSITIVITY) <= MOST_SENSITIVITY


def _slowed(rule: Callable[..., Gains], plants: list[SampledPlant]) -> tuple[Gains, float] | None:
    """Return the fastest gains of a rule that suit all plants, and `slower`."""
    order = list(plants)
    for attempt in range(_ATTEMPTS):
        slower = _SLOWER**attempt
        gains = rule(slower=slower).rounded()
        failed = next((each for each in order if not _suits(gains, each)), None)
        if failed is None:
            return gains, slower
        # It probably fails next time, too.
        order.sort(key=lambda each, first=failed: each is not first)  # type: ignore[misc]
    return None


def identify(
    recorded: Recorded, *, order: int = 0, relay: bool = False, hysteresis: float = 0.0
) -> Identified:
    """Fit all models to an experiment.

    order       of the state space; 0 = automatic
    relay       the excitation was a relay with this hysteresis

    Raises RtcfError if the values do not determine a model.
    """
    u, y, period = recorded.inputs, recorded.outputs, recorded.period
    point = None
    if relay:
        point = tuning.relay_point(recorded.signal, y, period, hysteresis)
    space = None
    with contextlib.suppress(RtcfError):  # e.g. a delay of many cycles
        space = fitting.fit_state_space(u, y, period, order)
    return Identified(
        period,
        fitting.fit_first_order(u, y, period),
        fitting.fit_second_order(u, y, period),
        space,
        point,
    )


def estimated_response(recorded: Recorded) -> tuple[Any, Any]:
    """Return frequencies in Hz, and the frequency response there, without a model.

    Welch's estimate: the cross spectrum by the spectrum of the input, at frequencies that the
    input contains.
    """
    u = recorded.inputs - recorded.inputs.mean()
    y = recorded.outputs - recorded.outputs.mean()
    length = max(len(u) // 4, 16)
    f, cross = signal.csd(u, y, 1.0 / recorded.period, nperseg=length)
    _, power = signal.welch(u, 1.0 / recorded.period, nperseg=length)
    there = (power > 1e-3 * power.max()) & (f > 0)
    return f[there], cross[there] / power[there]


def fitted_response(fit: Fit, frequencies: Any, period: float) -> Any:
    """Return the frequency response of a fit at frequencies in Hz, with the hold of a cycle."""
    above, below = fit.model.fraction(2.0 * np.pi * np.asarray(frequencies, float), period)
    return above / below
