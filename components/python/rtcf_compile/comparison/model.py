"""A component as a plain class, with which compiled code is compared.

Its members are attributes: Python numbers and NumPy arrays, to which names refer as in any program.
It has the methods of the component, as written. Only single operations are replaced, for the order
of sums of compiled code, and for divisions of single numbers, which NumPy does not reject.
"""

import ast
import enum
import operator
from collections.abc import Collection, Iterable, Iterator
from copy import deepcopy as copy_of
from types import CodeType, FunctionType
from typing import Any

import numpy as np
from rtcf.component import Component, Fault
from rtcf.component.declaration import (
    ASSIGNED,
    LOG_LEVELS,
    PORTS,
    TIME_FIELDS,
    Derived,
    Description,
    Input,
    Member,
    MemberAttribute,
    Output,
    Queue,
    State,
    own_field,
)
from rtcf.component.interpreter import QueuePort
from rtcf.component.memory import Memory
from rtcf.component.message_view import MessageView, checked, copy
from rtcf.component.value_type import number_of

from rtcf_compile.rewriting import operators
from rtcf_compile.rewriting.common_rewriting import CommonRewriting, call_of, index_of, like, loaded
from rtcf_compile.rewriting.functions import HELPERS, drop_types, operator_functions
from rtcf_compile.rewriting.functions import made as made_of
from rtcf_compile.source.checks import resolve
from rtcf_compile.source.modules import Source, read
from rtcf_compile.source.objects import method_names
from rtcf_compile.source.parsed import is_own, opened
from rtcf_compile.source.spelling import SETTER, defaults_of


class Model:
    """A component as a plain class, whose members can be copied from and to a record."""

    def __init__(
        self, cls: type[Component], description: Description, narrow: Collection[CodeType]
    ) -> None:
        """Make an object of the class. `narrow`: see Functions."""
        known = {each.known for each in description.members.values() if each.type.optional}
        self._members = [each for each in description.members.values() if each.name not in known]
        self.branches: dict[Branch, list[int]] = {}
        functions = _Functions(cls, narrow, self.branches)
        self._object = functions.plain()(description)
        self._ports = vars(self._object)[_PORTS]
        # The ints in the source, and the values of its enums.
        self.numbers = sorted(functions.numbers)

    def run(self, hook: str) -> None:
        """Run a hook; raise its exceptions."""
        getattr(self._object, hook)()

    def load(self, record: Any, anew: bool = False) -> None:
        """Set all members. An array that has its value already stays, with the names that refer
        to it, unless `anew` is true.
        """
        plain = self._object
        for name in TIME_FIELDS:
            vars(plain)[name] = record[own_field(name)].item()
        for member in self._members:
            if member.kind in PORTS:
                self._ports[member.name].load(record, anew)
            else:
                old = None if anew else vars(plain).get(member.name)
                vars(plain)[member.name] = _loaded(record, member, old)

    def store(self, record: Any) -> None:
        """Copy all members to a record."""
        plain = self._object
        for member in self._members:
            if member.kind in PORTS:
                self._ports[member.name].store(record)
            else:
                _stored(record, member, vars(plain)[member.name])


def _loaded(record: Any, member: Member, old: Any) -> Any:
    if member.type.optional and not record[member.known]:
        return None
    value = record[member.name]
    if member.type.shape:
        same = isinstance(old, np.ndarray) and old.tobytes() == value.tobytes()
        return old if same else value.copy()
    plain = value.item()
    return member.type.enumeration(plain) if member.type.enumeration else plain


def _stored(record: Any, member: Member, value: Any) -> None:
    if member.type.optional:
        record[member.known] = value is not None
    if value is not None:
        record[member.name] = number_of(value) if isinstance(value, enum.Enum) else value


