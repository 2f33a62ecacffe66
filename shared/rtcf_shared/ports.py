"""Values of outputs and declared state of every cycle, as NumPy columns."""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from rtcf.v1 import ports_pb2

from rtcf_shared import ros_layout
from rtcf_shared.errors import RtcfError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_STATE = re.compile(
    r"^(bool|float|double|u?int(?:8|16|32|64))"
    r"(?:\[(\d+)(?:x(\d+)(,RowMajor)?)?\]|\[(\d+)x(\d+)x(\d+)\])?$"
)
_FORMATS = {"bool": "?", "float": "<f4", "double": "<f8"}


@dataclass(frozen=True)
class Signal:
    """A number or an array of numbers with a value in every cycle."""

    name: str  # full: component, '.', port or state, and the field of a message
    unit: str  # empty = unknown
    column: int  # index in the schema
    format: str  # NumPy format of one number
    shape: tuple[int, ...]  # () = scalar
    offset: int  # bytes, in a value of the column
    transposed: bool = False  # a matrix in column-major order
    number: int = 0  # index of the first number among all numbers of the column


@dataclass(frozen=True)
class PortSchema:
    """The content of a stream, valid until the graph changes."""

    columns: tuple[ports_pb2.PortColumn, ...] = ()
    notes: tuple[str, ...] = ()  # a line for each matching name without values
    signals: dict[str, Signal] = field(default_factory=dict)  # by name, in schedule order
    turns: tuple[str, ...] = ()  # components in schedule order, if the stream has their times


@dataclass(frozen=True)
class PortBatch:
    """Consecutive cycles, `every` apart.

    In a stream of minima and maxima, consecutive windows of `every` cycles, each identified by its
    first cycle.
    """

    schema: PortSchema
    every: int
    first_cycle: int
    lost: int  # dropped cycles before this batch
    last_of_loop: bool  # the last cycle is the one of safe(), at the end of the loop
    message: ports_pb2.PortBatch

    def __len__(self) -> int:
        return len(self.message.stamps_ns)

    @property
    def is_min_max(self) -> bool:
        """Whether the batch has minima and maxima of windows."""
        return len(self.message.counts) > 0

    @property
    def cycles(self) -> "NDArray[np.int64]":
        """The cycle numbers."""
        last = self.first_cycle + len(self) * self.every
        return _integers(range(self.first_cycle, last, self.every))

    @property
    def stamps_ns(self) -> "NDArray[np.int64]":
        """CLOCK_REALTIME of each cycle's deadline, or the simulated time; ns."""
        return _integers(self.message.stamps_ns)

    @property
    def latencies_ns(self) -> "NDArray[np.int64]":
        """The wake-up latency of each cycle; ns."""
        return _integers(self.message.latencies_ns)

    @property
    def durations_ns(self) -> "NDArray[np.int64]":
        """The calculation duration of each cycle; ns."""
        return _integers(self.message.durations_ns)

    def __getitem__(self, name: str) -> "NDArray[Any]":
        """Return the values of a signal, of shape (cycles, *shape of the signal)."""
        if self.is_min_max:
            raise RtcfError(f"{name}: use minima() and maxima() for a stream of minima and maxima")
        return self._values(name, len(self))

    def minima(self, name: str) -> "NDArray[Any]":
        """Return the minima of a signal's numbers, of shape (windows, *shape of the signal)."""
        return self._values(name, 2 * len(self))[0::2]

    def maxima(self, name: str) -> "NDArray[Any]":
        """Return the maxima like minima(); NaN counts as the largest value."""
        return self._values(name, 2 * len(self))[1::2]

    def minima_at(self, name: str) -> "NDArray[np.int64]":
        """Return the first cycle of each minimum."""
        return self._places(name)[0::2]

    def maxima_at(self, name: str) -> "NDArray[np.int64]":
        """Return the first cycle of each maximum."""
        return self._places(name)[1::2]

    @property
    def turns_ns(self) -> "NDArray[np.int64]":
        """The times of components, of shape (cycles, 1 + number of `schema.turns`); ns.

        The first column is the begin of the first update(), the others are the end of the update()
        of each component, at which the next one begins.  Times count from the begin of the
        calculation; -1 = the component did not run.
        """
        numbers: NDArray[np.int64] = numpy_module().frombuffer(self.message.turns, dtype="<i8")
        return numbers.reshape(len(self), 1 + len(self.schema.turns))

    @property
    def window_begins(self) -> "NDArray[np.int64]":
        """The first cycle included in the minima and maxima of each window.

        It is later than the window's first cycle if the stream began later or cycles were lost.
        """
        return self.cycles + _integers(self.message.begins or [0] * len(self))

    @property
    def window_ends(self) -> "NDArray[np.int64]":
        """The last cycle included in the minima and maxima of each window."""
        # Older executors do not send it: use the window's last cycle.
        return self.cycles + _integers(self.message.ends or [self.every - 1] * len(self))

    def part(self, begin: int, end: int | None = None) -> "PortBatch":
        """Return the cycles with index [begin, end) as a batch; not for minima and maxima."""
        end = len(self) if end is None else end
        old = self.message
        turn = len(old.turns) // max(len(self), 1)  # bytes per cycle
        message = ports_pb2.PortBatch(
            first_cycle=self.first_cycle + begin * self.every,
            lost=old.lost if begin == 0 else 0,
            last_of_loop=old.last_of_loop and end == len(self),
            stamps_ns=old.stamps_ns[begin:end],
            latencies_ns=old.latencies_ns[begin:end],
            durations_ns=old.durations_ns[begin:end],
            values=[
                values[begin * column.size : end * column.size]
                for values, column in zip(old.values, self.schema.columns, strict=True)
            ],
            turns=old.turns[begin * turn : end * turn],
        )
        return PortBatch(
            self.schema,
            self.every,
            message.first_cycle,
            message.lost,
            message.last_of_loop,
            message,
        )

    def _values(self, name: str, count: int) -> "NDArray[Any]":
        signal = self.schema.signals[name]
        size = self.schema.columns[signal.column].size
        return _column(self.message.values[signal.column], count, size, signal, signal.offset)

    def _places(self, name: str) -> "NDArray[np.int64]":
        signal = self.schema.signals[name]
        data, count = self.message.places[signal.column], 2 * len(self)
        size = len(data) // max(count, 1)
        places = _column(data, count, size, replace(signal, format="<u4"), 4 * signal.number)
        first = self.cycles.repeat(2).reshape(-1, *(1 for _ in signal.shape))
        found: NDArray[np.int64] = first + places
        return found


