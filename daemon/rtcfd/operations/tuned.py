"""Parameters that were tuned after a graph file was applied.

When the file is applied again, tuned values that still fit stay.  A parameter counts as tuned if
its value is neither the given value nor the default.
"""

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from rtcf.v1 import control_pb2, graph_pb2
from rtcf_shared.graph_writer import same_value

from rtcfd.access.caller import Caller
from rtcfd.catalog.catalog import Catalog
from rtcfd.common import declared_values
from rtcfd.common.errors import RequestError
from rtcfd.common.names import full_name
from rtcfd.operations import parameters
from rtcfd.operations.runner_core import RunnerCore


@dataclass
class Tuned:
    """The tuned parameters of one component that stay, and those that change."""

    kept: list[graph_pb2.ParameterSetting] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    before: dict[str, graph_pb2.ParameterValue] = field(default_factory=dict)
    # Changed by a value given now, or because a value does not fit; not by a new default.
    changed: list[graph_pb2.ParameterSetting] = field(default_factory=list)

    def note(self, runner: RunnerCore, component: str, acting: Caller | None, how: str) -> None:
        """Note the changes in the history; a value that stays keeps its author there."""
        parameters.note(runner, component, self.changed, self.before, acting, how)

    def add_to(self, result: control_pb2.ChangeResult) -> None:
        """Add kept values and notes to the result of a change of this component."""
        result.kept.extend(self.kept)
        result.notes.extend(self.notes)


async def keep_all(
    runner: RunnerCore,
    specs: Iterable[graph_pb2.ComponentSpec],
    given_before: Iterable[graph_pb2.ComponentSpec],
) -> dict[str, Tuned]:
    """Put tuned values into the components of a graph; return the results, by component."""
    earlier = {full_name(each): each for each in given_before}
    found = {}
    live = await parameters.live_components(runner)
    for spec in specs:
        name = full_name(spec)
        if name in earlier and (name in live or name in runner.desired.left_out):
            await parameters.settle_lists(runner, name)
            await _set_vector_sizes(runner.shared.catalog, spec, earlier[name], live.get(name))
            values = _values(runner, name, live.get(name), earlier[name])
            found[name] = await _keep(runner.shared.catalog, spec, earlier[name], values)
    return found


async def keep(
    runner: RunnerCore,
    old: str,
    spec: graph_pb2.ComponentSpec,
    given_before: graph_pb2.ComponentSpec,
) -> Tuned:
    """Put tuned values of the component `old`, whose lists are settled, into its replacement."""
    info = None if old in runner.desired.left_out else await parameters.live_component(runner, old)
    await _set_vector_sizes(runner.shared.catalog, spec, given_before, info)
    values = _values(runner, old, info, given_before)
    return await _keep(runner.shared.catalog, spec, given_before, values)


async def _set_vector_sizes(
    catalog: Catalog,
    spec: graph_pb2.ComponentSpec,
    given_before: graph_pb2.ComponentSpec,
    info: graph_pb2.ComponentInfo | None,
) -> None:
    """Set the vectors that a component and its earlier specification have as lists."""
    if not (spec.lists or given_before.lists):
        return
    library = await catalog.find(spec.package, spec.type)
    library.set_vector_sizes(spec)
    declared = library.parameters if info is None else info.parameters
    with contextlib.suppress(RequestError):  # an earlier type had other vectors
        declared_values.set_vector_sizes("", given_before, declared)


@dataclass
class _Present:
    values: dict[str, graph_pb2.ParameterValue]
    tuned: set[str]


def _values(
    runner: RunnerCore,
    name: str,
    info: graph_pb2.ComponentInfo | None,
    given_before: graph_pb2.ComponentSpec,
) -> _Present:
    given = _given(given_before)
    if info is None:  # the executor does not have it
        values = _given(runner.desired.components[name])
        base = given
    else:
        values = {each.name: each.value for each in info.parameters}
        base = {each.name: each.default_value for each in info.parameters} | given
    tuned = {
        each for each in values if each not in base or not same_value(values[each], base[each])
    }
    return _Present(values, tuned)


async def _keep(
    catalog: Catalog,
    spec: graph_pb2.ComponentSpec,
    given_before: graph_pb2.ComponentSpec,
    present: _Present,
) -> Tuned:
    given, wanted = _given(given_before), _given(spec)
    result = Tuned(before=present.values)
    tuned = {name for name in present.tuned if _same(given.get(name), wanted.get(name))}
    declared: dict[str, graph_pb2.ParameterInfo] = {}
    if tuned or given or wanted:
        library = await catalog.find(spec.package, spec.type)
        declared = {each.name: each for each in library.parameters}
    defaults = {name: each.default_value for name, each in declared.items()}
    for name in (each for each in present.values if each in tuned):
        setting = graph_pb2.ParameterSetting(name=name, value=present.values[name])
        why = _misfit(setting, declared)
        if not why:
            wanted[name] = setting.value
            result.kept.append(setting)
            continue
        line = (
            f"{full_name(spec)}: {name} = {declared_values.word(setting.value)} does not fit: {why}"
        )
        if (now := wanted.get(name, defaults.get(name))) is not None:
            line += f"; it is {declared_values.word(now)} now"
        result.notes.append(line)
    del spec.parameters[:]
    spec.parameters.extend(
        graph_pb2.ParameterSetting(name=name, value=value) for name, value in wanted.items()
    )
    for name in dict.fromkeys([*given, *wanted, *tuned]):
        now = wanted.get(name, defaults.get(name))
        if now is not None and not _same(present.values.get(name), now):
            result.changed.append(graph_pb2.ParameterSetting(name=name, value=now))
    return result


def _misfit(
    setting: graph_pb2.ParameterSetting, declared: Mapping[str, graph_pb2.ParameterInfo]
) -> str:
    """Return why a value does not fit a parameter; empty = it fits."""
    found = declared.get(setting.name)
    if found is None:
        return "there is no such parameter any more"
    try:
        declared_values.check("", setting, declared)
    except RequestError:
        if setting.value.WhichOneof("kind") != found.default_value.WhichOneof("kind"):
            return f"it is of type {found.type} now"
        if found.choices:
            return ", ".join(found.choices)
        low, high = found.HasField("minimum"), found.HasField("maximum")
        if low and high:
            return f"{found.minimum:g} to {found.maximum:g}"
        return f"at least {found.minimum:g}" if low else f"at most {found.maximum:g}"
    return ""


def _given(spec: graph_pb2.ComponentSpec) -> dict[str, graph_pb2.ParameterValue]:
    return {each.name: each.value for each in spec.parameters}


def _same(one: graph_pb2.ParameterValue | None, other: graph_pb2.ParameterValue | None) -> bool:
    if one is None or other is None:
        return one is other
    return same_value(one, other)
