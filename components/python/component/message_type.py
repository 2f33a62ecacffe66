"""ROS messages as ports carry them: each number in them is a field of the component's record.

Arrays of variable size have a largest size, which the port declares: `Input[JointState, 7]`. Texts
are not touched in the cycle: on an output they are constant.
"""

import importlib
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from rtcf.component.value_type import DeclarationError, ValueType

_SCALARS = {
    **{f"{sign}int{bits}": f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)},
    "float32": "float32",
    "float64": "float64",
    "bool": "bool",
    "byte": "int8",
    "char": "uint8",
}
_TIMES = ("time", "duration")  # as int64, ns
_LARGEST = 4096  # elements


@dataclass(frozen=True)
class Leaf:
    """A number of a message, or an array of them; all of a member that is no message."""

    path: tuple[str, ...]
    type: ValueType
    is_time: bool = False
    is_variable: bool = False  # the type's size is the largest

    @property
    def field(self) -> str:
        """Return its name in the record, behind the member's: nothing if it is all of it."""
        return f"__value__{'__'.join(self.path)}" if self.path else ""

    @property
    def count(self) -> str:
        """Return the name of the field that has how many elements there are."""
        return f"{self.field}__count"


@dataclass(frozen=True)
class MessageType:
    """A message: what of it is numbers, what is text, and what is not compiled."""

    name: str
    leaves: tuple[Leaf, ...]
    texts: tuple[tuple[str, ...], ...]
    others: tuple[tuple[str, ...], ...]
    md5: str = ""
    parts: tuple[tuple[tuple[str, ...], str], ...] = ()  # messages in it, by their types

    @property
    def cpp(self) -> str:
        """Return the C++ type."""
        return self.name.replace("/", "::")

    def leaf(self, path: tuple[str, ...]) -> Leaf | None:
        """Return what is at a path, or None if it is no number."""
        return next((each for each in self.leaves if each.path == path), None)

    def type_of(self, path: tuple[str, ...]) -> str | None:
        """Return the message type of a part; None for numbers and texts."""
        return dict(self.parts).get(path) if path else self.name

    def pairs(
        self, path: tuple[str, ...], other: "MessageType", place: tuple[str, ...]
    ) -> list[tuple[Leaf, Leaf]]:
        """Return the numbers of a part beside those of another message's, from which they are
        copied. Raise TypeError if that cannot be.
        """
        mine, theirs = self.type_of(path), other.type_of(place)
        if mine is None or mine != theirs:
            raise TypeError(f"{mine or '.'.join(path)} is not {theirs or '.'.join(place)}")
        for each in (*self.texts, *self.others):
            if each[: len(path)] == path:
                raise TypeError(f"{'.'.join(each)} is not copied in the cycle")
        found = []
        for leaf in self.leaves:
            if leaf.path[: len(path)] == path:
                source = other.leaf((*place, *leaf.path[len(path) :]))
                assert source is not None
                found.append((leaf, source))
        return found

    def below(self, path: tuple[str, ...]) -> list[str]:
        """Return the names that follow a path."""
        paths = [each.path for each in self.leaves]
        return list(
            dict.fromkeys(
                each[len(path)]
                for each in (*paths, *self.texts, *self.others)
                if each[: len(path)] == path and len(each) > len(path)
            )
        )


def is_message(declared: Any) -> bool:
    """Tell whether it is a message class as genpy makes them."""
    return isinstance(declared, type) and hasattr(declared, "_slot_types")


def message_type(cls: Any, size: int | None) -> MessageType:
    """Return what a message class has; `size` is that of its arrays of variable size."""
    leaves: list[Leaf] = []
    texts: list[tuple[str, ...]] = []
    others: list[tuple[str, ...]] = []
    parts: list[tuple[tuple[str, ...], str]] = []
    _collect(cls, (), size, leaves, texts, others, parts)
    if size is not None and not any(each.is_variable for each in leaves):
        raise DeclarationError(f"{cls._type} has no array of variable size: declare no size")
    if sum(each.type.count for each in leaves) > _LARGEST:
        raise DeclarationError(f"{cls._type} has more than {_LARGEST} elements: declare fewer")
    return MessageType(
        cls._type, tuple(leaves), tuple(texts), tuple(others), cls._md5sum, tuple(parts)
    )


def _collect(
    cls: Any,
    path: tuple[str, ...],
    size: int | None,
    leaves: list[Leaf],
    texts: list[tuple[str, ...]],
    others: list[tuple[str, ...]],
    parts: list[tuple[tuple[str, ...], str]],
) -> None:
    for name, declared in zip(cls.__slots__, cls._slot_types, strict=True):
        here = (*path, name)
        found = re.fullmatch(r"([\w/]+)(?:\[(\d*)\])?", declared)
        assert found is not None, declared
        element, length = found[1], found[2]
        if element == "string":
            texts.append(here)
        elif element in _TIMES and length is None:
            leaves.append(Leaf(here, ValueType(np.dtype(np.int64)), is_time=True))
        elif element in _SCALARS:
            scalar = np.dtype(_SCALARS[element])
            if length is None:
                leaves.append(Leaf(here, ValueType(scalar)))
            elif length:
                leaves.append(Leaf(here, ValueType(scalar, (int(length),))))
            elif size is None:
                raise DeclarationError(
                    f"{cls._type} has {'.'.join(here)} of any size: declare the largest, "
                    f"as {cls.__name__}, 6"
                )
            else:
                leaves.append(Leaf(here, ValueType(scalar, (size,)), is_variable=True))
        elif length is not None:
            others.append(here)  # a list of messages
        else:
            parts.append((here, element))
            _collect(_class_of(element), here, size, leaves, texts, others, parts)


def _class_of(name: str) -> Any:
    package, _, message = name.partition("/")
    return getattr(importlib.import_module(f"{package}.msg"), message)
