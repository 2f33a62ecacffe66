"""`rtcfctl identify`: excites an input, fits models of the plant, and proposes gains."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rtcf

from rtcfctl.control import excited
from rtcfctl.terminal.interruption import interrupted_by_termination
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted, figure, whole

if TYPE_CHECKING:
    from rtcf.identification.experiment import Recorded
    from rtcf.identification.fitting import Fit
    from rtcf.identification.result import Identified, Proposal
    from rtcf.identification.tuning import Notch

_SHAPES = ("prbs", "step", "relay", "chirp", "multisine")
_METHODS = ("simc", "lambda", "relay")
_DURATION_S = 10.0
_BITS = 200.0  # of the default PRBS
_TURNS = 2.0  # of the lowest default frequency
_LINES = 30  # of a multisine
_NEGLIGIBLE = 1e-9


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    identify = verbs.add_parser(
        "identify",
        parents=[common],
        help="excite an input, fit models of the plant, propose gains of a PID controller",
        # -o is the file for this verb; --output remains.
        conflict_handler="resolve",
    )
    identify.add_argument(
        "input", metavar="COMPONENT.PORT",
        help="input without a writer, or an Excitation of the graph",
    )  # fmt: skip
    identify.add_argument(
        "measured", metavar="OUTPUT", nargs="?", default="",
        help="output to record (default: that connected to the Excitation)",
    )  # fmt: skip
    excited.add_options(identify)
    identify.add_argument(
        "--shape", choices=_SHAPES, default="prbs", help="form of the excitation (prbs)"
    )
    identify.add_argument(
        "--amplitude", type=float, metavar="A",
        help="height or peak value (default: half of --upper minus --lower)",
    )  # fmt: skip
    identify.add_argument(
        "--duration", type=amount("s"), default=_DURATION_S, metavar="S",
        help=f"duration of the excitation ({_DURATION_S:g} s)",
    )  # fmt: skip
    identify.add_argument(
        "--frequency", type=float, metavar="HZ",
        help="bits per second of a prbs, lowest frequency of a chirp or multisine",
    )  # fmt: skip
    identify.add_argument(
        "--end-frequency", type=float, metavar="HZ", help="last frequency of a chirp"
    )
    identify.add_argument(
        "--hysteresis", type=float, default=0.0, metavar="Y", help="hysteresis of a relay (0)"
    )
    identify.add_argument(
        "--order", type=whole, default=0, metavar="N", help="order of the state space (automatic)"
    )
    identify.add_argument(
        "--method", choices=_METHODS, help="rule for the gains (simc; relay after a relay)"
    )
    identify.add_argument(
        "--closed-loop-time", type=amount("s"), metavar="S",
        help="time constant of the closed loop, for simc and lambda",
    )  # fmt: skip
    identify.add_argument("--apply", metavar="NAME", help="set the gains of this PID controller")
    identify.add_argument(
        "-o", dest="file", type=Path, metavar="FILE", help="draw the plots to FILE.svg or FILE.png"
    )
    identify.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Excite, fit, print, and apply with --apply."""
    _check(args)
    from rtcf.identification import require_scipy

    require_scipy()
    from rtcf.identification.result import identify

    from rtcfctl.control import plots

    if args.file is not None:
        plots.require_format(args.file)
    if args.apply:
        _require_pid(client, args)
    with (
        interrupted_by_termination(),
        excited.experiment(client, args.runner, args.input, args.measured) as experiment,
    ):
        experiment.configure(**_parameters(client, args))
        recorded = experiment.run(stepped=args.stepped)
    excited.complete(recorded, experiment.excitation)
    relay = args.shape == "relay"
    found = identify(recorded, order=args.order, relay=relay, hysteresis=args.hysteresis)
    method = args.method or ("relay" if relay else "simc")
    proposals, reason = _proposals(found, method, args.closed_loop_time)
    if output.for_people:
        _print(recorded, found, proposals, reason, args, output)
    else:
        output.data(_data(recorded, found, method, proposals, reason))
    if args.file is not None:
        plots.draw(recorded, found, args.file)
    if args.apply:
        proposal = proposals[None]
        if proposal is None:
            raise rtcf.RtcfError(f"{reason}; {args.apply} keeps its gains")
        found.require_stable(proposal.gains)
        _apply(client, proposal, args, output)