class _In:
    """An input: each read gives a copy."""

    def __init__(self, member: Member) -> None:
        self._member, self._name = member, member.name
        self.new = self.valid = self.connected = False
        self.age = 0
        self._value: Any = None

    @property
    def value(self) -> Any:
        return self._value.copy() if isinstance(self._value, np.ndarray) else self._value_of()

    def _value_of(self) -> Any:
        if isinstance(self._value, int) and self._value >= 2**63:
            raise OverflowError(f"{self._name} does not fit int64")
        enumeration = self._member.type.enumeration
        return enumeration(self._value) if enumeration else self._value

    def load(self, record: Any, anew: bool) -> None:
        name = self._name
        for flag in ("new", "valid", "connected"):
            setattr(self, flag, bool(record[f"{name}__{flag}"]))
        self.age = int(record[f"{name}__age"])
        message = self._member.message
        if message:
            self._value = MessageView(Memory(record), name, message, False)
        elif self._member.type.shape:
            self._value = record[name]
        else:
            self._value = record[name].item()

    def store(self, record: Any) -> None:
        pass


class _Out:
    """An output: it keeps a copy of the written value."""

    def __init__(self, member: Member) -> None:
        self._member, self._name = member, member.name
        self._written = False
        self.value: Any = None
        self._memory: Memory

    def write(self, value: Any) -> None:
        if self._member.message:
            copy(self._memory, self._name, self._member.message, (), value)
        else:
            self.value = _converted(self._member, value, is_copy=True)
        self._written = True

    def publish(self) -> None:
        self._written = True

    def load(self, record: Any, anew: bool) -> None:
        self._written = bool(record[f"{self._name}__written"])
        if self._member.message:
            self._memory = Memory(record.copy())
            self.value = MessageView(self._memory, self._name, self._member.message, True)
        else:
            self.value = _loaded(record, self._member, None if anew else self.value)

    def store(self, record: Any) -> None:
        record[f"{self._name}__written"] = self._written
        if self._member.message:
            written = self._memory.written()
            for leaf in self._member.leaves:
                record[self._name + leaf.field] = written[self._name + leaf.field]
        else:
            _stored(record, self._member, self.value)


class _Queued:
    """A queue, on a record of its own."""

    def __init__(self, member: Member) -> None:
        self._names = [f"{member.name}__{each}" for each in
                       ("times", "oldest", "count", "dropped", "connected")]  # fmt: skip
        self._names.append(member.name)
        self._member = member
        self._record: Any = None

    def load(self, record: Any, anew: bool) -> None:
        self._record = record.copy()

    def store(self, record: Any) -> None:
        for name in self._names:
            record[name] = self._record[name]

    def port(self) -> QueuePort:
        return QueuePort(self._record, self._member)


# Attributes of plain objects that no member can have.
_MEMBERS, _PORTS = "__members", "__ports"


class _Plain:
    """The base of plain classes: ports, and the methods that Component has."""

    def __init__(self, description: Description) -> None:
        vars(self)[_MEMBERS] = description.members
        kinds: dict[Any, Any] = {Input: _In, Output: _Out, Queue: _Queued}
        vars(self)[_PORTS] = {
            name: kinds[member.kind](member)
            for name, member in description.members.items()
            if member.kind in kinds
        }
        for name in set(LOG_LEVELS) & set(vars(self)[_PORTS]):
            vars(self)[name] = vars(self)[_PORTS][name]  # hides the method

    def __getattr__(self, name: str) -> Any:
        port = vars(self)[_PORTS].get(name)
        if port is None:
            raise AttributeError(name)
        return port.port() if isinstance(port, _Queued) else port

    def __setattr__(self, name: str, value: Any) -> None:
        member = vars(self)[_MEMBERS].get(name)
        if member is None or member.kind not in (State, Derived):
            raise AttributeError(name)
        vars(self)[name] = _converted(member, value)

    def prepare(self) -> None:
        pass

    def start(self) -> None:
        pass

    def safe(self) -> None:
        pass

    def fault(self, text: str) -> None:
        raise Fault(text)


for _level in LOG_LEVELS:
    setattr(_Plain, _level, lambda self, *values: None)


