"""The rewriting that hooks and other functions share: `@`, np.linalg and assignment to slices
become calls of helpers, and constants become their values.
"""

import ast
import copy
import dataclasses
import enum
import inspect
import math
import re
from collections.abc import Callable, Sequence
from types import ModuleType, SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from rtcf.component.value_type import is_enum

from rtcf_compile.rewriting import helpers, math_functions, numpy_functions, operators
from rtcf_compile.rewriting.helpers import IN_PLACE, INSTEAD, OF_LISTS, rtcf_round, rtcf_round_to
from rtcf_compile.rewriting.references import is_copied, is_ellipsis, is_new_axis
from rtcf_compile.rewriting.subscripts import Subscripts
from rtcf_compile.source.checks import resolve
from rtcf_compile.source.mistake import Mistake, Mistakes, at
from rtcf_compile.source.modules import Source
from rtcf_compile.source.parsed import is_of_user, is_own
from rtcf_compile.source.records import record_of

_Node = TypeVar("_Node", bound=ast.AST)
_BY_NODE: tuple[Any, ...] = (operators.BINARY, operators.SHIFTS, operators.COMPARISONS)
_OPERATORS: dict[type[ast.AST], operators.Function] = {
    node: operators.OF[operation] for by_node in _BY_NODE for node, operation in by_node.items()
}
_STANDS_FOR = [*INSTEAD.items(), *numpy_functions.STANDS_FOR, *math_functions.STANDS_FOR]
# Size of the arena for temporary arrays of a hook in the real-time thread, bytes.
ARENA = 64 * 1024
_NEW = (np.zeros, np.ones, np.empty, np.full, np.eye, np.identity)
_PLAIN = (*_NEW, np.zeros_like, np.ones_like, np.empty_like, np.full_like, np.arange)
_PLAIN_METHODS = ("copy", "fill", "flatten", "item", "view")
_DTYPES = {float: np.float64, int: np.int64, bool: np.bool_, complex: np.complex128}
# Arguments that have two names in NumPy.
_OTHER_NAMES = {
    (numpy_functions.rtcf_clip, "min"): "a_min",
    (numpy_functions.rtcf_clip, "max"): "a_max",
}
# NumPy functions with the position of their element type argument.
_TYPED = {np.zeros: 1, np.ones: 1, np.empty: 1, np.full: 2, np.zeros_like: 1, np.ones_like: 1}


