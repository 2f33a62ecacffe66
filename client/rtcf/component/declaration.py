"""Declarations of a component: ports, parameters and state, as annotations of its class.

A declaration such as `x: Output[np.float64, 2] = Output(unit="rad")` becomes a Member. All members
of a component lie in one NumPy record: compiled code accesses it as a C struct, the interpreter
through views.
"""

import inspect
import linecache
import re
import typing
import unicodedata
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import FunctionType
from typing import Any, ClassVar

import numpy as np

from rtcf.component.message_type import Leaf, MessageType, is_message, message_type
from rtcf.component.ros_name import advice, is_member_name
from rtcf.component.value_type import DeclarationError, ValueType, number_of, value_type

# Fields in the record of every component, in addition to those of its members; see own_field().
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
# A class keeps the value that was assigned to a declaration under another name.
ASSIGNED = "__declared_"
_RESERVED = {*TIME_FIELDS, *HOOKS, "configure", "stop", "cleanup", "fault"}


class MemberAttribute:
    """Base class of the attributes that replace declarations when a class is instantiated."""


@dataclass(frozen=True)
class Declared:
    """A kind and a type, as in `Input[float]`."""

    kind: "type[Declarable]"
    declared: object

    def __getitem__(self, size: object) -> Any:
        """Raise DeclarationError for `State[float][3]`."""
        kind = self.kind.__name__
        raise DeclarationError(f"{kind} has two pairs of brackets: write {kind}[np.float64, 3]")


class Declarable:
    """Base class of Input, Queue, Output, Parameter, State and Derived."""

    allowed: ClassVar[tuple[str, ...]] = ()

    def __class_getitem__(cls, declared: object) -> Any:
        """Return the annotation; describe() checks it with the class."""
        return Declared(cls, declared)

    def __init__(self, initial: Any = None, *others: Any, **options: Any) -> None:
        """Set the initial value, if the kind has one, and the options.

        Raises DeclarationError for an unknown option, or an initial value of a port or of Derived.
        """
        if isinstance(initial, type):
            own, of = _a(type(self)), getattr(initial, "__name__", "float")
            raise DeclarationError(
                f"{own} has its type in its annotation: write name: {type(self).__name__}[{of}]"
            )
        if others:
            names = "=…, ".join(self.allowed)
            raise DeclarationError(
                f"{type(self).__name__} has options without their names: write {names}=…"
            )
        if isinstance(initial, str) and type(self) in PORTS and "unit" in self.allowed:
            raise DeclarationError(
                f"{_a(type(self))} takes options by name: write unit={initial!r}"
            )
        for option in options:
            if option not in self.allowed:
                has = ", ".join(self.allowed)
                raise DeclarationError(
                    f"{type(self).__name__} has no option {option!r}: "
                    f"{f'use {has}' if has else 'remove it'}"
                )
        if initial is not None and type(self) in (*PORTS, Derived):
            raise DeclarationError(f"{_a(type(self))} has no initial value: remove it")
        self.initial = initial
        self.options = options


class Input(Declarable):
    """An input: `self.u.value`, `.new`, `.valid`, `.age` (ns), `.connected`."""

    allowed = ("unit", "doc")


class Queue(Declarable):
    """An input that keeps up to `size` messages, in order: `self.goals.size`, `.front` (the oldest
    message), `.pop()`, `.age` (of the oldest message, ns), `.dropped`, `.connected`.
    """

    allowed = ("size", "unit", "doc")


class Output(Declarable):
    """An output: `self.x.write(value)`, or, for a message, `self.x.value.linear.x = …` followed by
    `self.x.publish()`.

    With `finite=True`, readers never see NaN or infinity. `texts` sets the constant strings of a
    message: `{"header.frame_id": "base"}`.
    """

    allowed = ("unit", "doc", "finite", "texts")


class Parameter(Declarable):
    """A parameter: `self.kp`. Users set it within its bounds; it is constant during a cycle.

    `name` is its name outside the component, and may contain groups: `Parameter(1.0,
    name="gains/p")`. With `fixed=True`, the value does not change after the load: `rtcfctl set`
    rejects another one, and `rtcfctl apply` replaces the component.
    """

    allowed = ("unit", "doc", "min", "max", "name", "fixed")