def _converted(member: Member, value: Any, is_copy: bool = False) -> Any:
    """Return a value as the declared type; an array of this type as it is."""
    kind = member.type
    if value is None and kind.optional:
        return None
    if kind.enumeration:
        return kind.enumeration(value)
    new = checked(value, kind, member.name)
    if kind.shape and (new.dtype, new.shape) == (kind.scalar, kind.shape) and not is_copy:
        return new
    own = np.empty(kind.shape, kind.scalar)
    own[...] = new
    return own if kind.shape else own.item()


# Copies of functions.


# The file, the line and the text of a condition.
Branch = tuple[str, int, str]


class _Functions:
    """The functions of a class, with replaced operations."""

    def __init__(
        self,
        cls: type[Component],
        narrow: Collection[CodeType],
        branches: dict[Branch, list[int]],
    ) -> None:
        self._cls, self._narrow, self._branches = cls, narrow, branches
        self._known: dict[FunctionType, FunctionType] = {}
        self._copies: dict[type, type] = {}
        self.numbers: set[int] = set()

    def plain(self) -> type:
        """Return a copy of the class and its bases without rtcf's attributes."""
        for base in reversed(self._cls.__mro__):
            if base is object or base.__module__.startswith("typing"):
                self._copies[base] = base
                continue
            if base.__module__.startswith("rtcf.component"):
                self._copies[base] = _Plain
                continue
            members = {name: value for name, value in vars(base).items() if _is_kept(name, value)}
            bases = tuple(dict.fromkeys(self._copies[each] for each in base.__bases__))
            made = type(base.__name__, bases, members)
            self._copies[base] = made
            for name, value in members.items():
                if (changed := self._attribute(name, value, made)) is not None:
                    setattr(made, name, changed)
        return self._copies[self._cls]

    def _attribute(self, name: str, value: Any, owner: type) -> Any:
        if isinstance(value, FunctionType) and is_own(value):
            return self._function(value, owner)
        if isinstance(value, staticmethod) and is_own(value.__func__):
            function: Any = value.__func__
            return staticmethod(self._function(function, owner))
        if isinstance(value, property) and isinstance(value.fget, FunctionType):
            if isinstance(value.fset, FunctionType):
                setattr(owner, SETTER + name, self._function(value.fset, owner))
            return property(self._function(value.fget, owner), value.fset)
        return None

    def _function(self, function: FunctionType, owner: type | None = None) -> FunctionType:
        function = opened(function)
        if function in self._known:
            return self._known[function]
        source = read(function, is_whole=True)
        self._note_numbers(source)
        functions = operator_functions(function, self._narrow) | operators.COMPARED
        rewriting = _Operations(source, functions, self._branches)
        tree = source.tree
        tree.body = rewriting.statements(tree.body)
        drop_types(tree)
        scope = {**function.__globals__, **HELPERS, **rewriting.scope, **rewriting.constants}
        for name, value in scope.items():
            if isinstance(value, type) and value in self._copies:
                scope[name] = self._copies[value]
        self._known[function] = _in_class(tree, scope, source, owner)
        for name in dict.fromkeys((*_global_names(function.__code__), *rewriting.constants)):
            value = scope.get(name)
            if isinstance(value, FunctionType) and is_own(value) and name not in HELPERS:
                scope[name] = self._function(value)
        return self._known[function]

    def _note_numbers(self, source: Source) -> None:
        for node in ast.walk(source.tree):
            value = node.value if isinstance(node, ast.Constant) else resolve(node, source)
            if type(value) is int:
                self.numbers.add(value)
            elif isinstance(value, type) and issubclass(value, enum.IntEnum):
                self.numbers.update(map(int, value))


def _global_names(code: CodeType) -> Iterator[str]:
    """Yield the names that a function, or a function nested in it, takes from its module."""
    yield from code.co_names
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from _global_names(each)


def _is_kept(name: str, value: Any) -> bool:
    return (
        name not in ("__dict__", "__weakref__", "__annotations__")
        and not name.startswith(ASSIGNED)
        and not isinstance(value, MemberAttribute)
    )


