"""The private parameters of rt_launcher: its own, and load-time values of its component."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rtcf.v1 import control_pb2, graph_pb2
from rtcf_shared.enums import choices

from rtcf_launch.codes import Code, Ending
from rtcf_launch.parameters import Parameters, close_to

_ON_LOST = choices(control_pb2.OnLeaseLost.DESCRIPTOR)
_LARGEST = 2**31 - 1  # XML-RPC has no larger integers


@dataclass
class LauncherParameters:
    """What an rt_launcher is asked to do."""

    runner: str | None  # name of an rt_runner; None = the nearest one
    first: bool
    ignore: str
    every: int
    phase: int | None
    optional: bool
    on_lost: Any  # OnLeaseLost
    others: dict[str, Any] = field(default_factory=dict)  # the component's


def read(values: Mapping[str, Any]) -> LauncherParameters:
    """Check the launcher's own parameters."""
    given = Parameters(values)
    on_lost = given.word("on_lease_lost", _ON_LOST)
    return LauncherParameters(
        runner=given.text("runner"),
        first=bool(given.boolean("is_first", False)),
        ignore=_ignore(given.raw("topics_ignore_for_graph")),
        every=given.integer("every", 1, _LARGEST) or 0,
        phase=given.integer("phase", 0, _LARGEST),
        optional=bool(given.boolean("optional", False)),
        on_lost=_ON_LOST[on_lost] if on_lost else control_pb2.ON_LEASE_LOST_STOP,
        others=given.rest(),
    )


def settings(
    others: Mapping[str, Any], declared: Mapping[str, graph_pb2.ParameterInfo]
) -> tuple[list[graph_pb2.ParameterSetting], list[str]]:
    """Return load-time values of declared parameters, and the names of the other private ones.

    Those are left to the component's node handle; what looks like a slip of the pen
    is refused.
    """
    result = []
    rest = []
    for name, value in sorted(others.items()):
        info = declared.get(name)
        if info is not None:
            result.append(graph_pb2.ParameterSetting(name=name, value=_value(info, value)))
            continue
        missing = [each for each in declared if each not in others]
        if hint := close_to(name, missing):
            raise Ending(Code.USAGE, f"the component has no parameter ~{name}{hint}")
        rest.append(name)
    return result, rest


def _value(info: graph_pb2.ParameterInfo, value: Any) -> graph_pb2.ParameterValue:
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
    """Return an expression over connections; a list of them means any."""
    if value is None:
        return ""
    expressions = value if isinstance(value, list) else [value]
    if not all(isinstance(each, str) for each in expressions):
        raise Ending(
            Code.USAGE,
            f"~topics_ignore_for_graph must be a regular expression or a list of them, not {value}",
        )
    return "|".join(expressions)
