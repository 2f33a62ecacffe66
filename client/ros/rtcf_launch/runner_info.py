"""The output of the rosrun tools for a rtcf_msgs/RunnerInfo: the texts of RTCF 2021, for scripts.

Functions raise NotFoundError, with the text of RTCF 2021, if there is nothing to show.
"""

from collections.abc import Iterable, Sequence
from typing import Any

_LINE = "-" * 80


class NotFoundError(Exception):
    """There is no such component, connection or order."""


def component_list(info: Any, _: str) -> list[str]:
    """Return the components' names."""
    return sorted(each.name for each in info.components)


def component_info(info: Any, name: str) -> list[str]:
    """Return one component's kind and ports."""
    found = _named(info.components, name, "component")
    return [
        _LINE,
        f"Node [{found.name}] ({found.package}/{found.type})",
        *_section("Publications", [_port(each) for each in _sorted(found.output_ports)]),
        *_section("Subscriptions", [_port(each) for each in _sorted(found.input_ports)]),
    ]


def component_order(info: Any, _: str) -> list[str]:
    """Return the components in the order in which they run, numbered."""
    if not info.component_order:
        raise NotFoundError("Empty order!")
    numbered = [f"{number}. {name}" for number, name in enumerate(info.component_order, 1)]
    return ["Real-time execution order is:", *numbered, "", f"Total: {len(numbered)}"]


def connection_list(info: Any, _: str) -> list[str]:
    """Return the connections' names."""
    if not info.connections:
        raise NotFoundError("No connections found!")
    return sorted(each.name for each in info.connections)


def connection_info(info: Any, name: str) -> list[str]:
    """Return the writers and readers of a connection."""
    found = _named(info.connections, name, "connection")
    return [
        _LINE,
        f"Connection [{found.name}] ({found.type})",
        f"Connection {'IS' if found.connected_to_ROS else 'is NOT'} bridged to ROS.",
        "",
        *_section("Publishing components", sorted(found.publishing_components)),
        *_section("Subscribing components", sorted(found.subscribing_components)),
    ]


def _named(there: Iterable[Any], name: str, what: str) -> Any:
    by_name = {each.name: each for each in there}
    if not by_name:
        raise NotFoundError(f"No {what}s found!")
    found = by_name.get(name) or by_name.get(f"/{name}")
    if found is None:
        raise NotFoundError(f"Given {what} not found!")
    return found


def _sorted(ports: Iterable[Any]) -> list[Any]:
    return sorted(ports, key=lambda port: str(port.name_remapped))


def _port(port: Any) -> str:
    ros = "(connected to ROS)" if port.connected_to_ROS else ""
    return f"{port.name_remapped} [{port.msg_type}] {ros}"


def _section(heading: str, lines: Sequence[str]) -> list[str]:
    if not lines:
        return [f"{heading}: None", ""]
    return [f"{heading}:", *(f" * {line}" for line in lines), ""]
