"""The log calls of a component: their texts and the types of their arguments."""

import ast
import string
from dataclasses import dataclass, field

from rtcf_compile.source.mistake import at
from rtcf_compile.source.modules import Source


@dataclass
class LogCall:
    """A log call in the source."""

    level: str
    text: str
    file: str
    line: int
    function: str
    count: int
    types: list[str] = field(default_factory=list)  # scalar types, set when the call is compiled


class Logs:
    """The log calls of a component class, by number."""

    def __init__(self, component: str) -> None:
        """Create an empty list for the component class of this name."""
        self.component = component
        self.calls: list[LogCall] = []

    def add(self, level: str, node: ast.Call, source: Source) -> int:
        """Add a call; return its number."""
        text = node.args[0] if node.args else None
        if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
            raise at(
                source.file,
                node,
                "a log call needs a constant text",
                f'write self.{level}("x {{}}", x)',
            )
        if node.keywords:
            raise at(source.file, node, "a log call takes no named arguments", "give them in order")
        count = len(node.args) - 1
        if count > 8:
            raise at(source.file, node, "has more than 8 arguments", "write two calls")
        self.calls.append(
            LogCall(level, text.value, source.file, node.lineno, source.tree.name, count)
        )
        return len(self.calls) - 1

    def symbol(self, number: int) -> str:
        """Return the symbol of the C function for a call."""
        return f"rtcf_log_{self.component}_{number}"


def with_name(text: str, number: int, name: str) -> str | None:
    """Return a format with one {} replaced by a name; None if fields are numbered or named."""
    result, place = "", 0
    try:
        parts = list(string.Formatter().parse(text))
    except ValueError:
        return None
    for literal, field_name, form, conversion in parts:
        result += literal.replace("{", "{{").replace("}", "}}")
        if field_name is None:
            continue
        if field_name or conversion not in (None, "s"):
            return None
        if place == number:
            result += format(name, form or "").replace("{", "{{").replace("}", "}}")
        else:
            result += (
                "{" + (f"!{conversion}" if conversion else "") + (f":{form}" if form else "") + "}"
            )
        place += 1
    return result if place > number else None
