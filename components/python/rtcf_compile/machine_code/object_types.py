"""The types of objects of NamedTuples and dataclasses, which know their class: see records.py.

Objects of a NamedTuple are tuples, too. Those of a dataclass have fields and methods only: their
length, an index, or an order has no meaning, as in Python.
"""

from collections.abc import Iterable
from typing import Any

from numba import types
from numba.core import cgutils, imputils
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.extending import intrinsic, lower_cast, register_model, typeof_impl

from rtcf_compile.source.records import Arranged, Meaning, Object, Record, Unknown, is_small


class _Object:
    """The part that both types share.

    small  the places of fields whose ints are exact as floats
    """

    record: Record
    types: tuple[types.Type, ...]
    small: frozenset[int]

    @property
    def key(self) -> Any:
        """Return what tells types from each other."""
        return self.record.cls, self.types, self.small

    @property
    def mangling_args(self) -> Any:
        """Return the parts of the names of compiled functions."""
        return "_".join(["Object", self.record.name, *map(str, sorted(self.small))]), self.types

    def unify(self, context: Any, other: Any) -> Any:
        """Return the type of two objects of one class."""
        return _unified(self, other, context)

    def can_convert_to(self, context: Any, other: Any) -> Any:
        """Tell how an object becomes one with other types of fields."""
        return _conversion(self, other, context)


class NamedTupleType(_Object, types.NamedTuple):  # type: ignore[misc]
    """An object of a NamedTuple."""

    def __init__(self, record: Record, fields: list[types.Type], small: frozenset[int]) -> None:
        """Remember the class."""
        self.record, self.small = record, small
        super().__init__(tuple(fields), record.cls)
        self.name = _name(self)

    def __unliteral__(self) -> "NamedTupleType":
        """Return this type: fields are no literals."""
        return self

    def unify(self, context: Any, other: Any) -> Any:
        """Return the type of two objects of one class, or the tuple of an object and a tuple."""
        if isinstance(other, types.BaseTuple) and not is_object(other):
            return types.BaseTuple.from_types(self.types).unify(context, other)
        return super().unify(context, other)

    def can_convert_to(self, context: Any, other: Any) -> Any:
        """Tell how an object becomes one with other types of fields, or a tuple."""
        if isinstance(other, types.BaseTuple) and not is_object(other):
            return types.BaseTuple.from_types(self.types).can_convert_to(context, other)
        return super().can_convert_to(context, other)


class DataclassType(_Object, types.Type):  # type: ignore[misc]
    """An object of a dataclass."""

    def __init__(self, record: Record, fields: list[types.Type], small: frozenset[int]) -> None:
        """Remember the class."""
        self.record, self.types, self.small = record, tuple(fields), small
        super().__init__(_name(self))


class MarkerType(types.Dummy):  # type: ignore[misc]
    """A class, or an attribute of a class."""

    def __init__(self, marker: Arranged | Meaning) -> None:
        """Remember the class or attribute."""
        self.marker = marker
        super().__init__(f"Marker<{marker.name}>")

    @property
    def key(self) -> Any:
        """Return what tells types from each other."""
        return self.marker


class UnknownType(types.Dummy):  # type: ignore[misc]
    """A field of a constant that is not compiled, such as a dict; nothing can be done with it."""

    def __init__(self, cls: type) -> None:
        """Remember the class of the value."""
        super().__init__(f"Unknown<{cls.__name__}>")


def is_object(kind: Any) -> bool:
    """Tell whether a type is that of objects."""
    return isinstance(kind, _Object)


def object_type(
    record: Record, fields: Iterable[types.Type], small: Iterable[int]
) -> NamedTupleType | DataclassType:
    """Return the type of the objects of a class with these types of fields.

    small  the places of fields whose ints, if they are ints, are exact as floats
    """
    plain = [types.unliteral(each) for each in fields]
    kept = frozenset(place for place in small if isinstance(plain[place], types.Integer))
    if record.is_tuple:
        return NamedTupleType(record, plain, kept)
    return DataclassType(record, plain, kept)


