"""What a component declares: ports, parameters and state, as annotations of its class.

`x: Output[np.float64, 2] = Output(unit="rad")` is kept as a Member with the layout of all members
as one NumPy record, which compiled code sees as one C struct and the interpreter as views.
"""

import inspect
import linecache
import re
import typing
import unicodedata
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from rtcf.component.message_type import Leaf, MessageType, is_message, message_type
from rtcf.component.ros_name import advice, is_member_name
from rtcf.component.value_type import DeclarationError, ValueType, value_type

# Fields of the record that every component has, beside those of its members.
TIME_FIELDS = {
    "time": np.dtype(np.int64),
    "stamp": np.dtype(np.int64),
    "period": np.dtype(np.int64),
    "iteration": np.dtype(np.int64),
    "dt": np.dtype(np.float64),
    "frequency": np.dtype(np.float64),
}
HOOKS = ("prepare", "start", "update", "safe")
REALTIME_HOOKS = ("update", "safe")  # in the real-time thread
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")
_RESERVED = {*TIME_FIELDS, *HOOKS, *LOG_LEVELS, "configure", "stop", "cleanup", "fault"}


class MemberAttribute:
    """Base of what stands for a member in a class that has been instantiated."""


@dataclass(frozen=True)
class Declared:
    """`Input[float]`: a kind and a type."""

    kind: "type[Declarable]"
    declared: object

    def __getitem__(self, size: object) -> Any:
        """Refuse `State[float][3]`."""
        kind = self.kind.__name__
        raise DeclarationError(f"{kind} has two brackets: write {kind}[np.float64, 3]")


class Declarable:
    """Base of Input, Output, Parameter and State."""

    allowed: ClassVar[tuple[str, ...]] = ()

    def __class_getitem__(cls, declared: object) -> Any:
        """Give the annotation; what it says is looked at with the class."""
        return Declared(cls, declared)

    def __init__(self, initial: Any = None, **options: Any) -> None:
        """Take an initial value, where the kind has one, and options."""
        for option in options:
            if option not in self.allowed:
                has = ", ".join(self.allowed)
                raise DeclarationError(
                    f"{type(self).__name__} knows no option {option!r}: "
                    f"{f'use {has}' if has else 'leave it out'}"
                )
        if initial is not None and type(self) in (*PORTS, Derived):
            raise DeclarationError(f"{_a(type(self))} has no initial value: leave it out")
        self.initial = initial
        self.options = options


class Input(Declarable):
    """An input: `self.u.value`, `.new`, `.valid`, `.age` (ns), `.connected`."""


class Queue(Declarable):
    """An input that keeps up to `size` messages, in order: `self.goals.size`, `.front`, `.pop()`,
    `.age` (ns, of the front one), `.dropped`, `.connected`.
    """

    allowed = ("size",)


class Output(Declarable):
    """An output: `self.x.write(value)`; of a message `self.x.value.linear.x = …`, and then
    `self.x.publish()`. `finite=True` has values checked for NaN and infinity; `texts` are those of
    a message, `{"header.frame_id": "base"}`.
    """

    allowed = ("unit", "finite", "texts")


class Parameter(Declarable):
    """A parameter, constant during a cycle: `self.kp`. Set from outside, within its bounds."""

    allowed = ("unit", "doc", "min", "max")


class State(Declarable):
    """What is remembered from cycle to cycle: `self.integral += …`."""

    allowed = ("unit", "doc")


class Derived(Declarable):
    """What prepare() computes of parameters, and only it sets; constant during a cycle."""


PORTS = (Input, Output, Queue)


@dataclass(frozen=True)
class Member:
    """One port, parameter or state of a class."""

    name: str
    kind: type[Declarable]
    type: ValueType
    initial: np.ndarray[Any, Any]
    options: dict[str, Any]
    line: int
    message: MessageType | None = None  # then `type` says nothing
    is_none: bool = False  # at the beginning

    @property
    def leaves(self) -> tuple[Leaf, ...]:
        """Return the numbers, and arrays of numbers, of a value."""
        return self.message.leaves if self.message else (Leaf((), self.type),)

    @property
    def elements(self) -> list[str]:
        """Return the names by which a parameter is set: those of an array's elements, `gain_0`."""
        if not self.type.shape:
            return [self.name]
        places = np.ndindex(self.type.shape)
        return ["_".join([self.name, *map(str, place)]) for place in places]

    @property
    def known(self) -> str:
        """Return the name of the state that says whether an optional one is not None."""
        return f"{self.name}__known"

    @property
    def size(self) -> int:
        """Return how many messages a queue keeps."""
        return int(self.options["size"])


