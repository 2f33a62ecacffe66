"""`rtcfctl get`: prints present values of a component."""

import argparse
from typing import Any

import rtcf
from rtcf.v1 import graph_pb2

from rtcfctl.terminal import words
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import plain


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    get = verbs.add_parser(
        "get", parents=[common], help="show present values of parameters, ports or state"
    )
    get.add_argument(
        "name", metavar="NAME", help="COMPONENT (all values), COMPONENT.PARAMETER, .PORT or .STATE"
    )
    get.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print one value, or all values of a component."""
    component, dot, name = args.name.partition(".")
    found = client.get_component(component, args.runner)
    values = _values(found)
    if dot:
        if name not in values:
            known = ", ".join(values) or "nothing"
            raise rtcf.RtcfError(f"{found.full_name} has no {name}; it has {known}")
        values = {name: values[name]}
    if not output.for_people:
        data = {each: plain_value for each, (_, plain_value) in values.items()}
        output.data(data[name] if dot else data)
        return
    for each, (text, _) in values.items():
        output.line(text if dot else f"{each}: {text}")


def _values(found: graph_pb2.ComponentInfo) -> dict[str, tuple[str, Any]]:
    """Return each value as text and as plain data, by name.

    A state with the name of a port or parameter has the name `state.NAME`.
    """
    values: dict[str, tuple[str, Any]] = {}
    for parameter in found.parameters:
        values[parameter.name] = (words.value(parameter.value), plain(parameter.value))
    for port in found.ports:
        text = words.port_value(port.value) if port.HasField("value") else "none yet"
        values.setdefault(port.name, (text, plain(port)["value"]))
    for state in found.states:
        value = (state.value or "no answer in time", plain(state)["value"])
        values[f"state.{state.name}" if state.name in values else state.name] = value
    return values
