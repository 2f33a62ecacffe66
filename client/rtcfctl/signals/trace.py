"""`rtcfctl trace`: writes a timeline of a loop for Perfetto and chrome://tracing."""

import argparse
import contextlib
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rtcf
from rtcf.recording.trace import Trace
from rtcf.streams.numbered import Place
from rtcf.streams.ports import PortStream
from rtcf.v1 import runner_pb2
from rtcf_shared.whole_files import whole_file

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.signals.termination import ended_by_signals
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import counted, whole

if TYPE_CHECKING:
    from rtcf.kernel.late_cycles import LateCycles

_EVERY_S = 0.5  # interval of queries for events, log records and statistics
_FAULT_S = 10.0  # longest wait for rtcfd's fault event after the executor has died
_SETTLE_S = 0.3  # time until rtcfd has the log records of a cycle


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    verb = verbs.add_parser(
        "trace",
        parents=[common],
        help="write a timeline of the loop to a file for Perfetto",
        # -o is the file for this verb; --output remains.
        conflict_handler="resolve",
    )
    verb.add_argument("-o", dest="file", metavar="FILE", type=Path, required=True, help="JSON file")
    verb.add_argument(
        "--cycles", type=whole, metavar="N", help="end after N cycles (default: Ctrl-C)"
    )
    verb.add_argument(
        "--components",
        action="store_true",
        help="also write the duration of each component in each cycle",
    )
    verb.add_argument(
        "--kernel", action="store_true", help="find the cause of each late cycle (as root)"
    )
    verb.add_argument("--force", action="store_true", help="overwrite an existing file")
    verb.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Trace the loop until Ctrl-C, or for some cycles."""
    if args.cycles == 0:
        raise ValueError("--cycles 0: at least 1")
    runner = args.runner or "rt_runner"
    (status,) = client.get_status(runner).runners
    try:
        with whole_file(args.file, force=args.force) as part:
            trace = Trace(part, runner, status.settings.frequency_hz)
            try:
                # watch_ports() raises an error if the loop cannot be watched.
                with (
                    _kernel(trace, status, args) as late,  # starts before the first cycle
                    client.watch_ports((), runner, component_times=args.components) as stream,
                    ended_by_signals(stream),
                ):
                    error = _follow(client, stream, trace, late, args, output)
                    if late is not None:
                        late.finish()
                trace.close()
            except BaseException:
                trace.abandon()
                raise
    except FileExistsError:
        raise ValueError(f"{args.file} exists: use --force to overwrite it") from None
    except OSError as error:
        raise rtcf.RtcfError(f"{args.file} cannot be written: {error.strerror or error}") from None
    _tell(trace, late, args, output)
    if error is not None:
        raise error


@contextlib.contextmanager
def _kernel(
    trace: Trace, status: runner_pb2.RunnerStatus, args: argparse.Namespace
) -> "Iterator[LateCycles | None]":
    """Trace the kernel during the `with` block, if --kernel is given."""
    if not args.kernel:
        yield None
        return
    if args.host is not None:
        raise ValueError(
            f"--kernel traces the local machine: use ssh {args.host} rtcfctl trace --kernel"
        )
    if not status.realtime_tid:
        raise ValueError(f"--kernel: the loop of {status.runner} does not run; start it first")
    cpu = status.loop_cpu if status.HasField("loop_cpu") else None
    from rtcf.kernel.late_cycles import LateCycles
    from rtcf.kernel.tracefs import KernelTrace

    with KernelTrace(status.realtime_tid, cpu) as kernel:
        yield LateCycles(trace, kernel)


class _Queries:
    """Queries rtcfd for events, log records and statistics, and adds them to the trace."""

    def __init__(self, client: rtcf.Client, runner: str, trace: Trace) -> None:
        self._client = client
        self._runner = runner
        self._trace = trace
        with client.watch_events([runner]) as events, client.watch_logs(runner) as records:
            self._events: Place = events.place
            self._records: Place = records.place
        trace.add_statistics(client.get_statistics(runner))

    def ask(self) -> None:
        """Add the events, records and statistics since the last call."""
        client, runner = self._client, self._runner
        with client.watch_events([runner], self._events, until_now=True) as events:
            self._trace.add_events(events)
        with client.watch_logs(runner, after=self._records, until_now=True) as records:
            self._trace.add_records(records)
        self._events, self._records = events.place, records.place
        self._trace.add_statistics(client.get_statistics(runner))
        (status,) = client.get_status(runner).runners
        self._trace.set_frequency(status.settings.frequency_hz)


def _follow(
    client: rtcf.Client,
    stream: PortStream,
    trace: Trace,
    late: "LateCycles | None",
    args: argparse.Namespace,
    output: Output,
) -> rtcf.RtcfError | None:
    """Trace the loop.  Return the error that ended it; raise the error if there are no cycles."""
    runner = args.runner or "rt_runner"
    queries = _Queries(client, runner, trace)
    say_if_idle(client, runner, output)  # from here on, nothing is lost
    try:
        _follow_cycles(stream, queries, trace, late, args, output)
        time.sleep(_SETTLE_S)
        queries.ask()
    except rtcf.RtcfError as error:
        if not trace.cycles:
            raise
        # The executor has died: complete the trace, and wait for the fault event.
        until = time.monotonic() + _FAULT_S
        with contextlib.suppress(rtcf.RtcfError):
            queries.ask()
            while not trace.faults and time.monotonic() < until:
                time.sleep(_SETTLE_S)
                queries.ask()
        return error
    return None


def _follow_cycles(
    stream: PortStream,
    queries: _Queries,
    trace: Trace,
    late: "LateCycles | None",
    args: argparse.Namespace,
    output: Output,
) -> None:
    due = time.monotonic() + _EVERY_S
    for batch in stream:
        left = None if args.cycles is None else args.cycles - trace.cycles
        if left is not None and len(batch) > left:
            batch = batch.part(0, left)
        trace.add_cycles(batch, None if late is None else late.add)
        if args.cycles is not None and trace.cycles >= args.cycles:
            return
        say_if_ended(batch, args.runner, output)
        if time.monotonic() >= due:
            queries.ask()
            if late is not None:
                late.ask()
            due = time.monotonic() + _EVERY_S


def _tell(
    trace: Trace, late: "LateCycles | None", args: argparse.Namespace, output: Output
) -> None:
    if not output.for_people:
        result: dict[str, Any] = {
            "file": str(args.file), "cycles": trace.cycles, "late": trace.late,
            "lost": trace.lost, "events": trace.events, "records": trace.records,
        }  # fmt: skip
        if late is not None:
            result["kernel"] = [
                {"cycle": cycle, "kind": culprit.kind.value, "instead": culprit.words,
                 "us": culprit.taken_ns / 1e3}
                for cycle, culprit in late.found
            ]  # fmt: skip
        output.data(result)
        return
    lost = f"{counted(trace.lost, 'cycle')} lost" if trace.lost else "none lost"
    output.line(
        f"{args.file}: {counted(trace.cycles, 'cycle')}, {trace.late} late, {lost}, "
        f"{counted(trace.events, 'event')}, {counted(trace.records, 'log record')}"
    )
    if late is not None:
        for words, count in late.counts():
            output.line(f"{counted(count, 'late cycle')}: {words}")
        if late.problem:
            print(f"rtcfctl: --kernel ended early: {late.problem}", file=sys.stderr)
    print("open it at https://ui.perfetto.dev or chrome://tracing", file=sys.stderr)
