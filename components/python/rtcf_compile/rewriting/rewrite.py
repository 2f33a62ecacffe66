"""Rewrites a hook or method to a function on the component's record, which needs no object.

`self.u.value` becomes the field `self.u`, `self.x.write(v)` an assignment and a flag,
`self.helper(v)` the call `method_0_helper(self, v)`, `@` a call of a helper.
"""

import ast
import copy
import difflib
import inspect
from collections.abc import Sequence
from types import FunctionType
from typing import Any

import numpy as np
from rtcf.component import Component
from rtcf.component.declaration import (
    HOOKS,
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
    own_field,
    private_name,
    written_name,
)
from rtcf.component.value_type import ValueType, number_of

from rtcf_compile.rewriting.common_rewriting import call_of, changed_elements, like, loaded
from rtcf_compile.rewriting.logs import Logs, with_name
from rtcf_compile.rewriting.methods import Method, Methods, nested
from rtcf_compile.rewriting.ports import Ports, a_kind
from rtcf_compile.rewriting.references import is_super
from rtcf_compile.source.checks import METHODS, check_arguments, resolve
from rtcf_compile.source.mistake import at, once
from rtcf_compile.source.modules import Source, read
from rtcf_compile.source.spelling import SETTER

_MOST_TEXTS = 32  # of a dict, tuple or list
# Names of loggers in other libraries.
_LOGGERS = ("log", "logger", "_logger", "get_logger")