def _proposals(
    found: Identified, method: str, time: float | None
) -> tuple[dict[Notch | None, Proposal | None], str]:
    """Return proposals without a notch, and with the one for the resonance, and why one is None."""
    proposals: dict[Notch | None, Proposal | None] = {}
    reason = ""
    for notch in dict.fromkeys((None, found.notch)):
        try:
            proposals[notch] = found.propose(method, time, notch)
        except rtcf.RtcfError as error:
            proposals[notch] = None
            reason = reason or str(error)
    return proposals, reason


def _check(args: argparse.Namespace) -> None:
    excited.checked(args)
    if args.hysteresis < 0:
        raise ValueError(f"--hysteresis {args.hysteresis:g}: 0 or more")
    if args.method == "relay" and args.shape != "relay":
        raise ValueError("--method relay requires --shape relay")
    for option in ("frequency", "end_frequency"):
        value = getattr(args, option)
        if value is not None and value <= 0:
            raise ValueError(f"--{option.replace('_', '-')} {value:g}: more than 0 Hz")


def _parameters(client: rtcf.Client, args: argparse.Namespace) -> dict[str, Any]:
    """Return the parameters of the Excitation."""
    (status,) = client.get_status(args.runner or "rt_runner").runners
    rate = status.settings.frequency_hz
    shape = "log_chirp" if args.shape == "chirp" else args.shape
    lowest = _TURNS / args.duration
    default = min(_BITS / args.duration, rate) if shape == "prbs" else lowest
    amplitude = args.amplitude
    if amplitude is None:
        amplitude = (args.upper - args.lower) / 2.0
    return excited.limits(args) | {
        "shape": shape,
        "amplitude": amplitude,
        "duration": args.duration,
        "frequency": args.frequency or default,
        "end_frequency": args.end_frequency or max(rate / 20.0, 2.0 * lowest),
        "lines": _LINES,
        "hysteresis": args.hysteresis,
        "delay": 0.0,
    }


def _require_pid(client: rtcf.Client, args: argparse.Namespace) -> None:
    found = client.get_component(args.apply, args.runner)
    names = {each.name for each in found.parameters}
    if not {"kp", "ki", "kd"} <= names:
        raise rtcf.RtcfError(f"--apply {args.apply}: it has no parameters kp, ki and kd")
    if found.spec.every > 1:
        raise rtcf.RtcfError(
            f"--apply {args.apply}: it runs once in {found.spec.every} cycles, but gains are for "
            "a controller of each cycle: omit --apply, or load it without --every"
        )


def settings(proposal: Proposal) -> list[str]:
    """Return the parameters of a Pid as words."""
    names = ("kp", "ki", "kd", "filter_time") if proposal.gains.kd else ("kp", "ki", "kd")
    return [f"{name}:={getattr(proposal.gains, name)!r}" for name in names]


def _apply(
    client: rtcf.Client, proposal: Proposal, args: argparse.Namespace, output: Output
) -> None:
    words = settings(proposal)
    result = client.set_parameters(
        args.apply, [rtcf.parse_parameter(each) for each in words], args.runner, output.progress
    )
    if output.for_people:
        output.changed(
            f"set {', '.join(words)} of {args.apply}; `rtcfctl undo {args.apply}` reverts it",
            result,
        )


def describe(fit: Fit) -> str:
    """Return the numbers of a model."""
    from rtcf.identification.models import StateSpace

    model = fit.model
    if isinstance(model, StateSpace):
        poles = sorted({(round(abs(p) / math.tau, 4), round(-p.real / abs(p), 4))
                        for p in model.poles})  # fmt: skip
        text = ", ".join(f"{figure4(f)} Hz (damping {figure4(d)})" for f, d in poles)
        return f"order {model.order}, poles at {text}"
    times = model.time_constants
    shape = (
        ", ".join(f"T{n if len(times) > 1 else ''} = {figure4(each)} s"
                  for n, each in enumerate(times, 1))
        if times
        else f"{figure4(model.natural_frequency / math.tau)} Hz, "
             f"damping {figure4(model.damping)}"
    )  # fmt: skip
    return f"K = {figure4(model.gain)}, {shape}, delay {figure4(model.delay)} s"


