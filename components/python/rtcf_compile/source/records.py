"""Objects of NamedTuples and dataclasses become tuples, and their fields elements.

`Sample(s=x, v=y)` becomes `(x, y)`, `sample.v` an element, and `sample.energy()` a call of a
function. The class of a variable is known by its annotation, or by what it is set to; else from the
name of the field. Such an object has the meaning of a tuple as long as nothing sets its fields,
which is rejected.
"""

import ast
import dataclasses
import difflib
import enum
import inspect
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import FunctionType, ModuleType
from typing import Any, ForwardRef

import numpy as np
from rtcf.component import Component

from rtcf_compile.source.mistake import at
from rtcf_compile.source.parsed import is_of_user
from rtcf_compile.source.scopes import everywhere

# Attributes that other values have: with these names, the class of a variable must be known.
_OTHERS = {*dir(np.ndarray), "name", "value", "front", "new", "valid", "age"}


@dataclass(frozen=True)
class Record:
    """A class whose objects are tuples of their fields."""

    cls: type
    fields: tuple[str, ...]
    defaults: Mapping[str, Any]
    # Methods, and the getters of properties.
    methods: Mapping[str, FunctionType] = field(default_factory=dict)
    properties: Mapping[str, FunctionType] = field(default_factory=dict)

    def has(self, name: str) -> bool:
        """Tell whether objects have this attribute."""
        return self.meaning(name) is not None

    def meaning(self, name: str) -> int | FunctionType | None:
        """Return the place of a field, or the function of a method or a property."""
        if name in self.fields:
            return self.fields.index(name)
        return self.methods.get(name) or self.properties.get(name)


def record_of(cls: Any) -> Record | None:
    """Return the record of a NamedTuple or dataclass of the user; None for another class.

    A class with operators, or with code of its own to make objects, is another class.
    """
    if not isinstance(cls, type) or not is_of_user(cls) or issubclass(cls, Component):
        return None
    if issubclass(cls, tuple) and hasattr(cls, "_field_defaults"):
        names, defaults = cls._fields, cls._field_defaults  # type: ignore[attr-defined]
    elif dataclasses.is_dataclass(cls):
        known = dataclasses.fields(cls)
        made = [each for each in known if each.default_factory is not dataclasses.MISSING]
        if made or not all(each.init and not each.kw_only for each in known):
            return None
        names = tuple(each.name for each in known)
        missing = dataclasses.MISSING
        defaults = {each.name: each.default for each in known if each.default is not missing}
    else:
        return None
    methods: dict[str, FunctionType] = {}
    properties: dict[str, FunctionType] = {}
    for base in reversed(cls.__mro__):
        for name, value in vars(base).items() if is_of_user(base) else ():
            of = value.fget if isinstance(value, property) else value
            if not isinstance(of, FunctionType) or _is_of_python(of):
                continue
            if name.startswith("__"):
                return None
            (properties if isinstance(value, property) else methods)[name] = of
    return Record(cls, tuple(names), defaults, methods, properties)


def _is_of_python(function: FunctionType) -> bool:
    """Tell whether Python has made a function: of a text without a file, or of its library."""
    file = function.__code__.co_filename
    return file.startswith("<") or "/lib/python3" in file


def as_tuple(value: Any) -> Any:
    """Return the tuple for an object of such a class, other values as they are."""
    record = None if isinstance(value, type) else record_of(type(value))
    return value if record is None else tuple(getattr(value, each) for each in record.fields)


def method_names(function: FunctionType) -> set[str]:
    """Return the names of all methods of objects that a function can use."""
    return {name for record in _records(function) for name in record.methods}


def replace(tree: ast.FunctionDef, function: FunctionType, file: str) -> dict[str, FunctionType]:
    """Replace the objects in a function; return the functions that it then calls, by name."""
    found = {record.cls: record for record in _records(function)}
    if not found:
        return {}
    replacing = _Replacing(tree, function, file, list(found.values()))
    tree.body = [replacing.visit(each) for each in tree.body]
    return replacing.functions