def _column(data: bytes, count: int, size: int, signal: Signal, offset: int) -> "NDArray[Any]":
    """Return a signal at `offset` in each of `count` values of `size` bytes."""
    np = numpy_module()
    if not data:
        return np.zeros((0, *signal.shape), signal.format)  # type: ignore[no-any-return]
    each = ros_layout.size_of(signal.format)
    strides = [each] * len(signal.shape)
    for axis in range(len(signal.shape) - 1, 0, -1):
        strides[axis - 1] = strides[axis] * signal.shape[axis]
    values = np.ndarray(
        (count, *signal.shape),
        dtype=signal.format,
        buffer=data,
        offset=offset,
        strides=(size, *strides),
    )
    columns: NDArray[Any] = values.swapaxes(1, 2) if signal.transposed else values
    return columns


def schema_of(message: ports_pb2.PortSchema) -> PortSchema:
    """Return the schema of a message, with its signals."""
    signals = {}
    outputs = {
        (column.component, column.name)
        for column in message.columns
        if column.kind == ports_pb2.PortColumn.KIND_OUTPUT
    }
    for number, column in enumerate(message.columns):
        also_output = (column.component, column.name) in outputs
        name = signal_name(column.component, column.name, also_output and _is_state(column))
        for signal in _signals(number, name, column):
            signals[signal.name] = signal
    return PortSchema(tuple(message.columns), tuple(message.notes), signals, tuple(message.turns))


def signal_name(component: str, name: str, hidden: bool) -> str:
    """Return the full name of an output or a state.

    `hidden` marks a state with the same name as an output of its component.
    """
    return f"{component}.{name}[state]" if hidden else f"{component}.{name}"


def _is_state(column: ports_pb2.PortColumn) -> bool:
    return column.kind == ports_pb2.PortColumn.KIND_STATE


def _signals(number: int, name: str, column: ports_pb2.PortColumn) -> Iterator[Signal]:
    shape: tuple[int, ...]
    if column.kind == ports_pb2.PortColumn.KIND_OUTPUT:
        for leaf in ros_layout.leaves(column.ros_definition, column.sample):
            full = f"{name}.{leaf.path}" if leaf.path else name
            shape = () if leaf.count is None else (leaf.count,)
            unit = column.unit if leaf.has_unit else ""
            yield Signal(full, unit, number, leaf.format, shape, leaf.offset, number=leaf.number)
        return
    if column.type in ("quaternion", "transform"):
        numbers = 4 if column.type == "quaternion" else 16
        form = "<f8" if column.size == 8 * numbers else "<f4"
        shape = (4,) if numbers == 4 else (4, 4)
        unit = "" if numbers == 4 else column.unit
        yield Signal(name, unit, number, form, shape, 0, transposed=numbers == 16)
        return
    match = _STATE.match(column.type)
    if match is None:
        return  # a structure with unknown fields
    kind, rows, columns, by_rows, *three = match.groups()
    form = _FORMATS.get(kind) or f"<{'u' if kind[0] == 'u' else 'i'}{int(kind.strip('uint')) // 8}"
    if three[0] is not None:
        yield Signal(name, column.unit, number, form, tuple(map(int, three)), 0)
    elif rows is None:
        yield Signal(name, column.unit, number, form, (), 0)
    elif columns is None or "1" in (rows, columns):
        yield Signal(name, column.unit, number, form, (int(rows) * int(columns or 1),), 0)
    elif by_rows:
        yield Signal(name, column.unit, number, form, (int(rows), int(columns)), 0)
    else:
        shape = (int(columns), int(rows))
        yield Signal(name, column.unit, number, form, shape, 0, transposed=True)


def _integers(numbers: Iterable[int]) -> "NDArray[np.int64]":
    integers: NDArray[np.int64] = numpy_module().array(numbers, dtype="i8")
    return integers


def numpy_module() -> Any:
    """Return NumPy, imported at its first use; raises RtcfError if it is not installed."""
    try:
        import numpy
    except ImportError:
        raise RtcfError("values of ports are NumPy arrays: install python3-numpy") from None
    return numpy
