"""Replay of bags: feeds recorded messages to a loop by their time stamps, as fast as possible.

The first cycle at or after the time of a message reads it. The loop's mapped outputs can be
written to another bag. The same bag always results in bit-identical outputs.
"""

import contextlib
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rtcf_shared.mcap_writer import MAGIC
from rtcf_shared.whole_files import whole_file

from rtcf.client import Client, ReplayCall
from rtcf.recording import bags
from rtcf.recording.reader import RecordingError
from rtcf.v1 import control_pb2

# Of one request; far below the maximum size of a message.
_MAX_MESSAGES = 2000
_MAX_BYTES = 2 * 1024 * 1024

LONGEST_GAP_S = 3600.0

OnProgress = Callable[[str], None]


@dataclass
class Summary:
    """The result of a replay; times in ns since 1970."""

    start_ns: int = 0
    end_ns: int = 0
    cycles: int = 0
    injected: int = 0  # messages fed to the loop
    outputs: int = 0  # messages written by the loop
    unread: list[str] = field(default_factory=list)  # topics of the bag that no component reads
    missing: list[str] = field(default_factory=list)  # topics read by components, not in the bag


def replay(
    client: Client,
    recording: Path,
    runner: str = "",
    output: Path | None = None,
    on_progress: OnProgress | None = None,
    longest_gap_s: float = LONGEST_GAP_S,
) -> Summary:
    """Replay a bag in a stopped loop, with newly created components.

    recording      the bag to read
    output         a bag for the outputs, stamped with the times of the cycles
    on_progress    called from time to time with a line of progress
    longest_gap_s  longest time between two messages, s; the loop runs all its cycles in it

    Raises RefusedError, and RecordingError for errors of the files.
    """
    if output is not None and output.resolve() == recording.resolve():
        raise RecordingError(f"{output} is the recording itself: write to another file")
    with _reader(recording) as bag, client.replay() as call:
        topics = [
            control_pb2.RecordedTopic(topic=each.topic, type=each.datatype, md5=each.md5sum)
            for each in bag._get_connections()
        ]
        _require_no_gap(recording, bag, longest_gap_s)
        messages = bag.read_messages(raw=True)
        first = next(messages, None)
        if first is None:
            raise RecordingError(f"{recording} has no messages")
        start_ns = int(first.timestamp.to_nsec())
        begun = call.run(
            control_pb2.ReplayRequest(runner=runner, begin=True, start_ns=start_ns, topics=topics)
        )
        session = _Session(call, {each.topic for each in begun.inputs})
        session.summary.start_ns = session.summary.end_ns = start_ns
        recorded = {each.topic for each in topics}
        session.summary.unread = sorted(recorded - session.inputs)
        session.summary.missing = sorted(session.inputs - recorded)
        with _Writer(output, begun.written) as writer:
            session.take(first, writer)
            for message in messages:
                session.take(message, writer)
                if on_progress is not None and session.due:
                    seconds = (session.summary.end_ns - start_ns) / 1e9
                    on_progress(f"{seconds:.1f} s, {session.summary.cycles} cycles")
            session.run(writer, end=True)
        return session.summary


def _require_no_gap(recording: Path, bag: Any, longest_gap_s: float) -> None:
    """Raise RecordingError for a time without messages that no recording has, as after the clock
    of a robot was set."""
    before: int | None = None
    for entry in bag._get_entries():
        now = int(entry.time.to_nsec())
        if before is not None and now - before > longest_gap_s * 1e9:
            gap = round((now - before) / 1e9)
            raise RecordingError(
                f"{recording} has no message for {gap} s after {_date(before)}, as if its clock "
                f"was set then: `rosbag filter {recording} PART.bag 't.secs >= {now // 10**9}'` "
                "writes the part after that; --gap permits it, and runs all cycles of this time"
            )
        before = now


def _date(time_ns: int) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(time_ns / 1e9))


class _Session:
    """A running replay."""

    def __init__(self, call: ReplayCall, inputs: set[str]) -> None:
        self.inputs = inputs
        self.summary = Summary()
        self.due = False  # whether the last take() ran cycles
        self._call = call
        self._waiting: list[control_pb2.RecordedMessage] = []
        self._bytes = 0

    def take(self, message: Any, writer: "_Writer") -> None:
        """Queue the bag's next message; run cycles if enough are queued."""
        self.due = False
        self.summary.end_ns = int(message.timestamp.to_nsec())
        if message.topic not in self.inputs:
            return
        data = bytes(message.message[1])
        self._waiting.append(
            control_pb2.RecordedMessage(topic=message.topic, time_ns=self.summary.end_ns, data=data)
        )
        self._bytes += len(data)
        self.summary.injected += 1
        if len(self._waiting) >= _MAX_MESSAGES or self._bytes >= _MAX_BYTES:
            self.run(writer)
            self.due = True

    def run(self, writer: "_Writer", end: bool = False) -> None:
        """Run all cycles up to the last message's time."""
        for response in self._call.cycles(self._waiting, self.summary.end_ns, end):
            self.summary.cycles = response.cycles
            self.summary.outputs += len(response.outputs)
            writer.write(response.outputs)
        self._bytes = sum(len(each.data) for each in self._waiting)


class _Writer:
    """The bag of the outputs; without a path, the outputs are discarded."""

    def __init__(self, path: Path | None, topics: Any) -> None:
        self._path = path
        self._types = {
            each.topic: bags.MessageType(each.type, each.md5, each.definition) for each in topics
        }
        self._bag: Any = None
        self._open = contextlib.ExitStack()

    def __enter__(self) -> "_Writer":
        if self._path is not None:
            with contextlib.ExitStack() as opening, self._said():
                # The file gets its name only when it is complete.
                part = opening.enter_context(whole_file(self._path, force=True))
                # Bag.close() leaves its own file open if the disk is full.
                file = opening.enter_context(part.open("w+b"))
                self._bag = opening.enter_context(bags.rosbag().Bag(file, "w"))
                self._open = opening.pop_all()
        return self

    def __exit__(self, *why: Any) -> None:
        with self._said():
            self._open.__exit__(*why)

    def write(self, outputs: Any) -> None:
        """Append messages."""
        if self._bag is None:
            return
        with self._said():
            for each in outputs:
                raw = self._types[each.topic].raw(each.data)
                self._bag.write(each.topic, raw, bags.time(each.time_ns), raw=True)

    @contextlib.contextmanager
    def _said(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(
                f"{self._path} cannot be written: {error.strerror or error}"
            ) from None


def _is_mcap(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


@contextlib.contextmanager
def _reader(path: Path) -> Iterator[Any]:
    rosbag = bags.rosbag()
    try:
        bag = rosbag.Bag(str(path))
    except rosbag.ROSBagUnindexedException:
        raise RecordingError(
            f"{path} has no index because its recording was interrupted: rosbag reindex {path}"
        ) from None
    except (rosbag.ROSBagException, ValueError) as error:
        if _is_mcap(path):
            bag_path = path.with_suffix(".bag")
            raise RecordingError(
                f"{path} is an MCAP file, but replay reads bags: `rtcfctl convert {path} "
                f"{bag_path}`, then replay {bag_path}"
            ) from None
        raise RecordingError(f"{path} is not a bag: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}") from None
    with bag:
        yield bag
