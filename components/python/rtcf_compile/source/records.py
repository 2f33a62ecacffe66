"""NamedTuples and dataclasses of the user: their fields, methods and constants.

Their objects are compiled as objects whose class is known by their type, see
machine_code/object_types.py.
"""

import abc
import collections
import dataclasses
import enum
import inspect
import keyword
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import FunctionType, MemberDescriptorType
from typing import Any

import numpy as np
from rtcf.component import Component

from rtcf_compile.source.parsed import is_of_user

# The values to which names in rewritten functions refer: classes, their attributes, and defaults.
NAMED: dict[str, Any] = {}
# Special methods without an effect on the results of a compiled program.
_HARMLESS = {"__repr__", "__str__", "__format__"}
_REASONS = {
    "__post_init__": "its fields are computed by __post_init__: compute them in a function",
    "__init__": "it has an __init__ of its own: let @dataclass write it",
    "__new__": "it has a __new__ of its own: write a function that makes the object",
    "__eq__": "it has an __eq__ of its own: write a method, such as is_near",
}
# Special methods that mean something else in a class with its own.
_OPERATORS = {
    *("__eq__", "__ne__", "__lt__", "__le__", "__gt__", "__ge__", "__bool__", "__len__"),
    *("__getitem__", "__iter__", "__contains__", "__call__", "__getattr__", "__getattribute__"),
}
_CONSTANTS = (bool, int, float, np.generic, enum.Enum, tuple)
_FIELD_OF_TUPLE = type(vars(collections.namedtuple("_One", "x"))["x"])


@dataclass(frozen=True, eq=False)
class Record:
    """A class whose objects are compiled."""

    cls: type
    # A name that no other class has.
    name: str
    fields: tuple[str, ...]
    defaults: Mapping[str, Any]
    # Methods, static methods, and the getters of properties.
    methods: Mapping[str, FunctionType]
    static_methods: Mapping[str, FunctionType]
    properties: Mapping[str, FunctionType]
    constants: Mapping[str, Any]
    # Whether objects are tuples, too, and whether == compares all fields.
    is_tuple: bool
    is_compared: bool
    # Whether < orders objects by all fields.
    is_ordered: bool

    def has(self, name: str) -> bool:
        """Tell whether objects have this attribute."""
        return self.meaning(name) is not None

    def meaning(self, name: str) -> object:
        """Return what tells an attribute from one of the same name in another class: the place of
        a field, the function of a method, the value of a constant; the class for no name.
        """
        if not name:
            return self.cls
        if name in self.fields:
            return self.fields.index(name)
        if name in self.constants:
            return type(self.constants[name]), repr(self.constants[name])
        return self.function(name) or self.properties.get(name)

    def function(self, name: str) -> FunctionType | None:
        """Return a method or a static method, or None."""
        return self.methods.get(name) or self.static_methods.get(name)

    def names(self) -> list[str]:
        """Return the names of all attributes."""
        parts = (self.fields, self.methods, self.static_methods, self.properties, self.constants)
        return [name for each in parts for name in each]

    def description(self) -> object:
        """Return all that decides how objects are compiled, besides functions."""
        classes = [
            (each.__module__, each.__qualname__, sorted(vars(each)))
            for each in self.cls.__mro__
            if is_of_user(each)
        ]
        kinds = self.is_tuple, self.is_compared, self.is_ordered
        meanings = [(name, _described(self.meaning(name))) for name in self.names()]
        return self.name, self.fields, kinds, classes, meanings


@dataclass(frozen=True)
class Meaning:
    """An attribute of a class: objects of other classes may have another one of this name.

    Without a name: the class itself.
    """

    record: Record
    attribute: str

    @property
    def name(self) -> str:
        """Return a name that no other attribute has."""
        return f"{self.record.name}.{self.attribute}"

    @property
    def kind(self) -> str:
        """Return the kind of the attribute, for messages."""
        if self.record.function(self.attribute) is not None:
            return "method"
        return "property" if self.attribute in self.record.properties else "field"

    @property
    def gives_fields(self) -> bool:
        """Tell whether the fields are taken from the object, else the object itself."""
        return not self.attribute or self.attribute in self.record.fields


