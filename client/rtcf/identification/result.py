"""The result of an identification: models, gains of a PID controller and its margins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from rtcf_shared.errors import RtcfError
from scipy import signal

from rtcf.identification import fitting, tuning
from rtcf.identification.experiment import Recorded
from rtcf.identification.fitting import Fit
from rtcf.identification.margins import Margins, margins
from rtcf.identification.models import Transfer
from rtcf.identification.tuning import Gains, RelayPoint

METHODS = ("simc", "lambda", "relay")
_BETTER = 1.0  # percent by which a model must be better to be used


@dataclass(frozen=True)
class Proposal:
    """Gains by a rule, and the margins of the loop with them and the best model."""

    method: str
    gains: Gains
    margins: Margins


@dataclass(frozen=True)
class Identified:
    """Models of a plant.

    first, second, space  the fits
    relay                 the oscillation of a relay experiment, else None
    """

    period: float
    first: Fit
    second: Fit
    space: Fit
    relay: RelayPoint | None

    @property
    def best(self) -> Fit:
        """The fit with the smallest residuals; of similar ones the simplest."""
        found = self.first
        for each in (self.second, self.space):
            if each.percent > found.percent + _BETTER:
                found = each
        return found

    @property
    def for_rules(self) -> Fit:
        """The fit that the rules for gains can use: without complex poles."""
        model = self.second.model
        real = isinstance(model, Transfer) and bool(model.time_constants)
        better = self.second.percent > self.first.percent + _BETTER
        return self.second if real and better else self.first

    def propose(self, method: str, closed_loop_time: float | None = None) -> Proposal:
        """Return gains by a method of METHODS; raises RtcfError if it does not apply.

        closed_loop_time  in s, for simc and lambda; None = the default of the rule
        """
        hold = self.period / 2.0
        if method == "relay":
            if self.relay is None:
                raise RtcfError("the method relay needs an excitation by --shape relay")
            if closed_loop_time is not None:
                raise ValueError("the method relay has no closed-loop time constant")
            gains = tuning.relay_tuning(self.relay)
        elif method == "simc":
            model = self.for_rules.model
            assert isinstance(model, Transfer)
            gains = tuning.simc(model, closed_loop_time, extra_delay=hold)
        elif method == "lambda":
            model = self.first.model
            assert isinstance(model, Transfer)
            gains = tuning.lambda_tuning(model, closed_loop_time, extra_delay=hold)
        else:
            raise ValueError(f"method {method}: use one of {', '.join(METHODS)}")
        return Proposal(method, gains, margins(gains, self.best.model, self.period))


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
    return Identified(
        period,
        fitting.fit_first_order(u, y, period),
        fitting.fit_second_order(u, y, period),
        fitting.fit_state_space(u, y, period, order),
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
    omega = 2.0 * np.pi * np.asarray(frequencies, float)
    found = fit.model.response(omega)
    if isinstance(fit.model, Transfer):
        found = found * np.sinc(omega * period / 2.0 / np.pi) * np.exp(-0.5j * omega * period)
    return found