class State(Declarable):
    """A value that the component keeps from one cycle to the next: `self.integral += …`.

    `_integral` is a private name in the class; outside the component, the state is `integral`.
    With `live=True`, neither `rtcfctl reset` nor `rtcfctl restore` changes it while the loop runs
    in real time: for a latched stop, or the last command of a drive.
    """

    allowed = ("unit", "doc", "live")


class Derived(Declarable):
    """A value that prepare() computes from parameters; it is constant during a cycle."""


PORTS = (Input, Output, Queue)


@dataclass(frozen=True)
class Member:
    """One port, parameter, state or derived member of a class."""

    name: str
    kind: type[Declarable]
    type: ValueType
    initial: np.ndarray[Any, Any]
    options: dict[str, Any]
    line: int
    message: MessageType | None = None  # if set, `type` has no meaning
    is_none: bool = False  # initially

    @property
    def outer_name(self) -> str:
        """Return the name outside the component: `integral` of `_integral`."""
        return self.name.removeprefix("_")

    @property
    def leaves(self) -> tuple[Leaf, ...]:
        """Return the numbers and arrays of numbers in a value."""
        return self.message.leaves if self.message else (Leaf((), self.type),)

    @property
    def elements(self) -> list[str]:
        """Return the names by which a parameter is set; `gain_0`, `gain_1` … for an array."""
        name = str(self.options.get("name") or self.name)
        if not self.type.shape:
            return [name]
        places = np.ndindex(self.type.shape)
        return ["_".join([name, *map(str, place)]) for place in places]

    @property
    def known(self) -> str:
        """Return the name of the bool state that is true if an optional state is not None."""
        return f"{self.name}__known"

    @property
    def size(self) -> int:
        """Return the capacity of a queue, in messages."""
        return int(self.options["size"])


@dataclass
class Description:
    """All declarations of a component class."""

    name: str
    doc: str
    members: dict[str, Member] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)

    def of(self, kind: type[Declarable]) -> list[Member]:
        """Return the members of a kind, in the order of their declarations."""
        return [member for member in self.members.values() if member.kind is kind]

    @property
    def record(self) -> np.dtype[Any]:
        """Return the layout of a component's memory, which is that of a C struct."""
        fields: list[tuple[Any, ...]] = [(own_field("component"), np.int64)]
        fields += [(own_field(name), dtype) for name, dtype in TIME_FIELDS.items()]
        fields.append((own_field("line"), np.int64))
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
        # Must be last: compiled code and the runtime compute its place from the end of the record.
        fields.append((own_field("raised"), np.int64, (2,)))
        return np.dtype(fields, align=True)


def own_field(name: str) -> str:
    """Return the field of the record that belongs to no member; no member begins with `__`."""
    return f"__{name}"


