"""Makes the desired state follow a running executor, and lists the differences.

The executor is right: it may have adopted a change whose save was lost when the previous
rtcfd died.  Pure functions on the desired state.
"""

from collections.abc import Iterable

from rtcf.v1 import graph_pb2, runner_pb2
from rtcf_shared.graph_writer import live_spec, same_value

from rtcfd.common import runner_settings
from rtcfd.state.desired import Desired


def follow_settings(
    desired: Desired,
    defaults: runner_pb2.RunnerSettings,
    found: runner_pb2.RunnerSettings,
) -> list[str]:
    """Make the desired settings those of an executor; return a line for each difference."""
    present = runner_pb2.RunnerSettings()
    present.CopyFrom(found)
    if present.spin_auto:
        present.ClearField("spin_us")  # the executor chose it
    complete = desired.complete(defaults)
    lines = runner_settings.differences(complete, present)
    desired.choose(runner_settings.changed(complete, present))
    return lines


def follow_components(
    desired: Desired, components: Iterable[graph_pb2.ComponentInfo], restored: bool
) -> tuple[list[str], dict[str, str]]:
    """Make the desired components those of an executor.

    Returns a line for each difference, and the components that the executor does not have,
    with the reason; these stay in the desired state.  If the executor's graph was completely
    `restored` before, a missing component that was not left out has been unloaded since, by a
    change whose save was lost; it is dropped.  A new or different component shows such a change,
    too: it is followed as a whole.
    """
    lines: list[str] = []
    known_left_out = dict(desired.left_out)
    left_out = dict.fromkeys(desired.components, "its executor does not have it")
    left_out |= known_left_out | desired.quarantined
    for info in components:
        name = str(info.full_name)
        left_out.pop(name, None)
        present = live_spec(info)
        if name in desired.components:
            desired.settle(name, present)
        known = desired.components.get(name)
        if known is None:
            lines.append(f"{name} was not in the saved graph")
        elif name in desired.quarantined:
            lines.append(f"{name} was quarantined in the saved graph")
        elif difference := _difference(known, present, info):
            lines.append(f"{name} differs from the saved graph: {difference}")
        else:
            continue
        desired.put(name, present)
    restored = restored or bool(lines)
    for name in [name for name in left_out if name not in desired.quarantined]:
        if restored and name not in known_left_out:
            lines.append(f"{name} was unloaded")
            desired.drop([name])
            del left_out[name]
        else:
            lines.append(f"{name} is not in its loop")
    return lines, left_out


def _difference(
    known: graph_pb2.ComponentSpec,
    present: graph_pb2.ComponentSpec,
    info: graph_pb2.ComponentInfo,
) -> str:
    """Return the names of the fields that differ; empty = none."""
    different = []
    for field in ("package", "type", "first", "ignore", "optional"):
        if getattr(known, field) != getattr(present, field):
            different.append(field)
    if _pairs(known) != _pairs(present):
        different.append("remaps")
    if set(known.breaks) != set(present.breaks):
        different.append("breaks")
    if max(known.every, 1) != max(present.every, 1):
        different.append("every")
    if known.HasField("phase") and (not present.HasField("phase") or known.phase != present.phase):
        different.append("phase")
    given = {setting.name: setting.value for setting in known.parameters}
    for parameter in info.parameters:
        if not same_value(given.get(parameter.name, parameter.default_value), parameter.value):
            different.append(f"parameter {parameter.name}")
    return ", ".join(different)


def _pairs(spec: graph_pb2.ComponentSpec) -> list[tuple[str, str]]:
    return sorted((remap.source, remap.target) for remap in spec.remaps)
