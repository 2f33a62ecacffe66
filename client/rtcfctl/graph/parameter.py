"""`rtcfctl set|history|undo|reset`."""

import argparse
from typing import Any

import rtcf

from rtcfctl.terminal import words
from rtcfctl.terminal.output import Output

_MOST = 20  # default number of printed changes


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    setting = verbs.add_parser(
        "set", parents=[common], help="change parameters of a component, all at one cycle"
    )
    setting.add_argument(
        "component",
        metavar="NAME",
        help="component, or NAME.state for its declared state while the loop is stopped",
    )
    setting.add_argument("parameters", metavar="PARAMETER:=VALUE", nargs="+")
    setting.set_defaults(run=set_parameters)

    past = verbs.add_parser(
        "history", parents=[common], help="show parameter changes with user and time"
    )
    past.add_argument("component", metavar="NAME", nargs="?", default="")
    past.add_argument("parameter", metavar="PARAMETER", nargs="?", default="")
    past.add_argument(
        "-n",
        dest="most",
        type=int,
        default=_MOST,
        metavar="N",
        help="show the last N changes (default: 20)",
    )
    past.set_defaults(run=show_history)

    undoing = verbs.add_parser(
        "undo", parents=[common], help="revert the last change of a component's parameters"
    )
    undoing.add_argument("component", metavar="NAME")
    undoing.set_defaults(run=undo)

    resetting = verbs.add_parser(
        "reset", parents=[common], help="reset a component's declared state to its initial values"
    )
    resetting.add_argument("component", metavar="NAME")
    resetting.set_defaults(run=reset_state)


def set_parameters(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Change parameters."""
    parameters = [rtcf.parse_parameter(text) for text in args.parameters]
    # Component names have no dots.
    component, dot, what = args.component.partition(".")
    if dot and what != "state":
        raise ValueError(f"{args.component}: use a component's name, or {component}.state")
    if dot:
        result = client.set_state(component, parameters, args.runner, output.progress)
    else:
        result = client.set_parameters(component, parameters, args.runner, output.progress)
    output.changed(f"set {', '.join(args.parameters)} of {args.component}", result)


def show_history(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print the last parameter changes."""
    if args.most < 1:
        raise ValueError(f"-n {args.most}: at least 1")
    found = client.get_history(args.component, args.parameter, args.runner, args.most)
    if not output.for_people:
        output.data(found)
        return
    output.table(
        ("when", "who", "how", "parameter", "before", "value"),
        (
            (
                words.date(each.time_ns),
                each.who,
                each.how,
                f"{each.component}.{each.parameter}",
                words.value(each.before) if each.HasField("before") else "-",
                words.value(each.value),
            )
            for each in found
        ),
    )


def undo(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Revert the last change."""
    result = client.undo_parameters(args.component, args.runner, output.progress)
    output.changed(f"reverted the last change of {args.component}", result)


def reset_state(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Reset state."""
    result = client.reset_state(args.component, args.runner, output.progress)
    output.changed(f"reset the state of {args.component}", result)
