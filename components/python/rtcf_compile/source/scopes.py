"""The names that a function sets, and those that it takes from around it."""

import ast
from collections.abc import Iterable, Iterator
from typing import Any

_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp)
_NAMED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.MatchAs, ast.MatchStar)
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)


def bound(tree: ast.AST) -> set[str]:
    """Return the arguments and variables of a function or lambda, or the variables of a
    comprehension; without those of functions inside it.
    """
    found, parts = set(), [tree]
    if isinstance(tree, _FUNCTIONS):
        found = set(_arguments(tree.args))
        parts = _body(tree)
    elif isinstance(tree, _COMPREHENSIONS):
        parts = [each.target for each in tree.generators]
    for part in parts:
        found |= set(_set(part))
    return found


def everywhere(tree: ast.AST) -> frozenset[str]:
    """Return the names that are set in a function or in what is nested in it."""
    found = set()
    for each in ast.walk(tree):
        if isinstance(each, _FUNCTIONS):
            found |= set(_arguments(each.args))
        if each is not tree:
            found |= set(_own(each))
    return frozenset(found)


def free(node: ast.AST) -> set[str]:
    """Return the names that a node reads and does not set in a scope of its own."""
    if isinstance(node, ast.Name):
        return {node.id} if isinstance(node.ctx, ast.Load) else set()
    if isinstance(node, _FUNCTIONS):
        outside = [*node.args.defaults, *(each for each in node.args.kw_defaults if each)]
        return _free(_body(node)) - bound(node) | _free(outside)
    if isinstance(node, _COMPREHENSIONS):
        first, *rest = node.generators
        inside: list[ast.AST] = [first.target, *first.ifs, *rest]
        elements = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
        return _free([*inside, *elements]) - bound(node) | free(first.iter)
    return _free(list(ast.iter_child_nodes(node)))


def _body(node: Any) -> list[ast.AST]:
    return list(node.body) if isinstance(node.body, list) else [node.body]


def _free(nodes: Iterable[ast.AST]) -> set[str]:
    return {name for each in nodes for name in free(each)}


def _arguments(given: ast.arguments) -> Iterator[str]:
    several = [each for each in (given.vararg, given.kwarg) if each is not None]
    for each in (*given.posonlyargs, *given.args, *given.kwonlyargs, *several):
        yield each.arg


def _set(node: ast.AST) -> Iterator[str]:
    """Yield the names that a part of a function sets."""
    yield from _own(node)
    for each in ast.iter_child_nodes(node):
        if isinstance(node, (*_FUNCTIONS, ast.ClassDef)):
            break
        # The targets of a comprehension are its own, but `y := x` in it is set outside.
        if isinstance(node, _COMPREHENSIONS):
            yield from (
                part.target.id for part in ast.walk(each) if isinstance(part, ast.NamedExpr)
            )
        else:
            yield from _set(each)


def _own(node: ast.AST) -> Iterator[str]:
    """Yield the name that a node itself sets."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
        yield node.id
    elif isinstance(node, _NAMED) and node.name:
        yield node.name