class CommonRewriting(ast.NodeTransformer):
    """Replaces `@`, np.linalg and assignment to slices by calls of helpers."""

    def __init__(
        self, source: Source, functions: frozenset[type[ast.AST]] = operators.ALWAYS
    ) -> None:
        """Rewrite a function; `functions`: the operators that become calls of functions."""
        self.source = source
        self.mistakes = Mistakes()
        self._functions = functions
        self.constants: dict[str, Any] = {}
        self._named_values: dict[str, Any] = {}  # what the names of constants stand for
        # These read the tree before it is rewritten.
        self._counters = self._find_counters()
        self._lists: set[str] = set()
        self._lists = self._find_lists()
        self._uncertain = self._find_uncertain()
        self._uses_flags = self._has_flags()
        self.large: list[ast.AST] = []
        # Calls that may need functions that the loop does not have.
        self.others: list[ast.Call] = []

    def mistake(self, node: ast.AST, what: str, remedy: str) -> Exception:
        """Return an error at a node."""
        return at(self.source.file, node, what, remedy)

    def constant(self, node: ast.AST) -> Any:
        """Return the constant to which a dotted name refers, or None."""
        return resolve(node, self.source)

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        """Rewrite `GAINS.kp` of a dataclass of constants, `Mode.RUN` of an enum."""
        if (number := self._flags(node)) is not None:
            return number
        owner, value = resolve(node.value, self.source), resolve(node, self.source)
        if is_enum(type(value)):
            return like(node, ast.Attribute(self._enum(type(value)), value.name, ast.Load()))
        if node.attr == "name" and (isinstance(owner, enum.Enum) or self._is_enum(node.value)):
            raise self.mistake(
                node, "text cannot be built in the cycle", 'log it: self.info("{}", self.mode.name)'
            )
        if owner is not None and not isinstance(node.ctx, ast.Load):
            name = ast.unparse(node.value)
            raise self.mistake(node, f"{name} is a constant of the module", "declare a State")
        is_module = isinstance(owner, ModuleType)
        if is_own(value) if is_module else _is_namespace(owner) and _is_constant(value):
            return self._named_constant(node, value)
        self.generic_visit(node)
        return node

    def _flags(self, node: ast.expr) -> ast.expr | None:
        """Return a member of a set of flags, or its `~`, which is within the flags of its class, as
        an int; None for another expression.
        """
        is_inverted = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Invert)
        of = node.operand if isinstance(node, ast.UnaryOp) and is_inverted else node
        flags = resolve(of, self.source)
        if isinstance(flags, enum.IntFlag):
            return like(node, ast.Constant(int(~flags if is_inverted else flags)))
        if is_inverted and not isinstance(of, ast.Call | ast.Constant) and self._uses_flags:
            remedy = "write int(…) for all bits, or ~ of a member"
            raise self.mistake(node, "~ of flags keeps to the bits of their class", remedy)
        return None

    def _has_flags(self) -> bool:
        """Tell whether the function uses `~` and sets of flags."""
        nodes = list(ast.walk(self.source.tree))
        if not any(isinstance(each, ast.Invert) for each in nodes):
            return False
        values = [resolve(each, self.source) for each in nodes]
        return any(isinstance(each, enum.IntFlag) or (
            isinstance(each, type) and issubclass(each, enum.IntFlag)
        ) for each in values)  # fmt: skip

    def _named_constant(self, node: ast.expr, value: Any) -> ast.expr:
        """Return a constant, or a function of another module, by a name of its own."""
        name = self._name_for(value, ast.unparse(node))
        self.constants[name] = value
        return like(node, ast.Name(name, ast.Load()))

    def _name_for(self, value: Any, written: str) -> str:
        """Return a name for a constant, such as `constant_Gains_kp` for `Gains.kp`."""
        plain = f"constant_{re.sub('[^a-zA-Z0-9]', '_', written)}"
        name, number = plain, 0
        while self._named_values.setdefault(name, value) is not value:
            name, number = f"{plain}_{number}", number + 1
        return name

    def _enum(self, cls: type[enum.Enum]) -> ast.expr:
        """Return an enum class as a constant."""
        name, number = f"rtcf_enum_{cls.__name__}", 0
        while self.constants.setdefault(name, cls) is not cls:
            name, number = f"rtcf_enum_{cls.__name__}_{number}", number + 1
        return ast.Name(name, ast.Load())

    def _is_enum(self, node: ast.expr) -> bool:
        """Tell whether an expression is declared as an enum."""
        return False

    def visit(self, node: ast.AST) -> Any:
        """Rewrite a node; collect the errors of each statement."""
        if not isinstance(node, ast.stmt):
            return self._visit(node)
        try:
            return self._visit(node)
        except Mistake as mistake:
            self.mistakes.add(mistake)
        # Find the errors of the statements inside, too.
        cases = node.cases if isinstance(node, ast.Match) else []
        for each in (node, *cases):
            for inner in (*getattr(each, "body", ()), *getattr(each, "orelse", ())):
                self.visit(inner)
        return like(node, ast.Pass())

    def _visit(self, node: ast.AST) -> Any:
        """Move `y := x` before the statement that contains it; copy where references.py says so."""
        if isinstance(node, ast.stmt) and (before := self._before(node)):
            return self.statements(before)
        new = super().visit(node)
        is_read = isinstance(getattr(node, "ctx", None), ast.Load | None)
        if is_copied(node) and is_read and isinstance(new, ast.expr):
            return like(node, call_of("rtcf_copied", new))
        return new

    def visit_NamedExpr(self, node: ast.NamedExpr) -> ast.AST:
        """Reject `y := x` that is not always computed or follows a use of y."""
        raise self.mistake(node, "a := inside an expression", "write it as a statement before")

    def _before(self, node: ast.stmt) -> list[ast.stmt] | None:
        """Return a statement preceded by its `y := x` as statements; None if it has none."""
        field = "test" if isinstance(node, ast.If | ast.While) else "value"
        value = getattr(node, field, None)
        if not isinstance(value, ast.expr) or not _has_walrus(value):
            return None
        before, value = self._without_walrus(value, isinstance(node, ast.If | ast.While))
        if not before:
            return None
        if isinstance(node, ast.While):
            if node.orelse:
                raise self.mistake(node, "while with := and else", "write a := as a statement")
            leave = like(node, ast.If(ast.UnaryOp(ast.Not(), value), [ast.Break()], []))
            loop = ast.While(ast.Constant(True), [*before, leave, *node.body], [])
            return [like(node, loop)]
        new = copy.copy(node)
        setattr(new, field, value)
        return [*before, new]

    def _without_walrus(self, node: ast.expr, is_test: bool) -> tuple[list[ast.stmt], ast.expr]:
        """Return the `y := x` of an expression as assignments, and the expression without them."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            before, operand = self._without_walrus(node.operand, True)
            return before, like(node, ast.UnaryOp(node.op, operand))
        if isinstance(node, ast.BoolOp) and is_test and any(map(_has_walrus, node.values[1:])):
            name = f"rtcf_test_{node.lineno}_{node.col_offset}"
            before, first = self._without_walrus(node.values[0], True)
            before.append(_assigned(node, ast.Name(name, ast.Store()), _as_bool(first)))
            rest = node.values[1:]
            others = rest[0] if len(rest) == 1 else like(node, ast.BoolOp(node.op, rest))
            after, value = self._without_walrus(others, True)
            after.append(_assigned(node, ast.Name(name, ast.Store()), _as_bool(value)))
            test: ast.expr = ast.Name(name, ast.Load())
            if isinstance(node.op, ast.Or):
                test = ast.UnaryOp(ast.Not(), test)
            before.append(like(node, ast.If(test, after, [])))
            return before, like(node, ast.Name(name, ast.Load()))
        found: list[ast.stmt] = []

        class First(ast.NodeTransformer):
            """Extracts assignments that are always computed, in source order."""

            def visit_BoolOp(self, each: ast.BoolOp) -> ast.AST:
                each.values[0] = self.visit(each.values[0])
                return each

            def visit_IfExp(self, each: ast.IfExp) -> ast.AST:
                each.test = self.visit(each.test)
                return each

            def visit_NamedExpr(self, each: ast.NamedExpr) -> ast.AST:
                target, value = each.target, self.visit(each.value)
                found.append(_assigned(each, ast.Name(target.id, ast.Store()), value))
                return like(each, ast.Name(target.id, ast.Load()))

        new = First().visit(copy.deepcopy(node))
        set_there = {each.targets[0].id: each for each in found}  # type: ignore[attr-defined]
        for each in ast.walk(node):
            early = isinstance(each, ast.Name) and each.id in set_there and _is_before(
                each, set_there[each.id]
            ) and isinstance(each.ctx, ast.Load)  # fmt: skip
            calls = isinstance(each, ast.Call) and any(
                _is_before(each, other) and not _contains(each, other) for other in found
            )
            # The expression reads a member or an element before a method that may set it.
            reads = isinstance(each, ast.Attribute | ast.Subscript) and any(
                _is_before(each, other) and self._changes(other.value, True)  # type: ignore[attr-defined]
                for other in found
            )
            reads = reads and not any(_contains(each, other) for other in found)
            calls = calls and resolve(each.func, self.source) is None  # type: ignore[attr-defined]
            if early or reads or calls:
                raise self.mistake(
                    node, "a := after a value that it may change", "write it as a statement before"
                )
        return found, new

    def visit_Match(self, node: ast.Match) -> list[ast.stmt]:
        """Rewrite `match x:` to if and elif."""
        place = f"{node.lineno}_{node.col_offset}"
        before: list[ast.stmt] = []

        def named(value: ast.expr, name: str) -> ast.expr:
            """Assign a subject, or its parts, to variables; return these."""
            if isinstance(value, ast.Tuple | ast.List):
                parts = [named(each, f"{name}_{k}") for k, each in enumerate(value.elts)]
                return ast.Tuple(parts, ast.Load())
            before.append(_assigned(node, ast.Name(name, ast.Store()), value))
            return ast.Name(name, ast.Load())

        subject = named(node.subject, f"rtcf_subject_{place}")
        result: list[ast.stmt] = []
        for case in reversed(node.cases):
            tests, sets = self._pattern(case.pattern, subject)
            bound = [
                _assigned(case.pattern, ast.Name(name, ast.Store()), copy.deepcopy(value))
                for name, value in sets
            ]
            body = list(case.body)
            if case.guard is not None and bound:
                first: list[ast.stmt] = bound
                if tests:
                    first = [like(case.pattern, ast.If(_all(tests), bound, []))]
                test = _all([*tests, case.guard])
                result = [*first, like(case.pattern, ast.If(test, body, result))]
                continue
            tests = [*tests, case.guard] if case.guard is not None else tests
            if tests:
                result = [like(case.pattern, ast.If(_all(tests), [*bound, *body], result))]
            else:
                result = [*bound, *body]
        return self.statements([*before, *result])

    def _pattern(
        self, pattern: ast.pattern, subject: ast.expr
    ) -> tuple[list[ast.expr], list[tuple[str, ast.expr]]]:
        """Return the conditions of a pattern and the names that it sets."""
        value = copy.deepcopy(subject)
        if isinstance(pattern, ast.MatchValue):
            return [like(pattern, ast.Compare(value, [ast.Eq()], [pattern.value]))], []
        if isinstance(pattern, ast.MatchSingleton):
            constant = ast.Constant(pattern.value)
            if pattern.value is None:
                return [like(pattern, ast.Compare(value, [ast.Is()], [constant]))], []
            return [like(pattern, call_of("rtcf_is", value, constant))], []
        if isinstance(pattern, ast.MatchAs):
            tests, sets = ([], []) if pattern.pattern is None else self._pattern(
                pattern.pattern, subject
            )  # fmt: skip
            return tests, [*sets, *([(pattern.name, value)] if pattern.name else [])]
        if isinstance(pattern, ast.MatchOr):
            ways = [self._pattern(each, subject) for each in pattern.patterns]
            if any(sets for _, sets in ways):
                raise self.mistake(pattern, "a | of patterns with names", "write two cases")
            if any(not tests for tests, _ in ways):
                return [], []
            either = ast.BoolOp(ast.Or(), [_all(tests) for tests, _ in ways])
            return [like(pattern, either)], []
        if isinstance(pattern, ast.MatchSequence) and isinstance(subject, ast.Tuple):
            if len(pattern.patterns) == len(subject.elts):
                found = [
                    self._pattern(each, part)
                    for each, part in zip(pattern.patterns, subject.elts, strict=True)
                ]
                return (
                    [test for tests, _ in found for test in tests],
                    [each for _, sets in found for each in sets],
                )
            return [ast.Constant(False)], []
        raise self.mistake(
            pattern, "a pattern that unpacks", "match numbers, enums, or (a, b) with (1, _)"
        )

    def visit_If(self, node: ast.If) -> ast.AST:
        """Rewrite `if point:`, of a variable that may be None."""
        return self._tested(node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        """Rewrite `x if point else y`, of a variable that may be None."""
        return self._tested(node)

    def visit_While(self, node: ast.While) -> ast.AST:
        """Rewrite `while point:`, of a variable that may be None."""
        return self._tested(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        """Rewrite `point and x`, of a variable that may be None."""
        node.values = list(map(self._truth, node.values))
        self.generic_visit(node)
        return node

    def _tested(self, node: ast.If | ast.IfExp | ast.While) -> ast.AST:
        node.test = self._truth(node.test)
        self.generic_visit(node)
        return node

    def _truth(self, node: ast.expr) -> ast.expr:
        """Return a condition, which may be None, or a tuple."""
        kinds = (ast.Name, ast.Subscript, ast.NamedExpr, ast.IfExp)
        if isinstance(node, kinds) or self._is_uncertain(node, self._uncertain):
            return like(node, call_of("rtcf_truth", node))
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        """Rewrite `x in (1, 2)`, `key in LIMITS` of a dict, and comparisons with lists."""
        contained = node.comparators[0]
        table = self.constant(contained)
        if isinstance(table, dict) and table and _has_number_keys(table):
            keys = [self._number_key(each) for each in table]
            contained = like(contained, ast.Tuple(keys, ast.Load()))
        if (
            len(node.ops) == 1
            and isinstance(node.ops[0], ast.In | ast.NotIn)
            and isinstance(contained, ast.Tuple | ast.List | ast.Set)
            and contained.elts
            and not any(map(self._acts, (node.left, contained)))
        ):
            tests: list[ast.expr] = [
                ast.Compare(copy.deepcopy(node.left), [ast.Eq()], [each]) for each in contained.elts
            ]
            either = tests[0] if len(tests) == 1 else ast.BoolOp(ast.Or(), tests)
            if isinstance(node.ops[0], ast.NotIn):
                either = ast.UnaryOp(ast.Not(), either)
            return self.visit(like(node, either))  # type: ignore[no-any-return]
        uncertain = self._may_be_none(node.left) or self._may_be_none(contained)
        if uncertain and len(node.ops) == 1 and isinstance(node.ops[0], ast.Eq | ast.NotEq):
            sides = self._arrays(node.left), self._arrays(contained)
            return self._compared("rtcf_equal", node, *sides)
        if len(node.ops) == 1 and isinstance(node.ops[0], ast.Is | ast.IsNot):
            given = node.comparators[0]
            if isinstance(given, ast.Constant) and isinstance(given.value, bool):
                return self._compared("rtcf_is", node, node.left, given)
            if not any(isinstance(each, ast.Constant) for each in (node.left, given)):
                return self._compared("rtcf_same", node, node.left, given)
        if not all(isinstance(each, ast.In | ast.NotIn) for each in node.ops):
            node.left = self._arrays(node.left)
            node.comparators = [self._arrays(each) for each in node.comparators]
        self.generic_visit(node)
        if len(node.ops) == 1 and type(node.ops[0]) in self._functions:
            compare = _OPERATORS[type(node.ops[0])].__name__
            return like(node, call_of(compare, node.left, node.comparators[0]))
        return node

    def _compared(self, helper: str, node: ast.Compare, *sides: ast.expr) -> ast.expr:
        """Return a comparison by a helper, or its opposite for `!=` and `is not`."""
        called = like(node, call_of(helper, *(self.visit(each) for each in sides)))
        is_opposite = isinstance(node.ops[0], ast.NotEq | ast.IsNot)
        return like(node, ast.UnaryOp(ast.Not(), called)) if is_opposite else called

    def _number_key(self, key: Any) -> ast.expr:
        if isinstance(key, enum.Enum):
            return ast.Attribute(self._enum(type(key)), key.name, ast.Load())
        return ast.Constant(int(key))

    def _may_be_none(self, node: ast.expr) -> bool:
        """Tell whether a comparison must check for None: a variable that is a parameter, or is set
        to an optional value. Types are not known here.
        """
        return isinstance(node, ast.Name) and node.id in self._uncertain

    def _find_uncertain(self) -> set[str]:
        found = {each.arg for each in self.source.tree.args.args}
        for each in ast.walk(self.source.tree):
            if isinstance(each, ast.Assign) and self._is_uncertain(each.value, found):
                found |= {name.id for target in each.targets for name in ast.walk(target)
                          if isinstance(name, ast.Name)}  # fmt: skip
        return found

    def _is_uncertain(self, node: ast.expr, names: set[str]) -> bool:
        """Tell whether a value may be None."""
        if isinstance(node, ast.IfExp):
            return self._is_uncertain(node.body, names) or self._is_uncertain(node.orelse, names)
        if isinstance(node, ast.Tuple | ast.List):
            return any(self._is_uncertain(each, names) for each in node.elts)
        if isinstance(node, ast.Call):
            return resolve(node.func, self.source) is None or is_own(
                resolve(node.func, self.source)
            )
        if isinstance(node, ast.Name):
            return node.id in names
        return isinstance(node, ast.Constant) and node.value is None

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        """Rewrite `a @ b`, `a ** b` and other operators that become functions."""
        if (of_lists := self._of_lists(node)) is not None:
            return of_lists
        self.generic_visit(node)
        if isinstance(node.op, ast.MatMult):
            return like(node, call_of("rtcf_matmul", node.left, node.right))
        # A constant power becomes a product, which never raises.
        if isinstance(node.op, ast.Pow):
            power = _power(node.right)
            return like(node, call_of(power, node.left, node.right))
        if type(node.op) in self._functions:
            return like(node, call_of(_OPERATORS[type(node.op)].__name__, node.left, node.right))
        return node

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        """Rewrite `-a`, and `~Fault.HOT` of flags."""
        if (number := self._flags(node)) is not None:
            return number
        is_constant = isinstance(node.operand, ast.Constant)
        if isinstance(node.op, ast.Not):
            node.operand = self._truth(node.operand)
        self.generic_visit(node)
        if type(node.op) not in self._functions or is_constant:
            return node
        return like(node, call_of("rtcf_negative", node.operand))

    def visit_List(self, node: ast.List) -> ast.AST:
        """Rewrite a list of constant size to a tuple."""
        if isinstance(node.ctx, ast.Load):
            if not node.elts:
                raise self.mistake(
                    node, "a list that grows allocates memory", "use a State array and a count"
                )
            numbers = [type(each.value) for each in node.elts if isinstance(each, ast.Constant)]
            mixed = len(numbers) == len(node.elts) and set(numbers) == {int, float}
            for each in node.elts if mixed else ():
                each.value = float(each.value)  # type: ignore[attr-defined]
            node.elts = [self.visit(each) for each in node.elts]
            return like(node, ast.Tuple(node.elts, ast.Load()))
        self.generic_visit(node)
        return node

    def _is_list(self, node: ast.expr) -> bool:
        """Tell whether an expression is known to be a list."""
        if isinstance(node, ast.Name):
            if node.id in self.source.variables:
                return node.id in self._lists
            return isinstance(resolve(node, self.source), list)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
            return self._is_list(node.left) and self._is_list(node.right)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            times = node.right if self._is_list(node.left) else node.left
            values = node.left if times is node.right else node.right
            return self._is_list(values) and self._is_whole(times)
        return isinstance(node, ast.List)

    def _of_lists(self, node: ast.BinOp) -> ast.AST | None:
        """Rewrite `[0.0] * 3`, `[1.0] + values`, `x + [1.0, 2.0]`; return None for others."""
        left, right = self._is_list(node.left), self._is_list(node.right)
        if not left and not right:
            return None
        if isinstance(node.op, ast.Mult) and (
            self._is_whole(node.right) if left else self._is_whole(node.left)
        ):
            values, times = (node.left, node.right) if left else (node.right, node.left)
            count = self._constant(times)
            if not isinstance(count, int) or not isinstance(values, ast.List) or count < 1:
                raise self.mistake(
                    node, "repeats a list a variable number of times", "write its elements"
                )
            if self._acts(values, surely=True):
                raise self.mistake(node, "repeats calls", "set variables to their results before")
            elements = [copy.deepcopy(each) for _ in range(count) for each in values.elts]
            return self.visit(like(node, ast.List(elements, ast.Load())))  # type: ignore[no-any-return]
        if isinstance(node.op, ast.Add) and left and right:
            one, other = self.visit(node.left), self.visit(node.right)
            if isinstance(one, ast.Tuple) and isinstance(other, ast.Tuple):
                return like(node, ast.Tuple([*one.elts, *other.elts], ast.Load()))
            return like(node, ast.BinOp(one, ast.Add(), other))
        if isinstance(node.op, ast.MatMult):
            sides = [self.visit(self._arrays(each)) for each in (node.left, node.right)]
            return like(node, call_of("rtcf_matmul", *sides))
        if type(node.op) not in OF_LISTS:
            raise self.mistake(node, "is not compiled for a list", "use np.array([…])")
        helper = OF_LISTS[type(node.op)].__name__
        return like(node, call_of(helper, self.visit(node.left), self.visit(node.right)))

    def _constant(self, node: ast.expr) -> Any:
        """Return the value of a constant expression, or None."""
        names = {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}
        if names & self.source.variables:
            return None
        if any(isinstance(each, ast.Call) for each in ast.walk(node)):
            return None
        try:
            code = compile(ast.Expression(copy.deepcopy(node)), "", "eval")
            return eval(code, dict(self.source.function.__globals__))
        except Exception:
            return None

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Rewrite calls such as `np.linalg.solve(a, b)` and `a.dot(b)`."""
        target = resolve(node.func, self.source)
        if target is math.log and len(node.args) == 2 and not node.keywords:
            parts = [like(node, ast.Call(node.func, [each], [])) for each in node.args]
            quotient = like(node, ast.BinOp(parts[0], ast.Div(), parts[1]))
            return self.visit(quotient)  # type: ignore[no-any-return]
        if target is float and (number := _number_in(node)) is not None:
            return like(node, ast.Constant(number))
        instead = next((own for each, own in _STANDS_FOR if each is target), None)
        if instead is not None and instead in math_functions.OF_ALL_ARGUMENTS.values():
            return self._instead(node, instead, [like(node, ast.Tuple(node.args, ast.Load()))])
        if target is np.einsum:
            return self._einsum(node)
        if target is np.meshgrid and len(node.args) != 2:
            what = f"np.meshgrid of {len(node.args)} vectors"
            raise self.mistake(node, what, "give it two: arrays have one or two dimensions")
        if target is np.gradient and node.args:
            spacing = like(node, ast.Tuple(node.args[1:], ast.Load()))
            return self._instead(node, numpy_functions.rtcf_gradient, [node.args[0], spacing])
        if instead is not None:
            return self._instead(node, instead, node.args)
        if target is round and len(node.args) == 1 and not node.keywords:
            return self._instead(node, rtcf_round, node.args)
        if target is round:
            digits = self._constant(node.args[1]) if len(node.args) == 2 else None
            if node.keywords or type(digits) is not int or not 0 <= digits <= 15:
                what = "round to other than 0 to 15 digits is not compiled"
                raise self.mistake(node, what, "use np.round(x, digits)")
            given = [self.visit(node.args[0]), ast.Constant(digits)]
            return like(node, call_of(rtcf_round_to.__name__, *given))
        if target is reversed and len(node.args) == 1 and not node.keywords:
            return self._reversed(node, node.args[0])
        if target is range and not node.keywords:
            node.args = [
                each if isinstance(each, ast.Constant) else like(each, call_of("rtcf_index", each))
                for each in (self.visit(each) for each in node.args)
            ]
            return node
        if self._functions == operators.NARROW and isinstance(target, np.ufunc):
            of = operators.UFUNCS.get(target)
            if of is not None and len(node.args) == target.nin and not node.keywords:
                return self._instead(node, operators.OF[of], node.args)
        if isinstance(target, np.ufunc) and len(node.args) + len(node.keywords) > target.nin:
            raise self.mistake(
                node, f"{target.__name__} has too many arguments", "set its result: x[:] = …"
            )
        if isinstance(target, np.ufunc) and len(node.args) < target.nin:
            what = f"{target.__name__} takes {target.nin} arguments"
            raise self.mistake(node, what, "give all of them")
        if target in (max, min, sum) and node.keywords:
            remedy = f"use np.{target.__name__}, np.argmax or a loop"
            raise self.mistake(node, f"{target.__name__} takes no {node.keywords[0].arg}", remedy)
        if isinstance(node.func, ast.Attribute) and node.func.attr == "get":
            table = self.constant(node.func.value)
            if isinstance(table, dict) and table and len(node.args) == 2 and not node.keywords:
                return self._looked_up_or(node, node.func.value, table)
        if target is enumerate and [each.arg for each in node.keywords] == ["start"]:
            node.args.append(node.keywords.pop().value)
        if isinstance(node.func, ast.Attribute) and (
            target is None or isinstance(resolve(node.func.value, self.source), np.ndarray)
        ):
            if node.func.attr == "dot":
                arguments = [self.visit(each) for each in node.args]
                return like(node, call_of("rtcf_matmul", self.visit(node.func.value), *arguments))
            if node.func.attr in numpy_functions.METHODS:
                return self._method(node, node.func)
        if is_enum(target) and len(node.args) == 1:
            return like(node, call_of("rtcf_enum", self.visit(node.args[0]), self._enum(target)))
        self._typed(node, target)
        if self._bytes(node, target) > ARENA - 64:
            self.large.append(node)
        if isinstance(target, np.ufunc):
            node.args = [
                call_of("rtcf_array", each, ast.Constant(None)) if self._is_list(each) else each
                for each in node.args
            ]
        if getattr(target, "__module__", "") == "numpy.linalg" or (
            isinstance(node.func, ast.Attribute)
            and resolve(node.func.value, self.source) is np.linalg
        ):
            remedy = "use np.linalg.solve, inv, cholesky, det or norm"
            if target is np.linalg.pinv:
                remedy = "write A.T @ np.linalg.inv(A @ A.T), or compute it at module level"
            raise self.mistake(node, "calls LAPACK, which allocates memory", remedy)
        if self._is_other(node, target):
            self.others.append(node)
        if self._functions == operators.NARROW and getattr(target, "__module__", "") == "math":
            node.args = [like(each, call_of("rtcf_plain", self.visit(each))) for each in node.args]
            return node
        self.generic_visit(node)
        return node

    def _is_other(self, node: ast.Call, target: Any) -> bool:
        """Tell whether no helper replaces a NumPy function or a method of arrays."""
        if target is None:
            return isinstance(node.func, ast.Attribute) and node.func.attr not in _PLAIN_METHODS
        if isinstance(target, np.ufunc | type) or any(target is each for each in _PLAIN):
            return False
        return (getattr(target, "__module__", None) or "numpy").startswith("numpy")

    def _bytes(self, node: ast.Call, target: Any) -> int:
        """Return the size of a new array, bytes; 0 if it is not constant."""
        if not node.args or not any(target is each for each in _NEW):
            return 0
        size = self._constant(node.args[0])
        if target in (np.eye, np.identity) and isinstance(size, int):
            size = (size, self._constant(node.args[1]) if len(node.args) > 1 else size)
        sizes = size if isinstance(size, tuple | list) else (size,)
        if not all(isinstance(each, int) for each in sizes):
            return 0
        return 8 * math.prod(sizes)

    def _reversed(self, node: ast.Call, of: ast.expr) -> ast.AST:
        """Rewrite `reversed(range(n))`, and `reversed(x)` of a vector."""
        if isinstance(of, ast.Call) and resolve(of.func, self.source) is range:
            if not 1 <= len(of.args) <= 2:
                raise self.mistake(node, "reverses a range with steps", "write the reverse range")
            low = of.args[0] if len(of.args) == 2 else ast.Constant(0)
            bounds = [ast.BinOp(each, ast.Sub(), ast.Constant(1)) for each in (of.args[-1], low)]
            step = ast.UnaryOp(ast.USub(), ast.Constant(1))
            return self.visit(like(node, ast.Call(of.func, [*bounds, step], [])))  # type: ignore[no-any-return]
        return like(node, call_of("rtcf_reversed", self.visit(of)))

    def _einsum(self, node: ast.Call) -> ast.AST:
        """Rewrite `np.einsum("ij,j->i", a, b)`."""
        if node.keywords:
            what = f"np.einsum takes no {node.keywords[0].arg}"
            raise self.mistake(node, what, f"remove {node.keywords[0].arg}")
        given = node.args[0] if node.args else None
        text = given.value if isinstance(given, ast.Constant) else None
        if not isinstance(text, str):
            what = "np.einsum takes constant subscripts"
            raise self.mistake(node, what, 'write np.einsum("ij,j->i", a, b)')
        try:
            subscripts = Subscripts(text)
        except ValueError as error:
            raise self.mistake(node, *error.args) from None
        count = len(node.args) - 1
        if count != len(subscripts.operands):
            what = f"{text!r} has subscripts of {len(subscripts.operands)} operands, not {count}"
            raise self.mistake(node, what, "write one part per operand, with commas between")
        operands = ast.Tuple([self.visit(each) for each in node.args[1:]], ast.Load())
        return like(node, call_of("rtcf_einsum", ast.Constant(text), operands))

    def _method(self, node: ast.Call, called: ast.Attribute) -> ast.AST:
        """Rewrite a method call such as `a.sum(axis=0)`."""
        helper, arguments = numpy_functions.METHODS[called.attr], node.args
        if called.attr == "reshape" and len(arguments) > 1:
            arguments = [like(node, ast.Tuple(arguments, ast.Load()))]
        return self._instead(node, helper, [called.value, *arguments])

    def _instead(
        self, node: ast.Call, helper: Callable[..., Any], arguments: Sequence[ast.expr]
    ) -> ast.AST:
        """Return the call of the helper that replaces a function."""
        signature = inspect.signature(helper)
        try:
            named = {
                _OTHER_NAMES.get((helper, each.arg), each.arg): each.value
                for each in node.keywords
                if each.arg
            }
            bound = signature.bind(*arguments, **named).arguments
        except TypeError:
            name, takes = ast.unparse(node.func), ", ".join(signature.parameters)
            remedy = f"write {name}({takes})"
            if "kind" in signature.parameters:
                remedy = 'write kind="stable"'
            raise self.mistake(node, f"{name} takes {takes}", remedy) from None
        given: list[ast.expr] = []
        for name, parameter in signature.parameters.items():
            value = bound.get(name)
            if value is None:
                given.append(ast.Constant(parameter.default))
            elif name == "dtype":
                given.append(self._dtype(value))
            else:
                given.append(self._argument(name, value, parameter.default))
        return like(node, call_of(helper.__name__, *given))

    def _argument(self, name: str, value: ast.expr, default: Any) -> ast.expr:
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            known = numpy_functions.WORDS.get(name, {})
            if value.value not in known:
                what, remedy = "a text has no meaning here", "give it a number"
                if known:
                    what, remedy = f"{name}={value.value!r} is not compiled", f"remove {name}"
                if name == "kind":
                    remedy = 'write kind="stable"'
                raise self.mistake(value, what, remedy)
            return like(value, ast.Constant(known[value.value]))
        if name == "copy" and not (isinstance(value, ast.Constant) and value.value is True):
            raise self.mistake(value, "the result is always a new array", "remove copy")
        if default is None and isinstance(value, ast.Constant) and value.value is False:
            return like(value, ast.Constant(None))
        return self.visit(value)  # type: ignore[no-any-return]

    def _dtype(self, node: ast.expr) -> ast.expr:
        """Return an element type as a constant."""
        value: Any = node.value if isinstance(node, ast.Constant) else resolve(node, self.source)
        if value is None:
            return node
        value = _DTYPES.get(value, value)
        try:
            scalar = np.dtype(value)
        except TypeError:
            scalar = np.dtype(object)
        if not is_number(scalar):
            remedy = "use float, int, bool or complex"
            if isinstance(value, int):
                remedy = "write sizes in parentheses: np.zeros((2, 2))"
            raise self.mistake(node, "is not a number type", remedy)
        name = f"rtcf_dtype_{scalar.name}"
        self.constants[name] = scalar.type
        return like(node, ast.Name(name, ast.Load()))

    def _typed(self, node: ast.Call, target: Any) -> None:
        """Convert element types, such as dtype=float, to constants that numba supports."""
        for each in node.keywords:
            if each.arg == "dtype":
                each.value = self._dtype(each.value)
        place = next((each for own, each in _TYPED.items() if own is target), len(node.args))
        if place < len(node.args):
            node.args[place] = self._dtype(node.args[place])

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Rewrite `x[i]`, where i may be an array, and `GAINS["kp"]` of a dict of constants."""
        table = self.constant(node.value)
        if isinstance(table, dict) and table and isinstance(node.ctx, ast.Load):
            return self._looked_up(node, table)
        node.slice = self._arrays(node.slice)
        parts = list(_parts(node))
        if isinstance(node.ctx, ast.Load) and any(is_new_axis(each) for each in parts):
            return self._with_new_axis(node, parts)
        is_load, of_tuple = isinstance(node.ctx, ast.Load), self._is_tuple(node)
        self.generic_visit(node)
        if is_load and (of_tuple or any(self._may_select(each) for each in parts)):
            return like(node, call_of("rtcf_get", node.value, index_of(node.slice)))
        return node

    def _looked_up(self, node: ast.Subscript, table: dict[Any, Any]) -> ast.AST:
        """Rewrite an element of a dict of the module, whose keys are texts, or ints and enums."""
        name = ast.unparse(node.value)
        if isinstance(node.slice, ast.Constant):
            if node.slice.value not in table:
                keys = ", ".join(map(repr, list(table)[:8]))
                what = f"{name} has no {node.slice.value!r}"
                raise self.mistake(node, what, f"use one of {keys}")
            return self._named_constant(node, table[node.slice.value])
        parts = self._table(node, name, table)
        return like(node, call_of("rtcf_looked_up", *parts, self._key(node.slice, table)))

    def _looked_up_or(self, node: ast.Call, of: ast.expr, table: dict[Any, Any]) -> ast.AST:
        """Rewrite `SPEEDS.get(key, default)` of a dict of the module."""
        key, default = node.args
        if isinstance(key, ast.Constant) and not self._acts(default):
            if key.value not in table:
                return self.visit(default)  # type: ignore[no-any-return]
            element = like(node, ast.Subscript(of, key, ast.Load()))
            return self._named_constant(element, table[key.value])
        parts = [*self._table(node, ast.unparse(of), table), self._key(key, table)]
        return like(node, call_of("rtcf_looked_up_or", *parts, self.visit(default)))

    def _key(self, node: ast.expr, table: dict[Any, Any]) -> ast.expr:
        """Return a key for a dict; ints are no keys of a dict of enums that are no ints."""
        cls = type(next(iter(table)))
        key: ast.expr = self.visit(node)
        return call_of("rtcf_stored_enum", key, self._enum(cls)) if is_enum(cls) else key

    def _table(self, node: ast.expr, name: str, table: dict[Any, Any]) -> list[ast.expr]:
        """Return the keys and values of a dict of numbers, tuples or objects as constants."""
        if hasattr(type(table), "__missing__"):
            raise self.mistake(node, f"{name} is a {type(table).__name__}", "use a dict")
        kinds = {type(each) for each in table.values()}
        numbers = kinds <= {int, float}
        cls = next(iter(kinds))
        known = cls in (tuple, bool) or is_enum(cls) or record_of(cls) is not None
        alike = len(kinds) == 1 and known
        if not (numbers or alike) or not _has_number_keys(table):
            remedy = "use ints or enums as keys, and numbers, tuples or objects as values"
            raise self.mistake(node, f"{name} is a dict with other keys or values", remedy)
        keys, values = (self._name_for(table, f"{name} {each}") for each in ("keys", "values"))
        self.constants[keys] = tuple(map(helpers.rtcf_number, table))
        kind: Any = float if float in kinds else int
        elements = map(kind, table.values()) if numbers else table.values()
        self.constants[values] = tuple(elements)
        return [ast.Name(each, ast.Load()) for each in (keys, values)]

    def _is_tuple(self, node: ast.Subscript) -> bool:
        """Tell whether a node is an element of a tuple or list with a variable index."""
        if isinstance(node.slice, ast.Constant | ast.Slice | ast.UnaryOp):
            return False
        known = self._is_list(node.value) or isinstance(node.value, ast.Tuple)
        return known or isinstance(resolve(node.value, self.source), tuple)

    def _arrays(self, node: ast.expr) -> ast.expr:
        """Return an index or an operand with lists converted to arrays."""
        if isinstance(node, ast.Tuple):
            return like(node, ast.Tuple([self._arrays(each) for each in node.elts], ast.Load()))
        if self._is_list(node):
            return like(node, call_of("rtcf_array", node, ast.Constant(None)))
        return node

    def _may_select(self, node: ast.expr) -> bool:
        """Tell whether an index may be an array."""
        return not _is_view(node) and not self._is_whole(node)

    def _with_new_axis(self, node: ast.Subscript, parts: list[ast.expr]) -> ast.AST:
        """Rewrite `v[:, None]` and its like: the other indices first, then the new axes."""
        others = [each for each in parts if not is_new_axis(each)]
        # Told apart by type: None for a new axis, 0 for ..., True for an old axis.
        kept = [
            ast.Constant(None if is_new_axis(each) else 0 if is_ellipsis(each) else True)
            for each in parts
            if _is_view(each) or is_new_axis(each)
        ]
        base: ast.expr = node.value
        others = [
            each
            if _is_view(each) or isinstance(each, ast.Constant)
            else like(each, call_of("rtcf_one_index", each))
            for each in others
        ]
        if not all(self._is_whole_axis(each) for each in others):
            index = ast.Tuple(others, ast.Load()) if len(others) > 1 else others[0]
            base = like(node, ast.Subscript(node.value, index, ast.Load()))
        axes = ast.Tuple(list(kept), ast.Load())
        return like(node, call_of("rtcf_new_axes", self.visit(base), axes))

    def _is_whole_axis(self, node: ast.expr) -> bool:
        """Tell whether an index is `:` or `...`."""
        is_slice = isinstance(node, ast.Slice) and not (node.lower or node.upper or node.step)
        return is_slice or is_ellipsis(node)

    def visit_Assign(self, node: ast.Assign) -> ast.AST | list[ast.stmt]:
        """Rewrite `x[1:3] = value`, `x[i] = value`, `a, b = f()`."""
        if (steps := self._steps(node)) is not None:
            return self.statements(steps)
        target = node.targets[0]
        if len(node.targets) == 1 and isinstance(target, ast.Subscript):
            return self._set_part(node, target)
        self.generic_visit(node)
        return node

    def statements(self, statements: Sequence[ast.stmt]) -> list[ast.stmt]:
        """Return rewritten statements."""
        found: list[ast.stmt] = []
        for each in statements:
            new = self.visit(each)
            found.extend(new if isinstance(new, list) else [new])
        return found

    def _steps(self, node: ast.Assign) -> list[ast.stmt] | None:
        """Return an assignment to several targets as single assignments, values first.

        Return None for a single target, and for variables only.
        """
        place = f"{node.lineno}_{node.col_offset}"
        if len(node.targets) > 1:
            if all(isinstance(each, ast.Name) for each in node.targets):
                return None
            value = f"rtcf_same_{place}"
            steps = [_assigned(node, ast.Name(value, ast.Store()), node.value)]
            steps += [_assigned(node, each, ast.Name(value, ast.Load())) for each in node.targets]
            return steps
        target = node.targets[0]
        if not isinstance(target, ast.Tuple | ast.List):
            return None
        parts, values = target.elts, node.value
        if isinstance(values, ast.Tuple | ast.List):
            if len(values.elts) != len(parts):
                raise self.mistake(
                    node, f"{len(values.elts)} values for {len(parts)} names", "use as many names"
                )
        elif _is_call(values, "rtcf_items"):
            return None
        else:
            count = ast.Tuple([ast.Constant(0)] * len(parts), ast.Load())
            values = like(node, call_of("rtcf_items", values, count))
        if all(isinstance(each, ast.Name) for each in parts):
            if values is node.value and isinstance(target, ast.Tuple):
                return None
            names = like(node, ast.Tuple(list(parts), ast.Store()))
            return [_assigned(node, names, values)]
        names_of = [f"rtcf_part_{place}_{number}" for number in range(len(parts))]
        stored: list[ast.expr] = [ast.Name(each, ast.Store()) for each in names_of]
        if isinstance(values, ast.Tuple | ast.List):
            steps = [_assigned(node, *each) for each in zip(stored, values.elts, strict=True)]
        else:
            steps = [_assigned(node, ast.Tuple(stored, ast.Store()), values)]
        steps += [
            _assigned(node, part, ast.Name(name, ast.Load()))
            for part, name in zip(parts, names_of, strict=True)
        ]
        return steps

    def _set_part(self, node: ast.Assign, target: ast.Subscript) -> ast.stmt | list[ast.stmt]:
        """Rewrite `x[…] = value`, unless it surely sets one element."""
        parts = list(_parts(target))
        self._check_constant(target)
        self._check_index(target)
        before: list[ast.stmt] = []
        value = node.value
        reads_members = any(_reads_members(each) for each in parts)
        if any(map(self._acts, (*parts, target.value))) or (reads_members and self._changes(value)):
            # Python computes the value before the array and the index.
            name = f"rtcf_value_{node.lineno}_{node.col_offset}"
            before = [like(node, ast.Assign([ast.Name(name, ast.Store())], self.visit(value)))]
            value = like(node, ast.Name(name, ast.Load()))
        if all(_is_view(each) or self._is_whole(each) for each in parts):
            dimensions, is_float = self._known(target.value)
            if any(_is_view(each) for each in parts) or len(parts) < dimensions:
                assigned = call_of("rtcf_assign", self.visit(loaded(target)), self.visit(value))
                return [*before, like(node, ast.Expr(assigned))]
            if len(parts) == dimensions and is_float:
                node.value = value
                self.generic_visit(node)
                return [*before, node]
        value = self.visit(value)
        base = self.visit(loaded(target.value))
        index = index_of(self.visit(self._arrays(target.slice)))
        return [*before, like(node, ast.Expr(call_of("rtcf_set", base, index, value)))]

    def _check_index(self, node: ast.Subscript) -> None:
        """Reject constant indices beyond declared sizes: see Ports."""

    def _check_constant(self, target: ast.Subscript) -> None:
        """Reject setting elements of module constants and of lists."""
        base: ast.expr = target
        while isinstance(base, ast.Subscript | ast.Attribute):
            base = base.value
        variables = self.source.variables
        is_other = isinstance(base, ast.Name) and base.id not in variables
        if isinstance(base, ast.Name) and is_other and not base.id.startswith("rtcf_"):
            raise self.mistake(
                target, f"{base.id} is a constant of the module", "declare a State, or copy it"
            )
        if self._is_list(target.value):
            raise self.mistake(target, "a list that changes allocates memory", "use np.array([…])")

    def _known(self, base: ast.expr) -> tuple[int, bool]:
        """Return the declared dimensions, 0 if undeclared, and whether elements are floats."""
        return 0, False

    def _is_whole(self, node: ast.expr) -> bool:
        """Tell whether an index is surely an int."""
        if isinstance(node, ast.UnaryOp):
            return isinstance(node.op, ast.USub | ast.UAdd) and self._is_whole(node.operand)
        if isinstance(node, ast.BinOp):
            whole = (ast.Add, ast.Sub, ast.Mult, ast.FloorDiv, ast.Mod)
            both = self._is_whole(node.left) and self._is_whole(node.right)
            return isinstance(node.op, whole) and both
        if isinstance(node, ast.Constant):
            return type(node.value) is int
        if isinstance(node, ast.Name) and node.id in self.source.variables:
            return node.id in self._counters
        return type(resolve(node, self.source)) is int

    def _find_counters(self) -> set[str]:
        """Return the variables that only `for … in range(…)` sets."""
        tree = self.source.tree
        sets = [each.id for each in ast.walk(tree)
                if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)]  # fmt: skip
        sets += [each.name for each in ast.walk(tree)
                 if isinstance(each, ast.MatchAs) and each.name]  # fmt: skip
        sets += [each.arg for each in tree.args.args]
        by_range = [each.target.id for each in ast.walk(tree) if isinstance(each, ast.For)
                    and isinstance(each.target, ast.Name) and _is_range(each.iter)]  # fmt: skip
        return {each for each in by_range if by_range.count(each) == sets.count(each)}

    def _find_lists(self) -> set[str]:
        """Return the variables that are set to lists."""
        found: set[str] = set()
        for each in ast.walk(self.source.tree):
            if isinstance(each, ast.Assign) and self._is_list(each.value):
                found |= {name.id for name in each.targets if isinstance(name, ast.Name)}
        return found

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | list[ast.stmt]:
        """Rewrite `x += value`, `x[1:3] += value`, `x @= m`."""
        before, target = self._steady(node.target, node.value)
        in_parts = isinstance(target, ast.Subscript)
        is_function = type(node.op) in self._functions and type(node.op) not in IN_PLACE
        if in_parts or is_function or isinstance(node.op, ast.MatMult | ast.Pow):
            value: ast.expr = ast.BinOp(loaded(target), node.op, node.value)
            if in_parts and self._functions == operators.NARROW:
                value = changed_elements(loaded(target), node.op, node.value)
            # Change an array in place: other variables may refer to it.
            if isinstance(target, ast.Name) and not isinstance(node.op, ast.MatMult):
                value = call_of("rtcf_changed", loaded(target), value)
        elif type(node.op) in IN_PLACE:
            value = call_of(IN_PLACE[type(node.op)].__name__, loaded(target), node.value)
        else:
            self.generic_visit(node)
            return node
        new = self.visit(like(node, ast.Assign([target], like(node, value))))
        return [*before, *(new if isinstance(new, list) else [new])]

    def _steady(self, target: ast.expr, value: ast.expr) -> tuple[list[ast.stmt], ast.expr]:
        """Return a target that can be evaluated twice, and the statements before it.

        The statements evaluate parts of the index that have effects, or that the value may change.
        """
        before: list[ast.stmt] = []
        changes = self._changes(value)

        def named(node: ast.expr) -> ast.expr:
            name = f"rtcf_index_{node.lineno}_{node.col_offset}"
            before.append(like(node, ast.Assign([ast.Name(name, ast.Store())], node)))
            return like(node, ast.Name(name, ast.Load()))

        class Parts(ast.NodeTransformer):
            def visit_Call(self, node: ast.Call) -> ast.AST:
                return named(node)

            def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
                return named(node) if resolve(node, source) is None else node

            def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
                return named(node)

        class Calls(ast.NodeTransformer):
            def visit_Call(self, node: ast.Call) -> ast.AST:
                return named(node)

            def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
                node.value = self.visit(node.value)
                if (changes and _reads_members(node.slice)) or is_acting(node.slice):
                    node.slice = Parts().visit(node.slice)
                return node

        source, is_acting = self.source, self._acts
        if isinstance(target, ast.Subscript):
            target = Calls().visit(copy.deepcopy(target))
        return self.statements(before), target

    def _acts(self, node: ast.expr, surely: bool = False) -> bool:
        """Tell whether an expression has a call or a property and must be computed only once."""
        return any(
            isinstance(each, ast.Call) or self._is_property(each, surely) for each in ast.walk(node)
        )

    def _changes(self, node: ast.expr, surely: bool = False) -> bool:
        """Tell whether an expression may change members: it has a property or calls functions other
        than those of NumPy and Python.
        """
        calls = [each for each in ast.walk(node) if isinstance(each, ast.Call)]
        targets = [resolve(each.func, self.source) for each in calls]
        return any(each is None or is_own(each) for each in targets) or any(
            self._is_property(each, surely) for each in ast.walk(node)
        )

    def _is_property(self, node: ast.AST, surely: bool = False) -> bool:
        """Tell whether a node may be a property. The class is not known here, so any attribute of
        self may be one.
        """
        return (
            not surely
            and isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name)
            and node.value.id == "self"
        )


def _has_number_keys(table: dict[Any, Any]) -> bool:
    """Tell whether the keys of a dict are ints, or members of one enum."""
    kinds = {type(each) for each in table}
    ints = all(isinstance(each, int) for each in table)
    return ints or (len(kinds) == 1 and is_enum(kinds.pop()))


def _is_namespace(value: Any) -> bool:
    """Tell whether a value is a class, or an object, of the user whose attributes are constants."""
    if isinstance(value, type):
        return not issubclass(value, enum.Enum | np.generic) and is_of_user(value)
    return isinstance(value, SimpleNamespace) or (
        dataclasses.is_dataclass(value) or (isinstance(value, tuple) and hasattr(value, "_fields"))
    )


def is_number(kind: np.dtype[Any]) -> bool:
    """Tell whether a type is one of numbers that are compiled."""
    return kind.kind in "fiub" or kind == np.complex128


def _is_constant(value: Any) -> bool:
    numbers = (bool, int, float, complex, np.generic)
    return isinstance(value, (*numbers, str, tuple, list, np.ndarray))


def _number_in(node: ast.Call) -> float | None:
    """Return the value of `float("inf")`, or None."""
    text = node.args[0] if len(node.args) == 1 and not node.keywords else None
    if not isinstance(text, ast.Constant) or not isinstance(text.value, str):
        return None
    try:
        return float(text.value)
    except ValueError:
        return None


def _parts(node: ast.Subscript) -> list[ast.expr]:
    return node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]


def _is_view(index: ast.AST) -> bool:
    return isinstance(index, ast.Slice) or is_ellipsis(index)


def _reads_members(index: ast.expr) -> bool:
    """Tell whether an index reads attributes or elements."""
    return any(isinstance(each, ast.Attribute | ast.Subscript) for each in ast.walk(index))


def _has_walrus(node: ast.AST) -> bool:
    return any(isinstance(each, ast.NamedExpr) for each in ast.walk(node))


def _place(node: Any) -> tuple[int, int]:
    return node.lineno, node.col_offset


def _is_before(node: ast.AST, other: ast.AST) -> bool:
    return _place(node) < _place(other)


def _contains(node: Any, other: ast.AST) -> bool:
    end = (node.end_lineno, node.end_col_offset)
    return _place(node) <= _place(other) < end


def _as_bool(node: ast.expr) -> ast.expr:
    """Return a condition as a bool."""
    return like(node, ast.UnaryOp(ast.Not(), ast.UnaryOp(ast.Not(), node)))


def _all(tests: Sequence[ast.expr]) -> ast.expr:
    """Return the conjunction of conditions."""
    found = [copy.deepcopy(each) for each in tests]
    return found[0] if len(found) == 1 else ast.BoolOp(ast.And(), found)


def _is_call(node: ast.AST, function: str) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) == function


def _assigned(node: ast.AST, target: ast.expr, value: ast.expr) -> ast.stmt:
    target.ctx = ast.Store()  # type: ignore[attr-defined]
    return like(node, ast.Assign([target], value))


def _is_range(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and ast.unparse(node.func) in ("range",)


def index_of(node: ast.expr) -> ast.expr:
    """Return an index as a tuple, with slices as slice objects."""
    parts = node.elts if isinstance(node, ast.Tuple) else [node]
    return like(node, ast.Tuple([_sliced(each) for each in parts], ast.Load()))


def _sliced(node: ast.expr) -> ast.expr:
    if not isinstance(node, ast.Slice):
        return node
    bounds = [each or ast.Constant(None) for each in (node.lower, node.upper, node.step)]
    return like(node, call_of("slice", *bounds[: 3 if node.step else 2]))


def changed_elements(target: ast.expr, operation: ast.operator, value: ast.expr) -> ast.expr:
    """Return the new elements for `target += value`."""
    helper = operators.OF_ELEMENTS.get(type(operation))
    if helper is None:
        return ast.BinOp(target, operation, value)
    return call_of(helper.__name__, target, value)


def _power(exponent: ast.expr) -> str:
    """Return the name of the helper for a power with this exponent."""
    is_negative = isinstance(exponent, ast.UnaryOp) and isinstance(exponent.op, ast.USub)
    number = exponent.operand if is_negative else exponent  # type: ignore[attr-defined]
    if not isinstance(number, ast.Constant) or type(number.value) is not int or number.value == 0:
        return "rtcf_pow"
    return "rtcf_negative_pow" if is_negative else "rtcf_whole_pow"


def loaded(target: ast.expr) -> ast.expr:
    """Return a target as an expression that reads it."""
    new = copy.deepcopy(target)
    new.ctx = ast.Load()  # type: ignore[attr-defined]
    return new


def call_of(function: str, *arguments: Any) -> ast.Call:
    """Return a call of a function by its name."""
    for each in arguments:
        if isinstance(each, ast.Attribute):
            each.ctx = ast.Load()
    return ast.Call(ast.Name(function, ast.Load()), list(arguments), [])


def like(node: ast.AST, new: _Node) -> _Node:
    """Return a new node with the source location of another."""
    ast.copy_location(new, node)
    return ast.fix_missing_locations(new)
