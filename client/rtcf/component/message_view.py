"""Access to a port's message in the interpreter, `self.twist.value.linear.x`, in the record."""

import operator
from typing import Any

import numpy as np

from rtcf.component.memory import Memory
from rtcf.component.message_type import MessageType
from rtcf.component.value_type import ValueType


class MessageView:
    """A message, or a part of one."""

    __slots__ = ("_is_output", "_memory", "_message", "_path", "_port")

    def __init__(
        self, memory: Memory, port: str, message: MessageType, is_output: bool, path: Any = ()
    ) -> None:
        """Create a view of a port's message, or of the part at a path."""
        for name, value in (
            ("_memory", memory),
            ("_port", port),
            ("_message", message),
            ("_is_output", is_output),
            ("_path", path),
        ):
            object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        """Return a number, an array or a nested message."""
        path = (*self._path, name)
        leaf = self._message.leaf(path)
        if leaf is None:
            if not self._message.below(path):
                raise AttributeError(f"{self._message.name} has no number {'.'.join(path)}")
            return MessageView(self._memory, self._port, self._message, self._is_output, path)
        if leaf.type.shape and self._is_output:
            return self._memory.array(self._port + leaf.field)
        value = self._memory.record[self._port + leaf.field]
        if leaf.is_variable:
            value = value[: self._memory.record[self._port + leaf.count]]
        return value.copy() if leaf.type.shape else value.item()

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a number, an array or a nested message of an output."""
        path = (*self._path, name)
        leaf = self._message.leaf(path)
        if not self._is_output:
            raise AttributeError(f"{self._port} is an input, which is read-only")
        if leaf is None and isinstance(value, MessageView):
            copy(self._memory, self._port, self._message, path, value)
            return
        if leaf is None:
            raise AttributeError(f"{self._message.name} has no number {'.'.join(path)}")
        self._memory.set(self._port + leaf.field, checked(value, leaf.type, ".".join(path)))


def copy(memory: Memory, port: str, message: MessageType, path: Any, source: MessageView) -> None:
    """Copy a message to an output's message, or to a part of it.

    Raises TypeError as MessageType.pairs() does.
    """
    for leaf, theirs in message.pairs(path, source._message, source._path):
        value: Any = source
        for name in theirs.path[len(source._path) :]:
            value = getattr(value, name)
        memory.set(port + leaf.field, checked(value, leaf.type, ".".join(leaf.path)))


def put(record: Any, port: str, message: MessageType, given: Any) -> bool:
    """For tests: write a message to an input; return False if it has too many elements."""
    found = {}
    for leaf in message.leaves:
        value = operator.attrgetter(".".join(leaf.path))(given)
        if leaf.is_time:
            value = value.to_nsec()
        if isinstance(value, bytes):
            value = np.frombuffer(value, np.uint8)
        if leaf.is_variable and len(value) > leaf.type.count:
            return False
        found[leaf] = value
    for leaf, value in found.items():
        if leaf.is_variable:
            record[port + leaf.field][: len(value)] = value
            record[port + leaf.count] = len(value)
        else:
            record[port + leaf.field] = value
    return True


def named(value: Any, kind: ValueType, name: str) -> Any:
    """Return a value that a test sets; names of enumerators become their values.

    Raises ValueError if the enum does not have the name or value.
    """
    if kind.enumeration is None:
        return value
    known = ", ".join(each.name for each in kind.enumeration)
    try:
        return kind.enumeration[value] if isinstance(value, str) else kind.enumeration(value)
    except (KeyError, ValueError):
        raise ValueError(f"{name} is {value!r}, which is none of {known}") from None


def checked(value: Any, kind: ValueType, name: str) -> Any:
    """Return a value as an array or scalar of a type.

    Raises ValueError for another shape, TypeError for another type, OverflowError for an int beyond
    64 bits.
    """
    new = np.asarray(value)
    if new.shape not in (kind.shape, ()):
        raise ValueError(f"{name} has shape {kind.shape}, not {new.shape}")
    scalar = kind.scalar
    if (
        (new.dtype.kind == "f" and scalar.kind not in "fc")
        or (new.dtype.kind == "c" and scalar.kind != "c")
        or ((new.dtype.kind == "b") != (scalar.kind == "b"))
    ):
        raise TypeError(f"{name} is {scalar.name}, not {new.dtype.name}")
    if new.dtype.kind == "O":
        raise OverflowError(f"{name} is {scalar.name}: {value} does not fit")
    return new