def figure4(number: float) -> str:
    """Return a number with four digits."""
    return f"{number:.4g}" if abs(number) >= _NEGLIGIBLE else "0"


def _print(
    recorded: Recorded,
    found: Identified,
    proposals: dict[Notch | None, Proposal | None],
    reason: str,
    args: argparse.Namespace,
    output: Output,
) -> None:
    from rtcfctl.control import plots

    cycles = len(recorded.time)
    filled = f", {recorded.filled} interpolated" if recorded.filled else ""
    output.line(f"{counted(cycles, 'cycle')} of {recorded.period * 1e3:g} ms{filled}")
    output.table(
        ("model", "numbers", "fit"),
        [(name, describe(fit), f"{fit.percent:.1f} %") for name, fit in found.fits.items()],
        ["fit"],
    )
    if found.relay is not None:
        output.line(
            f"relay: the loop oscillates with a gain of {figure4(found.relay.ultimate_gain)} and "
            f"a period of {figure4(found.relay.ultimate_period)} s"
        )
    for line in plots.lines(recorded, found):
        output.line(line)
    output.line("")
    if found.resonance is not None:
        output.line(
            f"resonance at {figure4(found.resonance.frequency)} Hz, "
            f"damping {figure4(found.resonance.damping)}"
        )
    for notch, proposal in proposals.items():
        if proposal is None:
            continue
        margins = proposal.margins
        filtered = "" if notch is None else " with the notch"
        output.line(
            f"{proposal.method}{filtered}: gain margin {figure(round(margins.gain, 2))}, "
            f"phase margin {figure(round(margins.phase, 1))}°, "
            f"delay margin {figure4(margins.delay)} s, "
            f"largest sensitivity {margins.sensitivity:.2f} "
            f"({proposal.sensitivity:.2f} with all models)"
        )
        if proposal.slower > 1.0:
            output.line(
                f"slower than the rule by the factor {proposal.slower:.2f}, for a sensitivity of "
                "at most 2 with all models"
            )
        if notch is not None:
            output.line(
                "rtcfctl load rtcf_control Biquads --name notch "
                f'--param sections:="{notch.sections}", between PID and plant'
            )
        if notch is not None or not args.apply:
            output.line(f"rtcfctl set PID {' '.join(settings(proposal))}")
    if reason:
        output.line(reason, "bold red")


def _data(
    recorded: Recorded,
    found: Identified,
    method: str,
    proposals: dict[Notch | None, Proposal | None],
    reason: str,
) -> Any:
    from rtcf.identification.models import StateSpace

    def model(fit: Fit | None) -> dict[str, Any] | None:
        if fit is None:
            return None
        if isinstance(fit.model, StateSpace):
            poles = [{"real": float(p.real), "imaginary": float(p.imag)} for p in fit.model.poles]
            return {"fit": fit.percent, "order": fit.model.order, "poles": poles,
                    "a": fit.model.a.tolist(), "b": fit.model.b.tolist(),
                    "c": fit.model.c.tolist()}  # fmt: skip
        return {"fit": fit.percent, "gain": fit.model.gain, "delay": fit.model.delay,
                "denominator": list(fit.model.denominator)}  # fmt: skip

    def numbers(proposal: Proposal | None) -> dict[str, Any]:
        if proposal is None:
            return {"gains": None, "margins": None, "slower": None}
        margins = vars(proposal.margins) | {"worst_sensitivity": proposal.sensitivity}
        return {"gains": vars(proposal.gains), "margins": margins,
                "slower": proposal.slower}  # fmt: skip

    filtered = None
    if found.notch is not None:
        filtered = {"sections": found.notch.sections} | numbers(proposals[found.notch])
    return excited.plain({
        "cycles": len(recorded.time),
        "interpolated": recorded.filled,
        "period": recorded.period,
        "first_order": model(found.first),
        "second_order": model(found.second),
        "state_space": model(found.space),
        "relay": None if found.relay is None else vars(found.relay),
        "resonance": None if found.resonance is None else vars(found.resonance),
        "method": method,
        **numbers(proposals[None]),
        "reason": reason or None,
        "notch": filtered,
    })  # fmt: skip
