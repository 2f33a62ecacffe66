"""Which variables of a function are read later."""

import ast
from collections.abc import Iterator, Sequence

Names = frozenset[str]
_NONE: Names = frozenset()


class LiveNames:
    """The variables that are read after each statement of a function, on some path."""

    def __init__(self, tree: ast.FunctionDef) -> None:
        """Follow the statements backwards."""
        self._after: dict[ast.stmt, Names] = {}
        self._inside: dict[ast.stmt, Names] = {}  # after the first expression of a statement
        self._statement: dict[ast.expr, ast.stmt] = {}
        self._block(tree.body, _NONE, _NONE, _NONE)

    def after(self, node: ast.stmt) -> Names:
        """Return the names that are read after a statement."""
        return self._after.get(node, _NONE)

    def during(self, node: ast.stmt) -> Names:
        """Return the names that are read in or after the expressions at the head of a statement."""
        return self._inside.get(node, _NONE) | _uses(node)

    def outside(self, node: ast.expr) -> Names:
        """Return the names that are read outside an expression, while or after it is computed."""
        statement = self._statement[node]
        inside = set(ast.walk(node))
        others = {
            each.id
            for head in _head(statement)
            for each in ast.walk(head)
            if isinstance(each, ast.Name) and each not in inside
        }
        return self._inside.get(statement, _NONE) | others

    def _block(self, body: Sequence[ast.stmt], out: Names, left: Names, again: Names) -> Names:
        """Return the names that are read in or after a block.

        `left`, `again`: the names that are read after a break, and after a continue.
        """
        for node in reversed(body):
            self._after[node] = self._after.get(node, _NONE) | out
            for head in _head(node):
                for each in ast.walk(head):
                    if isinstance(each, ast.expr):
                        self._statement[each] = node
            out = self._before(node, out, left, again)
        return out

    def _before(self, node: ast.stmt, out: Names, left: Names, again: Names) -> Names:
        if isinstance(node, ast.Break | ast.Continue):
            return left if isinstance(node, ast.Break) else again
        if isinstance(node, ast.Return | ast.Raise):
            out = _NONE
        inside = out
        if isinstance(node, ast.If):
            inside = self._block(node.body, out, left, again)
            inside |= self._block(node.orelse, out, left, again)
        elif isinstance(node, ast.While | ast.For):
            inside = self._loop(node, out, left, again)
        elif isinstance(node, ast.Match):
            for case in node.cases:
                inside |= self._block(case.body, out, left, again)
        self._inside[node] = self._inside.get(node, _NONE) | inside
        return (inside - _set(node)) | _uses(node)

    def _loop(self, node: ast.While | ast.For, out: Names, left: Names, again: Names) -> Names:
        tested = _read(node.test) if isinstance(node, ast.While) else _NONE
        head = out | tested | self._block(node.orelse, out, left, again)
        while True:
            more = head | self._block(node.body, head, out, head)
            if more == head:
                return head
            head = more


def _head(node: ast.stmt) -> Iterator[ast.AST]:
    """Yield the expressions of a statement, without those of the statements in it."""
    if isinstance(node, ast.If | ast.While):
        yield node.test
    elif isinstance(node, ast.For):
        yield from (node.iter, node.target)
    elif isinstance(node, ast.Match):
        yield node.subject
        for case in node.cases:
            yield case.pattern
            if case.guard is not None:
                yield case.guard
    else:
        yield from (each for each in ast.iter_child_nodes(node) if isinstance(each, ast.expr))


def _uses(node: ast.stmt) -> Names:
    """Return the names that the expressions of a statement read, and `x` of `x += 1`."""
    found = frozenset(name for each in _head(node) for name in _read(each))
    is_changed = isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name)
    return found | {node.target.id} if is_changed else found  # type: ignore[attr-defined]


def _read(node: ast.AST) -> Names:
    """Return the names that an expression or a target reads."""
    found = {
        each.id
        for each in ast.walk(node)
        if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)
    }
    return frozenset(found)


def _set(node: ast.stmt) -> Names:
    """Return the names that a statement surely sets, without reading them."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return _NONE
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    found = set()
    for target in targets:
        parts = target.elts if isinstance(target, ast.Tuple | ast.List) else [target]
        found |= {each.id for each in parts if isinstance(each, ast.Name)}
    return frozenset(found)
