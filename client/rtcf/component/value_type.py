"""Types of ports, parameters and states: numbers, bools, enums, and arrays of numbers or bools;
states may also be complex.
"""

import enum
import types
import typing
from dataclasses import dataclass, replace
from typing import Any

import numpy as np


class DeclarationError(Exception):
    """A wrong declaration; the text contains a remedy."""


_PYTHON = {float: np.float64, int: np.int64, bool: np.bool_, complex: np.complex128}
_CPP = {
    "bool": "bool",
    "int8": "std::int8_t",
    "int16": "std::int16_t",
    "int32": "std::int32_t",
    "int64": "std::int64_t",
    "uint8": "std::uint8_t",
    "uint16": "std::uint16_t",
    "uint32": "std::uint32_t",
    "uint64": "std::uint64_t",
    "float32": "float",
    "float64": "double",
}
_LARGEST = 4096  # elements; as many doubles are 32 KiB


@dataclass(frozen=True)
class ValueType:
    """A scalar type of NumPy and a shape; () is a single value."""

    scalar: np.dtype[Any]
    shape: tuple[int, ...] = ()
    enumeration: type[enum.Enum] | None = None
    optional: bool = False  # the value may be None

    @property
    def cpp(self) -> str:
        """Return the C++ type of one element."""
        return _CPP[self.scalar.name]

    @property
    def is_float(self) -> bool:
        """Return True if the elements are floating-point numbers."""
        return self.scalar.kind == "f"

    @property
    def is_complex(self) -> bool:
        """Return True if the elements are complex numbers."""
        return self.scalar.kind == "c"

    @property
    def stored(self) -> "ValueType":
        """Return the type of the same memory in C++: complex numbers are pairs of doubles."""
        return ValueType(np.dtype(np.float64), (2 * self.count,)) if self.is_complex else self

    @property
    def is_bool(self) -> bool:
        """Return True if the elements are bools."""
        return self.scalar.kind == "b"

    @property
    def count(self) -> int:
        """Return the number of elements."""
        return int(np.prod(self.shape, dtype=np.int64))

    def __str__(self) -> str:
        """Return the type as written in a declaration."""
        name = self.enumeration.__name__ if self.enumeration else self.scalar.name
        name += " | None" if self.optional else ""
        return ", ".join([name, *map(str, self.shape)])


def value_type(declared: Any) -> ValueType:
    """Return the type of `X` in `Input[X]`, where X is `type` or `type, size, …`.

    Raises DeclarationError.
    """
    element, *sizes = declared if isinstance(declared, tuple) else (declared,)
    origin: Any = typing.get_origin(element)
    if origin in (typing.Union, types.UnionType):
        others = [each for each in typing.get_args(element) if each is not types.NoneType]
        if len(others) == 1 and len(typing.get_args(element)) == 2:
            return replace(value_type((others[0], *sizes)), optional=True)
    if len(sizes) == 1 and isinstance(sizes[0], tuple):
        sizes = list(sizes[0])
    for size in sizes:
        if not isinstance(size, int) or isinstance(size, bool) or size < 1:
            given = getattr(size, "__name__", repr(size))
            raise DeclarationError(
                f"has the size {given}: use an integer above 0, as in np.float64, 3"
            )
    if len(sizes) > 3:
        raise DeclarationError(f"has {len(sizes)} dimensions: declare one to three sizes")
    if isinstance(element, type) and issubclass(element, enum.Enum):
        if sizes:
            raise DeclarationError("is an array of enums: declare an array of np.int64")
        _check_members(element)
        return ValueType(np.dtype(np.int64), (), element)
    result = ValueType(_scalar(element), tuple(sizes))
    if result.count > _LARGEST:
        raise DeclarationError(f"has {result.count} elements: declare at most {_LARGEST}")
    return result


def is_enum(kind: Any) -> bool:
    """Tell whether a type is an enum of ints."""
    return (
        isinstance(kind, type)
        and issubclass(kind, enum.Enum)
        and not issubclass(kind, enum.Flag)
        and all(type(each.value) is int for each in kind)
    )


def number_of(member: enum.Enum) -> int:
    """Return the number that stands for a member of an enum in the loop."""
    return int(member.value)


def _check_members(enumeration: type[enum.Enum]) -> None:
    name, limits = enumeration.__name__, np.iinfo(np.int64)
    if not list(enumeration):
        raise DeclarationError(f"is an enum {name}, which has no members: write `IDLE = 0` in it")
    if issubclass(enumeration, enum.Flag):
        raise DeclarationError(f"is a set of flags {name}: declare an int, and write int(…)")
    for each in enumeration:
        if not isinstance(each.value, int) or isinstance(each.value, bool):
            raise DeclarationError(
                f"has {name}.{each.name} = {each.value!r}, which is no int: write an int or auto()"
            )
        if not limits.min <= each.value <= limits.max:
            raise DeclarationError(
                f"has {name}.{each.name}, which does not fit 64 bits: use a smaller value"
            )


def _scalar(element: Any) -> np.dtype[Any]:
    if isinstance(element, enum.Enum):
        raise DeclarationError(
            f"has {element} as its type: write its enum, State[{type(element).__name__}]"
        )
    if isinstance(element, type):
        element = _PYTHON.get(element, element)
        if issubclass(element, np.generic) and np.dtype(element).name in (*_CPP, "complex128"):
            return np.dtype(element)
    if element in (list, np.ndarray):
        raise DeclarationError("is an array without element type and size: write np.float64, 3")
    name = getattr(element, "__name__", repr(element))
    raise DeclarationError(
        f"has the unsupported type {name}: use float, int, bool, an enum of ints, or a NumPy type "
        "with a size, such as np.float64, 3"
    )