def converted(context: Any, builder: Any, given: Any, wanted: Any, value: Any) -> Any:
    """Return the code that makes an object of a tuple, a tuple of an object, or another object."""
    parts = [builder.extract_value(value, place) for place in range(len(wanted.types))]
    cast = [
        context.cast(builder, part, one, other)
        for part, one, other in zip(parts, given.types, wanted.types, strict=True)
    ]
    return context.make_tuple(builder, wanted, cast)


def _name(kind: _Object) -> str:
    parts = enumerate(kind.types)
    fields = [f"small {each}" if place in kind.small else str(each) for place, each in parts]
    return f"Object<{kind.record.cls.__name__}>({', '.join(fields)})"


def _unified(one: Any, other: Any, context: Any) -> Any:
    if not is_object(other) or one.record is not other.record or not _fit(one, other):
        return None
    fields = [context.unify_pairs(*pair) for pair in zip(one.types, other.types, strict=True)]
    return None if None in fields else object_type(one.record, fields, one.small & other.small)


def _fit(one: Any, other: Any) -> bool:
    """Tell whether no int of a field loses digits where the field is a float in the other type."""
    for place, (mine, theirs) in enumerate(zip(one.types, other.types, strict=True)):
        for kind, of, wanted in ((one, mine, theirs), (other, theirs, mine)):
            is_lost = isinstance(of, types.Integer) and isinstance(wanted, types.Float)
            if is_lost and place not in kind.small:
                return False
    return True


def _conversion(one: Any, other: Any, context: Any) -> Any:
    if not is_object(other) or one.record is not other.record or not _fit(one, other):
        return None
    pairs = zip(one.types, other.types, strict=True)
    kinds = [context.can_convert(*pair) for pair in pairs]
    return None if None in kinds else max(kinds, default=Conversion.safe)


@register_model(NamedTupleType)
@register_model(DataclassType)
class _ObjectModel(models.StructModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        members = [(f"f{place}", each) for place, each in enumerate(kind.types)]
        super().__init__(manager, kind, members)


register_model(MarkerType)(models.OpaqueModel)
register_model(UnknownType)(models.OpaqueModel)


@lower_cast(NamedTupleType, NamedTupleType)
@lower_cast(NamedTupleType, types.BaseTuple)
@lower_cast(DataclassType, DataclassType)
def _cast(context, builder, given, wanted, value):  # type: ignore[no-untyped-def]
    return converted(context, builder, given, wanted, value)


@typeof_impl.register(Arranged)
@typeof_impl.register(Meaning)
def _type_of_marker(value, context):  # type: ignore[no-untyped-def]
    return MarkerType(value)


@typeof_impl.register(Unknown)
def _type_of_unknown(value, context):  # type: ignore[no-untyped-def]
    return UnknownType(value.cls)


@typeof_impl.register(Object)
def _type_of_object(value, context):  # type: ignore[no-untyped-def]
    fields = [typeof_impl(each, context) for each in value]
    constant = [each.copy(readonly=True) if isinstance(each, types.Array) else each
                for each in fields]  # fmt: skip
    small = [place for place, each in enumerate(value) if type(each) is int and is_small(each)]
    return None if None in fields else object_type(value.record, constant, small)


@imputils.lower_constant(NamedTupleType)
@imputils.lower_constant(DataclassType)
def _constant(context, builder, kind, value):  # type: ignore[no-untyped-def]
    parts = [
        context.get_constant_generic(builder, of, each)
        for of, each in zip(kind.types, value, strict=True)
    ]
    made = cgutils.pack_struct(builder, parts)
    return imputils.impl_ret_borrowed(context, builder, kind, made)


@imputils.lower_constant(MarkerType)
@imputils.lower_constant(UnknownType)
def _nothing(context, builder, kind, value):  # type: ignore[no-untyped-def]
    return context.get_dummy_value()


@intrinsic
def fields_of(typing, value):  # type: ignore[no-untyped-def]
    """Return the tuple of the fields of an object."""
    fields = types.BaseTuple.from_types(value.types)

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        found = converted(context, builder, value, fields, arguments[0])
        return imputils.impl_ret_borrowed(context, builder, fields, found)

    return fields(value), generate