@dataclass
class Description:
    """All that a component class declares."""

    name: str
    doc: str
    members: dict[str, Member] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)

    def of(self, kind: type[Declarable]) -> list[Member]:
        """Return the members of a kind in order of their declaration."""
        return [member for member in self.members.values() if member.kind is kind]

    @property
    def record(self) -> np.dtype[Any]:
        """Return the layout of a component's memory: that of a C struct."""
        fields: list[tuple[Any, ...]] = [("_component", np.int64)]
        fields += [(f"_{name}", dtype) for name, dtype in TIME_FIELDS.items()]
        fields.append(("_line", np.int64))
        for member in self.members.values():
            if member.kind is Queue:
                fields += _queue_fields(member)
                continue
            for leaf in member.leaves:
                fields.append((member.name + leaf.field, leaf.type.scalar, leaf.type.shape))
                if leaf.is_variable and member.kind is Input:
                    fields.append((member.name + leaf.count, np.int64))
            if member.kind is Input:
                fields.append((f"{member.name}__age", np.int64))
                fields += [
                    (f"{member.name}__{flag}", np.bool_) for flag in ("new", "valid", "connected")
                ]
            elif member.kind is Output:
                fields.append((f"{member.name}__written", np.bool_))
        # Last: compiled code and the runtime find it from the end.
        fields.append(("_raised", np.int64, (2,)))
        return np.dtype(fields, align=True)


def describe(cls: type) -> Description:
    """Return what a class declares, its bases' members first; raise DeclarationError."""
    result = Description(cls.__name__, _first_line(cls.__doc__) or cls.__name__)
    for base in reversed(cls.__mro__):
        if base in (object,) or base.__module__.startswith("rtcf.component"):
            continue
        lines = _lines(base)
        annotations = inspect.get_annotations(base, eval_str=True)
        annotations = {
            name: annotation
            for name, annotation in annotations.items()
            if not is_constant(annotation)
        }
        for name, annotation in annotations.items():
            try:
                member = _member(base, name, annotation, lines.get(name, 0))
                result.members[name] = member
                if member.type.optional:
                    result.members[member.known] = _known(member)
            except DeclarationError as error:
                raise _at(error, base, lines.get(name, 0), name) from None
        for name, value in vars(base).items():
            if name.startswith(("__", "_declared_")) or name in annotations or callable(value):
                continue
            if isinstance(value, MemberAttribute):
                continue
            if isinstance(value, Declarable):
                kind = type(value).__name__
                raise _at(
                    DeclarationError(f"has no annotation: write `{name}: {kind}[float] = …`"),
                    base,
                    lines.get(name, 0),
                    name,
                )
            if not isinstance(value, staticmethod | classmethod | property | cached_property):
                result.constants[name] = value
    taken: dict[str, str] = {}
    for member in result.of(Parameter):
        for name in member.elements:
            if (other := taken.setdefault(name, member.name)) != member.name:
                both = DeclarationError(f"and {other} both have a parameter {name}: rename one")
                raise _at(both, cls, member.line, member.name)
    return result


