"""`rtcfctl wait`: waits until a condition on signals is true, e.g. in scripts."""

import argparse
import math
import sys
import threading
from typing import Any

import rtcf
from rtcf.streams.condition import Condition
from rtcf_shared.ports import PortBatch

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    wait = verbs.add_parser(
        "wait", parents=[common], help="wait until a condition on signals is true in a cycle"
    )
    wait.add_argument(
        "condition",
        nargs="+",
        metavar="CONDITION",
        help="e.g. 'wave.phase > 0.9 and abs(pid.effort) < 2'; every cycle is checked",
    )
    wait.add_argument(
        "--timeout", type=amount("s"), metavar="S", help="give up after this time (exit code 1)"
    )
    wait.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Wait for the condition.  Raises RtcfError after the timeout."""
    condition = Condition(" ".join(args.condition))
    if args.timeout is not None and not 0 < args.timeout < math.inf:
        raise ValueError(f"--timeout {args.timeout:g}: more than 0 s")
    over = threading.Event()
    with client.watch_ports(condition.columns, args.runner) as stream:

        def end() -> None:
            over.set()
            stream.close()

        timer = threading.Timer(args.timeout, end) if args.timeout is not None else None
        if timer is not None:
            timer.daemon = True
            timer.start()
        try:
            condition.check(stream.schema)
            say_if_idle(client, args.runner, output)
            for batch in stream:
                if _tell(condition, batch, output):
                    return
                say_if_ended(batch, args.runner, output)
        finally:
            if timer is not None:
                timer.cancel()
    if over.is_set():
        raise rtcf.RtcfError(f"{condition.text}: not true in any cycle for {args.timeout:g} s")
    raise rtcf.RtcfError(f"{condition.text}: the stream has ended")


def _tell(condition: Condition, batch: PortBatch, output: Output) -> bool:
    """Print the first cycle in which the condition is true; return whether there is one."""
    if batch.lost:
        output.line(
            f"rtcfctl: note: {batch.lost} cycles were not checked: the reader is too slow",
            to=sys.stderr,
        )
    found = condition.where(batch).nonzero()[0]
    if not len(found):
        return False
    index = int(found[0])
    cycle = batch.first_cycle + index * batch.every
    if not output.for_people:
        output.data({"cycle": cycle, "stamp_ns": int(batch.message.stamps_ns[index])})
    else:
        print(f"true in cycle {cycle}")
    return True
