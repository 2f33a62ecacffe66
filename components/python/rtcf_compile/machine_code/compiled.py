"""A compiled component class."""

from dataclasses import dataclass, field
from types import CodeType

from rtcf.component.declaration import Description

from rtcf_compile.machine_code.raises import Raise
from rtcf_compile.rewriting.logs import Logs


@dataclass
class Compiled:
    """A component class as machine code."""

    description: Description
    file: str
    objects: list[bytes]
    hooks: list[str]
    logs: Logs
    used: set[str]
    lines: set[int]
    raises: dict[int, Raise] = field(default_factory=dict)
    line: int = 0  # the line of update
    other_calls: list[tuple[str, int, str, str]] = field(default_factory=list)
    narrow: set[CodeType] = field(default_factory=set)  # see Functions

    def symbol(self, hook: str) -> str:
        """Return the symbol of a hook."""
        return f"rtcf_{self.description.name}_{hook}"
