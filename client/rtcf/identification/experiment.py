"""An experiment: a component Excitation excites one input of a loop, and every cycle is recorded.

The excitation stops in the loop itself, at its limits, after its duration, and when this program no
longer renews it: after Ctrl-C, a lost connection or a crash.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import threading
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import rtcf_shared.spec
from rtcf_shared.errors import RtcfError
from rtcf_shared.naming import listing
from rtcf_shared.ports import PortBatch
from rtcf_shared.value_text import parse

from rtcf.client import DEFAULT_RUNNER, Client
from rtcf.connection import OnProgress
from rtcf.errors import DaemonUnreachableError
from rtcf.lease import Lease
from rtcf.streams.ports import PortStream
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

Array = npt.NDArray[np.float64]

READY, RUNNING, COMPLETED, STOPPED, LEFT_LIMITS, LEASE_ENDED, NOT_BEGUN = range(7)
_WHY = {
    STOPPED: "it was stopped",
    LEFT_LIMITS: "the measured value left its limits or was lost, or a value was not finite",
    LEASE_ENDED: "this program did not renew it in time",
    NOT_BEGUN: "it did not begin: a value is outside its limits, see `rtcfctl logs`",
}
_LEASE_S = 1.0
_RENEWALS = 4  # per lease
_PATIENCE_S = 10.0  # of loop time
_END_S = 5.0  # of a lease
_MOST_FILLED = 0.02  # share of cycles that may be missing
_TYPE = ("rtcf_control", "Excitation")


@dataclass(frozen=True)
class Recorded:
    """The values of an experiment, by cycle from the one before its begin.

    period     of the cycles, in s
    time       in s, from the first cycle of the excitation
    inputs     the excited command
    signal     the excitation alone
    outputs    the measured value, as a controller reads it in the cycle
    outcome    COMPLETED, or the reason of the end
    filled     cycles that were late or dropped, and are interpolated
    """

    period: float
    time: Array
    inputs: Array
    signal: Array
    outputs: Array
    outcome: int
    filled: int

    @property
    def why(self) -> str:
        """The reason of an early end; empty if the excitation is complete."""
        return _WHY.get(self.outcome, "")


class Experiment:
    """An Excitation of a loop; create it by `on_input` or `by_component`."""

    def __init__(self, client: Client, runner: str, excitation: str, measured: str) -> None:
        self._client = client
        self._runner = runner
        self._excitation = excitation
        self._measured = measured
        self._lease: Lease | None = None

    @classmethod
    def by_component(
        cls, client: Client, runner: str, component: str, measured: str = ""
    ) -> Experiment:
        """Use an Excitation of the graph; `measured` is by default the output connected to it."""
        found = client.get_component(component, runner)
        if (found.spec.package, found.spec.type) != _TYPE:
            raise RtcfError(
                f"{found.full_name} is no rtcf_control/Excitation: use one, or name an input "
                "without a writer as COMPONENT.PORT"
            )
        if not measured:
            measured = connected_output(client, runner, found, "measured")
        return cls(client, runner, found.full_name, _full(measured))

    @classmethod
    @contextlib.contextmanager
    def on_input(
        cls, client: Client, runner: str, port: str, measured: str
    ) -> Iterator[Experiment]:
        """Load an Excitation for an input without a writer, and unload it at the end.

        The input keeps the value that it had before.  rtcfd unloads the Excitation if this program
        dies.
        """
        target = rtcf_shared.spec.parse_port(port)
        found = client.get_component(target.component, runner)
        there = [p.name for p in found.ports if p.direction == graph_pb2.DIRECTION_INPUT]
        inputs = [p for p in found.ports if p.name == target.port and p.name in there]
        if not inputs:
            raise RtcfError(
                f"{found.full_name} has no input {target.port} (inputs: {listing(there)})"
            )
        before = 0.0
        if inputs[0].HasField("value"):
            value = parse(inputs[0].value)
            value = value.get("data") if isinstance(value, dict) else value
            if isinstance(value, int | float):  # else rtcfd rejects the connection
                before = float(value)
        output = rtcf_shared.spec.parse_port(measured)
        source = client.get_component(output.component, runner)
        outputs = [p for p in source.ports if p.name == output.port]
        if not outputs:
            known = [p.name for p in source.ports if p.direction == graph_pb2.DIRECTION_OUTPUT]
            raise RtcfError(
                f"{source.full_name} has no output {output.port} (outputs: {listing(known)})"
            )
        taken = {each.full_name for each in client.list_components(runner)}
        names = itertools.chain(["excitation"], (f"excitation_{n}" for n in itertools.count(2)))
        name = next(each for each in names if f"/{each}" not in taken)
        spec = rtcf_shared.spec.component(
            *_TYPE, name=name,
            remaps=[f"out:={inputs[0].mapped_name}", f"measured:={outputs[0].mapped_name}"],
            parameters=[f"idle:={before!r}"], breaks=["measured"],
        )  # fmt: skip
        with _leased(client, runner, spec) as lease:
            experiment = cls(client, runner, f"/{name}", _full(measured))
            experiment._lease = lease
            yield experiment

    @property
    def excitation(self) -> str:
        """The full name of the Excitation."""
        return self._excitation

    def set_parameters(
        self, component: str, settings: list[graph_pb2.ParameterSetting], on_progress: OnProgress
    ) -> None:
        """Set parameters of a component; rtcfd undoes the change if this program dies.

        Not with an Excitation of the graph.
        """
        leased = "" if self._lease is None else self._excitation
        try:
            self._client.set_parameters(
                component, settings, self._runner, on_progress, undo_with=leased
            )
        except KeyboardInterrupt:
            if self._lease is not None:
                self._lease.drop()  # rtcfd undoes the change if it has begun
            raise

    @property
    def measured(self) -> str:
        """The full name of the measured output."""
        return self._measured

    def configure(self, **parameters: Any) -> None:
        """Set parameters of the Excitation."""
        words = [f"{name}:={_word(value)}" for name, value in parameters.items()]
        settings = [rtcf_shared.spec.parse_parameter(each) for each in words]
        self._client.set_parameters(self._excitation, settings, self._runner)

    def run(self, *, stepped: bool = False) -> Recorded:
        """Excite once; return the recorded values, also of an early end.

        stepped  run the cycles of a stopped loop on a simulated clock, as fast as possible

        Raises RtcfError if the loop does not run, or if too many cycles are dropped.
        """
        (status,) = self._client.get_status(self._runner or DEFAULT_RUNNER).runners
        runs = status.state == runner_pb2.RUNNER_STATE_RUNNING
        name = status.runner
        if stepped and runs:
            raise RtcfError(f"the loop of {name} runs: omit --step, or stop it first")
        if not stepped and not runs:
            raise RtcfError(
                f"the loop of {name} does not run: `rtcfctl -r {name} start`, or use --step"
            )
        period_ns = round(1e9 / status.settings.frequency_hz)
        self._write(False)
        names = [f"{self._excitation}.{each}" for each in ("out", "signal", "state", "armed")]
        with self._client.watch_ports([*names, self._measured], self._runner) as stream:
            self._require(stream, [*names, self._measured])
            collector = Collector(names, self._measured, period_ns)
            try:
                if stepped:
                    self._follow_steps(stream, collector, period_ns)
                else:
                    self._follow(stream, collector)
            except DaemonUnreachableError:
                raise  # the excitation ends with its lease
            except BaseException:
                with contextlib.suppress(RtcfError):
                    self._write(False)
                    if stepped:
                        self._client.step(1, self._runner)  # back to the value before
                raise
        self._write(False)
        return collector.recorded(late=self._is_late())

    def _follow(self, stream: PortStream, collector: Collector) -> None:
        """Excite a running loop until the end of the excitation."""
        over = threading.Event()

        def renew() -> None:
            with contextlib.suppress(RtcfError):
                while not over.is_set():
                    self._write(True)
                    over.wait(_LEASE_S / _RENEWALS)

        renewer = threading.Thread(target=renew, daemon=True)
        begun = False
        try:
            for batch in stream:
                collector.take(batch)
                if not begun and collector.armed:
                    renewer.start()
                    begun = True
                if collector.over:
                    return
                collector.require_begin()
                if batch.last_of_loop:
                    raise RtcfError("the loop has ended during the experiment")
            raise RtcfError("the stream of values has ended during the experiment")
        finally:
            over.set()
            if begun:
                renewer.join()

    def _follow_steps(self, stream: PortStream, collector: Collector, period_ns: int) -> None:
        """Excite a stopped loop in steps."""
        chunk = max(int(_LEASE_S / _RENEWALS * 1e9 / period_ns), 1)
        self._step(stream, collector, 2)
        while not collector.over:
            collector.require_begin()
            self._write(True)
            self._step(stream, collector, chunk)

    def _step(self, stream: PortStream, collector: Collector, cycles: int) -> None:
        self._client.step(cycles, self._runner)
        wanted = collector.cycles + cycles
        for batch in stream:
            collector.take(batch)
            if collector.cycles >= wanted:
                return
        raise RtcfError("the stream of values has ended during the experiment")

    def _write(self, wanted: bool) -> None:
        self._client.write(f"{self._excitation}.run", wanted, self._runner)

    def _require(self, stream: PortStream, names: Iterable[str]) -> None:
        missing = [each for each in names if each not in stream.schema.signals]
        if missing:
            raise RtcfError(
                f"{listing(missing)}: no such number of the loop; name an output as COMPONENT.PORT"
            )

    def _is_late(self) -> bool:
        """Return whether the measured output is written after the excitation.

        A controller then reads it by a loop break, one cycle later.
        """
        order = self._client.get_order(self._runner)
        component = self._measured.partition(".")[0]
        if component not in order or self._excitation not in order:
            return False
        return order.index(component) > order.index(self._excitation)


class Collector:
    """The values of a stream around an excitation."""

    def __init__(self, names: list[str], measured: str, period_ns: int) -> None:
        self._names = [*names, measured]
        self._period_ns = period_ns
        self._columns: list[list[Array]] = [[] for _ in self._names]
        self._stamps: list[npt.NDArray[np.int64]] = []
        self._begun = False
        self.over = False  # the excitation has run, and has ended
        self.armed = False
        self.cycles = 0  # seen, including dropped ones
        self._armed_at = 0

    def require_begin(self) -> None:
        """Raise RtcfError if the excitation has not begun for a long time."""
        waited_ns = (self.cycles - self._armed_at) * self._period_ns
        if not self._begun and waited_ns > _PATIENCE_S * 1e9:
            raise RtcfError("the excitation does not begin: is its input stop true?")

    def take(self, batch: PortBatch) -> None:
        """Add cycles."""
        self.cycles += len(batch) + batch.lost
        if not len(batch) or self.over:
            return
        values = [np.asarray(batch[name], float) for name in self._names]
        before = 0  # cycles of this batch before it is armed, whose state is that of an earlier run
        if not self.armed:
            there = np.flatnonzero(values[3])
            self.armed = bool(there.size)
            before = int(there[0]) if self.armed else len(batch)
            self._armed_at = self.cycles
        self._stamps.append(np.asarray(batch.stamps_ns))
        for column, each in zip(self._columns, values, strict=True):
            column.append(each)
        states = values[2]
        if not self._begun:
            begins = (values[3] == 0) & ((states == RUNNING) | (states == NOT_BEGUN))
            self._begun = self.armed and bool(begins[before:].any())
        if self._begun:
            self.over = states[-1] != RUNNING
        elif len(self._stamps) > 1:
            # Only the last cycle before the begin is needed.
            for column in self._columns:
                del column[:-1]
            del self._stamps[:-1]

    def recorded(self, *, late: bool) -> Recorded:
        """Return the values from the cycle before the excitation to its last one."""
        stamps = np.concatenate(self._stamps)
        inputs, signal, states, _, outputs = (np.concatenate(each) for each in self._columns)
        if late:
            outputs = np.concatenate([outputs[:1], outputs[:-1]])
        active = np.flatnonzero(states == RUNNING)
        if not active.size:
            none = np.zeros(0)
            return Recorded(self._period_ns / 1e9, none, none, none, none, int(states[-1]), 0)
        begin, last = max(int(active[0]) - 1, 0), int(active[-1])
        outcome = int(states[last + 1]) if last + 1 < len(states) else STOPPED
        part = slice(begin, last + 1)
        at = np.round((stamps[part] - stamps[begin]) / self._period_ns).astype(int)
        count = int(at[-1]) + 1
        filled = count - len(np.unique(at))
        if filled > _MOST_FILLED * count:
            raise RtcfError(
                f"{filled} of {count} cycles are late or dropped: the values are not usable; see "
                "`rtcfctl status`"
            )
        grid = np.arange(count)
        time = (grid - (int(active[0]) - begin)) * (self._period_ns / 1e9)
        newest = np.searchsorted(at, grid, side="right") - 1
        return Recorded(
            period=self._period_ns / 1e9,
            time=time.astype(np.float64),
            inputs=inputs[part][newest],
            signal=signal[part][newest],
            outputs=np.interp(grid, at, outputs[part]),
            outcome=outcome,
            filled=filled,
        )


def connected_output(
    client: Client, runner: str, reader: graph_pb2.ComponentInfo, input_: str
) -> str:
    """Return the output that is connected to an input of a component; raises RtcfError."""
    mapped = [each.mapped_name for each in reader.ports if each.name == input_]
    if not mapped:
        raise RtcfError(f"{reader.full_name} has no input {input_}")
    for component in client.list_components(runner):
        for port in component.ports:
            if port.direction == graph_pb2.DIRECTION_OUTPUT and port.mapped_name == mapped[0]:
                return f"{component.full_name}.{port.name}"
    raise RtcfError(
        f"no output is connected to {reader.full_name}.{input_} ({mapped[0]}): connect it, or name "
        "the measured output"
    )


@contextlib.contextmanager
def _leased(client: Client, runner: str, spec: graph_pb2.ComponentSpec) -> Iterator[Lease]:
    """Load a component, and unload it at the end, or when this program dies."""
    opening = control_pb2.OpenLease(
        runner=runner, component=spec, on_lost=control_pb2.ON_LEASE_LOST_UNLOAD,
        holder=f"the experiment of process {os.getpid()}", unseen=True,
    )  # fmt: skip
    lease = client.lease_component(opening)
    messages = iter(lease)
    try:
        next(each for each in messages if each.HasField("loaded"))
    except BaseException:
        lease.drop()
        raise
    try:
        yield lease
    finally:
        # An interruption may have lost the request: then rtcfd unloads the component, too.
        patience = threading.Timer(_END_S, lease.drop)
        patience.start()
        lease.end()
        try:
            with contextlib.suppress(RtcfError):  # dropped, or lost: rtcfd unloads the component
                for _ in messages:
                    pass
        finally:
            patience.cancel()


def _full(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


def _word(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(float(value)) if isinstance(value, np.floating) else str(value)
