"""`rtcfctl types`."""

import argparse
import sys
from typing import Any

import rtcf

from rtcfctl.graph.component import print_parameters, print_ports
from rtcfctl.terminal.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    types = verbs.add_parser(
        "types", parents=[common], help="list the component types that can be loaded"
    )
    types.add_argument("package", metavar="PKG", nargs="?", default="")
    types.add_argument("--long", action="store_true", help="also show ports and parameters")
    types.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print component types."""
    response = client.list_types(args.package)
    if not output.for_people:
        output.data(response)
        return
    if args.long:
        for each in response.types:
            output.line(f"{each.package}/{each.type}  {each.doc}".rstrip(), "bold")
            print_ports(list(each.ports), output)
            if each.parameters:
                print_parameters(list(each.parameters), output, of_type=True)
    else:
        output.table(
            ("package", "type", "ports", "parameters", "description"),
            (
                (each.package, each.type, len(each.ports), len(each.parameters), each.doc)
                for each in response.types
            ),
            right=("ports", "parameters"),
        )
    for problem in response.problems:
        print(f"rtcfctl: cannot be loaded: {problem}", file=sys.stderr)
