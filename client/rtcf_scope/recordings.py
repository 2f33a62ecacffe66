"""Recordings that pages may open: files named on the command line, those of one folder, and the
incidents of rtcfd.
"""

import math
import tempfile
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import rtcf
from google.protobuf import json_format
from numpy.typing import NDArray
from rtcf.reasons import IncidentNotFoundError
from rtcf.recording.reader import RecordedColumn, Recording, RecordingError
from rtcf.v1 import control_pb2

from rtcf_scope import catalog, wire
from rtcf_scope.chunk import ELEMENTS, kind_of, split_element

_KEPT = 4  # copies of incidents
MOST_VALUES = 16_000_000  # 128 MB; above it, windows are reduced to minima and maxima


class Recordings:
    """Recordings by file name; pages cannot request paths."""

    def __init__(self, files: Iterable[Path], folder: Path | None, client: rtcf.Client) -> None:
        self._files = {file.name: file for file in files}
        self._folder = folder
        self._client = client
        self._copies = tempfile.TemporaryDirectory(prefix="rtcf-scope-")
        self._incidents: dict[str, Path] = {}  # their copies, oldest first
        self._received = 0
        self._receiving = threading.Lock()

    def close(self) -> None:
        """Remove the copies of incidents."""
        self._copies.cleanup()

    def incidents(self) -> list[dict[str, Any]]:
        """Return the incidents of rtcfd, newest first; raises RtcfError."""
        found = [catalog.incident(each) for each in self._client.list_incidents()]
        return sorted(found, key=lambda each: int(each["time_ns"]), reverse=True)

    def names(self) -> list[str]:
        """Return the names of all recordings, sorted."""
        return sorted(self._known())

    def describe(self, name: str) -> dict[str, Any]:
        """Return signals, number of cycles, length and events of a recording.

        Of an incident, also its reason, component and time. Raises RtcfError.
        """
        with self._open(name) as recording:
            signals = []
            for signal in recording.signals.values():
                count = signal.leaf.count
                names = [signal.name] if count is None else [
                    f"{signal.name}[{i}]" for i in range(min(count, ELEMENTS))
                ]  # fmt: skip
                kind = kind_of(signal.leaf.format)
                signals += [{"name": each, "unit": signal.unit, "kind": kind} for each in names]
            return {"name": name, "whole": recording.whole, "signals": signals,
                    "cycles": len(recording.cycles), "begin_ns": str(recording.begin_ns),
                    "seconds": (recording.end_ns - recording.begin_ns) / 1e9,
                    "events": _events(recording), "incident": _incident(recording)}  # fmt: skip

    def columns(
        self, name: str, traces: list[str], begin_s: float = -math.inf, end_s: float = math.inf
    ) -> bytes:
        """Return the cycles in [begin_s, end_s), in seconds after the first cycle, as `wire` bytes.

        Above MOST_VALUES values, each window of cycles has a minimum and a maximum instead.
        Raises RecordingError.
        """
        with self._open(name) as recording:
            span = (_stamp(recording, begin_s), _stamp(recording, end_s))
            numbers, durations, latencies = recording.read_cycles(*span).values()
            stamps = numbers.stamps_ns
            if not len(stamps):
                then = "" if span == (None, None) else " in this range"
                raise RecordingError(f"{name} has no cycles{then}")
            found = [(stamps - recording.begin_ns) / 1e9, numbers.values, latencies.values / 1e3,
                     durations.values / 1e3]  # fmt: skip
            named = {split_element(trace)[0] for trace in traces}
            signals = recording.read_all(named & recording.signals.keys(), *span)
            found += [_placed(signals, trace, stamps) for trace in traces]
        columns = _with_gaps(np.array(found, "<f8"))
        columns, each = _windows(columns, MOST_VALUES // len(columns))
        head = wire.head(wire.RECORDED, 0, columns.shape[1], len(columns), hit=each)
        return head + columns.tobytes()

    def _known(self) -> dict[str, Path]:
        found = {} if self._folder is None else {
            file.name: file for file in self._folder.glob("*.mcap")
        }  # fmt: skip
        return found | self._files

    def _open(self, name: str) -> Recording:
        file = self._known().get(name)
        return Recording(file or self._copy(name))

    def _copy(self, name: str) -> Path:
        """Return the copy of an incident."""
        with self._receiving:
            if name not in self._incidents:
                self._received += 1
                to = Path(self._copies.name, f"{self._received}.mcap")
                try:
                    with to.open("xb") as file:
                        self._client.get_incident(file, name)
                except IncidentNotFoundError:
                    what = f"no recording {name}: start the scope with this file"
                    raise RecordingError(what) from None
                except OSError as error:
                    why = error.strerror or error
                    raise RecordingError(f"cannot copy the incident to {to}: {why}") from None
                self._incidents[name] = to
                while len(self._incidents) > _KEPT:
                    self._incidents.pop(next(iter(self._incidents))).unlink(missing_ok=True)
            return self._incidents[name]


def _events(recording: Recording) -> list[dict[str, Any]]:
    """Return the events in a recording, as those of a loop; none if they are damaged."""
    try:
        found = [
            json_format.ParseDict(each, control_pb2.Event(), ignore_unknown_fields=True)
            for each in recording.listed("events")
        ]
    except (ValueError, TypeError, json_format.ParseError):
        return []
    return [catalog.event(each) for each in found]


def _incident(recording: Recording) -> dict[str, Any] | None:
    """Return the reason of an incident; None for another recording."""
    about = recording.metadata.get("incident")
    if about is None:
        return None
    time_ns = about.get("time_ns", "")
    return {
        "reason": about.get("reason", ""),
        "component": about.get("component", ""),
        "time_ns": time_ns if time_ns.isdecimal() else str(recording.end_ns),
    }


def _placed(signals: Mapping[str, RecordedColumn], trace: str, stamps: Any) -> Any:
    """Return the values of a trace at all cycles; NaN where it has none."""
    signal, index = split_element(trace)
    values = np.full(len(stamps), np.nan)
    if signal not in signals:
        return values
    column = signals[signal]
    each = column.values.reshape(len(column.values), math.prod(column.values.shape[1:]))
    if index < each.shape[1]:
        if len(each) == len(values):
            return each[:, index].astype("<f8")
        # The component was loaded or unloaded during the recording.
        place = np.searchsorted(stamps, column.stamps_ns).clip(max=len(stamps) - 1)
        values[place] = each[:, index]
    return values


def _stamp(recording: Recording, seconds: float) -> int | None:
    """Return the stamp (ns) at `seconds` after the first cycle; None if infinite."""
    return recording.begin_ns + round(seconds * 1e9) if math.isfinite(seconds) else None


def _with_gaps(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the columns with a NaN cycle in each gap, at the time of the cycle before the gap."""
    gaps = np.flatnonzero(np.diff(columns[1]) != 1) + 1
    if not len(gaps):
        return columns
    missing = np.full((len(columns), len(gaps)), np.nan)
    missing[0] = columns[0, gaps - 1]
    return np.insert(columns, gaps, missing, axis=1)


def _windows(columns: NDArray[np.float64], most: int) -> tuple[NDArray[np.float64], int]:
    """Return alternating minima and maxima of windows of cycles, and the window length in cycles.

    With at most `most` cycles, return the columns unchanged and 1.
    """
    count = columns.shape[1]
    if count <= most:
        return columns, 1
    each = math.ceil(2 * count / most)
    windows = math.ceil(count / each)
    padded = np.pad(columns, ((0, 0), (0, windows * each - count)), "edge")
    parts = padded.reshape(len(columns), windows, each)
    found = np.empty((len(columns), 2 * windows))
    found[:, 0::2], found[:, 1::2] = np.fmin.reduce(parts, 2), np.fmax.reduce(parts, 2)
    return found, each
