"""Runners as JSON for a page: state, signals, parameters, connections and statistics.

Functions with a `client` block on calls to rtcfd: do not call them in the event loop.
"""

import math
import time
from typing import Any

import rtcf
from rtcf.v1 import control_pb2, graph_pb2, incidents_pb2, runner_pb2
from rtcf_shared.enums import word

from rtcf_scope.chunk import traces

_SCHEMA_DECIMATION = 1_000_000  # cycles; decimation of a stream opened only for its schema


def runners(client: rtcf.Client) -> list[dict[str, Any]]:
    """Return the status of all runners."""
    return [runner(each) for each in client.list_runners()]


def runner(status: runner_pb2.RunnerStatus) -> dict[str, Any]:
    """Return the status of one runner."""
    return {
        "runner": status.runner,
        "state": word(runner_pb2.RunnerState.DESCRIPTOR, status.state),
        "frequency_hz": status.settings.frequency_hz,
        "iteration": status.iteration,
        "overruns": status.overruns,
        "missed": status.missed,
        "generation": status.generation,
        "degraded": list(status.degraded),
        "status": status.status,
        "simulated": status.simulated,
        "incident": status.incident,
    }


def graph(client: rtcf.Client, name: str) -> dict[str, Any]:
    """Return the signals, the components with their parameters, and the connections of a runner.

    Raises RtcfError.
    """
    with client.watch_ports([], name, _SCHEMA_DECIMATION) as stream:
        schema = stream.schema
    return {
        "signals": traces(schema),
        "notes": list(schema.notes),
        "components": [component(each) for each in client.list_components(name)],
        "connections": [_connection(each) for each in client.list_connections(name)],
    }


def component(info: graph_pb2.ComponentInfo) -> dict[str, Any]:
    """Return a component; values of ports and state only from a query for this component."""
    return {
        "name": info.full_name,
        "type": f"{info.spec.package}/{info.spec.type}",
        "state": word(graph_pb2.ComponentState.DESCRIPTOR, info.state),
        "position": info.position,
        "doc": info.doc,
        "fault": info.fault,
        "parameters": [_parameter(each) for each in info.parameters],
        "values": {each.name: each.value for each in info.ports if each.HasField("value")}
        | {each.name: each.value for each in info.states if each.value},
    }


def statistics(client: rtcf.Client, name: str) -> dict[str, Any]:
    """Return the times of cycles and components, in µs, and in which cycles these run; raises
    RtcfError.
    """
    found = client.get_statistics(name)
    every = {each.full_name: max(each.spec.every, 1) for each in client.list_components(name)}
    return {
        "iterations": found.iterations,
        "overruns": found.overruns,
        "duration": _distribution(found.duration),
        "latency": _distribution(found.latency),
        "components": {
            each.component: _distribution(each.duration)
            | {"overruns": each.overruns, "every": every.get(each.component, 1)}
            for each in found.components
        },
    }


def incident(found: incidents_pb2.Incident) -> dict[str, Any]:
    """Return an incident without its content."""
    return {
        "name": found.name,
        "runner": found.runner,
        "time_ns": str(found.time_ns),
        "reason": found.reason,
    }


def event(found: control_pb2.Event) -> dict[str, Any]:
    """Return an event of rtcfd."""
    return {
        "kind": "event",
        "what": word(control_pb2.Event.Kind.DESCRIPTOR, found.kind),
        "time_ns": str(found.time_ns),
        "iteration": found.iteration,
        "component": found.component,
        "user": found.user,
        "message": found.message,
    }


def record(found: control_pb2.LogRecord) -> dict[str, Any]:
    """Return a log record."""
    return {
        "kind": "record",
        "what": word(control_pb2.LogRecord.Level.DESCRIPTOR, found.level),
        "time_ns": str(found.time_ns),
        "iteration": found.iteration,
        "component": found.component,
        "message": found.message,
    }


def lost(count: int, what: str) -> dict[str, Any]:
    """Return a log record with the number of dropped events or log records; `what` names them."""
    return {
        "kind": "record",
        "what": "warn",
        "time_ns": str(time.time_ns()),
        "iteration": 0,
        "component": "",
        "message": f"{count} earlier {what} dropped",
    }


def value(parameter: graph_pb2.ParameterValue) -> Any:
    """Return a parameter's value for JSON: NaN and infinities as text."""
    kind = parameter.WhichOneof("kind")
    found = None if kind is None else getattr(parameter, kind)
    return str(found) if isinstance(found, float) and not math.isfinite(found) else found


def history(client: rtcf.Client, runner_name: str, most: int) -> list[dict[str, Any]]:
    """Return the last parameter changes, at most `most`, newest first; raises RtcfError."""
    changes = client.get_history(runner=runner_name, most=most)
    return [
        {"component": each.component, "parameter": each.parameter, "value": value(each.value),
         "before": value(each.before), "who": each.who, "how": each.how,
         "time_ns": str(each.time_ns)}
        for each in reversed(changes)
    ]  # fmt: skip


def setting(info: graph_pb2.ParameterInfo, given: Any) -> graph_pb2.ParameterSetting:
    """Return the setting of a parameter to a page's value.

    Raises ValueError if the value does not fit the parameter's type.
    """
    found = graph_pb2.ParameterValue()
    try:
        if info.type == "bool" and isinstance(given, bool):
            found.bool_value = given
        elif info.type == "int" and isinstance(given, int) and not isinstance(given, bool):
            found.int_value = given
        elif info.type == "double" and isinstance(given, int | float) and given == given:
            found.double_value = float(given)
        elif info.type in ("string", "enum") and isinstance(given, str):
            found.string_value = given
    except (OverflowError, ValueError):
        pass
    if found.WhichOneof("kind") is None:
        raise ValueError(f"{info.name} has type {info.type}: invalid value {given!r}")
    return graph_pb2.ParameterSetting(name=info.name, value=found)


def _parameter(info: graph_pb2.ParameterInfo) -> dict[str, Any]:
    return {
        "name": info.name,
        "type": info.type,
        "value": value(info.value),
        "default": value(info.default_value),
        "minimum": _bound(info, "minimum"),
        "maximum": _bound(info, "maximum"),
        "unit": info.unit,
        "doc": info.doc,
        "choices": list(info.choices),
    }


def _bound(info: graph_pb2.ParameterInfo, name: str) -> float | None:
    found = getattr(info, name) if info.HasField(name) else math.inf
    return float(found) if math.isfinite(found) else None


def _connection(found: graph_pb2.Connection) -> dict[str, Any]:
    writer = found.writer
    return {
        "name": found.name,
        "type": found.type,
        "writer": [writer.component, writer.port] if found.HasField("writer") else None,
        "readers": [[each.component, each.port, each.broken] for each in found.readers],
        "published": found.published,
        "subscribed": found.subscribed,
    }


def _distribution(found: runner_pb2.Distribution) -> dict[str, float]:
    return {name: getattr(found, f"{name}_ns") / 1e3 for name in ("mean", "p50", "p99", "max")}
