"""A test bench: runs a component or a graph in a private executor, without real time.

A run is a replay (see rtcf.replay) from the start of the loop, on simulated time, as fast as
possible. The same inputs always result in bit-identical outputs.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, MutableSequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import rtcf_shared.spec
from rtcf_shared.arrays import as_list
from rtcf_shared.errors import RtcfError
from rtcf_shared.graph_reader import Graph, read_graphs
from rtcf_shared.naming import listing, suggestion
from rtcf_shared.value_text import parse

import rtcf
from rtcf.client import DEFAULT_RUNNER, Client
from rtcf.connection import Closing
from rtcf.private_daemon import PrivateDaemon, component_folders, program
from rtcf.streams.numbered import Place
from rtcf.testing import messages
from rtcf.testing.response import Response, held
from rtcf.v1 import control_pb2, graph_pb2, runner_pb2

_MASKED: Any = np.ma  # without types in NumPy's own stubs
_START_NS = 1_000_000_000  # simulated time of the first cycle
_MOST_MESSAGES = 2000  # in one request
_MOST_BYTES = 2 * 1024 * 1024

Inputs = Mapping[str, npt.ArrayLike]


class Bench(Closing):
    """A component or graph under test, in a private rtcfd and executor that end with the bench.

    what             "package/Type", or the path of a graph file
    frequency_hz     the frequency of the loop
    path             folders of libraries; by default the build folders below the current folder
    parameters       parameters of the component
    more_parameters  the same as keyword arguments

    rtcfd logs to standard error, which pytest shows for a failed test. Raises RtcfError, and
    ValueError for invalid arguments.
    """

    def __init__(
        self,
        what: str,
        *,
        frequency_hz: float | None = None,
        path: Iterable[str | Path] = (),
        parameters: Mapping[str, Any] | None = None,
        **more_parameters: Any,
    ) -> None:
        graph = _graph_of(what, {**(parameters or {}), **more_parameters})
        if frequency_hz is not None:
            graph.settings.frequency_hz = frequency_hz
        folders = component_folders([Path(each) for each in path])
        daemon = PrivateDaemon(
            program(_build_tree()),
            options=[word for each in folders for word in ("--path", str(each))],
        )
        with ExitStack() as opening:
            opening.callback(daemon.end)
            daemon.start()
            self._client = opening.enter_context(Client(daemon.socket))
            self._begin(graph)
            self._open = opening.pop_all()

    def close(self) -> None:
        """End the executor and rtcfd."""
        self._open.close()

    @property
    def client(self) -> Client:
        """The client of the private rtcfd, for all other calls; the runner is rt_runner."""
        return self._client

    def run(self, inputs: Inputs | None = None, steps: int | None = None) -> Response:
        """Run `steps` cycles from the start of the loop, with newly created components.

        inputs  values of unconnected inputs, by name: "port" or "port.field", in a graph of several
                components "/component.port". A value is a number for all cycles, or an array with a
                row per cycle. Masked rows (numpy.ma) are not sent.
        steps   number of cycles; by default the number of rows of `inputs`

        Raises ValueError, and RefusedError if a component's fault ends the loop.
        """
        columns = {name: _MASKED.asarray(each) for name, each in (inputs or {}).items()}
        if steps is None:
            steps = max((len(each) for each in columns.values() if each.ndim), default=0)
        if steps < 1:
            raise ValueError("set steps to at least 1, or pass an array as input")
        by_topic = self._by_topic(columns, steps)
        with self._client.replay() as call:
            begun = call.run(
                control_pb2.ReplayRequest(runner=DEFAULT_RUNNER, begin=True, start_ns=_START_NS)
            )
            due = self._messages(by_topic, {each.topic: each for each in begun.inputs}, steps)
            outputs: list[control_pb2.RecordedMessage] = []
            for last, part in _pieces(due):
                until_ns = self._at(last) + self._period_ns // 2
                for response in call.cycles(part, until_ns, end=last == steps - 1):
                    outputs += response.outputs
        return self._response(steps, outputs, {each.topic: each for each in begun.written})

    def set(self, component: str = "", **values: Any) -> None:
        """Set parameters of `component` (default: the only one) for the next runs.

        A mapping sets the members of a group, a list or NumPy array the elements of an array or
        a vector, and the vector's size.
        """
        lists: list[graph_pb2.ListLength] = []
        settings = _settings(values, lists)
        self._client.set_parameters(component or self._only().full_name, settings, lists=lists)

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters of the only component, by name."""
        return {
            each.name: getattr(each.value, str(each.value.WhichOneof("kind")))
            for each in self._only().parameters
        }

    @property
    def state(self) -> dict[str, Any]:
        """The declared state of the only component after the last run, by name."""
        return {each.name: parse(each.value) for each in self._only().states}

    @property
    def logs(self) -> list[str]:
        """The log records of components as "/component: text", oldest first."""
        with self._client.watch_logs(after=Place(), until_now=True) as records:
            return [
                f"{each.component}: {each.message}"
                for each in records
                if isinstance(each, control_pb2.LogRecord) and each.component
            ]

    def _begin(self, graph: Graph) -> None:
        settings = graph.settings
        settings.realtime = runner_pb2.REALTIME_PREFERRED
        settings.lock_memory = False
        settings.ros.enabled = False
        settings.ros.whitelist = ".*"  # map all ports, because a replay uses only mapped ones
        settings.ros.blacklist = ""
        status = self._client.add_runner(DEFAULT_RUNNER, settings)
        self._period_ns = round(1e9 / status.settings.frequency_hz)
        self._client.apply(graph.components)
        self._components = self._client.list_components()

    def _only(self) -> graph_pb2.ComponentInfo:
        names = [each.full_name for each in self._components]
        if len(names) != 1:
            raise ValueError(f"needs one component, but there are {listing(names)}: use `client`")
        return self._client.get_component(names[0])

    def _ports(self, direction: graph_pb2.Direction) -> dict[str, str]:
        """Return the topics of mapped ports, by names as in run()."""
        found = {}
        for component in self._components:
            for port in component.ports:
                if port.direction != direction or not port.mapped:
                    continue
                single = len(self._components) == 1
                name = port.name if single else f"{component.full_name}.{port.name}"
                found[name] = port.mapped_name
        return found

    def _at(self, cycle: int) -> int:
        return _START_NS + cycle * self._period_ns

    def _by_topic(self, columns: Mapping[str, Any], steps: int) -> dict[str, dict[str, Any]]:
        """Return the rows of each field, by topic and field."""
        ports = self._ports(graph_pb2.DIRECTION_INPUT)
        found: dict[str, dict[str, Any]] = {}
        for name, column in columns.items():
            port, field = _split(name, ports)
            try:
                found.setdefault(ports[port], {})[field] = _rows(column, steps)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None
        return found

    def _messages(
        self, by_topic: Mapping[str, dict[str, Any]], topics: Mapping[str, Any], steps: int
    ) -> list[list[control_pb2.RecordedMessage]]:
        """Return the messages to send, by cycle."""
        found: list[list[control_pb2.RecordedMessage]] = [[] for _ in range(steps)]
        for topic, fields in by_topic.items():
            if topic not in topics:
                raise ValueError(f"{topic} is connected to an output of the graph")
            try:
                packed = messages.pack(
                    topics[topic].definition,
                    {path: np.asarray(each) for path, each in fields.items()},
                )
            except ValueError as error:
                raise ValueError(f"{topic}: {error}") from None
            masked = np.zeros(steps, bool)
            for column in fields.values():
                masked |= _MASKED.getmaskarray(column).reshape(steps, -1).any(axis=1)
            for cycle in as_list(np.flatnonzero(~masked)):
                # Half a period early, so that rounding cannot delay it to the next cycle.
                time_ns = self._at(cycle) - self._period_ns // 2
                found[cycle].append(
                    control_pb2.RecordedMessage(topic=topic, time_ns=time_ns, data=packed[cycle])
                )
        return found

    def _response(
        self,
        steps: int,
        outputs: Iterable[control_pb2.RecordedMessage],
        topics: Mapping[str, Any],
    ) -> Response:
        by_topic: dict[str, tuple[list[int], list[bytes]]] = {}
        for each in outputs:
            cycles, data = by_topic.setdefault(each.topic, ([], []))
            cycles.append(round((each.time_ns - _START_NS) / self._period_ns))
            data.append(each.data)
        written: dict[str, npt.NDArray[np.bool_]] = {}
        columns: dict[str, npt.NDArray[np.generic]] = {}
        without_columns: dict[str, str] = {}
        for name, topic in self._ports(graph_pb2.DIRECTION_OUTPUT).items():
            written[name] = np.zeros(steps, bool)
            if topic not in by_topic:
                continue
            at = np.asarray(by_topic[topic][0], np.int64)
            written[name][at] = True
            try:
                unpacked = messages.unpack(topics[topic].definition, by_topic[topic][1])
            except ValueError as error:
                without_columns[name] = str(error)
                continue
            for path, values in unpacked.items():
                columns[f"{name}.{path}" if path else name] = held(values, at, steps)
        time = np.arange(steps) * (self._period_ns / 1e9)
        return Response(time, written, columns, without_columns)


