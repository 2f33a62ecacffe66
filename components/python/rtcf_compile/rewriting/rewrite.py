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
from rtcf.component.value_type import ValueType

from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.rewriting.ports import Ports, a_kind
from rtcf_compile.rewriting.products import call_of, like, loaded
from rtcf_compile.source.checks import METHODS
from rtcf_compile.source.modules import Source


class Hook(Ports):
    """Puts fields of the record in the place of `self`'s members."""

    def __init__(
        self, source: Source, description: Description, methods: set[str], logs: Logs
    ) -> None:
        """Rewrite a method of a class that has these members and methods."""
        super().__init__(source, description)
        self._methods, self._logs = methods, logs
        self.called: dict[str, ast.AST] = {}
        self.lines: set[int] = set()

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
                    raise self.mistake(target, f"is of {a_kind(port)}", "it is only read")

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
            raise self.mistake(node, f"is {a_kind(member)}", f"it is {way}")
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
                raise self.mistake(node, f"is {a_kind(member)}", f"write self.{name}.{value}")
            return like(node, self._field(name, node.ctx))
        if name in self._description.constants:
            self.constants[f"constant_{name}"] = self._description.constants[name]
            return like(node, ast.Name(f"constant_{name}", ast.Load()))
        if name in self._methods:
            raise self.mistake(node, "a method is no value", f"call it: self.{name}(…)")
        raise self.mistake(node, "is not declared", f"write `{name}: State[float]` in the class")

    def _owned(self, target: ast.AST) -> list[ast.AST]:
        """Return what is set of `self` by a target; not elements of arrays."""
        if isinstance(target, ast.Tuple | ast.List):
            return [found for each in target.elts for found in self._owned(each)]
        return [target] if isinstance(target, ast.Attribute) and self._is_self(target.value) else []