@dataclass(frozen=True)
class Arranged:
    """A class, and for each of its fields the place of its value among those that are given."""

    record: Record
    places: tuple[int, ...]
    # The places of fields that are set to constant ints that are exact as floats.
    small: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """Return a name that no other class or arrangement has."""
        parts = [*map(str, self.places), "of", *map(str, self.small)]
        return f"{self.record.name}_{'_'.join(parts)}"

    @staticmethod
    def plain(record: Record, small: Iterable[int] = ()) -> "Arranged":
        """Return a class whose values are given in the order of its fields."""
        return Arranged(record, tuple(range(len(record.fields))), tuple(sorted(small)))


class Object(tuple[Any, ...]):
    """A constant object, as the tuple of its fields."""

    record: Record

    @staticmethod
    def of(record: Record, fields: Iterable[Any]) -> "Object":
        """Make the constant."""
        made = Object(fields)
        made.record = record
        return made


@dataclass(frozen=True)
class Unknown:
    """A field of a constant object that is not compiled, such as a dict."""

    cls: type


def record_of(cls: Any) -> Record | None:
    """Return the record of a NamedTuple or dataclass of the user; None for another class.

    A class with operators, or with code of its own to make objects, is another class.
    """
    if isinstance(cls, type) and cls not in _records:
        _records[cls] = _record(cls) if is_plain(cls) and not why_not(cls) else None
    return _records.get(cls) if isinstance(cls, type) else None


def _record(cls: Any) -> Record:
    if issubclass(cls, tuple):
        names, defaults = cls._fields, cls._field_defaults
        is_compared = is_ordered = True
    else:
        known = dataclasses.fields(cls)
        missing = dataclasses.MISSING
        names = tuple(each.name for each in known)
        defaults = {each.name: each.default for each in known if each.default is not missing}
        options = cls.__dataclass_params__
        is_compared = options.eq and all(each.compare for each in known)
        is_ordered = is_compared and options.order
    empty: dict[str, Any] = {}
    constants: dict[str, Any] = {}
    found: dict[type, dict[str, Any]] = {}
    for name in sorted(_own_names(cls) - set(names)):
        value = inspect.getattr_static(cls, name)
        function = {property: "fget", staticmethod: "__func__"}.get(type(value), "")
        of = getattr(value, function) if function else value
        if isinstance(of, FunctionType) and not _is_of_python(of):
            found.setdefault(type(value), {})[name] = of
        elif not name.startswith("_") and isinstance(value, _CONSTANTS):
            constants[name] = value
    name = unique("".join(each if each.isalnum() else "_" for each in cls.__qualname__), cls)
    return Record(
        cls, name, tuple(names), defaults, found.get(FunctionType, empty),
        found.get(staticmethod, empty), found.get(property, empty), constants,
        issubclass(cls, tuple), is_compared, is_ordered,
    )  # fmt: skip


def is_plain(cls: Any) -> bool:
    """Tell whether this is a NamedTuple or a dataclass of the user."""
    if not isinstance(cls, type) or not is_of_user(cls) or issubclass(cls, Component):
        return False
    if cls.__module__.partition(".")[0] in ("rtcf", "rtcf_compile"):
        return False
    return dataclasses.is_dataclass(cls) or (
        issubclass(cls, tuple) and hasattr(cls, "_field_defaults")
    )