def describe(cls: type) -> Description:
    """Return the declarations of a class, those of its base classes first.

    Raises DeclarationError: a line for each error, with file and line.
    """
    result = Description(cls.__name__, _first_line(cls.__doc__) or cls.__name__)
    errors: list[DeclarationError] = []
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
            written = written_name(base, name)
            line = lines.get(written, 0)
            try:
                member = _member(base, name, annotation, line)
                result.members[name] = member
                if member.type.optional:
                    result.members[member.known] = _known(member)
            except DeclarationError as error:
                errors.append(_at(error, base, line, written))
        for name, value in vars(base).items():
            if name.startswith("__") or name in annotations or callable(value):
                continue
            if isinstance(value, MemberAttribute):
                continue
            if isinstance(value, Declared):
                typed = DeclarationError(
                    f"is set to a type: write `{name}: {value.kind.__name__}[…]`"
                )
                errors.append(_at(typed, base, lines.get(name, 0), name))
                continue
            if isinstance(value, Declarable):
                kind, written = type(value).__name__, written_name(base, name)
                own = written if written == name else private_name(written)
                missing = DeclarationError(f"has no annotation: write `{own}: {kind}[float] = …`")
                errors.append(_at(missing, base, lines.get(written, 0), written))
                continue
            if not isinstance(value, staticmethod | classmethod | property | cached_property):
                result.constants[name] = value
    if errors:
        raise DeclarationError("\n".join(" ".join(str(each).split()) for each in errors))
    states: dict[str, str] = {}
    for member in result.of(State):
        if (other := states.setdefault(member.outer_name, member.name)) != member.name:
            both = DeclarationError(
                f"and {other} are both {member.outer_name} outside the component: rename one"
            )
            raise _at(both, cls, member.line, member.name)
    taken: dict[str, str] = {}
    for member in result.of(Parameter):
        for name in member.elements:
            if (other := taken.setdefault(name, member.name)) != member.name:
                both = DeclarationError(f"and {other} both have a parameter {name}: rename one")
                raise _at(both, cls, member.line, member.name)
    for member in result.of(Parameter):
        groups = _groups(member.elements[0]) if member.elements else []
        if group := next((each for each in groups if each in taken), None):
            both = DeclarationError(
                f"makes {group} a group, which is also a parameter (of {taken[group]}): rename one"
            )
            raise _at(both, cls, member.line, member.name)
    return result


def _member(owner: type, name: str, annotation: object, line: int) -> Member:
    if isinstance(annotation, type) and issubclass(annotation, Declarable):
        raise DeclarationError(f"has no type: write {annotation.__name__}[float]")
    if not isinstance(annotation, Declared):
        raise DeclarationError(
            f"is neither Input, Queue, Output, Parameter, Derived nor State: write {name}: "
            f"State[…] for a value that changes, {name} = … for a constant"
        )
    _check_name(owner, name, annotation.kind)
    kind, message = annotation.kind, _message(annotation)
    declared = ValueType(np.dtype(np.bool_)) if message else value_type(annotation.declared)
    given = vars(owner).get(ASSIGNED + name, vars(owner).get(name))
    if isinstance(given, MemberAttribute):
        given = None
    if isinstance(given, FunctionType):
        raise DeclarationError(f"is {_a(kind)} and also a method: rename one")
    options, initial = {}, None
    if isinstance(given, Declarable):
        if type(given) is not kind:
            raise DeclarationError(
                f"is declared as {kind.__name__} and as {type(given).__name__}: "
                f"write {kind.__name__}(…)"
            )
        options, initial = given.options, given.initial
    elif ASSIGNED + name in vars(owner) and given is None and not declared.optional:
        raise DeclarationError("is None: declare State[float | None], or set a number")
    elif given is not None:
        if kind in (*PORTS, Derived):
            remedy = "set it in prepare" if kind is Derived else "remove the value"
            raise DeclarationError(f"is {_a(kind)}, which has no initial value: {remedy}")
        initial = given
    if len(declared.shape) > 2 and kind not in (State, Derived):
        raise DeclarationError(
            f"has {len(declared.shape)} dimensions, but {_a(kind)} has at most two: "
            f"declare one or two sizes, or a State"
        )
    if declared.optional and kind is not State:
        raise DeclarationError("may be None, but only a State may be None: use .valid of an Input")
    if declared.is_complex and kind not in (State, Derived):
        raise DeclarationError("is complex, as only a State or Derived may be: use two floats")
    if kind is Parameter and initial is None:
        raise DeclarationError(f"has no default: write {name}: Parameter[…] = Parameter(1.0)")
    if kind is Parameter and declared.enumeration and {"min", "max"} & set(options):
        raise DeclarationError("is an enum, which is set by name: remove min and max")
    if kind is Queue:
        _check_size(name, options.get("size"))
    if options.get("texts") is not None:
        _check_texts(message, options["texts"])
    value = _initial(declared, initial)
    if kind is Parameter:
        _check_bounds(value, options)
        _check_path(options.get("name", name))
    for option in ("unit", "doc"):
        if not isinstance(options.get(option, ""), str):
            raise DeclarationError(f"has {option}={options[option]!r}: use a string")
    return Member(
        name, kind, declared, value, options, line, message, declared.optional and initial is None
    )


