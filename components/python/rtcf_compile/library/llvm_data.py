"""Constants and small functions as LLVM assembly, in the syntax of this Debian release's LLVM.

Every number has 64 bits and every pointer is an i8*, as in tables.hpp.
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass

from rtcf_compile.machine_code import backend

_POINTER = "i8*"


@dataclass(frozen=True)
class Value:
    """A constant and its type."""

    type: str
    text: str

    def __str__(self) -> str:
        """Return the type and the value, as in an aggregate constant."""
        return f"{self.type} {self.text}"


NULL = Value(_POINTER, "null")
Field = Value | int | float | str | None


class Data:
    """Collects the assembly of a module of constants."""

    def __init__(self) -> None:
        """Begin with an empty module."""
        self._lines: list[str] = []
        self._known: dict[tuple[str, str], Value] = {}

    def text(self, text: str) -> Value:
        """Return the address of a text, terminated by a zero byte."""
        # A Python string may contain surrogates, which UTF-8 cannot encode.
        return self.bytes(text.encode(errors="backslashreplace") + b"\0")

    def bytes(self, content: bytes, alignment: int = 1) -> Value:
        """Return the address of bytes."""
        escaped = "".join(f"\\{each:02X}" for each in content)
        return self._constant(f"[{len(content)} x i8]", f'c"{escaped}"', alignment)

    def struct(self, *fields: Field) -> Value:
        """Return a struct of these fields: numbers, texts, or values of this class."""
        values = [self.value(each) for each in fields]
        types = ", ".join(each.type for each in values)
        return Value(f"{{ {types} }}", f"{{ {', '.join(map(str, values))} }}")

    def address(self, value: Value) -> Value:
        """Return the address of a constant."""
        return self._constant(value.type, value.text, 8)

    def array(self, values: Sequence[Value]) -> Value:
        """Return the address of an array of values; null if there are none."""
        if not values:
            return NULL
        items = Value(f"[{len(values)} x {values[0].type}]", f"[ {', '.join(map(str, values))} ]")
        return self.address(items)

    def name(self, name: str, value: Value, linkage: str = "internal") -> Value:
        """Define a named constant; return its address."""
        self.add(f"@{name} = {linkage} constant {value}, align 8")
        return pointer_to(name, value.type)

    def add(self, lines: str) -> None:
        """Add assembly with typed pointers."""
        self._lines.append(lines)

    def value(self, field: Field) -> Value:
        """Return a field as a constant."""
        if isinstance(field, Value):
            return field
        if field is None:
            return NULL
        if isinstance(field, str):
            return self.text(field)
        if isinstance(field, float):
            return Value("double", f"0x{struct.pack('>d', field).hex().upper()}")
        return Value("i64", str(int(field)))

    def assembly(self) -> str:
        """Return the assembly of the module."""
        return backend.pointers("\n".join(self._lines) + "\n")

    def _constant(self, kind: str, text: str, alignment: int) -> Value:
        key = (kind, text)
        if key not in self._known:
            name = f"rtcf_data_{len(self._known)}"
            self._lines.append(f"@{name} = internal constant {kind} {text}, align {alignment}")
            self._known[key] = pointer_to(name, kind)
        return self._known[key]


def pointer_to(name: str, kind: str) -> Value:
    """Return the address of a constant or function of this type."""
    if not backend.POINTERS_HAVE_TYPES or kind == "i8":
        return Value(_POINTER, f"@{name}")
    return Value(_POINTER, f"bitcast ({kind}* @{name} to {_POINTER})")
