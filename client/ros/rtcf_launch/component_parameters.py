"""The private parameters of rt_launcher: its own, and load-time values of its component."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from rtcf.v1 import control_pb2, graph_pb2
from rtcf_shared.enums import choices

from rtcf_launch.codes import Code, Ending
from rtcf_launch.parameters import Parameters, close_to

_ON_LOST = choices(control_pb2.OnLeaseLost.DESCRIPTOR)
PREFIX = "rtcf_"
_LARGEST = 2**31 - 1  # XML-RPC has no larger integers


@dataclass
class LauncherParameters:
    """The values of rt_launcher's private parameters."""

    runner: str | None  # name of an rt_runner; None = the nearest one
    first: bool
    ignore: str
    every: int
    phase: int | None
    optional: bool
    on_lost: Any  # OnLeaseLost
    others: dict[str, Any] = field(default_factory=dict)  # the component's


def named_runner(values: Mapping[str, Any]) -> str | None:
    """Return the name of the runner that the parameters select; None = they select none."""
    for name in (PREFIX + "runner", "runner"):
        value = values.get(name)
        if isinstance(value, str):
            return value
    return None


def read(
    values: Mapping[str, Any], declared: Collection[str] = ()
) -> tuple[LauncherParameters, list[str]]:
    """Check the launcher's own parameters; return them, and a note for each that belongs to the
    component instead.

    A name may have the prefix `rtcf_`.  A parameter without the prefix belongs to the component
    if the component declares it, or if its value is not valid for the launcher: components may
    read private parameters that they do not declare.
    """
    given = Parameters(values)
    notes: list[str] = []

    def own(name: str, take: Callable[[str], Any], fits: bool = True) -> Any:
        if given.has(PREFIX + name):
            return take(PREFIX + name)
        why = ""
        if name in declared or _is_group(name, declared) or _is_array(name, declared):
            why = "the component declares it"
        elif not fits:
            why = "it has no effect without ~every"
        elif given.has(name):
            value = given.raw(name)
            try:
                given.put(name, value)
                return take(name)
            except Ending as error:
                given.put(name, value)
                why = str(error)
        if given.has(name):
            notes.append(
                f"~{name} belongs to the component, not to rt_launcher (use ~{PREFIX}{name}): {why}"
            )
        return None

    every = own("every", lambda name: given.integer(name, 1, _LARGEST))
    on_lost = own("on_lease_lost", lambda name: given.word(name, _ON_LOST))
    found = LauncherParameters(
        runner=own("runner", given.text),
        first=bool(given.boolean("is_first", False)),
        ignore=_ignore(given.raw("topics_ignore_for_graph")),
        every=every or 0,
        phase=own("phase", lambda name: given.integer(name, 0, _LARGEST), every is not None),
        optional=bool(own("optional", given.boolean)),
        on_lost=_ON_LOST[on_lost] if on_lost else control_pb2.ON_LEASE_LOST_STOP,
        others=given.rest(),
    )
    return found, notes


def settings(
    others: Mapping[str, Any], declared: Mapping[str, graph_pb2.ParameterInfo]
) -> tuple[list[graph_pb2.ParameterSetting], list[str], list[str]]:
    """Return load-time values of declared parameters, the names of the other private ones, and a
    warning for each other one that may be misspelt.

    A mapping sets the members of a group, a list the elements of an array. The component's node
    handle can read the others, which may have any name.
    """
    slips: list[str] = []
    given: dict[str, Any] = {}
    for name, value in _lists_last(others):
        for part, leaf in _parts(name, value, declared, slips):
            if part in given:
                slips.append(f"~{part} is ignored: ~{name} sets it, too")
            given[part] = leaf
    result = []
    rest = []
    for name, value in sorted(given.items()):
        info = declared.get(name)
        if info is not None:
            result.append(graph_pb2.ParameterSetting(name=name, value=_value(info, value)))
            continue
        rest.append(name)
        missing = [each for each in declared if each not in given]
        if hint := close_to(name, missing):
            slips.append(f"the component declares no parameter ~{name}{hint}")
    return result, rest, slips


def _parts(
    name: str, value: Any, declared: Mapping[str, graph_pb2.ParameterInfo], slips: list[str]
) -> Iterator[tuple[str, Any]]:
    """Yield the members of a declared group, the elements of a declared array or vector (with its
    size), or else the value as it is; add a warning for each value that cannot be one of these.
    """
    if name in declared:
        yield name, value
    elif _is_group(name, declared):
        if isinstance(value, Mapping):
            for key, member in _lists_last(value):
                yield from _parts(f"{name}/{key}", member, declared, slips)
        else:
            slips.append(f"~{name} is a group of parameters: set ~{name}/NAME")
    elif _is_array(name, declared):
        if not isinstance(value, list):
            slips.append(f"~{name} is an array: set a list, or its elements ~{name}_0 …")
            return
        taken = 0
        for element in value:
            part = f"{name}_{taken}"
            if part not in declared and not _is_array(part, declared):
                slips.append(f"~{name} has {len(value)} values: the component takes {taken}")
                break
            yield from _parts(part, element, declared, slips)
            taken += 1
        for size in (each.name for each in declared.values() if each.vector == name):
            yield size, taken
    else:
        yield name, value


def _lists_last(values: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Return the values, so that lists override what somebody has left under the names of their
    elements."""
    return sorted(values.items(), key=lambda each: isinstance(each[1], list))


def _is_group(name: str, declared: Iterable[str]) -> bool:
    return any(each.startswith(f"{name}/") for each in declared)


def _is_array(name: str, declared: Iterable[str]) -> bool:
    element = re.compile(rf"{re.escape(name)}(_[0-9]+)+")
    return any(element.fullmatch(each) for each in declared)


def _value(info: graph_pb2.ParameterInfo, value: Any) -> graph_pb2.ParameterValue:
    """Return a value with its own type; rtcfd converts it to the declared one if it fits."""
    made = graph_pb2.ParameterValue
    if isinstance(value, bool):
        found = made(bool_value=value)
    elif isinstance(value, int):
        found = made(int_value=value)
    elif isinstance(value, float):
        found = made(double_value=value)
    elif isinstance(value, str):
        found = made(string_value=value)
    else:
        raise Ending(
            Code.USAGE, f"~{info.name} must be one {info.type}, not a {type(value).__name__}"
        )
    return found


def _ignore(value: Any) -> str:
    """Return a regular expression for connections; a list matches if any of its items does."""
    if value is None:
        return ""
    expressions = value if isinstance(value, list) else [value]
    if not all(isinstance(each, str) for each in expressions):
        raise Ending(
            Code.USAGE,
            f"~topics_ignore_for_graph must be a regular expression or a list of them, not {value}",
        )
    return "|".join(expressions)
