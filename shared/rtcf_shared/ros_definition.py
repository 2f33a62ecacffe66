"""Parses the definition of a ROS message: its fields, and those of the messages in it.

http://wiki.ros.org/msg describes the format.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])?\s+(\w+)\s*$")


@dataclass(frozen=True)
class Field:
    """A field of a message, possibly an array."""

    name: str
    kind: str  # a number type, "string", or a message type with its package
    is_array: bool = False
    length: int | None = None  # of an array; None = variable


class Definition:
    """All message types of a definition; the defined message itself has the name ""."""

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
                continue  # a constant, a comment or an empty line
            kind, array, length, name = match.groups()
            full = self._resolve(kind, message.rpartition("/")[0])
            yield Field(name, full, array is not None, int(length) if length else None)

    def _resolve(self, kind: str, package: str) -> str:
        if kind == "Header":
            return "std_msgs/Header"
        if "/" in kind or f"{package}/{kind}" in self._texts:
            return kind if "/" in kind else f"{package}/{kind}"
        return next((name for name in self._texts if name.endswith(f"/{kind}")), kind)
