"""`rtcfctl record`: values of every cycle into a file."""

import argparse
import contextlib
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import rtcf
from rtcf.recording.mcap_writer import McapWriter
from rtcf.recording.recorder import Recorder
from rtcf.streams.ports import PortStream

from rtcfctl.signals.idle_loop import say_if_ended, say_if_idle
from rtcfctl.terminal.output import Output
from rtcfctl.terminal.words import amount, counted

_TOLD_S = 1.0
_LONGEST_S = 1e9
_KEPT_S = 1.0  # in memory: what a writer that is killed loses at most


def register(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Add the verb."""
    record = verbs.add_parser(
        "record",
        parents=[common],
        help="values of every cycle, into a file",
        # -o is the file here; --output stays.
        conflict_handler="resolve",
    )
    record.add_argument(
        "-o", dest="file", metavar="FILE", type=Path, required=True, help="the file, of MCAP"
    )
    record.add_argument(
        "selection",
        nargs="*",
        metavar="NAME",
        help="a component, or an output or state of it, as with rtcfctl echo; all without",
    )
    record.add_argument(
        "--duration", type=amount("s"), metavar="S", help="end after so much loop time"
    )
    record.add_argument("--force", action="store_true", help="write over a file that is there")
    record.set_defaults(run=run)


def run(client: rtcf.Client, args: argparse.Namespace, output: Output) -> None:
    """Record until Ctrl-C, or for a while."""
    if args.duration is not None and not 0 < args.duration <= _LONGEST_S:
        raise ValueError(f"--duration {args.duration:g}: more than 0 s, and {_LONGEST_S:g} at most")
    # Refused before there is a file.
    with client.watch_ports(args.selection, args.runner) as stream:
        for note in stream.schema.notes:
            _note(output, note)
        say_if_idle(client, args.runner, output)
        recorder = _record(stream, _opened(args.file, args.force), args, output)
    size_mb = args.file.stat().st_size / 1e6
    lost = f"{counted(recorder.lost, 'cycle')} lost" if recorder.lost else "none lost"
    if output.for_people:
        output.line(
            f"{args.file}: {counted(recorder.cycles, 'cycle')}, {size_mb:.1f} MB, {lost}",
            "bold red" if recorder.lost else "",
        )
    else:
        output.data(
            {"file": str(args.file), "cycles": recorder.cycles, "lost": recorder.lost,
             "bytes": args.file.stat().st_size}
        )  # fmt: skip


def _opened(path: Path, force: bool) -> BinaryIO:
    try:
        return path.open("wb" if force else "xb")
    except FileExistsError:
        raise ValueError(f"{path} is there already: --force writes over it") from None
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror}") from None


def _record(
    stream: PortStream, file: BinaryIO, args: argparse.Namespace, output: Output
) -> Recorder:
    try:
        # Closing writes what is left, and may find no room either.
        with file:
            writer = McapWriter(file)
            recorder = Recorder(writer, args.runner or "rt_runner")
            try:
                with _ended_by_signals(stream):
                    _follow(stream, writer, recorder, args, output)
            finally:
                recorder.flush()
                writer.close()
    except OSError as error:
        raise rtcf.RtcfError(
            f"{args.file}: {error.strerror}: what was written before can be read"
        ) from None
    return recorder


@contextlib.contextmanager
def _ended_by_signals(stream: PortStream) -> Iterator[None]:
    """Let signals end the stream, and break off nothing that is being written.

    The second one ends us at once: the disk may be one that takes nothing any more.
    """

    def end(number: int, _: object) -> None:
        signal.signal(number, signal.SIG_DFL)
        # Whatever locks we hold just now.
        threading.Thread(target=stream.close, daemon=True).start()

    before = {}
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        found = signal.getsignal(number)
        if found is not signal.SIG_IGN:  # as by nohup
            before[number] = found
            signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            # Who has had enough does not wait for the rest either.
            if signal.getsignal(number) is end:
                signal.signal(number, handler)


def _follow(
    stream: PortStream,
    writer: McapWriter,
    recorder: Recorder,
    args: argparse.Namespace,
    output: Output,
) -> None:
    until_ns = None
    told = flushed = time.monotonic()
    try:
        for batch in stream:
            for note in recorder.add(batch):
                _note(output, note)
            now = time.monotonic()
            say_if_ended(batch, args.runner, output)
            if now - flushed >= _KEPT_S or batch.last_of_loop:
                recorder.flush()
                flushed = now
            if now - told >= _TOLD_S and sys.stderr.isatty():
                told = now
                print(
                    f"\r{counted(recorder.cycles, 'cycle')}, {writer.size / 1e6:.1f} MB, "
                    f"{recorder.lost} lost ",
                    end="",
                    file=sys.stderr,
                    flush=True,
                )
            if args.duration is None or not len(batch):
                continue
            stamps = batch.message.stamps_ns
            if until_ns is None:
                until_ns = stamps[0] + round(args.duration * 1e9)
            if stamps[-1] >= until_ns:
                return
    finally:
        if sys.stderr.isatty():
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _note(output: Output, text: str) -> None:
    output.line(f"rtcfctl: note: {text}", to=sys.stderr)
