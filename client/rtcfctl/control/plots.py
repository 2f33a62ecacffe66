"""Plots of an identification: Bode diagram, step response and residuals."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rtcf.identification.models import StateSpace
from rtcf.identification.result import estimated_response, fitted_response

from rtcfctl.terminal import image_file
from rtcfctl.terminal.drawings import drawn

if TYPE_CHECKING:
    from rtcf.identification.experiment import Recorded
    from rtcf.identification.fitting import Fit
    from rtcf.identification.result import Identified

_FORMATS = (".svg", ".png")
_POINTS = 144  # of a curve in the terminal
_STEP_BY_TIME = 6.0  # length of a step response by the longest time constant


def require_format(file: Path) -> None:
    """Raise ValueError for an unknown suffix."""
    image_file.require_format(file, _FORMATS)


def lines(recorded: Recorded, found: Identified) -> list[str]:
    """Return the plots of the best model for a terminal."""
    name = next(title for title, fit in found.fits.items() if fit is found.best)
    f, estimate = estimated_response(recorded)
    grid = np.geomspace(f[0], f[-1], _POINTS)
    model = fitted_response(found.best, grid, recorded.period)
    marks = {0.0: f"{grid[0]:.3g} Hz", 1.0: f"{grid[-1]:.3g} Hz"}
    measured = 20.0 * np.log10(np.abs(_at(grid, f, estimate)))
    decibels = 20.0 * np.log10(np.abs(model))
    time, step = step_of(found.best, recorded)
    ends = {0.0: "0 s", 1.0: f"{time[-1]:.3g} s"}
    whole = {0.0: "0 s", 1.0: f"{recorded.time[-1]:.3g} s"}
    plots = [
        drawn(f"gain in dB, {name} and measured", [list(decibels), list(measured)], marks),
        drawn(f"phase in degrees, {name}", [list(np.degrees(np.unwrap(np.angle(model))))], marks),
        drawn(f"step response, {name}", [list(step)], ends),
        drawn(f"residuals, {name}", [list(found.best.residuals)], whole),
    ]
    return [line for plot in plots for line in ("", *plot)]


def step_of(fit: Fit, recorded: Recorded) -> tuple[Any, Any]:
    """Return the response of a model to a step of 1, over its longest time constant."""
    model = fit.model
    if isinstance(model, StateSpace):
        slowest = 1.0 / float(np.min(np.abs(model.poles)))
        delay = 0.0
    else:
        slowest = 1.0 / float(np.min(np.abs(np.roots(model.denominator))))
        delay = model.delay
    length = min(_STEP_BY_TIME * slowest + delay, float(recorded.time[-1]))
    count = max(int(length / recorded.period), 10)
    return (
        np.arange(count) * recorded.period,
        model.simulate(np.ones(count), recorded.period),
    )


def draw(recorded: Recorded, found: Identified, file: Path) -> None:
    """Write the plots of all models to an image file.  Raises RtcfError."""
    pyplot = image_file.pyplot_module()
    figure, axes = pyplot.subplots(4, 1, figsize=(8, 11), layout="constrained")
    f, estimate = estimated_response(recorded)
    grid = np.geomspace(f[0], f[-1], 500)
    axes[0].semilogx(f, 20.0 * np.log10(np.abs(estimate)), ".", color="grey", label="measured")
    axes[1].semilogx(f, np.degrees(np.unwrap(np.angle(estimate))), ".", color="grey")
    for name, fit in found.fits.items():
        response = fitted_response(fit, grid, recorded.period)
        label = f"{name}, {fit.percent:.1f} %"
        axes[0].semilogx(grid, 20.0 * np.log10(np.abs(response)), label=label)
        axes[1].semilogx(grid, np.degrees(np.unwrap(np.angle(response))), label=label)
        axes[2].plot(*step_of(fit, recorded), label=label)
        axes[3].plot(recorded.time, fit.residuals, label=label, linewidth=0.8)
    for axis, title, below in zip(
        axes,
        ("gain [dB]", "phase [°]", "step response", "residuals"),
        ("frequency [Hz]", "frequency [Hz]", "time [s]", "time [s]"),
        strict=True,
    ):
        axis.set_ylabel(title)
        axis.set_xlabel(below)
        axis.grid(True)
    axes[0].legend()
    image_file.write(figure, file)


def _at(grid: Any, f: Any, estimate: Any) -> Any:
    """Return an estimate at other frequencies, linear in logarithms."""
    found = np.interp(np.log(grid), np.log(f), np.log(np.abs(estimate)))
    return np.exp(found)
