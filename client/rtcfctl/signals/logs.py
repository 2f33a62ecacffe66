"""`rtcfctl logs`: prints log records of the components and of the executor."""

import argparse
import contextlib
import sys
from collections import deque
from collections.abc import Iterable
from typing import Any

import rtcf
from rtcf.client import LOG_LEVELS
from rtcf.streams.numbered import Lost, Place
from rtcf.v1 import control_pb2

from rtcfctl.terminal.output import Output
from rtcfctl.terminal.plain import enumerator
from rtcfctl.terminal.words import counted, date_ms, whole

_STYLES = {
    control_pb2.LogRecord.LEVEL_WARN: "yellow",
    control_pb2.LogRecord.LEVEL_ERROR: "red",
    control_pb2.LogRecord.LEVEL_FATAL: "bold red",
}


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "logs", parents=[common], help="show log records of components and the executor"
    )
    verb.add_argument(
        "components", nargs="*", metavar="NAME", help="only of these components (default: all)"
    )
    verb.add_argument(
        "-f", "--follow", action="store_true", help="continue with new records until Ctrl-C"
    )
    verb.add_argument(
        "-n", type=whole, metavar="N", help="show only the last N past records (default: all kept)"
    )
    verb.add_argument(
        "--level",
        choices=LOG_LEVELS,
        default="debug",
        help="show records of this level or above (default: debug)",
    )
    verb.set_defaults(run=show)


def show(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Print records; for programs, one document each."""
    asked = (args.runner, args.components, args.level)
    with client.watch_logs(*asked, Place(), until_now=True) as past:
        # With -n, the number of records that are no longer kept is not printed.
        found: Iterable[control_pb2.LogRecord | Lost] = past
        _print(found if args.n is None else deque(found, args.n), output)
    if args.follow:
        with contextlib.suppress(KeyboardInterrupt), client.watch_logs(*asked, past.place) as news:
            _print(news, output)


def _print(records: Iterable[control_pb2.LogRecord | Lost], output: Output) -> None:
    for each in records:
        if not output.for_people:
            output.record({"lost": each.count} if isinstance(each, Lost) else each)
        elif isinstance(each, Lost):
            output.line(f"{counted(each.count, 'older record')} not kept", "yellow")
        else:
            output.line(_line(each), _STYLES.get(each.level, ""))
        sys.stdout.flush()


def _line(record: control_pb2.LogRecord) -> str:
    who = record.component or "executor"
    level = enumerator(record, "level")
    message = " ".join(record.message.splitlines())
    return f"{date_ms(record.time_ns)} {level:5} {who} #{record.iteration}: {message}"