def _build_tree() -> Path | None:
    """Return the build tree of this library; None if it is installed."""
    tree = Path(rtcf.__file__).absolute().parents[2]
    return tree if (tree / "bin" / "rtcfd").exists() else None


def _graph_of(what: str, parameters: Mapping[str, Any]) -> Graph:
    if what.endswith((".yaml", ".yml")):
        if parameters:
            raise ValueError(f"{what}: set parameters in the graph file")
        try:
            graphs = read_graphs(Path(what).read_text(), what)
        except OSError as error:
            raise RtcfError(f"{what}: {error.strerror}") from None
        if len(graphs) != 1:
            raise ValueError(f"{what} has {len(graphs)} graphs: a bench needs exactly one")
        return graphs[0]
    package, slash, kind = what.partition("/")
    if not (package and slash and kind):
        raise ValueError(f'"{what}" is neither PACKAGE/TYPE nor a graph file (.yaml)')
    spec = rtcf_shared.spec.component(package, kind)
    spec.parameters.extend(_settings(parameters, spec.lists))
    return Graph(components=[spec])


def _settings(
    values: Mapping[str, Any], lists: MutableSequence[graph_pb2.ListLength]
) -> list[graph_pb2.ParameterSetting]:
    given = (rtcf_shared.spec.flat(*each, lists) for each in values.items())
    return [_setting(name, value) for each in given for name, value in each]


