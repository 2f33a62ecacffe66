"""Recordings that pages may open: those that were named at the start, and those of one folder."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rtcf.recording.reader import RecordedColumn, Recording, RecordingError

from rtcf_scope import wire
from rtcf_scope.chunk import ELEMENTS, split_element

MOST_CYCLES = 4_000_000  # 128 MiB with three traces; above, each n-th cycle is told


class Recordings:
    """Files by their names; a page never says a path."""

    def __init__(self, files: Iterable[Path], folder: Path | None) -> None:
        self._files = {file.name: file for file in files}
        self._folder = folder

    def names(self) -> list[str]:
        """Return those there are."""
        return sorted(self._known())

    def describe(self, name: str) -> dict[str, Any]:
        """Return what is in one; raises RecordingError."""
        with self._open(name) as recording:
            signals = []
            for signal in recording.signals.values():
                count = signal.leaf.count
                names = [signal.name] if count is None else [
                    f"{signal.name}[{i}]" for i in range(min(count, ELEMENTS))
                ]  # fmt: skip
                signals += [{"name": each, "unit": signal.unit} for each in names]
            return {"name": name, "whole": recording.whole, "signals": signals,
                    "cycles": len(recording.cycles)}  # fmt: skip

    def columns(self, name: str, traces: list[str]) -> bytes:
        """Return the values of traces as bytes of wire; raises RecordingError."""
        with self._open(name) as recording:
            numbers, durations, latencies = recording.read_cycles(
                ("iteration", "duration_ns", "latency_ns")
            ).values()
            cycles, stamps = numbers.values, numbers.stamps_ns
            if not len(cycles):
                raise RecordingError(f"{name} has no cycles")
            every = max(1, -(-len(cycles) // MOST_CYCLES))
            found = [(stamps - stamps[0]) / 1e9, cycles, latencies.values / 1e3,
                     durations.values / 1e3]  # fmt: skip
            named = {split_element(trace)[0] for trace in traces}
            signals = recording.read(named & recording.signals.keys())
            found += [_placed(signals, trace, stamps) for trace in traces]
            columns = np.array([each[::every] for each in found], "<f8")
        return wire.head(wire.RECORDED, 0, columns.shape[1], len(columns)) + columns.tobytes()

    def _known(self) -> dict[str, Path]:
        found = {} if self._folder is None else {
            file.name: file for file in self._folder.glob("*.mcap")
        }  # fmt: skip
        return found | self._files

    def _open(self, name: str) -> Recording:
        file = self._known().get(name)
        if file is None:
            raise RecordingError(f"no recording {name} here: start the scope with its file")
        return Recording(file)


def _placed(signals: Mapping[str, RecordedColumn], trace: str, stamps: Any) -> Any:
    """Return a trace's values at all cycles: NaN where it has none."""
    signal, index = split_element(trace)
    values = np.full(len(stamps), np.nan)
    if signal not in signals:
        return values
    column = signals[signal]
    each = column.values.reshape(len(column.values), math.prod(column.values.shape[1:]))
    if index < each.shape[1]:
        if len(each) == len(values):
            return each[:, index].astype("<f8")
        # One that has joined, or left.
        place = np.searchsorted(stamps, column.stamps_ns).clip(max=len(stamps) - 1)
        values[place] = each[:, index]
    return values
