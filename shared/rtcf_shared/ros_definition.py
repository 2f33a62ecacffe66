"""The fields of a ROS message and of the messages in it, by the text of its definition.

What ROS 1 writes there is told in http://wiki.ros.org/msg.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])?\s+(\w+)\s*$")


@dataclass(frozen=True)
class Field:
    """A field, or an array of such."""

    name: str
    kind: str  # a number, "string", or a message's name with its package
    is_array: bool = False
    length: int | None = None  # of an array; None: any


class Definition:
    """All messages of a definition; the one that it is of has the name ""."""

    def __init__(self, text: str) -> None:
        first, *others = re.split(r"^=+$", text, flags=re.MULTILINE)
        self._texts = {"": first}
        for other in others:
            head, _, body = other.strip().partition("\n")
            self._texts[head.removeprefix("MSG:").strip()] = body

    def fields(self, message: str = "") -> Iterator[Field]:
        """Yield the fields of a message, in order."""
        for line in self._texts[message].splitlines():
            match = _FIELD.match(line.partition("#")[0].strip())
            if match is None:
                continue  # a constant, or nothing
            kind, array, length, name = match.groups()
            full = self._resolve(kind, message.rpartition("/")[0])
            yield Field(name, full, array is not None, int(length) if length else None)

    def _resolve(self, kind: str, package: str) -> str:
        if kind == "Header":
            return "std_msgs/Header"
        if "/" in kind or f"{package}/{kind}" in self._texts:
            return kind if "/" in kind else f"{package}/{kind}"
        return next((name for name in self._texts if name.endswith(f"/{kind}")), kind)
