"""Conversion of recordings to CSV and ROS 1 bags, and repair of interrupted recordings."""

import csv
import io
import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from rtcf_shared.arrays import as_list
from rtcf_shared.mcap_writer import McapWriter
from rtcf_shared.whole_files import whole_file

from rtcf.recording import bags
from rtcf.recording.bag_writer import BagWriter, Messages
from rtcf.recording.reader import RecordedColumn, RecordedTopic, Recording, RecordingError

if TYPE_CHECKING:
    from numpy.typing import NDArray

_CYCLE = ("iteration", "duration_ns", "latency_ns")

OnProgress = Callable[[str], None]


def convert(
    recording: Recording, to: Path, *, force: bool = False, on_progress: OnProgress | None = None
) -> int:
    """Write a recording to a file in the format of its suffix, .csv or .bag.

    Return the number of cycles (.csv) or messages (.bag).  With `force`, overwrite an existing
    file.  After an error the incomplete file is removed.  Raises ValueError for an unusable file
    name, and RecordingError.
    """
    write = _KINDS.get(to.suffix)
    if write is None:
        raise ValueError(f"{to}: the suffix must be {' or '.join(_KINDS)}, to select the format")
    if to.exists() and to.samefile(recording.path):
        raise ValueError(f"{to} is the recording itself: write to another file")
    if write is _write_bag:
        bags.require()  # raises before the file is created
    with _new_file(to, force) as file:
        written = 0
        for chunk, count in enumerate(write(recording, file), 1):
            written += count
            if on_progress is not None:
                on_progress(f"{to}: {100 * chunk // recording.chunks} %")
        return written


def repair(recording: Recording, to: Path, *, force: bool = False) -> tuple[int, int]:
    """Copy an interrupted recording to a complete file with a summary, for other readers.

    Return the number of cycles and the number of damaged chunks, which are omitted.  With `force`,
    overwrite an existing file.  Raises ValueError for an unusable file name, and RecordingError.
    """
    if to.suffix != ".mcap":
        raise ValueError(f"{to}: the suffix must be .mcap for a repaired recording")
    if to.exists() and to.samefile(recording.path):
        raise ValueError(f"{to} is the recording itself: write to another file")
    cycles = damaged = 0
    with _new_file(to, force) as file:
        writer = McapWriter(file)
        for name, values in recording.metadata.items():
            writer.metadata(name, values)
        for topic in recording.topics:
            number = writer.channel(topic.name, topic.ros_type, topic.definition, topic.metadata)
            if number != topic.number:
                raise RecordingError(
                    f"{recording.path} has a topic number {topic.number} after {number - 1}: "
                    "it was not written by rtcfctl record"
                )
        for chunk in range(recording.chunks):
            try:
                packed, counts = recording.packed_chunk(chunk)
            except RecordingError:
                damaged += 1
                continue
            writer.packed_chunk(packed, counts)
            cycles += counts.get(recording.cycle_topic, 0)
        writer.close()
    return cycles, damaged


def _write_csv(recording: Recording, file: BinaryIO) -> Iterator[int]:
    """Write a line for each cycle; cells without a value are empty."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\n")
    head = ["cycle", "stamp_ns", *_CYCLE[1:]]
    for name, signal in recording.signals.items():
        count = signal.leaf.count
        head += [name] if count is None else [f"{name}[{index}]" for index in range(count)]
    recording.read_cycles(end_ns=0)  # raises before a line is written
    writer.writerow(head)
    for chunk in range(recording.chunks):
        first, *others = recording.read_cycles(chunk=chunk).values()
        columns = [as_list(first.values), as_list(first.stamps_ns)]
        columns += [as_list(other.values) for other in others]
        for column in recording.read_all(chunk=chunk).values():
            columns += _cells(column, first)
        writer.writerows(zip(*columns, strict=True))
        yield len(first.values)
    text.detach()


def _cells(column: RecordedColumn, cycles: RecordedColumn) -> list[list[Any]]:
    """Return the columns of a signal, with a cell for each cycle."""
    import numpy as np

    # Not reshape(…, -1), which fails for a signal without values in this chunk.
    values = column.values.reshape(len(column.values), math.prod(column.values.shape[1:]))
    shown = [_shown(values[:, index]) for index in range(values.shape[1])]
    if np.array_equal(column.cycles, cycles.values):
        return shown
    # Cycle numbers repeat after a restart of the loop: match by number and stamp.
    keys = zip(as_list(cycles.values), as_list(cycles.stamps_ns), strict=True)
    line = {key: number for number, key in enumerate(keys)}
    keys = zip(as_list(column.cycles), as_list(column.stamps_ns), strict=True)
    lines = [line.get(key) for key in keys]
    aligned = []
    for cells in shown:
        all_cells = [""] * len(cycles.values)
        for number, cell in zip(lines, cells, strict=True):
            if number is not None:
                all_cells[number] = cell
        aligned.append(all_cells)
    return aligned


def _shown(values: "NDArray[Any]") -> list[Any]:
    """Return numbers for the shortest exact text; bool as 0 and 1."""
    if values.dtype == bool:
        return as_list(values.astype(int))
    return as_list(values.astype(str) if values.dtype.itemsize == 4 else values)


def _write_bag(recording: Recording, file: BinaryIO) -> Iterator[int]:
    """Write the messages of each output and state."""
    topics: dict[str, tuple[str, ...]] = {}
    connections: dict[int, int] = {}  # by number of the topic
    bag = BagWriter(file)
    for chunk in range(recording.chunks):
        found = []
        for topic, stamps_ns, data in recording.runs(chunk):
            if topic.number not in connections:
                connections[topic.number] = bag.connection(*_named(topic, topics))
            found.append(Messages(connections[topic.number], stamps_ns, data))
        bag.chunk(found)
        yield sum(len(each.stamps_ns) for each in found)
    bag.close()


def _named(topic: RecordedTopic, topics: dict[str, tuple[str, ...]]) -> tuple[str, str, str, str]:
    """Return name, type, MD5 sum and definition of a topic; names are made unique, as a bag has one
    type per name.
    """
    md5 = bags.md5_of(topic.ros_type, topic.definition)
    kind = topic.metadata.get("kind", "other")
    own = topic.ros_type, md5, kind
    name, number = topic.name, 1
    while topics.setdefault(name, own) != own:
        name = f"{topic.name}/{kind}" if number == 1 else f"{topic.name}/{kind}_{number}"
        number += 1
    return name, topic.ros_type, md5, topic.definition


_KINDS = {".csv": _write_csv, ".bag": _write_bag}


@contextmanager
def _new_file(path: Path, force: bool) -> Iterator[BinaryIO]:
    try:
        with ExitStack() as open_files:
            try:
                part = open_files.enter_context(whole_file(path, force=force))
                file = open_files.enter_context(part.open("w+b"))
            except FileExistsError:
                raise
            except OSError as error:
                raise ValueError(f"{path}: {error.strerror}") from None
            yield file
    except FileExistsError:
        raise ValueError(f"{path} already exists: --force overwrites it") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