def _in_class(
    tree: ast.FunctionDef, scope: dict[str, Any], source: Source, owner: type | None
) -> FunctionType:
    """Return a function of a rewritten tree whose super() refers to its class."""
    tree.args.defaults = [ast.Constant(None) for _ in tree.args.defaults]
    place = ast.arguments([], [ast.arg("__class__")], None, [], [], None, [])
    name = ast.Return(ast.Name(tree.name, ast.Load()))
    outer = ast.FunctionDef("rtcf_in_class", place, [tree, name], [])
    ast.copy_location(outer, tree)
    made: FunctionType = made_of(outer, scope, source)(owner)
    made.__defaults__ = defaults_of(source.function)
    return made


def _is_array(value: Any) -> bool:
    return isinstance(value, np.ndarray | np.generic)


class _Operations(CommonRewriting):
    """Replaces operations on values. Names, assignments and their order stay as they are."""

    def __init__(
        self,
        source: Source,
        functions: frozenset[type[ast.AST]],
        branches: dict[Branch, list[int]],
    ) -> None:
        super().__init__(source, functions)
        self._branches = branches
        self._own_methods = method_names(source.function)
        self.scope: dict[str, Any] = {}

    def visit(self, node: ast.AST) -> Any:
        return ast.NodeTransformer.visit(self, node)

    def visit_NamedExpr(self, node: ast.NamedExpr) -> ast.AST:
        return self.generic_visit(node)

    def visit_Match(self, node: ast.Match) -> Any:
        return self.generic_visit(node)

    def visit_List(self, node: ast.List) -> ast.AST:
        return self.generic_visit(node)

    def _is_list(self, node: ast.expr) -> bool:
        return False

    def visit_Call(self, node: ast.Call) -> ast.AST:
        target, of = resolve(node.func, self.source), node.args[0] if node.args else None
        if target is sum:
            self.scope["rtcf_sum_in_order"] = _sum_in_order
            node.func = like(node.func, ast.Name("rtcf_sum_in_order", ast.Load()))
        owner = node.func.value if isinstance(node.func, ast.Attribute) else node.func
        is_table = isinstance(resolve(owner, self.source), dict)
        # A method of the class may have the name of one of arrays.
        arguments = self.source.tree.args.args
        is_self = isinstance(owner, ast.Name) and [each.arg for each in arguments[:1]] == [owner.id]
        is_method = is_self and owner is not node.func
        if (
            is_method
            or is_table
            or target is sum
            or isinstance(of, ast.GeneratorExp | ast.ListComp)
        ):
            return self.generic_visit(node)
        return super().visit_Call(node)

    def _method(self, node: ast.Call, called: ast.Attribute) -> ast.AST:
        if called.attr not in self._own_methods:
            return super()._method(node, called)
        # A method of an object of the user may have the name of one of arrays.
        own = like(called, ast.Name("rtcf_own", ast.Load()))
        plain = copy_of(node)
        plain.func = like(called, ast.Attribute(own, called.attr, ast.Load()))
        owner = self.visit(called.value)
        self.scope["rtcf_is_array"] = _is_array
        either = ast.IfExp(
            call_of("rtcf_is_array", own),
            super()._method(node, like(called, ast.Attribute(own, called.attr, ast.Load()))),
            self.generic_visit(plain),
        )
        arguments = ast.arguments([], [ast.arg("rtcf_own")], None, [], [], None, [])
        return like(node, ast.Call(ast.Lambda(arguments, either), [owner], []))

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        if isinstance(resolve(node.value, self.source), type(np.r_) | type(np.c_) | dict):
            return self.generic_visit(node)
        return super().visit_Subscript(node)

    def _flags(self, node: ast.expr) -> ast.expr | None:
        return None

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        if isinstance(resolve(node.comparators[0], self.source), dict):
            return self.generic_visit(node)
        return super().visit_Compare(node)

    def visit_If(self, node: ast.If) -> ast.AST:
        return self._counted(node)

    def visit_While(self, node: ast.While) -> ast.AST:
        return self._counted(node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        return self._counted(node)

    def _counted(self, node: Any) -> ast.AST:
        """Count how often a condition is true and false."""
        branch = (self.source.file, node.test.lineno, ast.unparse(node.test))
        counts = self._branches.setdefault(branch, [0, 0])
        self.generic_visit(node)

        def counted(test: Any) -> bool:
            is_true = bool(test)
            counts[is_true] += 1
            return is_true

        name = f"rtcf_counted_{len(self.scope)}"
        self.scope[name] = counted
        node.test = like(node.test, call_of(name, node.test))
        return node  # type: ignore[no-any-return]

    def visit_Assign(self, node: ast.Assign) -> Any:
        target = node.targets[0]
        self.generic_visit(node)
        if len(node.targets) > 1 or not isinstance(target, ast.Subscript):
            return node
        name = f"rtcf_value_{node.lineno}_{node.col_offset}"
        given = ast.Assign([ast.Name(name, ast.Store())], node.value)
        return [like(node, given), self._set(node, target, ast.Name(name, ast.Load()))]

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        target, value = node.target, self.visit(node.value)
        change = self._changing(node.op)
        if not isinstance(target, ast.Subscript):
            changed = call_of(change, self.visit(loaded(target)), value)
            return like(node, ast.Assign([self.visit(target)], changed))
        names = [
            f"rtcf_{each}_{node.lineno}_{node.col_offset}" for each in ("base", "index", "new")
        ]
        base, index, new = (ast.Name(each, ast.Load()) for each in names)
        place = call_of("rtcf_get", base, index)
        steps = (self.visit(target.value), index_of(self.visit(target.slice)), place,
                 call_of(f"{change}_element", new, value))  # fmt: skip
        found: list[ast.stmt] = [
            like(node, ast.Assign([ast.Name(name, ast.Store())], step))
            for name, step in zip((*names, names[2]), steps, strict=True)
        ]
        return [*found, like(node, ast.Expr(call_of("rtcf_set", base, index, new)))]

    def _set(self, node: ast.Assign, target: ast.Subscript, value: ast.expr) -> ast.stmt:
        index = index_of(target.slice)
        return like(node, ast.Expr(call_of("rtcf_set", loaded(target.value), index, value)))

    def _changing(self, operation: ast.operator) -> str:
        """Return the name of the function for `x += value`, which changes an array in place."""
        own = getattr(operator, _IN_PLACE[type(operation)])
        of = _SINGLE.get(type(operation))
        functions, element = self._functions, operators.OF_ELEMENTS.get(type(operation))

        def change(target: Any, value: Any) -> Any:
            if isinstance(target, np.ndarray) and own is not operator.imatmul:
                return own(target, operators.alike(target, value)[1])
            return own(target, value) if of is None else of(target, value)

        def change_element(target: Any, value: Any) -> Any:
            if functions == operators.NARROW and element and not isinstance(target, np.ndarray):
                return element(target, value)
            return change(target, value)

        name = f"rtcf_{_IN_PLACE[type(operation)]}"
        self.scope[name], self.scope[f"{name}_element"] = change, change_element
        return name


def _sum_in_order(values: Iterable[Any], start: Any = 0) -> Any:
    """Return the sum from the first element to the last, in all versions of Python."""
    for each in values:
        start = start + each
    return start


_IN_PLACE: dict[type[ast.operator], str] = {
    **{ast.Add: "iadd", ast.Sub: "isub", ast.Mult: "imul", ast.Div: "itruediv", ast.Pow: "ipow"},
    **{ast.FloorDiv: "ifloordiv", ast.Mod: "imod", ast.MatMult: "imatmul", ast.BitAnd: "iand"},
    **{ast.BitOr: "ior", ast.BitXor: "ixor", ast.LShift: "ilshift", ast.RShift: "irshift"},
}
# The operators whose single numbers are computed as in compiled code.
_SINGLE: dict[type[ast.operator], Any] = {
    **{node: operators.OF[of] for node, of in operators.BINARY.items()},
    **{node: operators.OF[of] for node, of in operators.SHIFTS.items()},
    ast.Pow: HELPERS["rtcf_pow"],
    ast.MatMult: HELPERS["rtcf_matmul"],
}
