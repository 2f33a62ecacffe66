"""`rtcfctl write`: writes a value to an input without a writer."""

import argparse
from typing import Any

import rtcf

from rtcfctl.terminal.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    write = verbs.add_parser(
        "write", parents=[common], help="write a value to an input without a writer"
    )
    write.add_argument("port", metavar="COMPONENT.PORT")
    write.add_argument(
        "value", metavar="VALUE", help="YAML: 1.5, true, text, [1, 2, 3] or '{linear: {x: 1}}'"
    )
    write.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Write the value."""
    result = client.write(args.port, args.value, args.runner, on_progress=output.progress)
    output.changed(f"{result.component}.{args.port.rpartition('.')[2]} written", result)
