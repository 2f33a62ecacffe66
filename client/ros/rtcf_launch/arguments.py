"""The command line of a ROS node, and the environment variables that complete it.

from:=to        a remap
_name:=value    a private parameter
__name:=value   a special key of ROS: __name, __ns, __master, __hostname, __ip, __log
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from rtcf.v1 import graph_pb2
from rtcf_shared.spec import parse_value

DEFAULT_MASTER = "http://localhost:11311"


@dataclass
class Arguments:
    """The parsed arguments of a node."""

    name: str  # base name
    ns: str  # namespace, absolute
    master_uri: str
    hostname: str  # by which peers reach this host; empty = not given
    log_file: str  # of roslaunch for this node; empty = none
    words: list[str] = field(default_factory=list)
    remaps: list[tuple[str, str]] = field(default_factory=list)
    private: dict[str, Any] = field(default_factory=dict)

    @property
    def full_name(self) -> str:
        """The node's full name."""
        return resolve(self.name, self.ns)


def parse(argv: Sequence[str], environment: Mapping[str, str], default_name: str) -> Arguments:
    """Parse the arguments of a program, without its name."""
    special: dict[str, str] = {}
    remaps: list[tuple[str, str]] = []
    private: dict[str, Any] = {}
    words: list[str] = []
    for word in argv:
        left, sign, right = word.partition(":=")
        if not sign:
            words.append(word)
        elif left.startswith("__"):
            special[left] = right
        elif left.startswith("_"):
            private[left[1:]] = _plain(right)
        else:
            remaps.append((left, right))
    hostname = (
        special.get("__hostname")
        or special.get("__ip")
        or environment.get("ROS_HOSTNAME")
        or environment.get("ROS_IP")
        or ""
    )
    return Arguments(
        name=special.get("__name") or default_name,
        ns=resolve(special.get("__ns") or environment.get("ROS_NAMESPACE") or "/", "/"),
        master_uri=special.get("__master") or environment.get("ROS_MASTER_URI") or DEFAULT_MASTER,
        hostname=hostname,
        log_file=special.get("__log", ""),
        words=words,
        remaps=remaps,
        private=private,
    )


def resolve(name: str, ns: str) -> str:
    """Return the absolute form of a name that is not private."""
    whole = name if name.startswith("/") else f"{ns}/{name}"
    return "/" + "/".join(part for part in whole.split("/") if part)


def upward(name: str, ns: str) -> list[str]:
    """Return the absolute names that a name may have, from its namespace up to the root."""
    if name.startswith("/"):
        return [resolve(name, "/")]
    parts = [part for part in ns.split("/") if part]
    return [resolve(name, "/".join(["", *parts[:count]])) for count in range(len(parts), -1, -1)]


def _plain(text: str) -> Any:
    value: graph_pb2.ParameterValue = parse_value(text)
    return getattr(value, str(value.WhichOneof("kind")))
