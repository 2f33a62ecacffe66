"""Loops over ports, such as `for port in (self.left, self.right):`, which are written out."""

import ast
import inspect
from collections.abc import Callable, Sequence

from rtcf.component.declaration import Declarable, Declared, MemberAttribute

_PORTS = ("Input", "Output", "Queue")


def by_port(
    target: ast.expr,
    iterated: ast.expr,
    body: Sequence[ast.stmt],
    is_port: Callable[[ast.expr], bool],
) -> list[tuple[dict[str, ast.expr], list[ast.stmt]]] | None:
    """Return the ports for the variables of a loop over ports, and assignments of its other
    variables, for each iteration; None for another loop.

    Ports are `self.name`, and the loop uses only their attributes.
    """
    several, targets = [iterated], [target]
    if isinstance(iterated, ast.Call) and ast.unparse(iterated.func) == "zip":
        several = list(iterated.args)
        targets = list(target.elts) if isinstance(target, ast.Tuple) else []
    if len(targets) != len(several) or not all(
        isinstance(each, ast.Tuple | ast.List) for each in several
    ):
        return None
    columns = [each.elts for each in several]  # type: ignore[attr-defined]
    are_ports = [all(map(is_port, each)) for each in columns]
    rounds: list[tuple[dict[str, ast.expr], list[ast.stmt]]] = []
    for values in zip(*columns, strict=False):
        ports: dict[str, ast.expr] = {}
        before: list[ast.stmt] = []
        for name, value, of_port in zip(targets, values, are_ports, strict=True):
            if not isinstance(name, ast.Name) or isinstance(value, ast.Starred):
                return None
            if of_port and uses_attributes(name.id, body):
                ports[name.id] = value
            elif isinstance(value, ast.Constant):
                stored = ast.Name(name.id, ast.Store())
                before.append(ast.copy_location(ast.Assign([stored], value), value))
            else:
                return None
        rounds.append((ports, before))
    return rounds if rounds and all(ports for ports, _ in rounds) else None


def is_port(node: ast.AST, owner: type | None) -> bool:
    """Tell whether a node is `self.name` of a port; if the class does not declare it, a class
    derived from it may.
    """
    if not isinstance(node, ast.Attribute) or ast.unparse(node.value) != "self":
        return False
    for each in owner.__mro__ if owner else ():
        if node.attr in vars(each) and not isinstance(
            vars(each)[node.attr], Declarable | MemberAttribute
        ):
            return False
        declared = inspect.get_annotations(each).get(node.attr)
        if isinstance(declared, str):
            return declared.partition("[")[0].rpartition(".")[2] in _PORTS
        if isinstance(declared, Declared):
            return declared.kind.__name__ in _PORTS
    return True


def uses_attributes(name: str, body: Sequence[ast.stmt]) -> bool:
    """Tell whether statements use only attributes of ports of a variable."""
    ports = ("value", "new", "valid", "age", "connected", "write", "publish", "size", "front",
             "pop", "dropped")  # fmt: skip
    nodes = [part for each in body for part in ast.walk(each)]
    names = [each for each in nodes if isinstance(each, ast.Name) and each.id == name]
    used = [each.value for each in nodes if isinstance(each, ast.Attribute) and each.attr in ports]
    return bool(names) and all(any(each is one for one in used) for each in names)
