"""Component in the interpreter, for tests: its members refer to arrays as in any NumPy program.

Compiled code has one record of all members. Each call of `cycle()` runs one `update()`.
"""

import enum
from dataclasses import dataclass, field
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from rtcf.component.declaration import (
    ASSIGNED,
    LOG_LEVELS,
    TIME_FIELDS,
    Derived,
    Description,
    Input,
    Member,
    MemberAttribute,
    Output,
    Parameter,
    Queue,
    State,
    describe,
    is_constant,
    own_field,
    private_name,
    written_name,
)
from rtcf.component.memory import Memory
from rtcf.component.message_view import MessageView, checked, copy, named, put
from rtcf.component.value_type import ValueType, number_of


class Fault(Exception):
    """Raised by `self.fault(…)`: the loop ends, or continues without an optional component."""


_TIME, _PERIOD = own_field("time"), own_field("period")


class _Value:
    """A value: a Python number, an array or a message."""

    def __init__(self, memory: Memory, member: Member) -> None:
        self._memory, self._record, self._member = memory, memory.record, member

    @property
    def type(self) -> ValueType:
        return self._member.type

    def get(self) -> Any:
        if self._member.message:
            is_output = self._member.kind is Output
            return MessageView(self._memory, self._member.name, self._member.message, is_output)
        if self._member.type.optional and not self._record[self._member.known]:
            return None
        value = self._record[self._member.name]
        if self._member.type.shape and self._member.kind in (Input, Parameter):
            value = value.copy()
            value.flags.writeable = self._member.kind is Input
            return value
        if self._member.type.shape:
            return self._memory.array(self._member.name)
        plain = value.item()
        if plain.__class__ is int and plain >= 2**63:
            raise OverflowError(f"{self._member.name} does not fit int64")
        enumeration = self._member.type.enumeration
        return enumeration(plain) if enumeration else plain

    def put(self, value: Any) -> bool:
        message = self._member.message
        if message:
            return put(self._record, self._member.name, message, value)
        self.set(value)
        return True

    def set(self, value: Any) -> None:
        if self._member.message and isinstance(value, MessageView):
            copy(self._memory, self._member.name, self._member.message, (), value)
            return
        if self._member.message:
            raise TypeError(
                f"{self._member.name} is a {self._member.message.name}: "
                f"set .value.…, then .publish()"
            )
        if self._member.type.optional:
            self._record[self._member.known] = value is not None
            if value is None:
                return
        if self._member.type.enumeration:
            value = number_of(self._member.type.enumeration(value))
        new = checked(value, self._member.type, self._member.name)
        if self._member.kind is Output:
            self._memory.set(self._member.name, new)
        elif self._member.type.shape and self._member.kind in (State, Derived):
            self._memory.bind(self._member.name, new)
        else:
            self._record[self._member.name] = new


class InputPort:
    """An input in the interpreter."""

    def __init__(self, memory: Memory, member: Member) -> None:
        self._value, self._record = _Value(memory, member), memory.record
        self._name = member.name

    @property
    def value(self) -> Any:
        """Return a copy of the newest value; zero if none has been written."""
        return self._value.get()

    @property
    def new(self) -> bool:
        """Return True if a value was written since this component's last update."""
        return bool(self._record[f"{self._name}__new"])

    @property
    def valid(self) -> bool:
        """Return True if a value has been written."""
        return bool(self._record[f"{self._name}__valid"])

    @property
    def connected(self) -> bool:
        """Return True if a component or a topic writes it."""
        return bool(self._record[f"{self._name}__connected"])

    @property
    def age(self) -> int:
        """Return the time since the value was written, ns; -1 without a value."""
        return int(self._record[f"{self._name}__age"])

    def put(self, value: Any) -> None:
        """For tests: write a value, as another component does.

        A message with too many elements is ignored.
        """
        if not self._value.put(named(value, self._value.type, self._name)):
            return
        self._record[f"{self._name}__new"] = self._record[f"{self._name}__valid"] = True
        self._record[f"{self._name}__connected"] = True
        self._record[f"{self._name}__age"] = 0


