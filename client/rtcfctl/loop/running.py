"""`rtcfctl start|stop|step`."""

import argparse
import sys
from typing import Any

import rtcf

from rtcfctl.terminal import words
from rtcfctl.terminal.output import Output

_MOST_CYCLES = 10**18


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verbs."""
    begin = verbs.add_parser("start", parents=[common], help="start the loop")
    begin.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="NAME",
        help="start even if this component, which is not optional, is left out",
    )
    begin.add_argument(
        "--partial", action="store_true", help="start even if any components are left out"
    )
    begin.set_defaults(run=start)
    end = verbs.add_parser("stop", parents=[common], help="end the loop at the next cycle")
    end.add_argument(
        "--all",
        action="store_true",
        help="end the loops of all runners at once, even if rtcfd does not answer",
    )
    end.set_defaults(run=stop)
    stepping = verbs.add_parser(
        "step", parents=[common], help="run cycles of a stopped loop on a simulated clock"
    )
    stepping.add_argument("cycles", metavar="N", type=int, help="cycles, run as fast as possible")
    stepping.set_defaults(run=step)


def start(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Start the loop."""
    result = client.start(args.runner, output.progress, without=args.without, partial=args.partial)
    if output.for_people:
        output.alarm(args.runner or "rt_runner", result.degraded, sys.stderr)
    output.changed("started", result)


def stop(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Stop the loop, or the loops of all runners."""
    if args.all:
        _stop_all(client, output)
        return
    result = client.stop(args.runner, output.progress)
    output.changed("stopped", result)


def _stop_all(client: rtcf.Client, output: Output) -> None:
    found = client.stop_all()
    failed = [each for each in found if each.error is not None]
    if output.for_people:
        for each in found:
            if each.error is None:
                print(f"{each.runner} stopped")
                output.notes(f"{each.runner}: {note}" for note in each.notes)
    else:
        output.data(
            [
                {
                    "runner": each.runner,
                    "stopped": each.error is None,
                    "notes": list(each.notes),
                }
                for each in found
            ]
        )
    if failed:
        lines = "; ".join(str(each.error) for each in failed)
        if all(isinstance(each.error, rtcf.DaemonUnreachableError) for each in failed):
            raise rtcf.DaemonUnreachableError(lines)
        raise rtcf.RtcfError(lines)


def step(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Run cycles of a stopped loop."""
    if args.cycles < 1:
        raise ValueError(f"step {args.cycles}: at least 1 cycle")
    if args.cycles > _MOST_CYCLES:
        raise ValueError(f"step {args.cycles}: at most {_MOST_CYCLES} cycles at once")
    result = client.step(args.cycles, args.runner, output.progress)
    if result.cycles < args.cycles:
        output.changed(f"stepped {result.cycles} of {words.counted(args.cycles, 'cycle')}", result)
        status = client.get_status(args.runner or "rt_runner").runners[0]
        raise rtcf.RtcfError(f"step ended early: {status.status or 'the loop was stopped'}")
    output.changed(f"stepped {words.counted(result.cycles, 'cycle')}", result)
