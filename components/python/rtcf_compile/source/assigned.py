"""Checks that each variable has a value before its use. Python raises UnboundLocalError otherwise;
compiled code would read undefined memory.
"""

import ast
import builtins
from collections.abc import Collection, Sequence

from rtcf_compile.source.mistake import Mistakes, at
from rtcf_compile.source.modules import Source

# The variables that have a value at a place; None: the place is unreachable.
_Known = frozenset[str] | None


def check_assigned(source: Source, rejected: Collection[ast.AST] = ()) -> None:
    """Raise Mistake at the first use of each variable that has no value on some path.

    `rejected`: expressions with another error, which are skipped.
    """
    flow = _Flow(source, rejected)
    flow.function()
    flow.mistakes.report()


def _both(one: _Known, other: _Known) -> _Known:
    """Return the assigned variables where two paths meet."""
    if one is None or other is None:
        return other if one is None else one
    return one & other


class _Flow:
    """Follows the statements of a function in execution order."""

    def __init__(self, source: Source, rejected: Collection[ast.AST]) -> None:
        self._source, self._rejected = source, rejected
        self.mistakes = Mistakes()
        self._variables = set(source.variables)
        # Per enclosing loop: the variables assigned at break and at continue.
        self._breaks: list[_Known] = []
        self._continues: list[_Known] = []

    def function(self) -> None:
        """Check the whole function."""
        tree = self._source.tree
        rest = [each for each in (tree.args.vararg, tree.args.kwarg) if each is not None]
        arguments = (*tree.args.posonlyargs, *tree.args.args, *tree.args.kwonlyargs, *rest)
        self._block(tree.body, frozenset(each.arg for each in arguments))

    def _block(self, body: Sequence[ast.stmt], known: _Known) -> _Known:
        for statement in body:
            if known is None:
                return None  # the rest is unreachable
            known = self._statement(statement, known)
        return known

    def _statement(self, node: ast.stmt, known: frozenset[str]) -> _Known:
        if isinstance(node, ast.Assign):
            known = self._used(node.value, known)
            for target in node.targets:
                known = self._target(target, known)
            return known
        if isinstance(node, ast.AugAssign):
            known = self._used(node.value, self._used(_read(node.target), known))
            return self._target(node.target, known)
        if isinstance(node, ast.AnnAssign):
            if node.value is None:
                return known
            return self._target(node.target, self._used(node.value, known))
        if isinstance(node, ast.If):
            return self._if(node, known)
        if isinstance(node, ast.For):
            return self._for(node, known)
        if isinstance(node, ast.While):
            return self._while(node, known)
        if isinstance(node, ast.Match):
            return self._match(node, known)
        if isinstance(node, ast.Break):
            self._breaks[-1] = _both(self._breaks[-1], known)
            return None
        if isinstance(node, ast.Continue):
            self._continues[-1] = _both(self._continues[-1], known)
            return None
        for each in ast.iter_child_nodes(node):
            if isinstance(each, ast.expr):
                known = self._used(each, known)
        if isinstance(node, ast.Return | ast.Raise) or _is_fault(node):
            return None
        return known

    def _if(self, node: ast.If, known: frozenset[str]) -> _Known:
        if_true, if_false = self._test(node.test, known)
        then, other = (_constant(node.test) is not False, _constant(node.test) is not True)
        return _both(
            self._block(node.body, if_true) if then else None,
            self._block(node.orelse, if_false) if other else None,
        )

    def _for(self, node: ast.For, known: frozenset[str]) -> _Known:
        known = self._used(node.iter, known)
        end, left = self._loop(node, self._target(node.target, known))
        # A loop that may run zero times leaves its variables without a value.
        ended = end if _runs(node.iter) else _both(known, end)
        return _both(self._block(node.orelse, ended) if ended is not None else None, left)

    def _while(self, node: ast.While, known: frozenset[str]) -> _Known:
        if_true, known = self._test(node.test, known)
        end, left = self._loop(node, if_true)
        if _constant(node.test) is True:
            return left
        ended = _both(known, end)
        return _both(self._block(node.orelse, ended) if ended is not None else None, left)

    def _loop(self, node: ast.For | ast.While, known: frozenset[str]) -> tuple[_Known, _Known]:
        """Return the variables assigned after one iteration of the body, and those after break."""
        self._breaks.append(None)
        self._continues.append(None)
        end = self._block(node.body, known)
        return _both(end, self._continues.pop()), self._breaks.pop()

    def _match(self, node: ast.Match, known: frozenset[str]) -> _Known:
        known = self._used(node.subject, known)
        result: _Known = None
        for case in node.cases:
            bound = {each.name for each in ast.walk(case.pattern)
                     if isinstance(each, ast.MatchAs | ast.MatchStar) and each.name}  # fmt: skip
            inside: frozenset[str] = known | bound
            if case.guard is not None:
                inside = self._used(case.guard, inside)
            result = _both(result, self._block(case.body, inside))
            if case.guard is None and matches_all(case.pattern):
                return result
        return _both(result, known)

    def _target(self, node: ast.expr, known: frozenset[str]) -> frozenset[str]:
        if isinstance(node, ast.Name):
            return known | {node.id}
        if isinstance(node, ast.Tuple | ast.List):
            for each in node.elts:
                known = self._target(each, known)
            return known
        if isinstance(node, ast.Starred):
            return self._target(node.value, known)
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                known = self._used(child, known)
        return known

    def _test(self, node: ast.expr, known: frozenset[str]) -> tuple[frozenset[str], frozenset[str]]:
        """Check a condition; return the assigned variables if it is true, and if it is false."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            if_true, if_false = self._test(node.operand, known)
            return if_false, if_true
        if isinstance(node, ast.BoolOp):
            all_of = isinstance(node.op, ast.And)
            ended: frozenset[str] | None = None  # after an operand that decides the result
            for each in node.values:
                if_true, if_false = self._test(each, known)
                known, out = (if_true, if_false) if all_of else (if_false, if_true)
                ended = out if ended is None else ended & out
            assert ended is not None
            return (known, ended) if all_of else (ended, known)
        after = self._used(node, known)
        return after, after

    def _without_value(self, name: str) -> tuple[str, str]:
        scope = self._source.function.__globals__
        if callable(scope.get(name, getattr(builtins, name, None))):
            return f"{name} is a function, but is set here", "use another name for the variable"
        if name in scope:
            return f"{name} is a constant of the module, but is set here", "declare a State"
        return f"{name} may have no value here", f"set `{name}` on every path to this line"

    def _used(self, node: ast.expr, known: frozenset[str]) -> frozenset[str]:
        """Check an expression; return the assigned variables after it."""
        if node in self._rejected:
            set_there = (each for each in ast.walk(node) if isinstance(each, ast.NamedExpr))
            return known | {each.target.id for each in set_there}
        if isinstance(node, ast.Name):
            is_read = isinstance(node.ctx, ast.Load) and not node.id.startswith("rtcf_")
            if is_read and node.id in self._variables - known:
                self.mistakes.add(at(self._source.file, node, *self._without_value(node.id)))
                self._variables.discard(node.id)  # report it once
            return known
        if isinstance(node, ast.NamedExpr):
            return self._used(node.value, known) | {node.target.id}
        if isinstance(node, ast.BoolOp):
            if_true, if_false = self._test(node, known)
            return if_true & if_false
        if isinstance(node, ast.IfExp):
            if_true, if_false = self._test(node.test, known)
            return self._used(node.body, if_true) & self._used(node.orelse, if_false)
        for each in ast.iter_child_nodes(node):
            if isinstance(each, ast.keyword):
                each = each.value
            if isinstance(each, ast.expr):
                known = self._used(each, known)
        return known


def _read(target: ast.expr) -> ast.expr:
    """Return the target of `x += 1` as the expression that it reads."""
    if isinstance(target, ast.Name):
        return ast.copy_location(ast.Name(target.id, ast.Load()), target)
    return target


def _constant(test: ast.expr) -> bool | None:
    return bool(test.value) if isinstance(test, ast.Constant) else None


def _runs(iterated: ast.expr) -> bool:
    """Tell whether a loop over it surely runs at least once: range(3), (1, 2), range(1, 4)."""
    if isinstance(iterated, ast.Tuple):
        return bool(iterated.elts)
    if not isinstance(iterated, ast.Call) or not isinstance(iterated.func, ast.Name):
        return False
    numbers = [_whole(each) for each in iterated.args]
    if iterated.func.id != "range" or None in numbers or not 1 <= len(numbers) <= 3:
        return False
    try:
        return len(range(*(each for each in numbers if each is not None))) > 0
    except ValueError:
        return False


def _whole(node: ast.expr) -> int | None:
    try:
        value = ast.literal_eval(node)
    except (ValueError, TypeError):
        return None
    return value if type(value) is int else None


def matches_all(pattern: ast.pattern) -> bool:
    """Tell whether a pattern matches every subject."""
    if isinstance(pattern, ast.MatchOr):
        return any(matches_all(each) for each in pattern.patterns)
    return isinstance(pattern, ast.MatchAs) and pattern.pattern is None


def _is_fault(node: ast.stmt) -> bool:
    """Tell whether a statement is `self.fault("…")`, which ends the hook."""
    call = node.value if isinstance(node, ast.Expr) else None
    return (
        isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr == "fault"
    )
