"""From a hook as written to one that works on the component's record, and needs no object.

`self.u.value` becomes the field `self.u`, `self.x.write(v)` an assignment and a flag,
`self.helper(v)` the function `method_helper(self, v)`, `@` the product of `helpers`.
"""

import ast
import copy
import dataclasses
import enum
from typing import Any, TypeVar

import numpy as np
from rtcf.component.declaration import (
    LOG_LEVELS,
    TIME_FIELDS,
    Description,
    Input,
    Member,
    Output,
    Parameter,
)

from rtcf_compile.rewriting.helpers import INSTEAD
from rtcf_compile.rewriting.logs import Logs
from rtcf_compile.source.checks import resolve
from rtcf_compile.source.mistake import at
from rtcf_compile.source.modules import Source

_Node = TypeVar("_Node", bound=ast.AST)
_INPUT_FIELDS = {"value": "", "new": "__new", "valid": "__valid", "age": "__age"}
_INPUT_FIELDS["connected"] = "__connected"


class Products(ast.NodeTransformer):
    """Puts the helpers in the place of `@`, np.linalg and assignment to slices."""

    def __init__(self, source: Source) -> None:
        """Rewrite a function of that source."""
        self.source = source
        self.constants: dict[str, Any] = {}

    def mistake(self, node: ast.AST, what: str, way_out: str) -> Exception:
        """Return a mistake at a node."""
        return at(self.source.file, node, what, way_out)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """`GAINS.kp` of a dataclass of constants, `Mode.RUN` of an enum."""
        owner = resolve(node.value, self.source)
        if isinstance(member := resolve(node, self.source), enum.IntEnum):
            return _like(node, ast.Constant(int(member)))
        if dataclasses.is_dataclass(owner) and not isinstance(owner, type):
            name = f"constant_{ast.unparse(node).replace('.', '_')}"
            self.constants[name] = getattr(owner, node.attr)
            return _like(node, ast.Name(name, ast.Load()))
        self.generic_visit(node)
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """`a @ b`."""
        self.generic_visit(node)
        if isinstance(node.op, ast.MatMult):
            return _like(node, _call("rtcf_matmul", node.left, node.right))
        return node

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """`np.linalg.solve(a, b)`, `a.dot(b)`."""
        target = resolve(node.func, self.source)
        instead = next((own for each, own in INSTEAD.items() if each is target), None)
        if instead is not None:
            arguments = [self.visit(each) for each in node.args]
            return _like(node, _call(instead.__name__, *arguments))
        if isinstance(node.func, ast.Attribute) and target is None and node.func.attr == "dot":
            arguments = [self.visit(each) for each in node.args]
            return _like(node, _call("rtcf_matmul", self.visit(node.func.value), *arguments))
        if getattr(target, "__module__", "") == "numpy.linalg" or (
            isinstance(node.func, ast.Attribute)
            and resolve(node.func.value, self.source) is np.linalg
        ):
            raise self.mistake(
                node, "calls LAPACK, which allocates", "np.linalg has solve, inv and cholesky here"
            )
        self.generic_visit(node)
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """`x[1:3] = value`."""
        if len(node.targets) == 1 and _is_slice(node.targets[0]):
            target = node.targets[0]
            read = self.visit(_loaded(target))
            return _like(node, ast.Expr(_call("rtcf_assign", read, self.visit(node.value))))
        self.generic_visit(node)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """`x[1:3] += value`, `x @= m`."""
        if _is_slice(node.target) or isinstance(node.op, ast.MatMult):
            value = ast.BinOp(_loaded(node.target), node.op, node.value)
            plain = ast.Assign([node.target], _like(node, value))
            return self.visit(_like(node, plain))  # type: ignore[no-any-return]
        self.generic_visit(node)
        return node


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
        return _like(tree, ast.FunctionDef(tree.name, arguments, body, []))

    def visit(self, node: ast.AST) -> Any:
        """Note the line before a statement that calls something: what it calls has other lines."""
        new = super().visit(node)
        calls = (ast.Call, ast.Subscript, ast.BinOp)
        simple = (ast.Expr, ast.Assign, ast.AugAssign, ast.Return)
        if isinstance(node, simple) and any(isinstance(each, calls) for each in ast.walk(node)):
            self.lines.add(node.lineno)
            target = ast.Attribute(ast.Name(self._self, ast.Load()), "_line", ast.Store())
            mark = _like(node, ast.Assign([target], ast.Constant(node.lineno)))
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
        """`self.name` and `self.port.value`."""
        port = self._member(node.value)
        if port is not None and port.kind in (Input, Output):
            return self._port(node, port)
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
                return _like(node, _call(f"rtcf_log_{number}", component, *arguments))
            if called.attr == "fault":
                raise self.mistake(node, "ends the hook", "write it as a statement of its own")
            if called.attr in self._methods:
                self.called[called.attr] = node
                arguments = [self.visit(each) for each in node.args]
                own = ast.Name(self._self, ast.Load())
                new = _call(f"method_{called.attr}", own, *arguments)
                new.keywords = [self.visit(each) for each in node.keywords]
                return _like(node, new)
        if isinstance(called, ast.Attribute):
            port = self._member(called.value)
            if port is not None and port.kind is Output and called.attr == "write":
                raise self.mistake(
                    node, "a write is no value", "write it as a statement of its own"
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
            if port is not None and port.kind is Output and call.func.attr == "write":
                if len(call.args) != 1 or call.keywords:
                    raise self.mistake(call, "writes one value", f"self.{port.name}.write(value)")
                flag = ast.Assign([self._field(f"{port.name}__written")], ast.Constant(True))
                return [self._set(node, port, self.visit(call.args[0])), _like(node, flag)]
            if self._is_self(call.func.value) and call.func.attr == "fault":
                return self._fault(node, call)
        return super().generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """`self.name = value`."""
        own = [each for target in node.targets for each in self._owned(target)]
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
            return _like(node, ast.Pass())
        plain = ast.Assign([node.target], node.value)
        return self.visit(_like(node, plain))  # type: ignore[no-any-return]

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        """`self.name += value`."""
        target = node.target
        if isinstance(target, ast.Attribute) and self._is_self(target.value):
            member = self._settable(target)
            value = self.visit(_like(node, ast.BinOp(_loaded(target), node.op, node.value)))
            return self._set(node, member, value)
        return super().visit_AugAssign(node)

    def _settable(self, node: ast.Attribute) -> Member:
        member = self._description.members.get(node.attr)
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
        if member.kind in (Input, Output):
            way = ".write(…)" if member.kind is Output else "only read"
            raise self.mistake(node, f"is an {member.kind.__name__}", f"it is {way}")
        return member

    def _set(self, node: ast.stmt, member: Member, value: ast.expr) -> ast.stmt:
        kind = member.type
        if kind.shape:
            call = _call("rtcf_assign", self._field(member.name, ast.Load()), value)
            return _like(node, ast.Expr(call))
        convert = "rtcf_float" if kind.is_float else "rtcf_bool" if kind.is_bool else "rtcf_int"
        return _like(node, ast.Assign([self._field(member.name)], _call(convert, value)))

    def _fault(self, node: ast.Expr, call: ast.Call) -> ast.stmt:
        text = call.args[0] if len(call.args) == 1 else None
        if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
            raise self.mistake(
                call, "a fault has one constant text", "log the values before it by self.error(…)"
            )
        return _like(node, ast.Raise(_call("rtcf_fault", text)))

    def _port(self, node: ast.Attribute, port: Member) -> ast.AST:
        fields = _INPUT_FIELDS if port.kind is Input else {"value": ""}
        if node.attr not in fields:
            has = ", ".join(f".{each}" for each in fields)
            has += ", .write(…)" if port.kind is Output else ""
            raise self.mistake(node, f"an {port.kind.__name__} has no {node.attr}", f"it has {has}")
        if isinstance(node.ctx, ast.Store):
            raise self.mistake(node, "a port's value is not set", f"self.{port.name}.write(…)")
        return _like(node, self._field(port.name + fields[node.attr], node.ctx))

    def _own(self, node: ast.Attribute) -> ast.AST:
        name = node.attr
        if name in TIME_FIELDS:
            self.used.add(f"_{name}")
            return _like(node, self._field(f"_{name}", node.ctx))
        member = self._description.members.get(name)
        if member is not None:
            if member.kind in (Input, Output):
                raise self.mistake(
                    node, f"is an {member.kind.__name__}", f"write self.{name}.value"
                )
            return _like(node, self._field(name, node.ctx))
        if name in self._description.constants:
            self.constants[f"constant_{name}"] = self._description.constants[name]
            return _like(node, ast.Name(f"constant_{name}", ast.Load()))
        if name in self._methods:
            raise self.mistake(node, "a method is no value", f"call it: self.{name}(…)")
        raise self.mistake(node, "is not declared", f"write `{name}: State[float]` in the class")

    def _field(self, name: str, context: ast.expr_context | None = None) -> ast.Attribute:
        self.used.add(name)
        return ast.Attribute(ast.Name(self._self, ast.Load()), name, context or ast.Store())

    def _member(self, node: ast.AST) -> Member | None:
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            return self._description.members.get(node.attr)
        return None

    def _is_self(self, node: ast.AST) -> bool:
        return isinstance(node, ast.Name) and node.id == self._self

    def _owned(self, target: ast.AST) -> list[ast.AST]:
        """Return what is set of `self` by a target; not elements of arrays."""
        if isinstance(target, ast.Tuple | ast.List):
            return [found for each in target.elts for found in self._owned(each)]
        return [target] if isinstance(target, ast.Attribute) and self._is_self(target.value) else []


def _is_slice(node: ast.AST) -> bool:
    if not isinstance(node, ast.Subscript):
        return False
    parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
    return any(isinstance(each, ast.Slice) or _is_ellipsis(each) for each in parts)


def _is_ellipsis(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is ...


def _loaded(target: ast.expr) -> ast.expr:
    """Return a target as an expression that reads it."""
    new = copy.deepcopy(target)
    new.ctx = ast.Load()  # type: ignore[attr-defined]
    return new


def _call(function: str, *arguments: Any) -> ast.Call:
    for each in arguments:
        if isinstance(each, ast.Attribute):
            each.ctx = ast.Load()
    return ast.Call(ast.Name(function, ast.Load()), list(arguments), [])


def _like(node: ast.AST, new: _Node) -> _Node:
    ast.copy_location(new, node)
    return ast.fix_missing_locations(new)
