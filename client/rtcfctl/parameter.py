"""`rtcfctl set|reset`."""

import argparse
from typing import Any

import rtcf

from rtcfctl.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    setting = verbs.add_parser(
        "set", parents=[common], help="change parameters of a component, all at one cycle"
    )
    setting.add_argument("component", metavar="NAME")
    setting.add_argument("parameters", metavar="PARAMETER:=VALUE", nargs="+")
    setting.set_defaults(run=set_parameters)

    resetting = verbs.add_parser(
        "reset", parents=[common], help="take a component's state back to its initial values"
    )
    resetting.add_argument("component", metavar="NAME")
    resetting.set_defaults(run=reset_state)


def set_parameters(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Change parameters."""
    parameters = [rtcf.parse_parameter(text) for text in args.parameters]
    result = client.set_parameters(args.component, parameters, args.runner, output.progress)
    output.changed(f"set {', '.join(args.parameters)} of {args.component}", result)


def reset_state(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Reset state."""
    result = client.reset_state(args.component, args.runner, output.progress)
    output.changed(f"reset the state of {args.component}", result)
