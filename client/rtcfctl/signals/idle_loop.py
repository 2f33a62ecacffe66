"""Notes for commands that wait for values while the loop runs no cycles."""

import sys

import rtcf
from rtcf.v1 import runner_pb2
from rtcf_shared.ports import PortBatch

from rtcfctl.terminal.output import Output

_RUNS = (runner_pb2.RUNNER_STATE_RUNNING, runner_pb2.RUNNER_STATE_STEPPING)


def say_if_idle(client: rtcf.Client, runner: str, output: Output) -> None:
    """Print a note if the loop does not run."""
    name = runner or "rt_runner"
    for found in client.get_status(name).runners:
        if found.state not in _RUNS:
            _say(
                f"the loop of {name} does not run: no values until it is started "
                f"(`rtcfctl -r {name} start`)",
                output,
            )


def say_if_ended(batch: PortBatch, runner: str, output: Output) -> None:
    """Print a note if a batch has the last cycle of its loop."""
    if batch.last_of_loop:
        _say(
            f"the loop of {runner or 'rt_runner'} ended in cycle "
            f"{batch.first_cycle + (len(batch) - 1) * batch.every}: no more values until it is "
            "started again",
            output,
        )


def _say(text: str, output: Output) -> None:
    sys.stdout.flush()  # print earlier output first
    output.line(f"rtcfctl: note: {text}", to=sys.stderr)