def _setting(name: str, value: object) -> graph_pb2.ParameterSetting:
    kinds: dict[type, str] = {bool: "bool", int: "int", float: "double", str: "string"}
    kind = kinds.get(type(value))
    if kind is None:
        raise ValueError(f"{name}: {value!r} is not a bool, int, float or text")
    held_value = graph_pb2.ParameterValue(**{f"{kind}_value": value})  # type: ignore[arg-type]
    return graph_pb2.ParameterSetting(name=name, value=held_value)


def _split(name: str, ports: Iterable[str]) -> tuple[str, str]:
    """Return the port and the field (possibly empty) of a name."""
    known = list(ports)
    for port in sorted(known, key=len, reverse=True):
        if name == port or name.startswith(f"{port}."):
            return port, name[len(port) + 1 :]
    raise ValueError(f"no input {name}{suggestion(name, known)} (inputs: {listing(known)})")


def _rows(column: Any, steps: int) -> Any:
    """Return a column with a row per cycle."""
    if column.dtype.kind not in "biuf":
        raise ValueError("values must be numbers")
    if column.ndim == 0:
        return _MASKED.asarray(np.full(steps, column))
    if len(column) != steps:
        raise ValueError(f"{len(column)} rows for {steps} cycles")
    return column


def _pieces(
    due: list[list[control_pb2.RecordedMessage]],
) -> Iterator[tuple[int, list[control_pb2.RecordedMessage]]]:
    """Yield the messages of each request, with its last cycle."""
    part: list[control_pb2.RecordedMessage] = []
    size = 0
    for cycle, sent in enumerate(due):
        part += sent
        size += sum(len(each.data) for each in sent)
        if len(part) >= _MOST_MESSAGES or size >= _MOST_BYTES or cycle == len(due) - 1:
            yield cycle, part
            part, size = [], 0