class QueuePort:
    """A queue in the interpreter."""

    def __init__(self, record: Any, member: Member) -> None:
        self._record, self._member, self._name = record, member, member.name

    @property
    def size(self) -> int:
        """Return the number of messages."""
        return int(self._record[f"{self._name}__count"])

    @property
    def front(self) -> Any:
        """Return the oldest message; raise IndexError if the queue is empty."""
        if self.size == 0:
            raise IndexError("front of an empty queue")
        value = self._record[self._name][self._record[f"{self._name}__oldest"]]
        return value.copy() if self._member.type.shape else value.item()

    @property
    def age(self) -> int:
        """Return the time since the oldest message was written, ns; -1 if the queue is empty."""
        if self.size == 0:
            return -1
        written = self._record[f"{self._name}__times"][self._record[f"{self._name}__oldest"]]
        return max(0, int(self._record[_TIME] - written))

    @property
    def dropped(self) -> int:
        """Return the number of messages that arrived at a full queue."""
        return int(self._record[f"{self._name}__dropped"])

    @property
    def connected(self) -> bool:
        """Return True if a component or a topic writes it."""
        return bool(self._record[f"{self._name}__connected"])

    def pop(self) -> None:
        """Remove the oldest message, if any."""
        if self.size:
            oldest = self._record[f"{self._name}__oldest"] + 1
            self._record[f"{self._name}__oldest"] = oldest % self._member.size
            self._record[f"{self._name}__count"] -= 1

    def put(self, value: Any) -> None:
        """For tests: add a message, as another component does."""
        name, size = self._name, self._member.size
        self._record[f"{name}__connected"] = True
        if self.size == size:
            self._record[f"{name}__dropped"] += 1
            return
        place = (self._record[f"{name}__oldest"] + self._record[f"{name}__count"]) % size
        value = named(value, self._member.type, name)
        self._record[name][place] = checked(value, self._member.type, name)
        self._record[f"{name}__times"][place] = self._record[_TIME]
        self._record[f"{name}__count"] += 1


class OutputPort:
    """An output in the interpreter."""

    def __init__(self, memory: Memory, member: Member, kept: Memory | None = None) -> None:
        """Create the port. `kept` has the value that readers see, if it differs."""
        self._value, self._record = _Value(memory, member), memory.record
        self._name = member.name
        self._seen = self._value if kept is None else _Value(kept, member)

    def write(self, value: Any) -> None:
        """Write a value; readers see it after the hook has returned."""
        self._value.set(value)
        self._record[f"{self._name}__written"] = True

    def publish(self) -> None:
        """Publish `.value`, which the hook has changed in place."""
        self._record[f"{self._name}__written"] = True

    @property
    def value(self) -> Any:
        """Return the newest value. After a cycle, a finite output returns its last finite value."""
        return self._seen.get()

    @property
    def written(self) -> bool:
        """For tests: return True if the output was written in this cycle."""
        return bool(self._record[f"{self._name}__written"])


class _Attribute(MemberAttribute):
    """The attribute of a component that accesses a member."""

    def __init__(self, member: Member) -> None:
        self._member = member

    def __get__(self, component: Any, owner: type) -> Any:
        if component is None:
            return self
        values = _values(component)
        if self._member.kind is Input:
            return InputPort(values.memory, self._member)
        if self._member.kind is Output:
            kept = values.kept if self._member.name in values.not_finite else None
            return OutputPort(values.memory, self._member, kept)
        if self._member.kind is Queue:
            return QueuePort(values.memory.record, self._member)
        return _Value(values.memory, self._member).get()

    def __set__(self, component: Any, value: Any) -> None:
        if self._member.kind in (State, Derived):
            _Value(_values(component).memory, self._member).set(value)
        elif self._member.kind is Parameter:
            raise AttributeError(f"{self._member.name} is a parameter, which hooks cannot set")
        else:
            raise AttributeError(f"{self._member.name} is a port: use .write(…)")


def fresh_record(description: Description) -> Any:
    """Return the record of a new component, whose loop runs at 1 kHz."""
    record = np.zeros((), description.record)
    for member in description.members.values():
        if member.kind is not Queue and not member.message:
            record[member.name] = member.initial
    for name, value in (("period", 1_000_000), ("dt", 1e-3), ("frequency", 1e3)):
        record[own_field(name)] = value
    return record


@dataclass
class _Values:
    """The values of a component. They are no attributes: a member may have any name."""

    memory: Memory
    finite: list[Member]  # outputs declared with finite=True
    kept: Memory  # their last finite values
    not_finite: set[str] = field(default_factory=set)  # outputs whose readers see `kept`

    def keep_finite(self) -> list[str]:
        """Show readers the last finite value of finite outputs; return errors to log."""
        errors = []
        for member in self.finite:
            name = member.name
            fields = [name + leaf.field for leaf in member.leaves]
            record = self.memory.written()
            values = [record[each] for each in fields]
            written = record[f"{name}__written"]
            if not all(np.isfinite(each).all() for each in values):
                self.not_finite.add(name)
                if written:
                    errors.append(f"output {name} is not finite: readers keep its last value")
                    record[f"{name}__written"] = False
            elif written:
                for each, value in zip(fields, values, strict=True):
                    self.kept.set(each, value)
        return errors


