"""Reads the frames of an executor, alive or dead: the last second of its loop.

They are in shared memory (layout in executor.proto) that rtcfd opens at hello and holds.
A frame that was being written when the process died is left out.  Needs NumPy, and runs
in a process of its own: rtcfd itself only holds the descriptor.
"""

import itertools
import mmap
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rtcf.executor.v1 import executor_pb2 as wire
from rtcf.v1 import ports_pb2
from rtcf_shared.arrays import as_list

from rtcfd.incidents import frame_memory


@dataclass(frozen=True)
class Ring:
    """The complete frames of one graph, in order."""

    layout: wire.FrameLayout
    words: "NDArray[np.uint64]"  # one row per frame

    def __len__(self) -> int:
        return len(self.words)

    @property
    def cycles(self) -> "NDArray[np.int64]":
        """The numbers of the cycles."""
        return self._signed(1)

    @property
    def stamps_ns(self) -> "NDArray[np.int64]":
        """CLOCK_REALTIME of each cycle's deadline, or the simulated time."""
        return self._signed(2)

    @property
    def latencies_ns(self) -> "NDArray[np.int64]":
        """The wake-up latency of each cycle, after its deadline."""
        return self._signed(3)

    @property
    def durations_ns(self) -> "NDArray[np.int64]":
        """The calculation duration of each cycle."""
        ticks = self._signed(7) - self._signed(5)
        durations: NDArray[np.int64] = np.rint(ticks * self.layout.ns_per_tick).astype("i8")
        return durations

    @property
    def last_of_loop(self) -> "NDArray[np.bool_]":
        """Whether a cycle ends its loop: the components' safe() has run in it."""
        flags: NDArray[np.bool_] = (self.words[:, 4] & 3) == 1
        return flags

    def schema(self) -> ports_pb2.PortSchema:
        """Return the schema of the columns, as in a stream; see PortColumn."""
        columns = []
        for value in self.layout.values:
            column = ports_pb2.PortColumn(
                component=value.component,
                name=value.name,
                kind=ports_pb2.PortColumn.KIND_STATE,
                type=value.type,
                unit=value.unit,
                mapped=value.mapped,
                size=value.size,
            )
            if value.output:
                of = self.layout.types[value.output - 1]
                column.kind = ports_pb2.PortColumn.KIND_OUTPUT
                column.ros_type, column.ros_md5 = of.ros_type, of.ros_md5
                column.ros_definition, column.sample = of.ros_definition, of.sample
                column.size = len(of.sample)
            if not self._computed(value):
                columns.append(column)
        return ports_pb2.PortSchema(columns=columns, notes=self.notes())

    def notes(self) -> list[str]:
        """Return a line for each value that is left out."""
        return [
            *self.layout.notes,
            *(
                f"{value.component}.{value.name} is left out: its message is not a copy of the "
                "value, but computed"
                for value in self.layout.values
                if self._computed(value)
            ),
        ]

    def batches(self) -> "list[ports_pb2.PortBatch]":
        """Return all cycles in batches, as in a stream: a batch has no gap."""
        cycles, last = self.cycles, self.last_of_loop
        gaps = (np.diff(cycles) != 1) | last[:-1]
        ends: list[int] = as_list(np.flatnonzero(gaps) + 1)
        bounds = [0, *ends, len(cycles)]
        return [self._batch(*pair) for pair in itertools.pairwise(bounds)]

    def _batch(self, begin: int, end: int) -> ports_pb2.PortBatch:
        part = slice(begin, end)
        return ports_pb2.PortBatch(
            first_cycle=int(self.cycles[begin]) if end > begin else 0,
            last_of_loop=bool(end > begin and self.last_of_loop[end - 1]),
            stamps_ns=as_list(self.stamps_ns[part]),
            latencies_ns=as_list(self.latencies_ns[part]),
            durations_ns=as_list(self.durations_ns[part]),
            values=[
                self._values(value, part)
                for value in self.layout.values
                if not self._computed(value)
            ],
        )

    def _values(self, value: wire.FrameValue, part: slice) -> bytes:
        first = frame_memory.HEAD_WORDS + self.layout.steps
        rows = np.ascontiguousarray(self.words[part, first:]).view("u1")
        raw = rows[:, value.offset : value.offset + value.size]
        if not value.output:
            return raw.tobytes()
        of = self.layout.types[value.output - 1]
        messages = np.tile(np.frombuffer(of.sample, "u1"), (len(raw), 1))
        for copy in of.copies:
            source = getattr(copy, "from")
            messages[:, copy.to : copy.to + copy.size] = raw[:, source : source + copy.size]
        return messages.tobytes()

    def _computed(self, value: wire.FrameValue) -> bool:
        return bool(value.output) and self.layout.types[value.output - 1].computed

    def _signed(self, word: int) -> "NDArray[np.int64]":
        return self.words[:, word].astype("i8")


def read(descriptor: int) -> list[Ring]:
    """Return the rings, the oldest first.

    Raises OSError, or ValueError if this is not a memory of frames.
    """
    with mmap.mmap(descriptor, 0, prot=mmap.PROT_READ) as memory:
        if frame_memory.HEAD.unpack_from(memory) != (frame_memory.MAGIC, frame_memory.VERSION):
            raise ValueError(f"not a memory of frames of version {frame_memory.VERSION}")
        entries = [
            frame_memory.ENTRY.unpack_from(memory, frame_memory.entry_at(index))
            for index in range(frame_memory.ENTRIES)
        ]
        return [_ring(memory, *entry[1:]) for entry in sorted(entries) if entry[0]]


def _ring(
    memory: Any, offset: int, frames: int, stride: int, layout_at: int, layout_bytes: int
) -> Ring:
    layout = wire.FrameLayout.FromString(memory[layout_at : layout_at + layout_bytes])
    flat = np.frombuffer(memory[offset : offset + 8 * frames * stride], "<u8")
    words = flat.reshape(frames, stride)
    marks = words[:, 0]
    # A complete frame has the number that belongs to its place; an odd mark means that it was
    # being written.
    numbers = marks // 2 - 1
    whole = (marks % 2 == 0) & (marks != 0) & (numbers % frames == np.arange(frames))
    kept = words[whole]
    return Ring(layout, kept[np.argsort(kept[:, 0], kind="stable")])
