"""`rtcfctl events`: prints past and new events."""

import argparse
import contextlib
import sys
from typing import Any

import rtcf
from rtcf.streams.numbered import Lost, Place
from rtcf.v1 import control_pb2

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import enumerator
from rtcfctl.terminal.words import date

_STYLES = {
    control_pb2.Event.KIND_LOOP_FAULT: "bold red",
    control_pb2.Event.KIND_EXECUTOR_FAULT: "bold red",
    control_pb2.Event.KIND_COMPONENT_FAULT: "red",
    control_pb2.Event.KIND_DEGRADED: "yellow",
    control_pb2.Event.KIND_OVERRUNS: "yellow",
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    verb = verbs.add_parser("events", parents=[common], help="show events: states, faults, changes")
    verb.add_argument(
        "-f", "--follow", action="store_true", help="continue with new events until Ctrl-C"
    )
    verb.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print events; for programs, one document each."""
    runners = [args.runner] if args.runner else []
    with (
        contextlib.suppress(KeyboardInterrupt) if args.follow else contextlib.nullcontext(),
        client.watch_events(runners, Place(), until_now=not args.follow) as events,
    ):
        for event in events:
            if output.for_people:
                _print(event, output)
            else:
                output.record({"lost": event.count} if isinstance(event, Lost) else event)
            sys.stdout.flush()


def _print(event: control_pb2.Event | Lost, output: Output) -> None:
    if isinstance(event, Lost):
        output.line(f"{event.count} older events are not kept", "yellow")
    else:
        output.line(_line(event), _STYLES.get(event.kind, ""))


def _line(event: control_pb2.Event) -> str:
    stamp = date(event.time_ns)
    subject = event.runner or "rtcfd"
    who = f" (by {event.user})" if event.user else ""
    return f"{stamp} {subject} {enumerator(event, 'kind')}: {event.message}{who}"
