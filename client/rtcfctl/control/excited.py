"""Options of the commands that excite a loop, and the experiment that they describe."""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import rtcf
from rtcf.v1 import graph_pb2

if TYPE_CHECKING:
    from rtcf.identification.experiment import Experiment, Recorded

_LONGEST_S = 86400.0


def add_options(to: argparse.ArgumentParser) -> None:
    """Add the limits of an excitation, and --step."""
    limits = to.add_argument_group("limits")
    limits.add_argument(
        "--lower", type=float, required=True, metavar="X", help="lowest value of the input"
    )
    limits.add_argument(
        "--upper", type=float, required=True, metavar="X", help="highest value of the input"
    )
    limits.add_argument(
        "--measured-lower", type=float, metavar="Y", help="stop if the output is below this value"
    )
    limits.add_argument(
        "--measured-upper", type=float, metavar="Y", help="stop if the output is above this value"
    )
    to.add_argument(
        "--step", action="store_true", dest="stepped",
        help="step a stopped loop on a simulated clock, as fast as possible",
    )  # fmt: skip


def checked(args: argparse.Namespace) -> None:
    """Check the limits and the duration; raises ValueError."""
    for low, high in (("lower", "upper"), ("measured_lower", "measured_upper")):
        first, last = getattr(args, low), getattr(args, high)
        if first is not None and last is not None and not first < last:
            option = f"--{low.replace('_', '-')}"
            raise ValueError(f"{option} {first:g}: must be below {option[:-5]}upper {last:g}")
    if not 0 < args.duration <= _LONGEST_S:
        raise ValueError(f"--duration {args.duration:g}: more than 0, at most {_LONGEST_S:g} s")


def limits(args: argparse.Namespace) -> dict[str, Any]:
    """Return the limits as parameters of the Excitation."""
    names = ("lower", "upper", "measured_lower", "measured_upper")
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}


@contextlib.contextmanager
def experiment(client: rtcf.Client, runner: str, what: str, measured: str) -> Iterator[Experiment]:
    """Yield the experiment of an Excitation of the graph, or of one that is loaded for an input.

    Parameters of an Excitation of the graph get their values back.
    """
    from rtcf.identification.experiment import Experiment

    if "." in what:
        if not measured:
            raise ValueError(f"{what}: name the measured output, too, as COMPONENT.PORT")
        with Experiment.on_input(client, runner, what, measured) as found:
            yield found
        return
    found = Experiment.by_component(client, runner, what, measured)
    component = client.get_component(found.excitation, runner)
    before = [
        graph_pb2.ParameterSetting(name=each.name, value=each.value)
        for each in component.parameters
    ]
    try:
        yield found
    finally:
        now = {each.name: each.value for each in
               client.get_component(found.excitation, runner).parameters}  # fmt: skip
        changed = [each for each in before if each.value != now.get(each.name)]
        if changed:
            client.set_parameters(found.excitation, changed, runner)


def complete(recorded: Recorded, excitation: str) -> None:
    """Raise RtcfError if an excitation has ended early."""
    if recorded.why:
        raise rtcf.RtcfError(f"the excitation by {excitation} ended early: {recorded.why}")


def plain(value: Any) -> Any:
    """Return data whose numbers are all finite: JSON has no others; null replaces them."""
    if isinstance(value, dict):
        return {name: plain(each) for name, each in value.items()}
    if isinstance(value, list):
        return [plain(each) for each in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