def _check_name(owner: type, name: str, kind: type[Declarable]) -> None:
    """Raise DeclarationError for a name that a member of this kind cannot have.

    Ports, parameters and states are visible outside the component, Derived members are not.
    """
    written = written_name(owner, name)
    outer = name.removeprefix("_")
    if written.startswith("__"):
        raise DeclarationError(f"begins with two _: write {private_name(written)}")
    if outer != name and kind not in (State, Derived):
        remedy = f"write {outer}" if is_member_name(outer) else "take another name"
        raise DeclarationError(f"is {_a(kind)}, whose name in ROS begins with a letter: {remedy}")
    if not name.isascii() and kind is not Derived:
        raise DeclarationError(f"is not a valid name in ROS (ASCII letters only): {advice(name)}")
    if not outer or "__" in name or (name.isascii() and not is_member_name(outer)):
        raise DeclarationError("is not a valid name: use a letter, then letters, digits, single _")
    if name in _RESERVED:
        raise DeclarationError("is a reserved name: take another name")


def private_name(written: str) -> str:
    """Return the name that a member may have in place of `__x`: `_x`."""
    return f"_{written.strip('_') or 'name'}"


def written_name(owner: type, name: str) -> str:
    """Return an attribute's name as in the source of a class: Python makes `_Observer__x` of
    `self.__x`.
    """
    prefix = f"_{owner.__name__.lstrip('_')}"
    return name.removeprefix(prefix) if name.startswith(f"{prefix}__") else name


def is_constant(annotation: object) -> bool:
    """Return True if an annotation is ClassVar, also if it is a string."""
    if isinstance(annotation, str):
        return "ClassVar" in annotation.partition("[")[0]
    return ClassVar in (annotation, typing.get_origin(annotation))


def _known(member: Member) -> Member:
    """Return the bool state that is true if an optional state is not None."""
    known = ValueType(np.dtype(np.bool_))
    return Member(member.known, State, known, np.array(not member.is_none), {}, member.line)


def _message(annotation: Declared) -> MessageType | None:
    """Return the message type of a port; None if it carries no message.

    `JointState, 7` declares 7 as the largest size of its arrays.
    """
    declared = annotation.declared
    cls, *sizes = declared if isinstance(declared, tuple) else (declared,)
    if not is_message(cls):
        return None
    if annotation.kind not in (Input, Output):
        raise DeclarationError(f"has the message type {cls._type}: declare an Input or an Output")
    if len(sizes) > 1 or not all(type(each) is int and each > 0 for each in sizes):
        raise DeclarationError(
            f"needs one size for all arrays of {cls._type}: write {cls.__name__}, 6"
        )
    return message_type(cls, sizes[0] if sizes else None)


def _check_texts(message: MessageType | None, texts: Any) -> None:
    known = [".".join(each) for each in message.texts] if message else []
    if not isinstance(texts, dict) or not all(each in known for each in texts):
        raise DeclarationError(
            "texts do not match the strings of the message: write {name: string} for names of: "
            f"{', '.join(known) or 'a message'}"
        )


def _groups(path: str) -> list[str]:
    """Return the groups of a parameter: a and a/b for a/b/c."""
    parts = path.split("/")[:-1]
    return ["/".join(parts[: i + 1]) for i in range(len(parts))]


def _check_path(path: Any) -> None:
    if not isinstance(path, str) or not all(map(is_member_name, path.split("/"))):
        raise DeclarationError(
            f"has name={path!r}: use names of letters, digits and _, with / between groups"
        )


def _queue_fields(member: Member) -> list[tuple[Any, ...]]:
    """Return the fields of a queue: the ring of its messages, their times, and its counters."""
    name, size = member.name, member.size
    return [
        (name, member.type.scalar, (size, *member.type.shape)),
        (f"{name}__times", np.int64, (size,)),
        *((f"{name}__{count}", np.int64) for count in ("oldest", "count", "dropped")),
        (f"{name}__connected", np.bool_),
    ]