def _member(owner: type, name: str, annotation: object, line: int) -> Member:
    if isinstance(annotation, type) and issubclass(annotation, Declarable):
        raise DeclarationError(f"says no type: write {annotation.__name__}[float]")
    if not isinstance(annotation, Declared):
        raise DeclarationError(
            f"is neither Input, Queue, Output, Parameter, Derived nor State: write {name}: "
            f"State[…] for a value that is kept, {name} = … for a constant"
        )
    # Derived members have no name outside the component.
    if not name.isascii() and annotation.kind is not Derived:
        raise DeclarationError(f"is no name in ROS, which has ASCII letters alone: {advice(name)}")
    if "__" in name or name.startswith("_") or (name.isascii() and not is_member_name(name)):
        raise DeclarationError("is no name: use a letter, then letters, digits and single _")
    if name in _RESERVED:
        raise DeclarationError("is a word that every component has: take another name")
    kind, message = annotation.kind, _message(annotation)
    declared = ValueType(np.dtype(np.bool_)) if message else value_type(annotation.declared)
    given = vars(owner).get(f"_declared_{name}", vars(owner).get(name))
    if isinstance(given, MemberAttribute):
        given = None
    options, initial = {}, None
    if isinstance(given, Declarable):
        if type(given) is not kind:
            raise DeclarationError(
                f"is declared as {kind.__name__} and as {type(given).__name__}: "
                f"write {kind.__name__}(…)"
            )
        options, initial = given.options, given.initial
    elif f"_declared_{name}" in vars(owner) and given is None and not declared.optional:
        raise DeclarationError("is None: declare State[float | None], or give it a number")
    elif given is not None:
        if kind in (*PORTS, Derived):
            way_out = "set it in prepare" if kind is Derived else "leave the value out"
            raise DeclarationError(f"is {_a(kind)} and has no initial value: {way_out}")
        initial = given
    if declared.optional and kind is not State:
        raise DeclarationError("may be None, as a State alone may: use .valid of an Input")
    if kind is Parameter and initial is None:
        raise DeclarationError(f"has no default: write {name}: Parameter[…] = Parameter(1.0)")
    if kind is Parameter and declared.enumeration and {"min", "max"} & set(options):
        raise DeclarationError("is an enum, which is set by name: leave min and max out")
    if kind is Queue:
        _check_size(name, options.get("size"))
    if kind is Parameter and declared.shape and declared.is_bool:
        raise DeclarationError("is an array of bools: declare single ones, or an array of ints")
    if options.get("texts") is not None:
        _check_texts(message, options["texts"])
    value = _initial(declared, initial)
    if kind is Parameter:
        _check_bounds(value, options)
    for option in ("unit", "doc"):
        if not isinstance(options.get(option, ""), str):
            raise DeclarationError(f"has {option}={options[option]!r}: give it a text")
    return Member(
        name, kind, declared, value, options, line, message, declared.optional and initial is None
    )


def is_constant(annotation: object) -> bool:
    """Tell whether an annotation is ClassVar, as it is or as text."""
    if isinstance(annotation, str):
        return "ClassVar" in annotation.partition("[")[0]
    return ClassVar in (annotation, typing.get_origin(annotation))


def _known(member: Member) -> Member:
    """Return the state that says whether another one is not None."""
    known = ValueType(np.dtype(np.bool_))
    return Member(member.known, State, known, np.array(not member.is_none), {}, member.line)


def _message(annotation: Declared) -> MessageType | None:
    """Return the message type of a port; `JointState, 7` says the size of its arrays."""
    declared = annotation.declared
    cls, *sizes = declared if isinstance(declared, tuple) else (declared,)
    if not is_message(cls):
        return None
    if annotation.kind not in (Input, Output):
        raise DeclarationError(
            f"{cls._type}: a message is carried by an Input or an Output: declare one"
        )
    if len(sizes) > 1 or not all(type(each) is int and each > 0 for each in sizes):
        raise DeclarationError(
            f"{cls._type} takes one size, of all its arrays: write {cls.__name__}, 6"
        )
    return message_type(cls, sizes[0] if sizes else None)


def _check_texts(message: MessageType | None, texts: Any) -> None:
    known = [".".join(each) for each in message.texts] if message else []
    if not isinstance(texts, dict) or not all(each in known for each in texts):
        raise DeclarationError(
            "texts are not of this message: give {name: text} of: "
            f"{', '.join(known) or 'a message'}"
        )


def _queue_fields(member: Member) -> list[tuple[Any, ...]]:
    """Return a ring of messages, when each was written, and how many of them count."""
    name, size = member.name, member.size
    return [
        (name, member.type.scalar, (size, *member.type.shape)),
        (f"{name}__times", np.int64, (size,)),
        *((f"{name}__{count}", np.int64) for count in ("oldest", "count", "dropped")),
        (f"{name}__connected", np.bool_),
    ]