_KEY = "values of the interpreter"  # not a name


def _values(component: "Component") -> _Values:
    values: _Values = vars(component)[_KEY]
    return values


def record_of(component: "Component") -> Any:
    """Return the record of a component, which may be changed from outside."""
    return _values(component).memory.whole()


_descriptions: WeakKeyDictionary[type, Description] = WeakKeyDictionary()


class Component:
    """Base class of components in Python. Derived classes declare members and implement hooks."""

    log: list[tuple[str, str]]

    def __init_subclass__(cls, **options: Any) -> None:
        """Rename what is assigned to declarations: instances use their names."""
        super().__init_subclass__(**options)
        for name, annotation in dict(vars(cls).get("__annotations__", {})).items():
            if name in vars(cls) and not is_constant(annotation):
                setattr(cls, ASSIGNED + name, vars(cls)[name])
                delattr(cls, name)

    def __init__(self, **parameters: Any) -> None:
        """Create a component in the interpreter. `parameters` override defaults."""
        description = _descriptions.get(type(self)) or describe(type(self))
        _descriptions[type(self)] = description
        for name, member in description.members.items():
            setattr(type(self), name, _Attribute(member))
        record = fresh_record(description)
        for name in parameters:
            if name not in {member.name for member in description.of(Parameter)}:
                raise TypeError(f"{type(self).__name__} has no parameter {name!r}")
            member = description.members[name]
            _Value(Memory(record), member).set(named(parameters[name], member.type, name))
        finite = [each for each in description.of(Output) if each.options.get("finite")]
        vars(self)[_KEY] = _Values(Memory(record), finite, Memory(record.copy()))
        object.__setattr__(self, "log", [])
        self.prepare()

    @property
    def _record(self) -> Any:
        """For tests: the record, see record_of()."""
        return record_of(self)

    def __setattr__(self, name: str, value: Any) -> None:
        """Set a state or a derived member; raise AttributeError for any other name."""
        if isinstance(found := getattr(type(self), name, None), property):
            if found.fset is not None:
                found.fset(self, value)
                return
            raise AttributeError(
                f"{name} is a read-only property: set the members that it is computed from, "
                f"or write a method: self.set_{name}(…)"
            )
        if not isinstance(getattr(type(self), name, None), _Attribute):
            cls = type(self)
            written = next((each for base in cls.__mro__
                            if (each := written_name(base, name)) != name), name)  # fmt: skip
            own = name if written == name else private_name(written)
            raise AttributeError(
                f"{written} is not declared: write `{own}: State[float]` in class {cls.__name__}"
            )
        object.__setattr__(self, name, value)

    def prepare(self) -> None:
        """Compute Derived members from parameters; not in the real-time thread."""

    def start(self) -> None:
        """Prepare for the start of the loop; not in the real-time thread."""

    def update(self) -> None:
        """Compute one cycle; in the real-time thread."""
        raise NotImplementedError

    def safe(self) -> None:
        """Write safe commands in the component's last cycle; in the real-time thread."""

    def fault(self, text: str) -> None:
        """Raise Fault with a reason: ends this component's part in the loop."""
        raise Fault(text)

    def cycle(self) -> None:
        """For tests: run `update()` once and advance the time by one period."""
        values = _values(self)
        record = values.memory.record
        for name in record.dtype.names:
            if name.endswith("__written"):
                record[name] = False
        values.not_finite.clear()
        self.update()
        self.log.extend(("error", text) for text in values.keep_finite())
        record[own_field("iteration")] += 1
        record[_TIME] += record[_PERIOD]
        for name in record.dtype.names:
            if name.endswith("__new"):
                record[name] = False


def _time(name: str) -> property:
    own = own_field(name)
    return property(lambda self: _values(self).memory.record[own].item(), doc=f"The loop's {name}.")


def _log(level: str) -> Any:
    def log(self: Any, text: str, *values: Any) -> None:
        plain = [each.value if isinstance(each, enum.Enum) else each for each in values]
        try:
            said = text.format(*plain)
        except (LookupError, ValueError):
            if values:
                raise
            said = text  # an f-string whose values have braces
        self.log.append((level, said))

    log.__doc__ = f"Log at level {level}; the text is formatted outside the real-time thread."
    return log


for _each in TIME_FIELDS:
    setattr(Component, _each, _time(_each))
for _each in LOG_LEVELS:
    setattr(Component, _each, _log(_each))