class Hook(Ports):
    """Replaces members of `self` by fields of the record."""

    def __init__(
        self,
        source: Source,
        description: Description,
        methods: Methods,
        owner: type,
        logs: Logs,
        functions: frozenset[type[ast.AST]],
        is_noted: bool = True,
        entry_line: int = 0,
    ) -> None:
        """Rewrite a method defined by `owner` for a component with these members and methods.

        `is_noted`: the method notes its lines while it runs, because it is in the component's file.
        `entry_line`: a line to note at entry, or 0.
        """
        super().__init__(source, description, functions)
        self._is_noted, self._entry_line = is_noted, entry_line
        self._methods, self._owner, self._logs = methods, owner, logs
        self.called: dict[str, Method] = {}
        self.lines: set[int] = set()

    def function(self) -> ast.FunctionDef:
        """Return the rewritten function."""
        tree = self.source.tree
        if not self._self:
            raise self.mistake(tree, f"{tree.name} has no self", f"write def {tree.name}(self):")
        self._without_aliases(tree)
        body = self.statements(tree.body)
        if self._entry_line:
            body.insert(0, self._mark(tree, self._entry_line))
        arguments = ast.arguments(
            posonlyargs=[],
            args=[ast.arg(each.arg) for each in (*tree.args.posonlyargs, *tree.args.args)],
            kwonlyargs=[],
            kw_defaults=[],
            defaults=tree.args.defaults,
        )
        return like(tree, ast.FunctionDef(tree.name, arguments, body, []))

    def visit(self, node: Any) -> Any:
        """Note the line before a statement that may raise or call: callees have other lines."""
        calls = (ast.Call, ast.Subscript, ast.BinOp)
        simple = (ast.Expr, ast.Assign, ast.AugAssign, ast.Return)
        is_simple = isinstance(node, simple)
        raises = is_simple and any(map(self._may_raise, ast.walk(node)))
        if isinstance(node, ast.If):
            parts = list(ast.walk(node.test))
            tests_none = any(isinstance(each, ast.Is | ast.IsNot) for each in parts)
            raises = not tests_none and any(map(self._may_raise, parts))
        new = super().visit(node)
        if not self._is_noted:
            return new
        if raises or (is_simple and any(isinstance(each, calls) for each in ast.walk(node))):
            mark = self._mark(node, node.lineno)
            return [mark, *(new if isinstance(new, list) else [new])]
        return new

    def _mark(self, node: ast.AST, line: int) -> ast.stmt:
        """Return a statement that notes a line."""
        self.lines.add(line)
        own = ast.Name(self._self, ast.Load())
        target = ast.Attribute(own, own_field("line"), ast.Store())
        return like(node, ast.Assign([target], ast.Constant(line)))

    def _may_raise(self, node: ast.AST) -> bool:
        """Tell whether a node is `self.goals.front` or a state that may be None."""
        if not isinstance(node, ast.Attribute):
            return False
        if node.attr == "front":
            return True
        member = self._description.members.get(node.attr) if self._is_self(node.value) else None
        return member is not None and member.type.optional

    def constant(self, node: ast.AST) -> Any:
        """Return the constant to which a dotted name refers, such as `self.SPEEDS`, or None."""
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            return self._description.constants.get(node.attr)
        return super().constant(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Reject `self` used as a value."""
        if node.id == self._self:
            raise self.mistake(
                node, f"{self._self} cannot be used as a value", f"pass a member: {self._self}.name"
            )
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """Rewrite `self.name`, `self.port.value` and `self.port.value.linear.x`."""
        message, path = self._message(node)
        if message is not None:
            return self._part(node, message, path)
        self._plain_member(node)
        owner = resolve(node.value, self.source)
        is_component = isinstance(owner, type) and issubclass(owner, Component)
        if is_component and node.attr in self._description.members:
            what = f"{node.attr} belongs to each object of {owner.__name__}"
            raise self.mistake(node, what, f"write self.{node.attr}")
        port = self._member(node.value)
        if port is not None and port.kind in PORTS:
            return self._queue(node, port) if port.kind is Queue else self._port(node, port)
        if self._is_self(node.value):
            return self._own(node)
        if is_super(node.value):
            method = self._of_super(node)
            if method.kind == "property":
                return self._call(node, method, [])
        return super().visit_Attribute(node)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        """Rewrite comparisons of an optional state, such as `self.last is None`."""
        if len(node.ops) == 1 and _is_none(node.comparators[0]):
            port = self._member(getattr(node.left, "value", node.left))
            if port is not None and port.kind is Input and isinstance(node.left, ast.Attribute):
                what, remedy = "an input always has a value", f"use self.{port.name}.valid"
                raise self.mistake(node, what, remedy)
            member = self._optional(node.left)
            if member is not None and isinstance(node.ops[0], ast.Is | ast.Eq):
                return like(node, ast.UnaryOp(ast.Not(), self._field(member.known, ast.Load())))
            if member is not None and isinstance(node.ops[0], ast.IsNot | ast.NotEq):
                return like(node, self._field(member.known, ast.Load()))
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.Eq | ast.NotEq):
            for one, other in ((node.left, node.comparators[0]), (node.comparators[0], node.left)):
                member = self._optional(one)
                if member is not None and self._optional(other) is None:
                    # None differs from every number.
                    value = self._as_enum(self._read(member.name, member.type), member.type)
                    equal = ast.Compare(value, [ast.Eq()], [self.visit(other)])
                    known = self._field(member.known, ast.Load())
                    test: ast.expr = ast.BoolOp(ast.And(), [known, equal])
                    if isinstance(node.ops[0], ast.NotEq):
                        test = ast.UnaryOp(ast.Not(), test)
                    return like(node, test)
        return super().visit_Compare(node)

    def _optional(self, node: ast.AST) -> Member | None:
        """Return the state of an expression if it may be None, else None."""
        if not isinstance(node, ast.Attribute) or not self._is_self(node.value):
            return None
        member = self._description.members.get(node.attr)
        if member is None or not member.type.optional:
            return None
        self._touch(node, node.attr)
        return member

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Rewrite `self.method(…)`, `self.x.write(…)`, `self.info(…)`, `self.fault(…)`."""
        called = node.func
        own = self.source.lifted.get(called.id) if isinstance(called, ast.Name) else None
        if own is not None and node.args and self._is_self(node.args[0]):
            return self._nested(node, own)
        if isinstance(called, ast.Attribute) and self._is_self(called.value):
            is_log = called.attr in LOG_LEVELS and called.attr not in self._own_names()
            if is_log:
                arguments = [self.visit(each) for each in node.args[1:]]
                number = self._logs.add(called.attr, node, self.source)
                component = self._field(own_field("component"))
                return like(node, call_of(f"rtcf_log_{number}", component, *arguments))
            if called.attr == "fault":
                raise self.mistake(node, "fault ends the hook", "write it as a separate statement")
            self._no_function(node, called)
            method = self._methods.find(called.attr)
            if method is not None and called.attr not in HOOKS:
                return self._call(node, method, node.args)
        if isinstance(called, ast.Attribute) and is_super(called.value):
            return self._call(node, self._of_super(called), node.args)
        if isinstance(called, ast.Attribute):
            owner = resolve(called.value, self.source)
            method = self._methods.find_of(owner, called.attr) if isinstance(owner, type) else None
            if method is not None and method.kind == "static method":
                return self._call(node, method, node.args)
            if method is not None and node.args and self._is_self(node.args[0]):
                return self._call(node, method, node.args[1:])
            port = self._member(called.value)
            if port is not None and port.kind is Output and called.attr == "write":
                raise self.mistake(
                    node, "write returns no value", "write it as a separate statement"
                )
            if port is not None and port.kind is not Queue and called.attr == "pop":
                raise self.mistake(node, *METHODS["pop"])
            if port is not None and called.attr == "pop":
                raise self.mistake(
                    node,
                    "pop returns no value",
                    f"read self.{port.name}.front, then write pop as a separate statement",
                )
            if port is not None and port.kind is Input and called.attr == "read":
                raise self.mistake(
                    node,
                    "inputs are read before each update",
                    f"use self.{port.name}.new, .valid or .value",
                )
        return super().visit_Call(node)

    def _nested(self, node: ast.Call, function: FunctionType) -> ast.AST:
        """Return the call of a nested function, which finds messages by itself."""
        names = list(inspect.signature(function).parameters)
        messages = tuple(
            (name, ast.unparse(each))
            for name, each in zip(names, node.args, strict=False)
            if self._message_part(each) is not None
        )
        values = [each for each in node.args[1:] if self._message_part(each) is None]
        return self._call(node, nested(function, self._owner, messages), values)

    def _call(self, node: ast.AST, method: Method, arguments: Sequence[ast.expr]) -> ast.AST:
        """Return the call of the compiled function of a method."""
        if method.function is None:
            raise self.mistake(node, f"{method.name} is a {method.kind}", method.remedy)
        if isinstance(node, ast.Call) and method.kind != "nested function":
            written = like(node, ast.Call(node.func, list(arguments), node.keywords))
            own = 0 if method.kind == "static method" else 1  # self is not in the source
            check_arguments(written, method.function, self.source.file, own)
        self.called[method.symbol] = method
        given = [self.visit(each) for each in arguments]
        if method.kind != "static method":
            given.insert(0, ast.Name(self._self, ast.Load()))
        new = call_of(method.symbol, *given)
        if isinstance(node, ast.Call):
            new.keywords = [self.visit(each) for each in node.keywords]
        return like(node, new)

    def _named(self, node: ast.Expr, call: ast.Call) -> ast.stmt | None:
        """Return a log call of an enum's name as one call per name; None for other statements."""
        if not isinstance(call.func, ast.Attribute) or call.func.attr not in LOG_LEVELS:
            return None
        if call.func.attr in self._own_names():
            return None
        for number, each in enumerate(call.args[1:]):
            if (logged := self._with_text(node, call, number)) is not None:
                return logged
            if not isinstance(each, ast.Attribute) or each.attr != "name":
                continue
            enumeration = self._enum_of(each.value)
            text = call.args[0]
            if enumeration is None or not isinstance(text, ast.Constant):
                continue
            result: list[ast.stmt] = []
            rest = [*call.args[1 : number + 1], *call.args[number + 2 :]]
            for member in enumeration:
                new = with_name(str(text.value), number, member.name)
                if new is None:
                    raise self.mistake(call, "the name of an enum needs a plain {}", "write {}")
                own = like(node, ast.Call(call.func, [ast.Constant(new), *rest], []))
                value = ast.Attribute(each.value, "value", ast.Load())
                test = ast.Compare(value, [ast.Eq()], [ast.Constant(number_of(member))])
                statement = like(node, ast.Expr(copy.deepcopy(own)))
                result = [like(node, ast.If(copy.deepcopy(test), [statement], result))]
            return result[0]
        return None

    def _with_text(self, node: ast.Expr, call: ast.Call, number: int) -> ast.stmt | None:
        """Return a log call with a text as an argument, or with one of several texts of the module,
        as calls with constant texts; None for other arguments.
        """
        given, text = call.args[number + 1], call.args[0]
        if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
            return None
        form = text.value
        rest = [*call.args[1 : number + 1], *call.args[number + 2 :]]

        def logged(value: str) -> ast.stmt | None:
            new = with_name(form, number, value)
            if new is None:
                return None
            own = ast.Call(copy.deepcopy(call.func), [ast.Constant(new), *copy.deepcopy(rest)], [])
            return like(node, ast.Expr(like(call, own)))

        if isinstance(given, ast.Constant) and isinstance(given.value, str):
            return logged(given.value)
        table = self.constant(given.value) if isinstance(given, ast.Subscript) else None
        if not isinstance(table, dict | tuple | list) or not 0 < len(table) <= _MOST_TEXTS:
            return None
        texts = list(table.values() if isinstance(table, dict) else table)
        assert isinstance(given, ast.Subscript)
        is_first = not any(map(self._acts, rest))  # the text is chosen before they are computed
        if not all(isinstance(each, str) for each in texts) or not is_first:
            return None
        if not self._only_reads(given.slice):
            return None
        error = "KeyError" if isinstance(table, dict) else "IndexError"
        raised = ast.Raise(
            call_of(error, ast.Constant(f"{ast.unparse(given.value)} has no such text"))
        )
        result: list[ast.stmt] = [like(node, raised)]
        keys = list(table) if isinstance(table, dict) else list(range(len(table)))
        for key, value in zip(keys, texts, strict=True):
            if (own := logged(value)) is None:
                raise self.mistake(call, "the text of a log needs a plain {}", "write {}")
            tests = [self._number_key(key)]
            if not isinstance(table, dict):
                tests.append(ast.Constant(key - len(table)))
            test: ast.expr = ast.Compare(
                copy.deepcopy(given.slice), [ast.In()], [ast.Tuple(tests, ast.Load())]
            )
            result = [like(node, ast.If(test, [own], result))]
        return result[0]

    def _only_reads(self, node: ast.expr) -> bool:
        """Tell whether an expression has no calls, properties and slices."""
        return not any(
            isinstance(each, ast.Call | ast.Slice)
            or (
                isinstance(each, ast.Attribute)
                and self._is_self(each.value)
                and each.attr not in self._description.members
            )
            for each in ast.walk(node)
        )

    def _own_names(self) -> set[str]:
        """Return the names that hide the methods of Component."""
        return {*self._methods.names(), *self._description.members}

    def _of_super(self, node: ast.Attribute) -> Method:
        method = self._methods.find(node.attr, behind=self._owner)
        if method is None:
            raise self.mistake(node, f"no base has {node.attr}", "call a method of a base")
        return method

    def visit_Expr(self, node: ast.Expr) -> ast.AST | list[ast.stmt]:
        """Rewrite calls as statements: log, write, publish, pop, fault."""
        call = node.value
        if isinstance(call, ast.Call) and (logged := self._named(node, call)) is not None:
            return self.statements([logged])
        if (
            isinstance(call, ast.Call)
            and isinstance(call.func, ast.Attribute)
            and is_super(call.func.value)
            and call.func.attr in ("prepare", "start", "safe")
            and self._methods.find(call.func.attr, behind=self._owner) is None
        ):
            return like(node, ast.Pass())  # the method of Component, which does nothing
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute):
            port = self._member(call.func.value)
            if port is not None and port.kind is Output and call.func.attr == "publish":
                if call.args or call.keywords:
                    raise self.mistake(
                        call, "takes no arguments", f"write self.{port.name}.publish()"
                    )
                flag = ast.Assign([self._field(f"{port.name}__written")], ast.Constant(True))
                return like(node, flag)
            if port is not None and port.kind is Output and call.func.attr == "write":
                if port.message and len(call.args) == 1:
                    whole = ast.Attribute(call.func.value, "value", ast.Load())
                    copied = self._copied(node, whole, call.args[0])
                    if copied is not None:
                        written = self._field(f"{port.name}__written")
                        return [*copied, like(node, ast.Assign([written], ast.Constant(True)))]
                if port.message:
                    raise self.mistake(
                        call,
                        "a message cannot be written as a whole",
                        f"set self.{port.name}.value.… = …, then self.{port.name}.publish()",
                    )
                if len(call.args) != 1 or call.keywords:
                    raise self.mistake(
                        call, "takes one value", f"write self.{port.name}.write(value)"
                    )
                flag = ast.Assign([self._field(f"{port.name}__written")], ast.Constant(True))
                value = self._set_field(node, port.name, port.type, self.visit(call.args[0]))
                return [value, like(node, flag)]
            if port is not None and port.kind is Queue and call.func.attr == "pop":
                if call.args or call.keywords:
                    raise self.mistake(call, "takes no arguments", f"write self.{port.name}.pop()")
                return self._pop(node, port)
            if self._is_self(call.func.value) and call.func.attr == "fault":
                return self._fault(node, call)
        return super().generic_visit(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """Rewrite `self.name = value`."""
        if (steps := self._steps(node)) is not None:
            return self.statements(steps)
        for target in node.targets:
            self._check_elements(target)
        own = [each for target in node.targets for each in self._owned(target)]
        if len(node.targets) == 1:
            copied = self._copied(node, node.targets[0], node.value)
            if copied is not None:
                return copied
        if len(node.targets) == 1 and (part := self._settable_part(node.targets[0])):
            return self._set_field(node, *part, self.visit(node.value))
        if not own:
            return super().visit_Assign(node)
        target = node.targets[0]
        if isinstance(target, ast.Attribute) and self._is_self(target.value):
            return self._set(node, self._settable(target), self.visit(node.value))
        return super().visit_Assign(node)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        """Reject declarations in a hook; drop the annotations of variables."""
        if self._owned(node.target):
            raise self.mistake(node, "a hook cannot declare members", "declare it in the class")
        if node.value is None:
            return like(node, ast.Pass())
        plain = ast.Assign([node.target], node.value)
        return self.visit(like(node, plain))  # type: ignore[no-any-return]

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | list[ast.stmt]:
        """Rewrite `self.name += value`."""
        target = node.target
        self._check_elements(target)
        if isinstance(target, ast.Attribute) and self._is_self(target.value):
            member = self._settable(target)
            new: ast.expr = ast.BinOp(loaded(target), node.op, node.value)
            if member.type.shape and member.type.scalar != np.float64:
                new = changed_elements(loaded(target), node.op, node.value)
            return self._set(node, member, self.visit(like(node, new)))
        if part := self._settable_part(target):
            value = self.visit(like(node, ast.BinOp(loaded(target), node.op, node.value)))
            return self._set_field(node, *part, value)
        return super().visit_AugAssign(node)

    def _check_elements(self, target: ast.expr) -> None:
        """Reject setting elements of members other than State and Output."""
        while isinstance(target, ast.Subscript):
            target = target.value
            if isinstance(target, ast.Attribute) and self._is_self(target.value):
                self._settable(target)
            elif isinstance(target, ast.Attribute):
                port = self._member(target.value)
                port = self._message(target)[0] if port is None else port
                if port is not None and port.kind is not Output:
                    raise self.mistake(
                        target, f"belongs to {a_kind(port)}, which is read-only", "set an Output"
                    )

    def _settable(self, node: ast.Attribute) -> Member:
        member = self._description.members.get(node.attr)
        if member is not None and member.kind is State:
            self._touch(node, node.attr)
        if member is None:
            if node.attr in TIME_FIELDS:
                raise self.mistake(node, "belongs to the loop", "keep your own time in a State")
            if node.attr in self._description.constants:
                raise self.mistake(
                    node, "is a constant of the class", f"declare {node.attr}: State[…]"
                )
            method = self._methods.find(node.attr)
            if self._methods.find(SETTER + node.attr) is not None:
                what = f"{node.attr} has a setter"
                raise self.mistake(node, what, f"write self.{node.attr} = … on a line of its own")
            if method is not None and method.kind == "property":
                raise self.mistake(
                    node,
                    f"{node.attr} is a read-only property",
                    f"set the members that it is computed from, or write a method: "
                    f"self.set_{node.attr}(…)",
                )
            raise self._undeclared(node)
        if member.kind is Parameter:
            raise self.mistake(node, "a parameter is set from outside", "declare a State for it")
        if member.kind is Derived and self.source.tree.name != "prepare":
            raise self.mistake(
                node, "is Derived: only prepare sets it", "set it in prepare, or declare a State"
            )
        if member.kind in PORTS:
            if member.kind is Output:
                remedy = f"write self.{node.attr}.write(…)"
                raise self.mistake(node, f"is {a_kind(member)}", remedy)
            raise self.mistake(node, f"is {a_kind(member)}, which is read-only", "write an Output")
        return member

    def _undeclared(self, node: ast.Attribute) -> Exception:
        names = [each for each in self._description.members if "__" not in each]
        words = (*names, *TIME_FIELDS, *LOG_LEVELS, *self._methods.names())
        kind = "Derived" if self._in_prepare(node.attr) else "State"
        remedy = f"write `{node.attr}: {kind}[float]` in the class"
        if kind == "Derived":
            remedy += f", or {node.attr}: Derived[np.float64, 2, 3] for an array"
        if node.attr in _LOGGERS:
            return once(at(self.source.file, node, "is not declared", 'write self.info("…")'))
        written = written_name(self._owner, node.attr)
        if written != node.attr:
            own = private_name(written)
            remedy = f"write `{own}: {kind}[float]` in the class, and self.{own}"
        elif near := (
            [each for each in names if each.strip("_") == node.attr.strip("_")]
            or difflib.get_close_matches(node.attr, words, 1, 0.75)
        ):
            remedy = f"correct its name (self.{near[0]}), or {remedy}"
        return once(at(self.source.file, node, "is not declared", remedy))

    def _in_prepare(self, name: str) -> bool:
        """Tell whether prepare sets a member."""
        prepare = self._methods.find("prepare")
        tree = read(prepare.function).tree if prepare and prepare.function else None
        return tree is not None and any(
            isinstance(each, ast.Attribute)
            and each.attr == name
            and isinstance(each.ctx, ast.Store)
            for each in ast.walk(tree)
        )

    def _no_function(self, node: ast.Call, called: ast.Attribute) -> None:
        """Reject the call of a member, a time or a property of `self`."""
        name = called.attr
        method = self._methods.find(name)
        if name in TIME_FIELDS or (method is not None and method.kind == "property"):
            raise self.mistake(node, f"self.{name} is not a function", "leave the ( ) out")
        member = self._description.members.get(name)
        if member is not None or name in self._description.constants:
            remedy = f"write self.{name}[0] for an element, * to multiply"
            if member is not None and member.kind in PORTS:
                of = {Output: "write(…)", Queue: "front"}.get(member.kind, "value")
                remedy = f"write self.{name}.{of}"
            raise self.mistake(node, f"self.{name} is not a function", remedy)
        if name in HOOKS:
            remedy = "call a method that both hooks use"
            raise self.mistake(node, f"{name} is a hook, which the loop calls", remedy)
        if name in self.source.lifted:
            raise self.mistake(node, f"{name} is a nested function", f"write {name}(…)")
        if method is None and name not in (*HOOKS, *LOG_LEVELS, "fault"):
            near = difflib.get_close_matches(name, (*self._methods.names(), *LOG_LEVELS), 1, 0.6)
            written = written_name(self._owner, name)
            remedy = f"define it: def {written}(self, …):"
            if near:
                remedy = f"correct its name (self.{near[0]}), or {remedy}"
            raise self.mistake(node, f"there is no method {written}", remedy)

    def _is_property(self, node: ast.AST, surely: bool = False) -> bool:
        if not isinstance(node, ast.Attribute):
            return False
        if is_super(node.value):
            return True
        method = self._methods.find(node.attr) if self._is_self(node.value) else None
        return method is not None and method.kind == "property"

    def _plain_member(self, node: ast.Attribute) -> None:
        """Reject port attributes of other members: `self.kp.value`, `self.f.write(…)`."""
        owner = node.value
        if not isinstance(owner, ast.Attribute) or not self._is_self(owner.value):
            return
        member = self._description.members.get(owner.attr)
        if member is None or member.kind in PORTS or member.type.enumeration:
            return
        kind, name = a_kind(member), f"self.{owner.attr}"
        if node.attr in ("value", "get", "new", "valid"):
            raise self.mistake(node, f"{kind} has no {node.attr}", f"write {name}")
        if node.attr in ("write", "set", "publish"):
            raise self.mistake(node, f"{kind} has no {node.attr}", f"write {name} = …")

    def _value(self, node: ast.Attribute, name: str, member: Member) -> ast.AST:
        """Return the value of a State, Parameter or Derived member."""
        if isinstance(node.ctx, ast.Store):
            return like(node, self._field(name))
        field = self._read(name, member.type)
        field = self._as_enum(field, member.type, checked=member.kind is Parameter)
        if member.type.optional:
            field = call_of("rtcf_maybe", field, self._field(member.known, ast.Load()))
        return like(node, field)

    def _set(self, node: ast.stmt, member: Member, value: ast.expr) -> ast.AST | list[ast.stmt]:
        if not member.type.optional:
            return self._set_field(node, member.name, member.type, value)
        new = f"rtcf_new_{node.lineno}_{node.col_offset}"
        flag = call_of("rtcf_is_known", ast.Name(new, ast.Load()))
        old = self._as_enum(self._read(member.name, member.type), member.type)
        some = call_of("rtcf_or_old", ast.Name(new, ast.Load()), old)
        return [
            like(node, ast.Assign([ast.Name(new, ast.Store())], value)),
            like(node, ast.Assign([self._field(member.known)], flag)),
            self._set_field(node, member.name, member.type, some),
        ]

    def _set_field(self, node: ast.stmt, name: str, kind: ValueType, value: ast.expr) -> ast.stmt:
        if kind.shape:
            call = call_of("rtcf_store", self._read(name, kind), value)
            return like(node, ast.Expr(call))
        if kind.enumeration:
            member = call_of("rtcf_stored_enum", value, self._enum(kind.enumeration))
            return like(node, ast.Assign([self._field(name)], call_of("rtcf_number", member)))
        of = {"f": "float", "b": "bool", "c": "complex"}.get(kind.scalar.kind, "int")
        convert = f"rtcf_{of}"
        return like(node, ast.Assign([self._field(name)], call_of(convert, value)))

    def _fault(self, node: ast.Expr, call: ast.Call) -> ast.stmt:
        text = call.args[0] if len(call.args) == 1 else None
        if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
            raise self.mistake(
                call, "a fault takes one constant text", "log the values with self.error(…)"
            )
        return like(node, ast.Raise(call_of("rtcf_fault", text)))

    def _own(self, node: ast.Attribute) -> ast.AST:
        name = node.attr
        if name in TIME_FIELDS:
            self._touch(node, name)
            return like(node, self._field(own_field(name), node.ctx))
        member = self._description.members.get(name)
        if member is not None:
            if member.kind is State:
                self._touch(node, name)
            if member.kind in PORTS:
                remedy = f"write self.{name}.value"
                if member.kind is Queue:
                    remedy = f"write self.{name}.front, or self.{name}.size for their number"
                raise self.mistake(node, f"is {a_kind(member)}", remedy)
            return self._value(node, name, member)
        if name in self._description.constants:
            return self._named_constant(node, self._description.constants[name])
        method = self._methods.find(name)
        if method is not None and method.kind == "property":
            return self._call(node, method, [])
        if method is not None and method.function is None:
            raise self.mistake(node, f"{name} is a {method.kind}", method.remedy)
        if method is not None:
            raise self.mistake(node, "a method is not a value", f"call it: self.{name}(…)")
        raise self._undeclared(node)

    def _owned(self, target: ast.AST) -> list[ast.AST]:
        """Return the members of `self` that a target sets, without elements of arrays."""
        if isinstance(target, ast.Tuple | ast.List):
            return [found for each in target.elts for found in self._owned(each)]
        return [target] if isinstance(target, ast.Attribute) and self._is_self(target.value) else []


def _is_none(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value is None
