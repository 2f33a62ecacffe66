"""Writes graph files for graph_reader.py, and converts loaded components to their specs."""

import math
import re
from collections.abc import Iterable
from typing import Any

from rtcf.v1 import graph_pb2, runner_pb2

from rtcf_shared.enums import word
from rtcf_shared.graph_reader import Graph
from rtcf_shared.spec import parse_value

# YAML 1.1 reads these as line breaks, and folds them.
_OTHER_BREAKS = re.compile("[\x85\u2028\u2029]")


def write_graphs(graphs: Iterable[Graph]) -> str:
    """Return the text of a graph file; one graph stands alone, several under `runners`."""
    import yaml  # slow to import

    class Dumper(yaml.SafeDumper):  # type: ignore[misc]
        """Quotes text that would otherwise be read as another type."""

    def text(dumper: Any, value: str) -> Any:
        style = None
        if _OTHER_BREAKS.search(value):
            style = '"'
        elif value and not _is_text(value):
            style = "'"
        return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)

    Dumper.add_representer(str, text)
    documents = {graph.runner: _graph(graph) for graph in graphs}
    if len(documents) == 1:
        ((runner, body),) = documents.items()
        document: dict[str, Any] = {"runner": runner, **body}
    else:
        document = {"runners": documents}
    return str(yaml.dump(document, Dumper=Dumper, sort_keys=False, allow_unicode=True))


def live_spec(info: graph_pb2.ComponentInfo) -> graph_pb2.ComponentSpec:
    """Return the spec that would load a component with its current values.

    It has the parameters that were given when the component was loaded, and those that
    differ from their defaults.
    """
    spec = graph_pb2.ComponentSpec()
    spec.CopyFrom(info.spec)
    if spec.every == 1:
        spec.every = 0
    live = {each.name: each for each in info.parameters}
    for setting in spec.parameters:
        if setting.name in live:
            setting.value.CopyFrom(live.pop(setting.name).value)
    for each in live.values():
        if not same_value(each.value, each.default_value):
            spec.parameters.append(graph_pb2.ParameterSetting(name=each.name, value=each.value))
    return spec


def same_value(one: graph_pb2.ParameterValue, other: graph_pb2.ParameterValue) -> bool:
    """Return whether two values are equal; 1 and 1.0 are, True and 1 are not."""
    left, right = (getattr(value, value.WhichOneof("kind") or "string_value")
                   for value in (one, other))  # fmt: skip
    if isinstance(left, float) and isinstance(right, float) and math.isnan(left):
        return math.isnan(right)
    # True == 1 in Python, but not here.
    return bool(left == right) and isinstance(left, bool) == isinstance(right, bool)


def _is_text(value: str) -> bool:
    """Return whether a value without quotes would be read as this string."""
    try:
        return parse_value(value).string_value == value
    except ValueError:
        return False  # without quotes it would not be valid


def _graph(graph: Graph) -> dict[str, Any]:
    result: dict[str, Any] = {}
    if settings := _settings(graph.settings):
        result["settings"] = settings
    result["components"] = [_component(spec) for spec in graph.components]
    return result


def _settings(settings: runner_pb2.RunnerSettings | runner_pb2.RosSettings) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for descriptor, value in settings.ListFields():
        if descriptor.message_type is not None:
            result[descriptor.name] = _settings(value)
        elif descriptor.enum_type is not None:
            result[descriptor.name] = word(descriptor.enum_type, value)
        else:
            result[descriptor.name] = value
    return result


def _parameters(spec: graph_pb2.ComponentSpec) -> dict[str, Any]:
    values: dict[str, Any] = {
        setting.name: getattr(setting.value, setting.value.WhichOneof("kind"))
        for setting in spec.parameters
    }
    for given in reversed(spec.lists):  # a list within a list comes behind it
        elements = [f"{given.name}_{index}" for index in range(given.length)]
        if all(name in values for name in elements):
            values[given.name] = [values.pop(name) for name in elements]
    return values


def _component(spec: graph_pb2.ComponentSpec) -> dict[str, Any]:
    result: dict[str, Any] = {"name": spec.name or spec.type}
    if spec.ns not in ("", "/"):
        result["ns"] = spec.ns
    result |= {"package": spec.package, "type": spec.type}
    if spec.remaps:
        result["remaps"] = {remap.source: remap.target for remap in spec.remaps}
    if spec.parameters or spec.lists:
        result["parameters"] = _parameters(spec)
    for flag in ("first", "optional"):
        if getattr(spec, flag):
            result[flag] = True
    if spec.ignore:
        result["ignore"] = spec.ignore
    if spec.breaks:
        result["breaks"] = list(spec.breaks)
    if spec.every > 1:
        result["every"] = spec.every
    if spec.HasField("phase"):
        result["phase"] = spec.phase
    return result
