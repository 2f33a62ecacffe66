"""Names of runners, packages, types and components: checking and resolving."""

import re
from collections.abc import Sequence

from rtcf.v1 import errors_pb2, graph_pb2

from rtcfd.common.errors import InvalidArgument

DEFAULT_RUNNER = "rt_runner"

# A runner's name becomes a file name and, with a suffix, a unix socket's path.
_MAX_LENGTH = 64
_BASE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*", re.ASCII)


def check_base_name(kind: str, name: str) -> str:
    """Return `name` if it is a ROS base name; `kind` ("runner", …) is for the error message."""
    if not _BASE_NAME.fullmatch(name):
        raise InvalidArgument(
            f'{kind} name "{name}" is not valid: use letters, digits and _, and begin with a '
            "letter",
            errors_pb2.REASON_NAME_INVALID,
            field=kind,
        )
    if len(name) > _MAX_LENGTH:
        raise InvalidArgument(
            f"{kind} name of {len(name)} characters: at most {_MAX_LENGTH}",
            errors_pb2.REASON_NAME_INVALID,
            field=kind,
        )
    return name


def absolute(name: str) -> str:
    """Return the absolute name of a component in a request: a relative one is in "/"."""
    return name if name.startswith("/") else "/" + name


def full_name(spec: graph_pb2.ComponentSpec) -> str:
    """Return the absolute name that the executor gives a component."""
    parts = [part for part in spec.ns.split("/") if part]
    return "/" + "/".join([*parts, spec.name or spec.type])


def check_graph(specs: Sequence[graph_pb2.ComponentSpec]) -> None:
    """Raise InvalidArgument for a graph with two components of one name."""
    seen: set[str] = set()
    for spec in specs:
        name = full_name(spec)
        if name in seen:
            raise InvalidArgument(
                f"component {name} occurs twice in the graph",
                errors_pb2.REASON_COMPONENT_TWICE,
                component=name,
            )
        seen.add(name)
