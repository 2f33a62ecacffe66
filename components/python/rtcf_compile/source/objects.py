"""Objects of NamedTuples and dataclasses: their classes, fields and methods, resolved in functions.

`Sample(s=x, v=y)` becomes the object of `(x, y)`, `sample.v` an element of its fields, and
`sample.energy()` a call of a function. The class of a variable is that of its annotation, or of its
values; else the only one with the field. The compiler then checks it, as objects have types.
An object does not change: nothing may set its fields, so that it can be copied.
"""

import ast
import dataclasses
import difflib
import enum
import inspect
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from types import FunctionType, ModuleType, NoneType
from typing import Any, ForwardRef, Optional, Self, get_args

import numpy as np

from rtcf_compile.source.mistake import at
from rtcf_compile.source.parsed import is_of_user
from rtcf_compile.source.records import (
    NAMED,
    Arranged,
    Meaning,
    Record,
    is_small,
    named,
    record_of,
    unique,
)
from rtcf_compile.source.scopes import everywhere

# Attributes that other values have: with these names, the class of a variable must be known.
_OTHERS = {*dir(np.ndarray), "name", "value", "front", "new", "valid", "age"}


def method_names(function: FunctionType) -> set[str]:
    """Return the names of all methods of objects that a function can use."""
    return {
        name for record in _records(function) for name in (*record.methods, *record.static_methods)
    }


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
        self._self = arguments[0].arg if arguments and self._is_method() else ""
        # Variables that are parts of messages.
        self._messages: set[str] = set()
        # The values of variables; None if one is not known.
        self._values: dict[str, list[ast.expr | Record | None]] = {}
        defaults = {
            name: self._record(type(each.default))
            for name, each in inspect.signature(function).parameters.items()
        }
        for each in arguments:
            known = self._annotated(each.annotation) or defaults.get(each.arg)
            self._values[each.arg] = [known]
        if self._own is not None and arguments:
            self._values[arguments[0].arg] = [self._own]
        for statement in tree.body:
            for node in ast.walk(statement):
                self._note(node)
        # The records of variables; None if they may have several, or none.
        self._known: dict[str, Record | None] = {}
        before = None
        while before != self._known:
            before = dict(self._known)
            for name, values in self._values.items():
                self._known[name] = self._of_all(values)

    def _is_method(self) -> bool:
        """Tell whether the first argument is the component."""
        if self._owner_class is None or self._record(self._owner_class) is not None:
            return False
        name = self._function.__qualname__.partition(".")[2]
        found = inspect.getattr_static(self._owner_class, name, None)
        return not isinstance(found, staticmethod)

    def _annotated(self, annotation: ast.expr | None) -> Record | None:
        """Return the record of an annotation: `Sample`, "Sample", `Sample | None`, Self."""
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            try:
                annotation = ast.parse(annotation.value, mode="eval").body
            except SyntaxError:
                return None
        if isinstance(annotation, ast.BinOp) and isinstance(annotation.op, ast.BitOr):
            parts = (annotation.left, annotation.right)
            found = [each for each in parts if not _is_none(each)]
            return self._annotated(found[0]) if len(found) == 1 else None
        if isinstance(annotation, ast.Subscript) and self._resolved(annotation.value) is Optional:
            return self._annotated(annotation.slice)
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
            if isinstance(each, ast.expr) and _is_none(each):
                continue
            if not isinstance(each, ast.expr):
                found.append(each)
            elif not any(getattr(part, "id", "") in unknown for part in ast.walk(each)):
                found.append(self._of_value(each))
        return found[0] if found and all(each is found[0] for each in found) else None

    def _note(self, node: ast.AST) -> None:
        """Note the values of the variables that a statement sets."""
        if isinstance(node, ast.AnnAssign):
            self._set(node.target, self._annotated(node.annotation))
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                self._set(target, node.value)
        elif isinstance(node, ast.NamedExpr):
            self._set(node.target, node.value)
        elif isinstance(node, ast.FunctionDef | ast.Lambda):
            # A variable of this name may be another one inside.
            for given in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
                self._set(ast.Name(given.arg), self._annotated(given.annotation))
        elif isinstance(node, ast.MatchAs | ast.MatchStar) and node.name:
            self._set(ast.Name(node.name), None)
        elif isinstance(node, ast.For | ast.comprehension):
            of = node.iter
            of_list = of.elts if isinstance(of, ast.Tuple | ast.List) else None
            for value in of_list or [_element_of(of)]:
                self._set(node.target, value)
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
        if isinstance(node, ast.NamedExpr):
            return self._of_value(node.value)
        if isinstance(node, ast.Call) and isinstance(marker := _marker(node), Arranged):
            return marker.record
        if isinstance(node, ast.Subscript) and isinstance(marker := _marker(node.value), Meaning):
            known = _annotation(marker.record.cls, marker.attribute)
            return self._typed(known, marker.record.cls)
        if isinstance(node, ast.Subscript):
            return self._of_elements(node.value)
        if isinstance(node, ast.Attribute) and (owner := self._of_value(node.value)) is not None:
            known = _annotation(owner.cls, node.attr)
            getter = owner.properties.get(node.attr)
            return self._typed(known, owner.cls) or self._returned(getter, owner)
        if not isinstance(node, ast.Call):
            value = self._resolved(node)
            if isinstance(value, property):
                return self._returned(value.fget)
            return self._record(type(value))
        of = node.func
        if isinstance(of, ast.Attribute) and of.attr == "get" and len(node.args) == 2:
            return self._of_elements(of.value)
        if isinstance(of, ast.Attribute) and of.attr == "_replace":
            return self._of_value(of.value)
        if self._resolved(of) is dataclasses.replace and node.args:
            return self._of_value(node.args[0])
        if isinstance(of, ast.Attribute) and (owner := self._of_value(of.value)) is not None:
            return self._returned(owner.function(of.attr), owner)
        called = self._resolved(of)
        called = called.__func__ if isinstance(called, staticmethod) else called
        if called is None and isinstance(of, ast.Name):
            called = self.functions.get(of.id)  # of a method, which is replaced already
        return self._record(called) or self._returned(called)

    def _of_elements(self, node: ast.expr) -> Record | None:
        """Return the record of all elements of a list, a tuple, or a constant."""
        if isinstance(node, ast.Tuple | ast.List):
            return self._of_all(node.elts)
        if isinstance(node, ast.ListComp):
            return self._of_value(node.elt)
        if isinstance(node, ast.Name) and node.id in self._bound:
            lists = self._values.get(node.id, [])
            found = [self._of_elements(each) if isinstance(each, ast.expr) else None
                     for each in lists if not _is_of(each, node.id)]  # fmt: skip
            return found[0] if found and all(each is found[0] for each in found) else None
        values = self._resolved(node)
        if isinstance(values, dict):
            values = list(values.values())
        if not isinstance(values, tuple | list):
            return None
        kinds = {type(each) for each in values}
        return self._record(kinds.pop()) if len(kinds) == 1 else None

    def _returned(self, called: Any, owner: Record | None = None) -> Record | None:
        """Return the record that a function returns; `owner`: that of which it is a method."""
        if not isinstance(called, FunctionType):
            return None
        annotation = called.__annotations__.get("return")
        if owner is not None and annotation in (Self, "Self"):
            return owner
        return self._typed(annotation, called)

    def _typed(self, annotation: Any, of: type | FunctionType) -> Record | None:
        """Return the record of an annotation of a class or a function."""
        if isinstance(annotation, ForwardRef):
            annotation = annotation.__forward_arg__
        if isinstance(annotation, str):
            text = annotation.removeprefix("Optional[").removesuffix("]")
            parts = {part.strip() for part in text.split("|")} - {"None"}
            found: Any = sys.modules[of.__module__]
            for part in parts.pop().split(".") if len(parts) == 1 else ("",):
                found = getattr(found, part, None)
            annotation = found
        parts = {each for each in get_args(annotation) if each is not NoneType}
        return self._record(parts.pop() if len(parts) == 1 else annotation)

    def _resolved(self, node: ast.AST | None) -> Any:
        """Return the object of a dotted name of the module, or None."""
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
            if found is not None and not found.is_tuple:
                given = node.args.pop()
                self._visit_arguments(node)
                return self._changed(node, given, found)
        if isinstance(of, ast.Attribute) and (found := self._record(self._resolved(of.value))):
            return self._of_class(node, of, found)
        if isinstance(of, ast.Attribute) and (found := self._owner(of, is_called=True)) is not None:
            if of.attr == "_replace" and found.is_tuple:
                self._visit_arguments(node)
                return self._changed(node, of.value, found)
            if (called := found.function(of.attr)) is not None:
                is_method = of.attr in found.methods
                if is_method:
                    self._check_call(node, of, called)
                own = self._meant(self.visit(of.value), found, of.attr)
                self._visit_arguments(node)
                name = self._name(found, of.attr, called)
                if is_method:
                    return _located(ast.Call(name, [own, *node.args], node.keywords), node)
                return _behind(own, ast.Call(name, node.args, node.keywords), node)
        self.generic_visit(node)
        return node

    def _check_call(self, node: ast.Call, of: ast.Attribute, function: FunctionType) -> None:
        """Reject other arguments than those of a method."""
        if any(isinstance(each, ast.Starred) for each in node.args):
            return
        signature = inspect.signature(function)
        try:
            signature.bind(None, *node.args, **{each.arg or "": each for each in node.keywords})
        except TypeError:
            names = ", ".join(list(signature.parameters)[1:])
            called = ast.unparse(of)
            what = f"{called} takes {names or 'no arguments'}"
            raise at(self._file, node, what, f"write {called}({names})") from None

    def _of_class(self, node: ast.Call, of: ast.Attribute, record: Record) -> ast.expr:
        """Rewrite `Sample.method(…)`."""
        called = record.function(of.attr)
        if called is None:
            what = f"{ast.unparse(of)} is not compiled"
            raise at(self._file, node, what, "write a function of the module")
        self._visit_arguments(node)
        if of.attr in record.methods and node.args:
            node.args[0] = self._meant(node.args[0], record, of.attr)
        function = self._name(record, of.attr, called)
        return _located(ast.Call(function, node.args, node.keywords), node)

    def _visit_arguments(self, node: ast.Call) -> None:
        node.args = [self.visit(each) for each in node.args]
        for each in node.keywords:
            each.value = self.visit(each.value)

    def _made(self, node: ast.Call, record: Record) -> ast.expr:
        """Return a new object."""
        name = ast.unparse(node.func)
        named = [each.arg or "" for each in node.keywords]
        if any(isinstance(each, ast.Starred) for each in node.args) or "" in named:
            raise at(self._file, node, f"{name} of any number of values", "write each field")
        values = dict(zip(record.fields, node.args, strict=False))
        is_wrong = len(node.args) > len(record.fields) or set(named) - set(record.fields)
        if is_wrong or set(named) & set(values):
            raise self._takes(node, record)
        # In the order of the text, in which Python computes them.
        values |= {each.arg or "": each.value for each in node.keywords}
        for each in record.fields:
            if each in values:
                continue
            if each not in record.defaults:
                raise self._takes(node, record)
            values[each] = self._default(node, each, record.defaults[each])
        return self._object(values, record, node)

    def _object(self, values: dict[str, ast.expr], record: Record, node: ast.expr) -> ast.expr:
        names = list(values)
        places = tuple(map(names.index, record.fields))
        small = (place for place, each in enumerate(record.fields) if _is_small(values[each]))
        marker = ast.Name(marker_of(record, places, tuple(small)), ast.Load())
        fields = ast.Tuple(list(values.values()), ast.Load())
        return _located(ast.Call(ast.Name("rtcf_made", ast.Load()), [fields, marker], []), node)

    def _takes(self, node: ast.Call, record: Record) -> Exception:
        name, fields = ast.unparse(node.func), ", ".join(record.fields)
        return at(self._file, node, f"{name} has the fields {fields}", f"write {name}({fields})")

    def _default(self, node: ast.Call, name: str, value: Any) -> ast.expr:
        if type(value) in (bool, int, float, NoneType):
            return _located(ast.Constant(value), node)
        if isinstance(value, enum.Enum | np.generic):
            return _located(ast.Name(named(f"rtcf_default_{name}", value), ast.Load()), node)
        what = f"the default of {name} is not a number"
        raise at(self._file, node, what, f"write {name}=…")

    def _changed(self, node: ast.Call, of: ast.expr, record: Record) -> ast.expr:
        """Return the object of `sample._replace(v=y)`."""
        given = {each.arg or "": each.value for each in node.keywords}
        if node.args or not set(given) <= set(record.fields):
            fields = ", ".join(record.fields)
            raise at(self._file, node, f"{record.cls.__name__} has the fields {fields}", "name one")
        if not isinstance(of, ast.Name):
            what = "an expression that is replaced in part"
            raise at(self._file, node, what, "bind it to a variable first")
        old, replaced = self._meant(of, record, ""), len(given)
        for place, each in enumerate(record.fields):
            if each not in given:
                kept = ast.Subscript(old, ast.Constant(place), ast.Load())
                given[each] = _located(kept, node)
        made = self._object(given, record, node)
        return made if replaced < len(record.fields) else _behind(old, made, node)

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
        name = node.attr
        if not record.has(name):
            raise self._has_no(node, record)
        if record.function(name) is not None:
            what = f"{ast.unparse(node)} is a method"
            raise at(self._file, node, what, f"call it: {ast.unparse(node)}(…)")
        of = self._meant(self.visit(node.value), record, name)
        if name in record.fields:
            place = ast.Constant(record.fields.index(name))
            return _located(ast.Subscript(of, place, ast.Load()), node)
        if name in record.properties:
            function = self._name(record, name, record.properties[name])
            return _located(ast.Call(function, [of], []), node)
        value = record.constants[name]
        if type(value) in (bool, int, float):
            return _behind(of, ast.Constant(value), node)
        return _behind(of, ast.Name(named(f"rtcf_constant_{name}", value), ast.Load()), node)

    def _has_no(self, node: ast.Attribute, record: Record) -> Exception:
        cls, name = record.cls, node.attr
        value = inspect.getattr_static(cls, name, None)
        if value is not None:
            kind = type(value).__name__
            what = f"{cls.__name__}.{name} is a {kind}, which is not compiled"
            return at(self._file, node, what, "write a method, or a function of the module")
        near = difflib.get_close_matches(name, record.names(), 1, 0.6)
        remedy = f"correct its name ({near[0]})" if near else f"it has {', '.join(record.names())}"
        return at(self._file, node, f"{cls.__name__} has no {name}", remedy)

    def _meant(self, node: ast.expr, record: Record, name: str) -> ast.expr:
        """Return the expression of an object, which must have this attribute of the record when it
        is compiled; for a field, that of the tuple of its fields.
        """
        marker = ast.Name(meaning_of(record, name), ast.Load())
        return _located(ast.Call(ast.Name("rtcf_object", ast.Load()), [node, marker], []), node)

    def _name(self, record: Record, name: str, function: FunctionType) -> ast.expr:
        plain = unique(f"rtcf_of_{record.name}_{name}", function)
        self.functions[plain] = function
        return ast.Name(plain, ast.Load())

    def _owner(self, node: ast.Attribute, is_called: bool = False) -> Record | None:
        """Return the record of the object that has this attribute, or None."""
        of, name = node.value, node.attr
        if (known := self._of_value(of)) is not None:
            return known
        if name in _OTHERS or self._is_of_port(node) or not self._may_be_object(of):
            return None
        found = [each for each in self._records if each.has(name)]
        if is_called and name == "_replace":
            found = [each for each in self._records if each.is_tuple]
        if len({each.meaning(name) for each in found}) > 1:
            names = " and ".join(sorted(each.cls.__name__ for each in found))
            remedy = f"annotate the variable: x: {found[0].cls.__name__} = …"
            raise at(self._file, node, f"{names} have {name}", remedy)
        return found[0] if found else None

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