def why_not(cls: type) -> str:
    """Return why the objects of a NamedTuple or dataclass are not compiled, and what to write
    instead; "" for others.
    """
    for name in sorted(_own_names(cls)):
        value = inspect.getattr_static(cls, name)
        is_written = isinstance(value, FunctionType) and not _is_of_python(value)
        if not name.startswith("__") or name in _HARMLESS:
            continue
        is_taken = name in _OPERATORS and not isinstance(value, FunctionType)
        if is_written or is_taken:
            return _REASONS.get(name, f"it has {name}: write a method, such as plus")
    if type(cls) not in (type, abc.ABCMeta):
        return "it has a metaclass: write a plain class"
    if issubclass(cls, tuple):
        fields = cls._fields  # type: ignore[attr-defined]
    else:
        known = cls.__dataclass_fields__.values()  # type: ignore[attr-defined]
        for each in known:
            if each._field_type is dataclasses._FIELD_INITVAR:  # type: ignore[attr-defined]
                return f"{each.name} is an InitVar: make the object in a function"
        fields = [each.name for each in dataclasses.fields(cls)]
        for each in dataclasses.fields(cls):
            if each.default_factory is not dataclasses.MISSING:
                return f"{each.name} has a default_factory: give it a value in each call"
            if not each.init:
                return f"{each.name} has init=False: give it a value in each call"
            if each.kw_only:
                return "its fields are keyword-only: remove kw_only=True"
    for name in fields:
        value = inspect.getattr_static(cls, name, None)
        is_own = isinstance(value, _FIELD_OF_TUPLE | MemberDescriptorType)
        if not is_own and (issubclass(cls, tuple) or hasattr(value, "__get__")):
            return f"{name} is a field, and a {type(value).__name__}: give one another name"
    return ""


def as_tuple(value: Any) -> Any:
    """Return the tuple for an object of such a class, other values as they are."""
    if isinstance(value, Object):
        return tuple(value)
    record = None if isinstance(value, type) else record_of(type(value))
    return value if record is None else tuple(getattr(value, each) for each in record.fields)


def unique(plain: str, of: Any) -> str:
    """Return a name for a value that no other value has."""
    name, number = plain, 1
    while _names.setdefault(name, of) is not of or keyword.iskeyword(name):
        number += 1
        name = f"{plain}_{number}"
    return name


_names: dict[str, Any] = {}
_records: dict[type, Record | None] = {}


def named(meaning: str, value: Any) -> str:
    """Return the name by which rewritten functions refer to a value."""
    name = unique(meaning, value)
    NAMED[name] = value
    return name


def alike(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return constants with the ints of a field as floats where it is a float in another object."""
    if len(values) < 2 or not all(isinstance(each, Object) for each in values):
        return values
    if len({each.record for each in values}) > 1:
        return values
    columns = []
    for column in zip(*values, strict=True):
        is_mixed = {type(each) for each in column} == {int, float}
        if is_mixed and all(is_small(each) for each in column if type(each) is int):
            column = tuple(map(float, column))
        columns.append(column)
    return tuple(Object.of(values[0].record, each) for each in zip(*columns, strict=True))


def is_small(value: int) -> bool:
    """Tell whether an int is exact as a float."""
    return abs(value) <= 2**53


def is_constant(value: Any) -> bool:
    """Tell whether a value can be a field of a constant object."""
    if isinstance(value, tuple | list):
        return all(map(is_constant, value))
    kinds = (bool, int, float, complex, str, type(None), np.generic, enum.Enum, Object)
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "fiubc"
    return isinstance(value, kinds) or record_of(type(value)) is not None


def _described(meaning: object) -> object:
    """Return what tells a meaning from others also in another process."""
    if isinstance(meaning, FunctionType):
        return meaning.__module__, meaning.__qualname__, meaning.__code__.co_firstlineno
    return repr(meaning)


def _own_names(cls: type) -> set[str]:
    """Return the names that the user's classes define."""
    return {name for each in cls.__mro__ if is_of_user(each) for name in vars(each)}


def _is_of_python(function: FunctionType) -> bool:
    """Tell whether Python has made a function: of a text without a file, or of its library."""
    file = function.__code__.co_filename
    return file.startswith("<") or "/lib/python3" in file
