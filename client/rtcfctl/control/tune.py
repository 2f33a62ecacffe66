"""`rtcfctl tune`: compares closed-loop steps before and after a change of a controller's gains."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import rtcf
from rtcf_shared.ports import numpy_module

from rtcfctl.control import excited
from rtcfctl.terminal.drawings import drawn
from rtcfctl.terminal.interruption import interrupted_by_termination
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, figure

if TYPE_CHECKING:
    from rtcf.identification.experiment import Experiment, Recorded
    from rtcf.testing import StepResponse

_DURATION_S = 2.0
_TOLERANCE = 0.05
_WORSE = 1.05  # criterion after the change by that before it, from which it is worse
_BASELINE = 0.2  # share of the time before the step from which its initial value is taken
_ROWS = (
    ("rise time", "rise_time", "s"),
    ("settling time", "settling_time", "s"),
    ("overshoot", "overshoot", "%"),
    ("final error", "final_error", ""),
)


@dataclass(frozen=True)
class Step:
    """A closed-loop step: times in s since the step, values, and measures.

    itae  criterion of the comparison: the integral of time by absolute error, in s², of a step of 1
          (Graham & Lathrop, The synthesis of optimum transient response, Transactions of the AIEE
          72, 1953)
    """

    time: Any
    value: Any
    measures: StepResponse
    itae: float


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    tune = verbs.add_parser(
        "tune",
        parents=[common],
        help="compare closed-loop steps before and after a change of parameters",
    )
    tune.add_argument("controller", metavar="NAME", help="controller, e.g. a Pid")
    tune.add_argument(
        "--param", dest="parameters", action="append", default=[], metavar="PARAMETER:=VALUE",
        help="new value of a parameter, repeatable (default: only measure)",
    )  # fmt: skip
    excited.add_options(tune)
    tune.add_argument("--size", type=float, required=True, metavar="X", help="height of the step")
    tune.add_argument(
        "--input", metavar="COMPONENT.PORT",
        help="input without a writer, or an Excitation of the graph (default: NAME.setpoint)",
    )  # fmt: skip
    tune.add_argument(
        "--measured", metavar="OUTPUT", default="",
        help="controlled output (default: that connected to NAME.measured)",
    )  # fmt: skip
    tune.add_argument(
        "--duration", type=amount("s"), default=_DURATION_S, metavar="S",
        help=f"time before the step, and of the step ({_DURATION_S:g} s)",
    )  # fmt: skip
    tune.add_argument(
        "--tolerance", type=float, default=_TOLERANCE, metavar="F",
        help=f"tolerance of the settling time, as a fraction of the step ({_TOLERANCE:g})",
    )  # fmt: skip
    tune.add_argument(
        "--undo", action="store_true", help="revert the parameters after the comparison"
    )
    tune.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Step, change, step, compare."""
    _check(args)
    numpy_module()  # raises RtcfError without NumPy
    from rtcf.identification.experiment import connected_output

    settings = [rtcf.parse_parameter(each) for each in args.parameters]
    controller = client.get_component(args.controller, args.runner)
    name = controller.full_name
    measured = args.measured or connected_output(client, args.runner, controller, "measured")
    with (
        interrupted_by_termination(),
        excited.experiment(
            client, args.runner, args.input or f"{name}.setpoint", measured
        ) as experiment,
    ):
        experiment.configure(
            **excited.limits(args), shape="step", mode="replace", amplitude=args.size,
            delay=args.duration, duration=args.duration,
        )  # fmt: skip
        found = [_step(experiment, args)]
        worse = False
        if settings:
            experiment.set_parameters(name, settings, output.progress)
            try:
                found.append(_step(experiment, args))
            except BaseException as error:
                client.undo_parameters(name, args.runner)
                if isinstance(error, rtcf.RtcfError):
                    raise rtcf.RtcfError(f"{error}; the parameters were set back") from None
                raise
            worse = not found[1].itae <= _WORSE * found[0].itae
            if args.undo or worse:
                client.undo_parameters(name, args.runner, output.progress)
    if output.for_people:
        _print(found, name, args, output, worse)
    else:
        names = ("before", "after")
        output.data(
            excited.plain(
                {title: asdict(each.measures) | {"itae": each.itae}
                 for title, each in zip(names, found, strict=False)}
            )
        )  # fmt: skip
    if worse:
        before, after = (f"{each.itae:.4g} s²" for each in found)
        raise rtcf.RtcfError(
            f"after is worse: its ITAE is {after}, before {before}: the parameters of {name} were "
            "set back"
        )


def _check(args: argparse.Namespace) -> None:
    excited.checked(args)
    if not 0 < args.tolerance < 1:
        raise ValueError(f"--tolerance {args.tolerance:g}: between 0 and 1")
    if not (args.size and math.isfinite(args.size)):
        raise ValueError(f"--size {args.size:g}: a number other than 0")
    if args.undo and not args.parameters:
        raise ValueError("--undo requires --param")


def _step(experiment: Experiment, args: argparse.Namespace) -> Step:
    """Step the closed loop, and measure it."""
    recorded = experiment.run(stepped=args.stepped)
    excited.complete(recorded, experiment.excitation)
    return _measured(recorded, args)


def _measured(recorded: Recorded, args: argparse.Namespace) -> Step:
    from rtcf.testing import step_response

    begin = int((recorded.signal != 0).argmax())
    if recorded.signal[begin] != args.size:
        raise rtcf.RtcfError(
            f"the limits leave {recorded.signal[begin]:g} of the step of {args.size:g}: set wider "
            "limits, or a smaller --size"
        )
    before = recorded.outputs[: begin + 1]
    initial = float(before[-max(int(_BASELINE * len(before)), 1) :].mean())
    time, value = recorded.time[begin:] - recorded.time[begin], recorded.outputs[begin:]
    target = float(recorded.inputs[-1])
    itae = float((time * abs(target - value)).sum()) * recorded.period / abs(args.size)
    return Step(time, value, step_response(time, value, target, initial, args.tolerance), itae)


def _print(
    found: list[Step], name: str, args: argparse.Namespace, output: Output, worse: bool
) -> None:
    rows = [
        (title, *(_value(getattr(each.measures, field), unit) for each in found))
        for title, field, unit in _ROWS
    ]
    rows.append(("ITAE", *(_value(each.itae, "s²") for each in found)))
    columns = ("step", "before", "after") if len(found) > 1 else ("step", "now")
    output.table(columns, rows, columns[1:])
    for title, each in zip(columns[1:], found, strict=True):
        if each.measures.unsettled:
            output.line(f"{title}, settling time: {each.measures.unsettled}")
    for title, each in zip(columns[1:], found, strict=True):
        output.line("")
        ends = {0.0: "0 s", 1.0: f"{each.time[-1]:.3g} s"}
        for line in drawn(title, [list(each.value)], ends):
            output.line(line)
    if len(found) > 1 and not worse:
        output.line("")
        output.line(_outcome(args.parameters, name, args.undo))


def _outcome(parameters: Iterable[str], name: str, undone: bool) -> str:
    text = ", ".join(parameters)
    if undone:
        return f"reverted {text} of {name}"
    return f"set {text} of {name}; `rtcfctl undo {name}` reverts it"


def _value(number: float, unit: str) -> str:
    if not math.isfinite(number):
        return "never"
    if unit == "%":
        return f"{100.0 * number:.1f} %"
    return f"{figure(float(f'{number:.4g}'))}{' ' if unit else ''}{unit}"