def _annotation(cls: type, name: str) -> Any:
    """Return the annotation of a field, also of a base."""
    found = (inspect.get_annotations(each).get(name) for each in cls.__mro__)
    return next((each for each in found if each is not None), None)


def _is_small(node: ast.expr) -> bool:
    """Tell whether an expression is a constant int that is exact as a float."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        node = node.operand
    return isinstance(node, ast.Constant) and type(node.value) is int and is_small(node.value)


def _behind(first: ast.expr, value: ast.expr, node: ast.expr) -> ast.expr:
    """Return the expression of a value, computed after another one."""
    both = ast.Tuple([first, value], ast.Load())
    return _located(ast.Subscript(both, ast.Constant(1), ast.Load()), node)


def _marker(node: ast.expr) -> Any:
    """Return the class or attribute to which a call refers that stands for an object."""
    called = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
    if called in ("rtcf_made", "rtcf_object"):
        return NAMED[node.args[1].id]  # type: ignore[attr-defined]
    return None


def _element_of(values: ast.expr) -> ast.expr:
    """Return an expression of the type of the elements of a loop."""
    if isinstance(values, ast.Call) and isinstance(values.func, ast.Name) and values.args:
        elements = list(map(_element_of, values.args))
        if values.func.id == "enumerate":
            return ast.Tuple([ast.Constant(0), elements[0]], ast.Load())
        if values.func.id == "zip":
            return ast.Tuple(elements, ast.Load())
        if values.func.id == "reversed":
            return elements[0]
    return ast.Subscript(values, ast.Constant(0), ast.Load())


def _is_none(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is None


def _is_of(node: Any, name: str) -> bool:
    """Tell whether an expression depends on a variable."""
    return isinstance(node, ast.AST) and any(
        isinstance(each, ast.Name) and each.id == name for each in ast.walk(node)
    )


@cache
def marker_of(record: Record, places: tuple[int, ...], small: tuple[int, ...]) -> str:
    """Return the name of a class in rewritten functions, see Arranged."""
    return named(f"rtcf_class_{record.name}", Arranged(record, places, small))


@cache
def meaning_of(record: Record, name: str) -> str:
    """Return the name of an attribute of a class in rewritten functions."""
    return named(f"rtcf_{record.name}_{name or 'itself'}", Meaning(record, name))
