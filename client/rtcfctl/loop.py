"""`rtcfctl start` and `rtcfctl stop`."""

import argparse
from typing import Any

import rtcf

from rtcfctl.output import Output


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    begin = verbs.add_parser("start", parents=[common], help="start the loop")
    begin.set_defaults(run=start)
    end = verbs.add_parser("stop", parents=[common], help="end the loop at the next cycle")
    end.set_defaults(run=stop)


def start(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Start the loop."""
    result = client.start(args.runner, output.progress)
    output.changed("started", result)


def stop(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Stop the loop."""
    result = client.stop(args.runner, output.progress)
    output.changed("stopped", result)
