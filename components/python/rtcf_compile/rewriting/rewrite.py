"""From a hook as written to one that works on the component's record, and needs no object.

`self.u.value` becomes the field `self.u`, `self.x.write(v)` an assignment and a flag,
`self.helper(v)` the function `method_helper(self, v)`, `@` the product of `helpers`.
"""

import ast
from typing import Any

from rtcf.component.declaration import (
    LOG_LEVELS,
    PORTS,
    TIME_FIELDS,
    Derived,
    Description,
    Input,
    Member,
    Output,
    Parameter,
    Queue,
    State,
)
from rtcf.component.message_type import MessageType
from rtcf.component.value_type import ValueType

from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.rewriting.products import Products, call_of, like, loaded
from rtcf_compile.source.checks import METHODS
from rtcf_compile.source.modules import Source

_INPUT_FIELDS = {"value": "", "new": "__new", "valid": "__valid", "age": "__age"}
_INPUT_FIELDS["connected"] = "__connected"
_QUEUE_FIELDS = {"size": "__count", "dropped": "__dropped", "connected": "__connected"}


class Hook(Products):
    """Puts fields of the record in the place of `self`'s members."""

    def __init__(
        self, source: Source, description: Description, methods: set[str], logs: Logs
    ) -> None:
        """Rewrite a method of a class that has these members and methods."""
        super().__init__(source)
        self._description, self._methods, self._logs = description, methods, logs
        self._self = source.tree.args.args[0].arg if source.tree.args.args else ""
        self.called: dict[str, ast.AST] = {}
        self.used: set[str] = set()
        self.lines: set[int] = set()
        self.touched: dict[str, ast.AST] = {}

    def function(self) -> ast.FunctionDef:
        """Return the rewritten function."""
        tree = self.source.tree
        if not self._self:
            raise self.mistake(tree, f"{tree.name} has no self", f"def {tree.name}(self):")
        body: list[ast.stmt] = []
        for statement in tree.body:
            new = self.visit(statement)
            body.extend(new if isinstance(new, list) else [new])
        arguments = ast.arguments(
            posonlyargs=[],
            args=[ast.arg(each.arg) for each in tree.args.args],
            kwonlyargs=[],
            kw_defaults=[],
            defaults=tree.args.defaults,
        )
        return like(tree, ast.FunctionDef(tree.name, arguments, body, []))

    def visit(self, node: ast.AST) -> Any:
        """Note the line before a statement that calls something: what it calls has other lines."""
        new = super().visit(node)
        calls = (ast.Call, ast.Subscript, ast.BinOp)
        simple = (ast.Expr, ast.Assign, ast.AugAssign, ast.Return)
        if isinstance(node, simple) and any(isinstance(each, calls) for each in ast.walk(node)):
            self.lines.add(node.lineno)
            target = ast.Attribute(ast.Name(self._self, ast.Load()), "_line", ast.Store())
            mark = like(node, ast.Assign([target], ast.Constant(node.lineno)))
            return [mark, *(new if isinstance(new, list) else [new])]
        return new

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """`self` alone is no value."""
        if node.id == self._self:
            raise self.mistake(
                node, f"{self._self} is no value here", f"pass what is needed, as {self._self}.name"
            )
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """`self.name`, `self.port.value` and `self.port.value.linear.x`."""
        message, path = self._message(node)
        if message is not None:
            return self._part(node, message, path)
        port = self._member(node.value)
        if port is not None and port.kind in PORTS:
            return self._queue(node, port) if port.kind is Queue else self._port(node, port)
        if self._is_self(node.value):
            return self._own(node)
        return super().visit_Attribute(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """`self.method(…)`, `self.x.write(…)`, `self.info(…)`, `self.fault(…)`."""
        called = node.func
        if isinstance(called, ast.Attribute) and self._is_self(called.value):
            if called.attr in LOG_LEVELS:
                arguments = [self.visit(each) for each in node.args[1:]]
                number = self._logs.add(called.attr, node, self.source)
                component = self._field("_component")
                return like(node, call_of(f"rtcf_log_{number}", component, *arguments))
            if called.attr == "fault":
                raise self.mistake(node, "ends the hook", "write it as a statement of its own")
            if called.attr in self._methods:
                self.called[called.attr] = node
                arguments = [self.visit(each) for each in node.args]
                own = ast.Name(self._self, ast.Load())
                new = call_of(f"method_{called.attr}", own, *arguments)
                new.keywords = [self.visit(each) for each in node.keywords]
                return like(node, new)
        if isinstance(called, ast.Attribute):
            port = self._member(called.value)
            if port is not None and port.kind is Output and called.attr == "write":
                raise self.mistake(
                    node, "a write is no value", "write it as a statement of its own"
                )
            if port is not None and port.kind is not Queue and called.attr == "pop":
                raise self.mistake(node, *METHODS["pop"])
            if port is not None and called.attr == "pop":
                raise self.mistake(
                    node,
                    "a pop is no value",
                    f"look at self.{port.name}.front, then write it as a statement of its own",
                )
            if port is not None and port.kind is Input and called.attr == "read":
                raise self.mistake(
                    node,
                    "inputs are read before each update",
                    f"look at self.{port.name}.new, .valid or .value",
                )
        return super().visit_Call(node)

    def visit_Expr(self, node: ast.Expr) -> ast.AST | list[ast.stmt]:
        """Statements that write and that end."""
        call = node.value
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
            port = self._member(call.func.value)
            if port is not None and port.kind is Output and call.func.attr == "publish":
                if call.args or call.keywords:
                    raise self.mistake(call, "takes nothing", f"self.{port.name}.publish()")
                flag = ast.Assign([self._field(f"{port.name}__written")], ast.Constant(True))
                return like(node, flag)
            if port is not None and port.kind is Output and call.func.attr == "write":
                if port.message:
                    raise self.mistake(
                        call,
                        "a message is not written as a whole",
                        f"self.{port.name}.value.… = …, then self.{port.name}.publish()",
                    )
                if len(call.args) != 1 or call.keywords:
                    raise self.mistake(call, "writes one value", f"self.{port.name}.write(value)")
                flag = ast.Assign([self._field(f"{port.name}__written")], ast.Constant(True))
                return [self._set(node, port, self.visit(call.args[0])), like(node, flag)]
            if port is not None and port.kind is Queue and call.func.attr == "pop":
                if call.args or call.keywords:
                    raise self.mistake(call, "takes nothing", f"self.{port.name}.pop()")
                return self._pop(node, port)
            if self._is_self(call.func.value) and call.func.attr == "fault":
                return self._fault(node, call)
        return super().generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """`self.name = value`."""
        for target in node.targets:
            self._check_elements(target)
        own = [each for target in node.targets for each in self._owned(target)]
        if len(node.targets) == 1 and (part := self._settable_part(node.targets[0])):
            return self._set_field(node, *part, self.visit(node.value))
        if not own:
            return super().visit_Assign(node)
        if len(node.targets) > 1 or isinstance(node.targets[0], ast.Tuple | ast.List):
            raise self.mistake(node, "sets several at once", "write one assignment a line")
        target = node.targets[0]
        if isinstance(target, ast.Attribute) and self._is_self(target.value):
            return self._set(node, self._settable(target), self.visit(node.value))
        return super().visit_Assign(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """`self.name: State[float] = 0.0` in a hook."""
        if self._owned(node.target):
            raise self.mistake(node, "declares in a hook", "declare it in the class")
        if node.value is None:
            return like(node, ast.Pass())
        plain = ast.Assign([node.target], node.value)
        return self.visit(like(node, plain))  # type: ignore[no-any-return]

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """`self.name += value`."""
        target = node.target
        self._check_elements(target)
        if isinstance(target, ast.Attribute) and self._is_self(target.value):
            member = self._settable(target)
            value = self.visit(like(node, ast.BinOp(loaded(target), node.op, node.value)))
            return self._set(node, member, value)
        if part := self._settable_part(target):
            value = self.visit(like(node, ast.BinOp(loaded(target), node.op, node.value)))
            return self._set_field(node, *part, value)
        return super().visit_AugAssign(node)

    def _check_elements(self, target: ast.expr) -> None:
        """Refuse to set elements of what is not a State, an Output or a variable."""
        while isinstance(target, ast.Subscript):
            target = target.value
            if isinstance(target, ast.Attribute) and self._is_self(target.value):
                self._settable(target)
            elif isinstance(target, ast.Attribute):
                port = self._member(target.value)
                port = self._message(target)[0] if port is None else port
                if port is not None and port.kind is not Output:
                    raise self.mistake(target, f"is of {_a(port)}", "it is only read")

    def _settable(self, node: ast.Attribute) -> Member:
        member = self._description.members.get(node.attr)
        if member is not None and member.kind is State:
            self._touch(node, node.attr)
        if member is None:
            if node.attr in TIME_FIELDS:
                raise self.mistake(node, "is the loop's", "keep a time of your own in a State")
            if node.attr in self._description.constants:
                raise self.mistake(
                    node, "is a constant of the class", f"declare {node.attr}: State[…]"
                )
            raise self.mistake(
                node, "is not declared", f"write `{node.attr}: State[float]` in the class"
            )
        if member.kind is Parameter:
            raise self.mistake(node, "a parameter is set from outside", "declare a State for it")
        if member.kind is Derived and self.source.tree.name != "prepare":
            raise self.mistake(
                node, "is Derived: prepare alone sets it", "set it in prepare, or declare a State"
            )
        if member.kind in PORTS:
            way = ".write(…)" if member.kind is Output else "only read"
            raise self.mistake(node, f"is {_a(member)}", f"it is {way}")
        return member

    def _set(self, node: ast.stmt, member: Member, value: ast.expr) -> ast.stmt:
        return self._set_field(node, member.name, member.type, value)

    def _set_field(self, node: ast.stmt, name: str, kind: ValueType, value: ast.expr) -> ast.stmt:
        if kind.shape:
            call = call_of("rtcf_assign", self._field(name, ast.Load()), value)
            return like(node, ast.Expr(call))
        convert = "rtcf_float" if kind.is_float else "rtcf_bool" if kind.is_bool else "rtcf_int"
        return like(node, ast.Assign([self._field(name)], call_of(convert, value)))

    def _fault(self, node: ast.Expr, call: ast.Call) -> ast.stmt:
        text = call.args[0] if len(call.args) == 1 else None
        if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
            raise self.mistake(
                call, "a fault has one constant text", "log the values before it by self.error(…)"
            )
        return like(node, ast.Raise(call_of("rtcf_fault", text)))

    def _port(self, node: ast.Attribute, port: Member) -> ast.AST:
        fields = _INPUT_FIELDS if port.kind is Input else {"value": ""}
        if node.attr not in fields:
            has = ", ".join(f".{each}" for each in fields)
            has += ", .write(…)" if port.kind is Output else ""
            raise self.mistake(node, f"{_a(port)} has no {node.attr}", f"it has {has}")
        if isinstance(node.ctx, ast.Store):
            raise self.mistake(node, "a port's value is not set", f"self.{port.name}.write(…)")
        if port.message and node.attr == "value":
            raise self._no_number(node, port.message, ())
        return like(node, self._field(port.name + fields[node.attr], node.ctx))

    def _message(self, node: ast.AST) -> tuple[Member | None, tuple[str, ...]]:
        """Return the port and the path of `self.port.value.path`, if it carries a message."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            port = self._member(node)
            if port is not None and port.message and len(names) > 1 and names[-1] == "value":
                return port, tuple(reversed(names[:-1]))
            names.append(node.attr)
            node = node.value
        return None, ()

    def _part(self, node: ast.Attribute, port: Member, path: tuple[str, ...]) -> ast.AST:
        assert port.message is not None
        leaf = port.message.leaf(path)
        if leaf is None:
            # An attribute of an array, as .shape, belongs to what is before it.
            if port.message.leaf(path[:-1]) is not None:
                return super().visit_Attribute(node)
            raise self._no_number(node, port.message, path)
        field = self._field(port.name + leaf.field, ast.Load() if leaf.is_variable else node.ctx)
        if not leaf.is_variable or port.kind is Output:
            return like(node, field)
        count = self._field(port.name + leaf.count, ast.Load())
        return like(node, ast.Subscript(field, ast.Slice(None, count), ast.Load()))

    def _settable_part(self, target: ast.expr) -> tuple[str, ValueType] | None:
        """Return the field and the type of a part of a message that is set."""
        port, path = self._message(target)
        if port is None or port.message is None:
            return None
        if port.kind is Input:
            raise self.mistake(target, "is of an Input", "it is only read")
        leaf = port.message.leaf(path)
        if leaf is None:
            raise self._no_number(target, port.message, path)
        return port.name + leaf.field, leaf.type

    def _no_number(self, node: ast.AST, message: MessageType, path: tuple[str, ...]) -> Exception:
        name = ".".join((message.name, *path))
        if path in message.texts:
            return self.mistake(
                node, f"{name} is text", 'declare it: Output(texts={"header.frame_id": "base"})'
            )
        if path in message.others:
            return self.mistake(node, f"{name} is a list of messages", "read it in C++")
        if below := message.below(path):
            return self.mistake(node, f"{name} is no number", f"it has .{', .'.join(below)}")
        has = ", .".join(message.below(path[:-1]))
        return self.mistake(node, f"{name} is not there", f"there is .{has}")

    def _queue(self, node: ast.Attribute, port: Member) -> ast.AST:
        """`self.goals.front`, `.size`, `.age`, `.dropped`, `.connected`."""
        name = port.name
        if isinstance(node.ctx, ast.Store):
            raise self.mistake(node, "a queue is only read", f"self.{name}.pop() removes one")
        ring = [
            self._field(f"{name}{each}", ast.Load())
            for each in ("__times" if node.attr == "age" else "", "__oldest", "__count")
        ]
        if node.attr == "front":
            return like(node, call_of("rtcf_front", *ring))
        if node.attr == "age":
            self.used.add("_time")
            return like(node, call_of("rtcf_age", self._field("_time", ast.Load()), *ring))
        if node.attr in _QUEUE_FIELDS:
            return like(node, self._field(name + _QUEUE_FIELDS[node.attr], node.ctx))
        raise self.mistake(
            node,
            f"{_a(port)} has no {node.attr}",
            "it has .size, .front, .pop(), .age, .dropped, .connected",
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

    def _own(self, node: ast.Attribute) -> ast.AST:
        name = node.attr
        if name in TIME_FIELDS:
            self._touch(node, name)
            self.used.add(f"_{name}")
            return like(node, self._field(f"_{name}", node.ctx))
        member = self._description.members.get(name)
        if member is not None:
            if member.kind is State:
                self._touch(node, name)
            if member.kind in PORTS:
                value = "front" if member.kind is Queue else "value"
                raise self.mistake(node, f"is {_a(member)}", f"write self.{name}.{value}")
            return like(node, self._field(name, node.ctx))
        if name in self._description.constants:
            self.constants[f"constant_{name}"] = self._description.constants[name]
            return like(node, ast.Name(f"constant_{name}", ast.Load()))
        if name in self._methods:
            raise self.mistake(node, "a method is no value", f"call it: self.{name}(…)")
        raise self.mistake(node, "is not declared", f"write `{name}: State[float]` in the class")

    def _touch(self, node: ast.AST, name: str) -> None:
        """Note what prepare cannot know: all but parameters, what derives from them, constants."""
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

    def _owned(self, target: ast.AST) -> list[ast.AST]:
        """Return what is set of `self` by a target; not elements of arrays."""
        if isinstance(target, ast.Tuple | ast.List):
            return [found for each in target.elts for found in self._owned(each)]
        return [target] if isinstance(target, ast.Attribute) and self._is_self(target.value) else []


def _a(member: Member) -> str:
    """Return a member's kind with its article."""
    kind = member.kind.__name__
    return f"{'an' if kind[0] in 'IO' else 'a'} {kind}"