def _check_size(name: str, size: Any) -> None:
    if size is None:
        raise DeclarationError(
            f"says not how many it keeps: write {name}: Queue[…] = Queue(size=8)"
        )
    if not isinstance(size, int) or isinstance(size, bool) or not 1 <= size <= 1024:
        raise DeclarationError(f"keeps 1 to 1024 messages, not {size!r}: give a size within")


def _a(kind: type) -> str:
    """Return the kind with its article."""
    return f"{'an' if kind.__name__[0] in 'IO' else 'a'} {kind.__name__}"


def _initial(declared: ValueType, given: Any) -> np.ndarray[Any, Any]:
    if given is None:
        if declared.enumeration:
            given = next(each for each in declared.enumeration)
        else:
            return np.zeros(declared.shape, declared.scalar)
    try:
        value = np.asarray(given)
    except ValueError:
        raise DeclarationError("has rows of different length: make them fit") from None
    if value.dtype.kind in "USO":
        raise DeclarationError(f"is {_number(declared)}, not {given!r}: give it a number")
    if declared.enumeration and value not in list(declared.enumeration):
        names = ", ".join(each.name for each in declared.enumeration)
        enumeration = declared.enumeration.__name__
        raise DeclarationError(f"{given!r} is no {enumeration}: use one of {names}")
    if declared.shape and value.shape == ():
        value = np.full(declared.shape, value)
    if value.shape != declared.shape:
        raise DeclarationError(
            f"has shape {declared.shape}, its value {value.shape}: make them the same"
        )
    if not np.can_cast(value.dtype, declared.scalar, "same_kind"):
        raise DeclarationError(
            f"is {_number(declared)}, its value {value.dtype.name}: give it {_number(declared)}"
        )
    if value.dtype.kind in "iu" and declared.scalar.kind in "iu":
        limits = np.iinfo(declared.scalar)
        if np.any(value < limits.min) or np.any(value > limits.max):
            raise DeclarationError(
                f"{given} does not fit {declared.scalar.name}: use {limits.min} to {limits.max}"
            )
    return value.astype(declared.scalar)


def _number(declared: ValueType) -> str:
    """Return a type of numbers in words, as Python's where it is one."""
    name = declared.scalar.name
    return {"float64": "a float", "int64": "an int", "bool": "a bool"}.get(name, f"a {name}")


def _check_bounds(initial: Any, options: dict[str, Any]) -> None:
    """Refuse bounds that are no numbers, and a default outside them."""
    bounds = {each: options[each] for each in ("min", "max") if options.get(each) is not None}
    for name, value in bounds.items():
        if not isinstance(value, int | float | np.number):
            raise DeclarationError(f"has {name}={value!r}: give it a number")
    low, high = bounds.get("min", -np.inf), bounds.get("max", np.inf)
    if low > high:
        raise DeclarationError(f"has min={low} above max={high}: exchange them")
    if np.any(initial < low) or np.any(initial > high):
        within = ", ".join(f"{name}={value}" for name, value in bounds.items())
        raise DeclarationError(f"has a default outside {within}: choose one within")


def _first_line(doc: str | None) -> str:
    return (doc or "").strip().partition("\n")[0].rstrip(".")


def _lines(cls: type) -> dict[str, int]:
    """Return the lines of a class's names, as far as its source is there."""
    try:
        source, begin = inspect.getsourcelines(cls)
    except (OSError, TypeError):
        return {}
    found: dict[str, int] = {}
    for number, line in enumerate(source, begin):
        # As Python has names: the sign of micro is the Greek letter.
        if match := re.match(r"\s+(\w+)\s*[:=]", unicodedata.normalize("NFKC", line)):
            found.setdefault(match[1], number)
    return found


def _at(error: DeclarationError, cls: type, line: int, name: str) -> DeclarationError:
    try:
        file = inspect.getsourcefile(cls) or "?"
    except TypeError:
        file = "?"
    source = linecache.getline(file, line).partition(" #")[0].strip()
    text = f"`{source}`: " if source else ""
    return DeclarationError(f"{file}:{line}: {text}{cls.__name__}.{name} {error}")