def _check_size(name: str, size: Any) -> None:
    if size is None:
        raise DeclarationError(f"has no size, in messages: write {name}: Queue[…] = Queue(size=8)")
    if not isinstance(size, int) or isinstance(size, bool) or not 1 <= size <= 1024:
        raise DeclarationError(f"has size={size!r}: use 1 to 1024 messages")


def _a(kind: type) -> str:
    """Return the name of a kind with its article."""
    return f"{'an' if kind.__name__[0] in 'IO' else 'a'} {kind.__name__}"


def _initial(declared: ValueType, given: Any) -> np.ndarray[Any, Any]:
    if given is None:
        if declared.enumeration:
            given = next(each for each in declared.enumeration)
        else:
            return np.zeros(declared.shape, declared.scalar)
    of_enum = declared.enumeration is not None and isinstance(given, declared.enumeration)
    try:
        value = np.asarray(number_of(given) if of_enum else given)
    except ValueError:
        raise DeclarationError("has rows of different lengths: make them equal") from None
    if value.dtype.kind in "USO":
        raise DeclarationError(f"is {_number(declared)}, not {given!r}: use a number")
    numbers = list(map(number_of, declared.enumeration or ()))
    if declared.enumeration and (value.shape != () or value.item() not in numbers):
        names = ", ".join(each.name for each in declared.enumeration)
        enumeration = declared.enumeration.__name__
        raise DeclarationError(
            f"has the value {given!r}, which is not in {enumeration}: use one of {names}"
        )
    if declared.shape and value.shape == ():
        value = np.full(declared.shape, value)
    if value.shape != declared.shape:
        raise DeclarationError(
            f"has shape {declared.shape}, but its value has {value.shape}: make them equal"
        )
    both = value.dtype.kind + declared.scalar.kind
    # Ints of another type are checked below.
    if not np.can_cast(value.dtype, declared.scalar, "same_kind") and set(both) - set("iu"):
        raise DeclarationError(
            f"is {_number(declared)}, but its value is {value.dtype.name}: use {_number(declared)}"
        )
    if value.dtype.kind in "iu" and declared.scalar.kind in "iu":
        limits = np.iinfo(declared.scalar)
        if np.any(value < limits.min) or np.any(value > limits.max):
            raise DeclarationError(
                f"has the value {given}, which does not fit {declared.scalar.name}: "
                f"use {limits.min} to {limits.max}"
            )
    return value.astype(declared.scalar)


def _number(declared: ValueType) -> str:
    """Return the name of a scalar type with its article, Python's name if it has one."""
    name = declared.scalar.name
    names = {"float64": "a float", "int64": "an int", "bool": "a bool", "complex128": "complex"}
    return names.get(name, f"a {name}")


def _check_bounds(initial: Any, options: dict[str, Any]) -> None:
    """Raise DeclarationError for bounds that are not numbers, and for a default outside them."""
    bounds = {each: options[each] for each in ("min", "max") if options.get(each) is not None}
    for name, value in bounds.items():
        if not isinstance(value, int | float | np.number):
            raise DeclarationError(f"has {name}={value!r}: use a number")
    low, high = bounds.get("min", -np.inf), bounds.get("max", np.inf)
    if low > high:
        raise DeclarationError(f"has min={low} above max={high}: exchange them")
    if np.any(initial < low) or np.any(initial > high):
        within = ", ".join(f"{name}={value}" for name, value in bounds.items())
        raise DeclarationError(f"has a default outside {within}: choose a default within")


def _first_line(doc: str | None) -> str:
    return (doc or "").strip().partition("\n")[0].rstrip(".")


@lru_cache(maxsize=256)  # reading the source would take most of the time of describe()
def _lines(cls: type) -> dict[str, int]:
    """Return the source line of each name in a class; empty if there is no source."""
    try:
        source, begin = inspect.getsourcelines(cls)
    except (OSError, TypeError):
        return {}
    found: dict[str, int] = {}
    for number, line in enumerate(source, begin):
        # Python normalises names: the micro sign becomes the Greek letter.
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