def _records(function: FunctionType) -> Iterator[Record]:
    """Yield the records whose names a function can use, and that of which it is a method."""
    scope = function.__globals__
    spaces = [scope]
    spaces += [vars(each) for each in (_class_of(function), *scope.values())
               if isinstance(each, type | ModuleType) and _is_of_user(each)]  # fmt: skip
    for space in spaces:
        for value in list(space.values()):
            if isinstance(value, type) and (record := record_of(value)) is not None:
                yield record


def _class_of(function: FunctionType) -> Any:
    """Return the class of the module around a function, or None."""
    return function.__globals__.get(function.__qualname__.rpartition(".")[0].partition(".")[0])


def _is_of_user(value: type | ModuleType) -> bool:
    if isinstance(value, type):
        return is_of_user(value)
    file = getattr(value, "__file__", None) or ""
    return bool(file) and "/dist-packages/" not in file and "/lib/python3" not in file


class _Replacing(ast.NodeTransformer):
    def __init__(
        self, tree: ast.FunctionDef, function: FunctionType, file: str, records: list[Record]
    ) -> None:
        self.functions: dict[str, FunctionType] = {}
        self._function, self._file, self._records = function, file, records
        self._bound = everywhere(tree)
        arguments = [*tree.args.posonlyargs, *tree.args.args]
        self._own = next((each for each in records if function in each.methods.values()
                          or function in each.properties.values()), None)  # fmt: skip
        self._owner_class = _class_of(function)
        is_method = self._owner_class is not None and self._record(self._owner_class) is None
        self._self = arguments[0].arg if arguments and is_method else ""
        # Variables that are parts of messages.
        self._messages: set[str] = set()
        # What variables are set to; None if it is not known.
        self._values: dict[str, list[ast.expr | Record | None]] = {}
        for each in arguments:
            self._values[each.arg] = [self._annotated(each.annotation)]
        if self._own is not None and arguments:
            self._values[arguments[0].arg] = [self._own]
        for node in ast.walk(tree):
            self._note(node)
        # The records of variables; None if they may have several, or none.
        self._known: dict[str, Record | None] = {}
        before = None
        while before != self._known:
            before = dict(self._known)
            for name, values in self._values.items():
                self._known[name] = self._of_all(values)

    def _annotated(self, annotation: ast.expr | None) -> Record | None:
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            annotation = ast.Name(annotation.value, ast.Load())
        return self._record(self._resolved(annotation))

    def _record(self, value: Any) -> Record | None:
        return next((each for each in self._records if each.cls is value), None)

    def _of_all(self, values: Sequence[ast.expr | Record | None]) -> Record | None:
        """Return the record that all of these values have, perhaps except those that depend on
        variables that are not known yet.
        """
        found: list[Record | None] = []
        unknown = set(self._values) - set(self._known)
        for each in values:
            if not isinstance(each, ast.expr):
                found.append(each)
            elif not any(getattr(part, "id", "") in unknown for part in ast.walk(each)):
                found.append(self._of_value(each))
        return found[0] if found and all(each is found[0] for each in found) else None

    def _note(self, node: ast.AST) -> None:
        """Note what a statement sets variables to."""
        if isinstance(node, ast.AnnAssign):
            self._set(node.target, self._annotated(node.annotation))
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                self._set(target, node.value)
        elif isinstance(node, ast.NamedExpr):
            self._set(node.target, node.value)
        elif isinstance(node, ast.For | ast.comprehension):
            of = node.iter
            values: list[ast.expr | None] = [None]
            if isinstance(of, ast.Tuple | ast.List):
                values = [*of.elts]
            for each in values:
                self._set(node.target, each)
            if self._is_of_port(node.iter):
                names = (each for each in ast.walk(node.target) if isinstance(each, ast.Name))
                self._messages |= {each.id for each in names}

    def _set(self, target: ast.expr, value: ast.expr | Record | None) -> None:
        if isinstance(target, ast.Name):
            self._values.setdefault(target.id, []).append(value)
            if isinstance(value, ast.expr) and self._is_of_port(value):
                self._messages.add(target.id)
            return
        parts = target.elts if isinstance(target, ast.Tuple | ast.List) else []
        values: list[ast.expr | None] = [None] * len(parts)
        if isinstance(value, ast.Tuple | ast.List) and len(value.elts) == len(parts):
            values = [*value.elts]
        for part, of in zip(parts, values, strict=True):
            self._set(part, of)

    def _of_value(self, node: ast.expr) -> Record | None:
        """Return the record that an expression surely gives."""
        if isinstance(node, ast.Name) and node.id in self._bound:
            return self._known.get(node.id)
        if isinstance(node, ast.IfExp):
            return self._of_all([node.body, node.orelse])
        if isinstance(node, ast.Attribute) and (owner := self._of_value(node.value)) is not None:
            known = owner.cls.__annotations__.get(node.attr)
            getter = owner.properties.get(node.attr)
            return self._typed(known, owner.cls) or self._returned(getter)
        if not isinstance(node, ast.Call):
            value = self._resolved(node)
            if isinstance(value, property):
                return self._returned(value.fget)
            return self._record(type(value))
        of = node.func
        if isinstance(of, ast.Attribute) and of.attr == "_replace":
            return self._of_value(of.value)
        if self._resolved(of) is dataclasses.replace and node.args:
            return self._of_value(node.args[0])
        if isinstance(of, ast.Attribute) and (owner := self._of_value(of.value)) is not None:
            return self._returned(owner.methods.get(of.attr))
        called = self._resolved(of)
        return self._record(called) or self._returned(called)

    def _returned(self, called: Any) -> Record | None:
        if not isinstance(called, FunctionType):
            return None
        return self._typed(called.__annotations__.get("return"), called)

    def _typed(self, annotation: Any, of: type | FunctionType) -> Record | None:
        """Return the record of an annotation of a class or a function."""
        if isinstance(annotation, ForwardRef):
            annotation = annotation.__forward_arg__
        if isinstance(annotation, str):
            annotation = vars(sys.modules[of.__module__]).get(annotation)
        return self._record(annotation)

    def _resolved(self, node: ast.AST | None) -> Any:
        """Return what a dotted name of the module refers to, or None."""
        if isinstance(node, ast.Name):
            if node.id == self._self:
                return self._owner_class
            return None if node.id in self._bound else self._function.__globals__.get(node.id)
        if isinstance(node, ast.Attribute):
            owner = self._resolved(node.value)
            if isinstance(owner, type):
                return inspect.getattr_static(owner, node.attr, None)
            return getattr(owner, node.attr, None) if isinstance(owner, ModuleType) else None
        return None

    def _is_of_port(self, node: ast.expr) -> bool:
        """Tell whether an expression is `self.port.value`, or a part of it."""
        names = []
        while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
            if isinstance(node, ast.Attribute):
                names.append(node.attr)
            node = node.func if isinstance(node, ast.Call) else node.value
        if not isinstance(node, ast.Name):
            return False
        is_port = node.id == self._self and len(names) > 1 and names[-2] in ("value", "front")
        return is_port or node.id in self._messages

    # Objects.

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Rewrite `Sample(…)`, `sample._replace(…)`, `replace(sample, …)`, `sample.method(…)`."""
        of = node.func
        if (record := self._record(self._resolved(of))) is not None:
            self._visit_arguments(node)
            return self._made(node, record)
        if self._resolved(of) is dataclasses.replace and len(node.args) == 1:
            found = self._of_value(node.args[0])
            if found is not None and not issubclass(found.cls, tuple):
                given = node.args.pop()
                self._visit_arguments(node)
                return self._changed(node, given, found)
        if isinstance(of, ast.Attribute) and (found := self._record(self._resolved(of.value))):
            return self._of_class(node, of, found)
        if isinstance(of, ast.Attribute) and (found := self._owner(of, is_called=True)) is not None:
            if of.attr == "_replace" and issubclass(found.cls, tuple):
                self._visit_arguments(node)
                return self._changed(node, of.value, found)
            if of.attr in found.methods:
                self._visit_arguments(node)
                function = self._name(found, of.attr, found.methods[of.attr])
                own = self._checked(self.visit(of.value))
                return _located(ast.Call(function, [own, *node.args], node.keywords), node)
        self.generic_visit(node)
        return node

    def _of_class(self, node: ast.Call, of: ast.Attribute, record: Record) -> ast.expr:
        """Rewrite `Sample.method(…)`."""
        value = inspect.getattr_static(record.cls, of.attr, None)
        called = value.__func__ if isinstance(value, staticmethod) else value
        if not isinstance(called, FunctionType) or _is_of_python(called):
            what = f"{ast.unparse(of)} is not compiled"
            raise at(self._file, node, what, "write a function of the module")
        self._visit_arguments(node)
        if called in record.methods.values() and node.args:
            node.args[0] = self._checked(node.args[0])
        function = self._name(record, of.attr, called)
        return _located(ast.Call(function, node.args, node.keywords), node)

    def _visit_arguments(self, node: ast.Call) -> None:
        node.args = [self.visit(each) for each in node.args]
        for each in node.keywords:
            each.value = self.visit(each.value)

    def _made(self, node: ast.Call, record: Record) -> ast.expr:
        """Return the tuple of a new object."""
        name = ast.unparse(node.func)
        named = [each.arg or "" for each in node.keywords]
        if any(isinstance(each, ast.Starred) for each in node.args) or "" in named:
            raise at(self._file, node, f"{name} of any number of values", "write each field")
        values = dict(zip(record.fields, node.args, strict=False))
        is_wrong = len(node.args) > len(record.fields) or set(named) - set(record.fields)
        if is_wrong or set(named) & set(values):
            raise self._takes(node, record)
        values |= {each.arg or "": each.value for each in node.keywords}
        self._check_order(node, values, record)
        for each in set(record.fields) - set(values):
            if each not in record.defaults:
                raise self._takes(node, record)
            values[each] = self._default(node, each, record.defaults[each])
        elements = [values[each] for each in record.fields]
        return _located(ast.Tuple(elements, ast.Load()), node)

    def _takes(self, node: ast.Call, record: Record) -> Exception:
        name, fields = ast.unparse(node.func), ", ".join(record.fields)
        return at(self._file, node, f"{name} has the fields {fields}", f"write {name}({fields})")

    def _check_order(self, node: ast.Call, values: dict[str, ast.expr], record: Record) -> None:
        """Reject values in another order than that of the fields, if one of them may have effects:
        they would be computed in the order of the fields.
        """
        others = {name: each for name, each in values.items() if not isinstance(each, ast.Constant)}
        parts = [part for each in others.values() for part in ast.walk(each)]
        acts = any(isinstance(each, ast.Call | ast.NamedExpr) for each in parts)
        places = [record.fields.index(each) for each in others]
        if acts and places != sorted(places):
            fields = ", ".join(record.fields)
            what = "calls are not in the order of the fields"
            raise at(self._file, node, what, f"write them in this order: {fields}")

    def _default(self, node: ast.Call, name: str, value: Any) -> ast.expr:
        cls = type(value)
        if isinstance(value, enum.Enum) and self._function.__globals__.get(cls.__name__) is cls:
            member = ast.Attribute(ast.Name(cls.__name__, ast.Load()), value.name, ast.Load())
            return _located(member, node)
        if cls not in (bool, int, float):
            what = f"the default of {name} is not a number"
            raise at(self._file, node, what, f"write {name}=…")
        return _located(ast.Constant(value), node)

    def _changed(self, node: ast.Call, of: ast.expr, record: Record) -> ast.expr:
        """Return the tuple of `sample._replace(v=y)`."""
        named = {each.arg or "": each.value for each in node.keywords}
        if node.args or not set(named) <= set(record.fields):
            fields = ", ".join(record.fields)
            raise at(self._file, node, f"{record.cls.__name__} has the fields {fields}", "name one")
        if not isinstance(of, ast.Name):
            what = "an expression that is replaced in part"
            raise at(self._file, node, what, "bind it to a variable first")
        self._check_order(node, named, record)
        elements = [
            named.get(each) or self._element(node, of, place)
            for place, each in enumerate(record.fields)
        ]
        return _located(ast.Tuple(elements, ast.Load()), node)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """Rewrite `sample.v`, of a field or a property."""
        record = self._owner(node)
        if record is None:
            self.generic_visit(node)
            return node
        if not isinstance(node.ctx, ast.Load):
            what = f"{ast.unparse(node)} is a field of an object"
            remedy = f"make a new object: {record.cls.__name__}(…), or keep it in a State"
            raise at(self._file, node, what, remedy)
        of = self.visit(node.value)
        if node.attr in record.fields:
            return self._element(node, of, record.fields.index(node.attr))
        if node.attr in record.properties:
            function = self._name(record, node.attr, record.properties[node.attr])
            return _located(ast.Call(function, [self._checked(of)], []), node)
        if node.attr in record.methods:
            what = f"{ast.unparse(node)} is a method"
            raise at(self._file, node, what, f"call it: {ast.unparse(node)}(…)")
        value = inspect.getattr_static(record.cls, node.attr, None)
        if type(value) in (bool, int, float):
            return _located(ast.Constant(value), node)
        names = (*record.fields, *record.methods, *record.properties)
        near = difflib.get_close_matches(node.attr, names, 1, 0.6)
        remedy = f"correct its name ({near[0]})" if near else f"it has {', '.join(names)}"
        raise at(self._file, node, f"{record.cls.__name__} has no {node.attr}", remedy)

    def _element(self, node: ast.expr, of: ast.expr, place: int) -> ast.expr:
        return _located(ast.Subscript(self._checked(of), ast.Constant(place), ast.Load()), node)

    def _checked(self, node: ast.expr) -> ast.expr:
        """Return an expression that must be a tuple when it is compiled."""
        return _located(ast.Call(ast.Name("rtcf_object", ast.Load()), [node], []), node)

    def _name(self, record: Record, name: str, function: FunctionType) -> ast.expr:
        plain = f"rtcf_of_{record.cls.__name__}_{name}"
        self.functions[plain] = function
        return ast.Name(plain, ast.Load())

    def _owner(self, node: ast.Attribute, is_called: bool = False) -> Record | None:
        """Return the record of the object that has this attribute, or None."""
        of, name = node.value, node.attr
        if (known := self._of_value(of)) is not None:
            if known.has(name):
                self._check_overridden(node, known)
            return known
        if name in _OTHERS or self._is_of_port(node) or not self._may_be_object(of):
            return None
        found = [each for each in self._records if each.has(name)]
        if is_called and name == "_replace":
            found = [each for each in self._records if issubclass(each.cls, tuple)]
        if len({each.meaning(name) for each in found}) > 1:
            names = " and ".join(sorted(each.cls.__name__ for each in found))
            remedy = f"annotate the variable: x: {found[0].cls.__name__} = …"
            raise at(self._file, node, f"{names} have {name}", remedy)
        return found[0] if found else None

    def _check_overridden(self, node: ast.Attribute, record: Record) -> None:
        """Reject a method that another class derived from this one has, too."""
        for each in self._records:
            same = each.meaning(node.attr) == record.meaning(node.attr)
            if issubclass(each.cls, record.cls) and not same:
                name = each.cls.__name__
                what = f"{name} has a {node.attr} of its own, and the type is not known"
                raise at(self._file, node, what, "write a function for each class")

    def _may_be_object(self, node: ast.expr) -> bool:
        """Tell whether an expression of unknown type may be an object: a variable, a call, an
        element of one, or a property of self.
        """
        if isinstance(node, ast.Name):
            return node.id in self._bound and node.id != self._self
        if isinstance(node, ast.Call | ast.IfExp):
            return True
        if isinstance(node, ast.Subscript):
            return self._may_be_object(node.value)
        if isinstance(node, ast.Attribute):
            if isinstance(node.value, ast.Name) and node.value.id == self._self:
                return isinstance(self._resolved(node), property)
            return self._may_be_object(node.value)
        return False


def _located(new: ast.expr, node: ast.expr) -> ast.expr:
    """Return an expression in the place of another."""
    return ast.fix_missing_locations(ast.copy_location(new, node))
