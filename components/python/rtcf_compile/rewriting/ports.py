"""Rewrites ports, their messages and queues to fields of the component's record.

`self.u.value` becomes the field `self.u`, `self.twist.value.linear.x` a field of its own, and
`self.goals.pop()` a step in a ring buffer.
"""

import ast
import copy
import enum

from rtcf.component.declaration import (
    PORTS,
    Description,
    Input,
    Member,
    Output,
    Queue,
    own_field,
)
from rtcf.component.message_type import MessageType
from rtcf.component.value_type import ValueType, is_enum

from rtcf_compile.rewriting.common_rewriting import CommonRewriting, call_of, like, loaded
from rtcf_compile.rewriting.operators import is_narrow
from rtcf_compile.source.checks import check_index, resolve
from rtcf_compile.source.modules import Source

_INPUT_FIELDS = {"value": "", "new": "__new", "valid": "__valid", "age": "__age"}
_INPUT_FIELDS["connected"] = "__connected"
_QUEUE_FIELDS = {"size": "__count", "dropped": "__dropped", "connected": "__connected"}


class Ports(CommonRewriting):
    """Replaces ports by fields of the record."""

    def __init__(
        self, source: Source, description: Description, functions: frozenset[type[ast.AST]]
    ) -> None:
        """Rewrite a method of a class with these members; see CommonRewriting."""
        self._description = description
        self._self = source.tree.args.args[0].arg if source.tree.args.args else ""
        self._arguments = {
            each.arg: kind
            for each in source.tree.args.args
            if each.annotation is not None and is_enum(kind := resolve(each.annotation, source))
        }
        super().__init__(source, functions)
        self.used: set[str] = set()
        self.touched: dict[str, ast.AST] = {}

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Check the index of a member with a declared size, such as `self.z[2]`."""
        self._check_index(node)
        return super().visit_Subscript(node)

    def _check_index(self, node: ast.Subscript) -> None:
        """Reject constant indices beyond declared sizes."""
        base = node.value
        is_value = isinstance(base, ast.Attribute) and base.attr == "value"
        owner = base.value if is_value else base  # type: ignore[attr-defined]
        if isinstance(owner, ast.Attribute) and self._is_self(owner.value):
            member = self._description.members.get(owner.attr)
            if member is not None and member.type.shape and is_value == (member.kind in PORTS):
                check_index(node, member.type.shape, ast.unparse(base), self.source.file)

    def _enum_of(self, node: ast.expr) -> type[enum.Enum] | None:
        """Return the declared enum of a member, of the value of a port, or of an argument with an
        annotation; None for others.
        """
        if isinstance(node, ast.Name):
            return self._arguments.get(node.id)
        is_value = isinstance(node, ast.Attribute) and node.attr == "value"
        owner = node.value if is_value else node  # type: ignore[attr-defined]
        if not isinstance(owner, ast.Attribute) or not self._is_self(owner.value):
            return None
        member = self._description.members.get(owner.attr)
        return None if member is None else member.type.enumeration

    def _is_enum(self, node: ast.expr) -> bool:
        return self._enum_of(node) is not None

    def _port(self, node: ast.Attribute, port: Member) -> ast.AST:
        fields = _INPUT_FIELDS if port.kind is Input else {"value": ""}
        if node.attr not in fields:
            has = ", ".join(f".{each}" for each in fields)
            has += ", .write(…)" if port.kind is Output else ""
            what = f"{a_kind(port)} has no {node.attr}"
            if port.message and port.message.below((node.attr,)):
                raise self.mistake(node, what, f"write self.{port.name}.value.{node.attr}")
            raise self.mistake(node, what, f"use {has}")
        if isinstance(node.ctx, ast.Store) and port.kind is Input:
            raise self.mistake(node, "an Input is read-only", "write an Output")
        if isinstance(node.ctx, ast.Store):
            what = "a port's value cannot be assigned"
            raise self.mistake(node, what, f"write self.{port.name}.write(…)")
        if port.message and node.attr == "value":
            raise self._no_number(node, port.message, ())
        if node.attr != "value":
            return like(node, self._field(port.name + fields[node.attr], node.ctx))
        value = self._read(port.name, port.type)
        return like(node, self._as_enum(value, port.type, checked=port.kind is Input))

    def _is_uncertain(self, node: ast.expr, names: set[str]) -> bool:
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            member = self._description.members.get(node.attr)
            return member is None or member.type.optional
        return super()._is_uncertain(node, names)

    def _read(self, name: str, kind: ValueType) -> ast.expr:
        """Return the value of a field: a number as a Python number, an array as a view, whose type
        has no sizes.
        """
        field: ast.expr = self._field(name, ast.Load())
        if kind.shape:
            return call_of("rtcf_view", field)
        return call_of("rtcf_plain", field) if is_narrow(kind.scalar) else field

    def _as_enum(self, field: ast.expr, kind: ValueType, checked: bool = False) -> ast.expr:
        """Return an int of the record as its declared enum."""
        if kind.enumeration is None:
            return field
        function = "rtcf_enum" if checked else "rtcf_member"
        return call_of(function, field, self._enum(kind.enumeration))

    def _message(self, node: ast.AST) -> tuple[Member | None, tuple[str, ...]]:
        """Return the port and the path of `self.port.value.path` if the port carries a message."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            port = self._member(node)
            if port is not None and port.message and len(names) > 1 and names[-1] == "value":
                return port, tuple(reversed(names[:-1]))
            names.append(node.attr)
            node = node.value
        return None, ()

    def _message_part(self, node: ast.AST) -> tuple[Member, tuple[str, ...]] | None:
        """Return the port and the path of a message or of a nested message, or None."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            port = self._member(node)
            if port is not None and port.message and names and names[-1] == "value":
                path = tuple(reversed(names[:-1]))
                return None if port.message.type_of(path) is None else (port, path)
            names.append(node.attr)
            node = node.value
        return None

    def _copied(self, node: ast.stmt, target: ast.expr, value: ast.expr) -> list[ast.stmt] | None:
        """Return assignments that copy a message or a part of one; None for other values."""
        mine, theirs = self._message_part(target), self._message_part(value)
        if mine is None or theirs is None:
            return None
        (port, path), (source, place) = mine, theirs
        assert port.message is not None and source.message is not None
        if port.kind is Input:
            raise self.mistake(target, "belongs to an Input, which is read-only", "set an Output")
        try:
            pairs = port.message.pairs(path, source.message, place)
        except TypeError as error:
            raise self.mistake(node, str(error), "copy its numbers one by one") from None
        steps: list[ast.stmt] = []
        for leaf, given in pairs:
            read = value
            for name in given.path[len(place) :]:
                read = ast.Attribute(read, name, ast.Load())
            new = self.visit(like(node, copy.deepcopy(read)))
            steps.append(self._set_field(node, port.name + leaf.field, leaf.type, new))
        return steps

    def _set_field(self, node: ast.stmt, name: str, kind: ValueType, value: ast.expr) -> ast.stmt:
        raise NotImplementedError

    def _without_aliases(self, tree: ast.FunctionDef) -> None:
        """Replace variables that stand for messages, as in `m = self.twist.value`."""
        known: dict[str, ast.expr] = {}
        while True:
            _Named(known).visit(tree)
            found: dict[str, list[ast.Assign]] = {}
            for each in ast.walk(tree):
                if not isinstance(each, ast.Assign) or len(each.targets) > 1:
                    continue
                target = each.targets[0]
                if isinstance(target, ast.Name) and self._message_part(each.value) is not None:
                    found.setdefault(target.id, []).append(each)
            new = {name: places for name, places in found.items() if name not in known}
            if not new:
                break
            for name, places in new.items():
                known[name] = places[0].value
                self._check_alias(tree, name, places)
        _Dropped(known).visit(tree)

    def _check_alias(self, tree: ast.FunctionDef, name: str, places: list[ast.Assign]) -> None:
        """Reject a variable that does not always stand for the same message."""
        own = [each.targets[0] for each in places]
        for each in ast.walk(tree):
            if not isinstance(each, ast.Name) or isinstance(each.ctx, ast.Load):
                continue
            if each.id == name and not any(each is target for target in own):
                raise self.mistake(each, f"{name} is a message", "use another name")
        for place in places:
            if ast.unparse(place.value) != ast.unparse(places[0].value):
                raise self.mistake(place, f"{name} stands for two messages", "use another name")

    def _part(self, node: ast.Attribute, port: Member, path: tuple[str, ...]) -> ast.AST:
        assert port.message is not None
        leaf = port.message.leaf(path)
        if leaf is None:
            # An attribute of an array field, such as .shape.
            if port.message.leaf(path[:-1]) is not None:
                return super().visit_Attribute(node)
            raise self._no_number(node, port.message, path)
        if isinstance(node.ctx, ast.Store) and not leaf.is_variable:
            return like(node, self._field(port.name + leaf.field))
        field = self._read(port.name + leaf.field, leaf.type)
        if not leaf.is_variable or port.kind is Output:
            return like(node, field)
        count = self._field(port.name + leaf.count, ast.Load())
        return like(node, ast.Subscript(field, ast.Slice(None, count), ast.Load()))

    def _settable_part(self, target: ast.expr) -> tuple[str, ValueType] | None:
        """Return the field and the type of a part of a message that is assigned, or None."""
        port, path = self._message(target)
        if port is None or port.message is None:
            return None
        if port.kind is Input:
            raise self.mistake(target, "belongs to an Input, which is read-only", "set an Output")
        leaf = port.message.leaf(path)
        if leaf is None:
            raise self._no_number(target, port.message, path)
        return port.name + leaf.field, leaf.type

    def _no_number(self, node: ast.AST, message: MessageType, path: tuple[str, ...]) -> Exception:
        name = ".".join((message.name, *path))
        if path in message.texts:
            return self.mistake(
                node, f"{name} is text", f'declare it: Output(texts={{"{".".join(path)}": "…"}})'
            )
        if path in message.others:
            return self.mistake(node, f"{name} is a list of messages", "read it in C++")
        if below := message.below(path):
            return self.mistake(node, f"{name} is not a number", f"use .{', .'.join(below)}")
        while not message.below(path[:-1]):
            path = path[:-1]
        has, name = ", .".join(message.below(path[:-1])), ".".join((message.name, *path))
        return self.mistake(node, f"{name} does not exist", f"use .{has}")

    def _queue(self, node: ast.Attribute, port: Member) -> ast.AST:
        """Rewrite `self.goals.front`, `.size`, `.age`, `.dropped`, `.connected`."""
        name = port.name
        if isinstance(node.ctx, ast.Store):
            raise self.mistake(node, "a queue is read-only", f"remove one with self.{name}.pop()")
        ring = [
            self._field(f"{name}{each}", ast.Load())
            for each in ("__times" if node.attr == "age" else "", "__oldest", "__count")
        ]
        if node.attr == "front":
            return like(node, call_of("rtcf_front", *ring))
        if node.attr == "age":
            now = self._field(own_field("time"), ast.Load())
            return like(node, call_of("rtcf_age", now, *ring))
        if node.attr in _QUEUE_FIELDS:
            return like(node, self._field(name + _QUEUE_FIELDS[node.attr], node.ctx))
        raise self.mistake(
            node,
            f"{a_kind(port)} has no {node.attr}",
            "use .size, .front, .pop(), .age, .dropped, .connected",
        )

    def _pop(self, node: ast.Expr, port: Member) -> ast.stmt:
        call = call_of("rtcf_after", self._field(f"{port.name}__oldest"), ast.Constant(port.size))
        count = self._field(f"{port.name}__count", ast.Load())
        steps: list[ast.stmt] = [
            ast.Assign([self._field(f"{port.name}__oldest")], call),
            ast.Assign(
                [self._field(f"{port.name}__count")],
                ast.BinOp(loaded(count), ast.Sub(), ast.Constant(1)),
            ),
        ]
        some = ast.Compare(count, [ast.Gt()], [ast.Constant(0)])
        return like(node, ast.If(some, steps, []))

    def _known(self, base: ast.expr) -> tuple[int, bool]:
        if not isinstance(base, ast.Attribute) or not self._is_self(base.value):
            return 0, False
        member = self._description.members.get(base.attr)
        if member is None or member.message or member.kind is Queue:
            return 0, False
        return len(member.type.shape), member.type.is_float

    def _touch(self, node: ast.AST, name: str) -> None:
        """Record the use of a member that prepare cannot read."""
        self.touched.setdefault(name, node)

    def _field(self, name: str, context: ast.expr_context | None = None) -> ast.Attribute:
        self.used.add(name)
        return ast.Attribute(ast.Name(self._self, ast.Load()), name, context or ast.Store())

    def _member(self, node: ast.AST) -> Member | None:
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            member = self._description.members.get(node.attr)
            if member is not None and member.kind in PORTS:
                self._touch(node, node.attr)
            return member
        return None

    def _is_self(self, node: ast.AST) -> bool:
        return isinstance(node, ast.Name) and node.id == self._self


def a_kind(member: Member) -> str:
    """Return the kind of a member with its article."""
    kind = member.kind.__name__
    return f"{'an' if kind[0] in 'IO' else 'a'} {kind}"


class _Named(ast.NodeTransformer):
    """Replaces variables by expressions where they are read."""

    def __init__(self, known: dict[str, ast.expr]) -> None:
        self._known = known

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if isinstance(node.ctx, ast.Load) and node.id in self._known:
            return like(node, copy.deepcopy(self._known[node.id]))
        return node


class _Dropped(ast.NodeTransformer):
    """Drops assignments to variables."""

    def __init__(self, known: dict[str, ast.expr]) -> None:
        self._known = known

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        target = node.targets[0]
        if len(node.targets) == 1 and isinstance(target, ast.Name) and target.id in self._known:
            return like(node, ast.Pass())
        return node
