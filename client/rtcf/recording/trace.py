"""A trace of a loop for Perfetto and chrome://tracing: JSON with one event per line.

The format is the "Trace Event Format" of the Chromium project.  Times are in microseconds since the
first cycle.
"""

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from rtcf_shared.enums import word
from rtcf_shared.ports import PortBatch

from rtcf.streams.numbered import Lost
from rtcf.v1 import control_pb2, runner_pb2

_CYCLES, _EVENTS, _LOGS, _KERNEL = 1, 2, 3, 4  # numbers of tracks, followed by those of components
_REAL = 10**18  # stamps above it are in ns since 1970, others are on a simulated clock
_FAULTS = (
    control_pb2.Event.KIND_LOOP_FAULT,
    control_pb2.Event.KIND_COMPONENT_FAULT,
    control_pb2.Event.KIND_EXECUTOR_FAULT,
)


OnLate = Callable[[int, int, int, int, int], None]


class Trace:
    """A trace file; one thread.  It is readable even after a kill of the writer."""

    def __init__(self, path: Path, runner: str, frequency_hz: float) -> None:
        """Create the file; this and all methods can raise OSError."""
        self.cycles = self.lost = self.late = 0
        self.events = self.faults = self.records = 0
        self.set_frequency(frequency_hz)
        self._first: tuple[int, int] | None = None  # the first cycle and its stamp in ns
        self._last_ns = 0
        self._tracks: dict[str, int] = {}
        self._sums: dict[str, tuple[int, float]] = {}  # by component: calls and total ns
        self.spans = 0  # number of component spans in cycles
        self._file = path.open("w", encoding="utf-8")
        self._file.write("[\n")
        self._write(self._named("process_name", 0, runner))
        self._track(_CYCLES, "cycles")
        self._track(_EVENTS, "events")
        self._track(_LOGS, "log of the executor")

    def set_frequency(self, frequency_hz: float) -> None:
        """Set the loop's rate, which defines late cycles."""
        self._period_ns = 1e9 / frequency_hz

    def close(self) -> None:
        """Complete and close the file."""
        # JSON needs an event after the last comma.
        self._file.write(json.dumps(self._named("trace_ended", 0, "")) + "\n]\n")
        self._file.close()

    def abandon(self) -> None:
        """Close the file without completing it; the caller removes it."""
        self._file.close()

    def add_cycles(self, batch: PortBatch, on_late: OnLate | None = None) -> None:
        """Add cycles in order, with spans of components if the stream has their times.

        `on_late` is called for each late cycle with its number, its deadline, its begin, its end
        and its lateness, in ns.
        """
        message = batch.message
        turns: Any = batch.turns_ns.tolist() if batch.schema.turns else []
        names = [json.dumps(each, ensure_ascii=False) for each in batch.schema.turns]
        for index, stamp_ns in enumerate(message.stamps_ns):
            cycle = batch.first_cycle + index * batch.every
            latency_ns, duration_ns = message.latencies_ns[index], message.durations_ns[index]
            if self._first is None:
                self._first = (cycle, stamp_ns)
            self._last_ns = stamp_ns
            if index == 0 and batch.lost:
                self.lost += batch.lost
                self._mark(_CYCLES, f"{batch.lost} cycles lost", stamp_ns, {})
            begin_ns = stamp_ns + latency_ns
            facts = {"cycle": cycle, "latency_us": latency_ns / 1e3}
            late_ns = latency_ns + duration_ns - self._period_ns
            name = "cycle" if late_ns <= 0 else "late cycle"
            if message.last_of_loop and index == len(batch) - 1:
                name = "safe()"
            self._write(
                {"name": name, "ph": "X", "pid": 1, "tid": _CYCLES, "ts": self._us(begin_ns),
                 "dur": duration_ns / 1e3, "args": facts}
            )  # fmt: skip
            if turns:
                self._add_turns(cycle, begin_ns, turns[index], names)
            self._count("wake-up latency (µs)", begin_ns, latency_ns / 1e3)
            if late_ns > 0:
                self.late += 1
                if on_late is not None:
                    on_late(cycle, stamp_ns, begin_ns, begin_ns + duration_ns, round(late_ns))
                self._mark(
                    _EVENTS, "overrun", begin_ns + duration_ns, {**facts, "late_us": late_ns / 1e3}
                )
            self.cycles += 1

    def _add_turns(self, cycle: int, begin_ns: int, turns: list[int], names: list[str]) -> None:
        """Add the spans of components in a cycle; without dicts, because spans are many."""
        before = turns[0]
        begin_us = self._us(begin_ns)
        spans = []
        for name, after in zip(names, turns[1:], strict=True):
            if after < 0:
                continue
            spans.append(
                f'{{"name": {name}, "ph": "X", "pid": 1, "tid": {_CYCLES}, '
                f'"ts": {begin_us + before / 1e3:.3f}, "dur": {(after - before) / 1e3:.3f}, '
                f'"args": {{"cycle": {cycle}}}}},\n'
            )
            before = after
        self.spans += len(spans)
        self._file.write("".join(spans))

    def add_culprit(self, cycle: int, end_ns: int, words: str) -> None:
        """Add the cause of a late cycle at its end, on the track of the kernel."""
        if "kernel" not in self._tracks:
            self._tracks["kernel"] = _KERNEL
            self._track(_KERNEL, "kernel: causes of late cycles")
        self._mark(_KERNEL, words, end_ns, {"cycle": cycle})

    def add_events(self, events: Iterable[control_pb2.Event | Lost]) -> None:
        """Add events: changes of the graph and other changes, states, faults."""
        for each in events:
            if isinstance(each, Lost):
                self._mark(_EVENTS, f"{each.count} events lost", self._last_ns, {})
                continue
            self.events += 1
            facts = {"message": each.message, "component": each.component, "user": each.user}
            kind = word(control_pb2.Event.Kind.DESCRIPTOR, each.kind)
            when = self._when(each.time_ns, each.iteration or None)
            known = {name: text for name, text in facts.items() if text}
            is_fault = each.kind in _FAULTS
            self.faults += is_fault
            self._mark(_EVENTS, f"{kind}: {each.message}", when, known, everywhere=is_fault)

    def add_records(self, records: Iterable[control_pb2.LogRecord | Lost]) -> None:
        """Add log records, on a track for each component."""
        for each in records:
            if isinstance(each, Lost):
                self._mark(_LOGS, f"{each.count} log records lost", self._last_ns, {})
                continue
            self.records += 1
            level = word(control_pb2.LogRecord.Level.DESCRIPTOR, each.level)
            facts = {"level": level, "cycle": each.iteration, "source": f"{each.file}:{each.line}"}
            track = self._track_of(f"log of {each.component}") if each.component else _LOGS
            when = self._when(each.time_ns, each.iteration)
            self._mark(track, f"{level}: {each.message}", when, facts)

    def add_statistics(self, found: runner_pb2.RunnerStatistics) -> None:
        """Add the mean duration of each component since the last call, as a curve."""
        for each in found.components:
            count, total = each.duration.count, each.duration.count * each.duration.mean_ns
            before = self._sums.get(each.component, (0, 0.0))
            self._sums[each.component] = (count, total)
            # Skip times before the trace, and statistics reset since the last call.
            if 0 < before[0] < count:
                mean_us = (total - before[1]) / (count - before[0]) / 1e3
                self._count(f"{each.component} (µs, mean)", self._last_ns, mean_us)

    def _when(self, time_ns: int, cycle: int | None) -> int:
        """Return the time of an event on the clock of the stamps; ns."""
        if self._first is None or self._first[1] > _REAL:
            return time_ns
        # On a simulated clock, the time follows from the cycle.
        if cycle is None:
            return self._last_ns
        first, stamp_ns = self._first
        return stamp_ns + round((cycle - first) * self._period_ns)

    def _us(self, at_ns: int) -> float:
        first_ns = self._first[1] if self._first else at_ns
        return (at_ns - first_ns) / 1e3

    def _track_of(self, name: str) -> int:
        if name not in self._tracks:
            self._tracks[name] = _KERNEL + 1 + len(self._tracks)
            self._track(self._tracks[name], name)
        return self._tracks[name]

    def _track(self, number: int, name: str) -> None:
        self._write(self._named("thread_name", number, name))

    @staticmethod
    def _named(what: str, track: int, name: str) -> dict[str, Any]:
        return {"name": what, "ph": "M", "pid": 1, "tid": track, "args": {"name": name}}

    def _mark(
        self, track: int, name: str, at_ns: int, facts: dict[str, Any], *, everywhere: bool = False
    ) -> None:
        self._write(
            {"name": name, "ph": "i", "s": "g" if everywhere else "t", "pid": 1, "tid": track,
             "ts": self._us(at_ns), "args": facts}
        )  # fmt: skip

    def _count(self, name: str, at_ns: int, value: float) -> None:
        self._write(
            {"name": name, "ph": "C", "pid": 1, "ts": self._us(at_ns), "args": {"us": value}}
        )

    def _write(self, event: dict[str, Any]) -> None:
        self._file.write(json.dumps(event, ensure_ascii=False) + ",\n")
