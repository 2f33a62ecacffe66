"""Nested functions, lambdas and comprehensions as functions of their own, which take the variables
that they use as arguments (Johnsson, "Lambda Lifting", 1985).

A nested function may only be called: its variables then have the values that Python gives them at
each call. A comprehension becomes a call in its place, which keeps the order of effects: that of a
loop that sums, compares or searches, or of one that fills an array where a list and an array are
the same.
"""

import ast
import copy
import inspect
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import FunctionType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from rtcf.component.value_type import is_enum

from rtcf_compile.source.given_functions import (
    Given,
    arguments,
    calls,
    is_function,
    is_plain,
    method_of,
    owner_of,
    without,
)
from rtcf_compile.source.mistake import at
from rtcf_compile.source.parsed import is_own, opened, parsed, without_defaults
from rtcf_compile.source.port_loops import by_port, is_port
from rtcf_compile.source.scopes import bound, everywhere, free
from rtcf_compile.source.spelling import defaults_of
from rtcf_compile.source.text_loops import Written, rounds_of, written

_Node = TypeVar("_Node", bound=ast.AST)
_Comprehension = ast.ListComp | ast.GeneratorExp
_COMPREHENSIONS = (ast.ListComp, ast.GeneratorExp)
_SCOPES = (ast.FunctionDef, ast.Lambda, *_COMPREHENSIONS, ast.SetComp, ast.DictComp)
# Builtins for which a list and an array are the same.
_NEUTRAL = (len, sum, any, all, max, min, enumerate, zip, reversed, math.prod)
_ITERATORS = (enumerate, zip, reversed)
_ARRAYS = (np.array, np.asarray)
_MOST = 16  # elements of a list that are written one by one


class _Reduction(NamedTuple):
    """A function that uses each element once, as a loop.

    In the texts, LOOP is the loop with `step` as its body, VALUE the element, and START the option
    of the function.
    """

    function: Callable[..., Any]
    takes: Any  # types of nodes
    option: str
    text: str
    with_option: str
    step: str


def _fold(function: Any, start: int, sign: str) -> _Reduction:
    text = "rtcf_each = {}\nLOOP\nreturn rtcf_each"
    step = f"rtcf_each = rtcf_each {sign} VALUE"
    return _Reduction(
        function, _COMPREHENSIONS, "start", text.format(start), text.format("START"), step
    )


def _first(function: Any, test: str, end: str) -> _Reduction:
    text = f"LOOP\nreturn {end}"
    step = f"if {test}VALUE:\n    return {end != 'True'}"
    return _Reduction(function, _COMPREHENSIONS, "", text, text, step)


def _extreme(function: Any, sign: str) -> _Reduction:
    text = "rtcf_is_first = True\nLOOP\nif rtcf_is_first:\n    {}\nreturn rtcf_each"
    step = (
        "rtcf_value = VALUE\n"
        "if rtcf_is_first:\n"
        "    rtcf_each = rtcf_value\n"
        f"elif rtcf_value {sign} rtcf_each:\n"
        "    rtcf_each = rtcf_value\n"
        "rtcf_is_first = False"
    )
    none = f"raise ValueError('{function.__name__} of no values')"
    return _Reduction(
        function, _COMPREHENSIONS, "default", text.format(none), text.format("return START"), step
    )


_COUNT = "rtcf_each = 0\nLOOP\nreturn rtcf_each"
_REDUCTIONS = (
    *(_fold(sum, 0, "+"), _fold(math.prod, 1, "*")),
    *(_first(any, "", "False"), _first(all, "not ", "True")),
    *(_extreme(max, ">"), _extreme(min, "<")),
    _Reduction(len, ast.ListComp, "", _COUNT, _COUNT, "VALUE\nrtcf_each += 1"),
    _Reduction(next, ast.GeneratorExp, "", "", "LOOP\nreturn START", "return VALUE"),
)
_FILLED = (
    "rtcf_count = COUNT\n"
    "if rtcf_count < 1:\n"
    "    raise ValueError('an array without elements')\n"
    "rtcf_place = 0\n"
    "LOOP\n"
    "return rtcf_each",
    "rtcf_value = VALUE\n"
    "if rtcf_place == 0:\n"
    "    rtcf_each = rtcf_array_of(rtcf_value, rtcf_count)\n"
    "rtcf_each[rtcf_place] = rtcf_value\n"
    "rtcf_place += 1",
)

# How a nested function is called: its own arguments, and the variables that are passed before them.
_Known = tuple[inspect.Signature, list[str]]


class _Lifted(NamedTuple):
    """A lifted function and its callees."""

    tree: ast.FunctionDef
    functions: dict[str, FunctionType]
    known: dict[str, _Known]
    owner: type | None
    depth: int  # copies of copies, see _copy


_lifted: dict[FunctionType, _Lifted] = {}
_made: dict[tuple[Any, ...], FunctionType] = {}
_copies: set[str] = set()  # their names


def tree_of(function: FunctionType) -> ast.FunctionDef | None:
    """Return the tree of a function that was lifted, else None."""
    known = _lifted.get(function)
    return copy.deepcopy(known.tree) if known else None


def lift(
    tree: ast.FunctionDef, function: FunctionType, file: str, called: Mapping[str, FunctionType]
) -> dict[str, FunctionType]:
    """Replace what is nested in a function by calls; return the functions that it calls, by name.

    `called`: those that it calls already. Raises Mistake for a nested function that is used in
    another way.
    """
    lifting = _Lifting(tree, function, file)
    lifting.functions |= called
    lifting.block(tree.body)
    lifting.drop_tuples()
    return lifting.functions


class _Lifting(ast.NodeTransformer):
    """Replaces the nested functions and the comprehensions of one function."""

    def __init__(self, tree: ast.FunctionDef, function: FunctionType, file: str) -> None:
        self._tree, self._outer, self._file = tree, function, file
        arguments = (*tree.args.posonlyargs, *tree.args.args)
        self._first = arguments[0].arg if arguments else ""
        self._nested = {name for each in ast.walk(tree) for name, _ in _nested(each)} - {tree.name}
        self._variables = bound(tree) - self._nested
        lifted = _lifted.get(function) or _Lifted(tree, {}, {}, owner_of(function), 0)
        self.functions: dict[str, FunctionType] = dict(lifted.functions)
        self._owner, self._depth = lifted.owner, lifted.depth
        # The nested functions that may be called here.
        self._known = {name: each for name, each in lifted.known.items() if name not in bound(tree)}
        self._nested |= set(self._known)
        self._lists = self._arrays_for_lists()
        self._dicts = dict(self._local_dicts())
        self._port_tuples = dict(self._tuples_of_ports())

    def _mistake(self, node: ast.AST, what: str, remedy: str) -> Exception:
        return at(self._file, node, what, remedy)

    # Nested functions.

    def block(self, body: list[ast.stmt]) -> None:
        """Lift from statements; a nested function is known to the statements behind it."""
        outside, new = dict(self._known), []
        for node in body:
            nested = next(_nested(node), None)
            if nested is not None:
                self._define(node, *nested)
                continue
            for each in self._simpler(node):
                new.append(self.visit(each))
        body[:] = new or [ast.copy_location(ast.Pass(), body[0])]
        self._known = outside

    def _simpler(self, node: ast.stmt) -> list[ast.stmt]:
        """Return the body of `with np.errstate(…)`, which has no meaning when compiled, and of a
        loop over ports once for each of them; other statements as they are.
        """
        if isinstance(node, ast.With) and all(map(self._is_errstate, node.items)):
            return [part for each in node.body for part in self._simpler(each)]
        if isinstance(node, ast.For) and not node.orelse:
            loop = ast.copy_location(
                ast.For(node.target, self._ports(node.iter), node.body, []), node
            )
            prefix = f"rtcf_of_{node.lineno}_{node.col_offset}"
            found = written(loop, self._target, self._is_port, prefix)
            if found is not None:
                return self._written(node, found, prefix)
        return [node]

    def _written(self, node: ast.For, loop: Written, prefix: str) -> list[ast.stmt]:
        """Return a loop that is written out."""
        rounds = []
        for k, (names, sets, longer) in enumerate(loop.rounds):
            body = [_Named(names).visit(copy.deepcopy(each)) for each in node.body]
            tests: list[ast.expr] = [
                ast.Compare(ast.Constant(k), [ast.Lt()], [ast.Call(_name("len"), [each], [])])
                for each in longer
            ]
            rounds.append((copy.deepcopy(sets), body, copy.deepcopy(tests)))
        statements = [*loop.before, *rounds_of(rounds, prefix)]
        for each in statements:
            for part in ast.walk(each):
                if isinstance(part, ast.stmt) and not hasattr(part, "lineno"):
                    ast.copy_location(part, node)
            ast.fix_missing_locations(each)
        return [part for each in statements for part in self._simpler(each)]

    def _is_errstate(self, item: ast.withitem) -> bool:
        call = item.context_expr
        return (
            isinstance(call, ast.Call)
            and self._target(call.func) is np.errstate
            and item.optional_vars is None
            and all(getattr(each.value, "value", "") == "ignore" for each in call.keywords)
        )

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Visit the parts of a node, and the statements of its blocks in order."""
        for field, value in ast.iter_fields(node):
            if isinstance(value, list) and value and isinstance(value[0], ast.stmt):
                self.block(value)
            elif isinstance(value, list):
                value[:] = [
                    self.visit(each) if isinstance(each, ast.AST) else each for each in value
                ]
            elif isinstance(value, ast.AST):
                setattr(node, field, self.visit(value))
        return node

    def _define(self, node: ast.stmt, name: str, nested: ast.FunctionDef | ast.Lambda) -> str:
        """Lift a nested function; return its name."""
        if isinstance(nested, ast.FunctionDef) and nested.decorator_list:
            decorator = nested.decorator_list[0]
            raise self._mistake(decorator, "a decorator is not compiled", "remove it")
        if sum(_sets(each, name) for each in ast.walk(self._tree)) > 1:
            raise self._mistake(node, f"{name} is set twice", "use two names")
        for each in ast.walk(nested):
            if isinstance(each, ast.AugAssign) and isinstance(each.target, ast.Name):
                changed = each.target.id
                if changed in self._variables and changed not in _set_before(nested, each):
                    what = f"{changed} belongs to the function around {name}"
                    raise self._mistake(each.target, what, "return the new value, or use a State")
            if isinstance(each, ast.Nonlocal):
                remedy = "declare a State, or return the value"
                raise self._mistake(each, "nonlocal is not compiled", remedy)
        given = nested.args
        for default in (*given.defaults, *given.kw_defaults):
            if default is not None and free(default) & self._variables:
                what = f"a default of {name} is a variable"
                raise self._mistake(default, what, f"use the variable in {name} itself")
        body = nested.body
        if not isinstance(body, list):
            body = [ast.copy_location(ast.Return(body), body)]
        tree = _located(ast.FunctionDef(name, _without_types(given), body, []), nested)
        signature = inspect.signature(self._compiled(_signature_only(tree)))
        tree = copy.deepcopy(tree)
        if name in free(tree):
            raise self._mistake(node, f"{name} calls itself", "use a loop")
        names = self._taken(tree)
        tree.args = _with_first(names, tree.args)
        ast.fix_missing_locations(tree)
        name = self._add(name, tree, nested)
        self._known[name] = signature, names
        return name

    def _taken(self, tree: ast.AST) -> list[str]:
        """Return the variables that a nested function takes from this one: the first argument,
        which may be self, and those that it or the functions that it calls read.
        """
        read, own = free(tree), bound(tree)
        for name in sorted(read & set(self._known)):
            for each in self._known[name][1]:
                if each in own:
                    use = next(of for of in ast.walk(tree) if getattr(of, "id", "") == name)
                    what = f"passes {each} of the function around it, and has a variable {each}"
                    raise self._mistake(use, what, "use two names")
                read.add(each)
        others = sorted(read & self._variables - {self._first})
        return [self._first, *others] if self._first and self._first not in own else others

    def _add(self, name: str, tree: ast.FunctionDef, node: ast.expr | ast.stmt) -> str:
        """Make a function that can be called by its name; return the name.

        Where a loop is written out, several functions have one place in the text.
        """
        key = self._outer, node.lineno, node.col_offset, ast.dump(tree)
        if self.functions.get(name, _made.get(key)) is not _made.get(key):
            if not name.startswith("rtcf_"):
                remedy = "define it before the loop"
                raise self._mistake(node, f"{name} differs between iterations", remedy)
            name = tree.name = f"{name}_{len(self.functions)}"
            key = self._outer, node.lineno, node.col_offset, ast.dump(tree)
        if key not in _made:
            _made[key] = self._compiled(tree)
            if name.startswith("rtcf_"):
                _made[key].__qualname__ = f"{self._outer.__qualname__}.<locals>.<comprehension>"
            self._note(_made[key], tree)
        self.functions[name] = _made[key]
        return name

    def _note(self, function: FunctionType, tree: ast.FunctionDef) -> None:
        """Note the tree and the callees of a lifted function."""
        functions, known = dict(self.functions), dict(self._known)
        _lifted[function] = _Lifted(tree, functions, known, self._owner, self._depth)

    def _compiled(self, tree: ast.FunctionDef) -> FunctionType:
        module = ast.Module([copy.deepcopy(tree)], [])
        scope: dict[str, Any] = {}
        exec(compile(module, self._file, "exec", dont_inherit=True), self._outer.__globals__, scope)
        function: FunctionType = scope[tree.name]
        function.__qualname__ = f"{self._outer.__qualname__}.<locals>.{tree.name}"
        # Code objects of one text are equal, but those of two copies may call other functions.
        name = f"{self._outer.__code__.co_name}.{tree.name}"
        function.__code__ = function.__code__.replace(co_name=name)
        return function

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Reject a nested function that is not called."""
        if node.id not in self._nested:
            return node
        if node.id in self._known:
            raise self._mistake(node, f"{node.id} is a function, used as a value", "call it")
        what = f"{node.id} is not defined here"
        raise self._mistake(node, what, "define it before, outside of if and loops")

    # Calls.

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Pass variables to nested functions; replace comprehensions as arguments."""
        if any(isinstance(each, ast.Starred) for each in node.args):
            node = self._without_star(node)
        if isinstance(node.func, ast.Name) and node.func.id in self._known:
            if (specialised := self._specialised(node)) is not None:
                return self.visit_Call(specialised)
            new = _passed(node, self._known, self._mistake)
            new.args = [self.visit(each) for each in new.args]
            for keyword in new.keywords:
                keyword.value = self.visit(keyword.value)
            return new
        if isinstance(node.func, ast.Attribute) and (table := self._table(node.func.value)):
            return self._looked_up(node, table, node.args)
        if (specialised := self._specialised(node)) is not None:
            return self.visit_Call(specialised)
        target = self._target(node.func)
        if (reduced := self._reduced(node, target)) is not None:
            return reduced
        first = node.args[0] if node.args else None
        if target is tuple and len(node.args) == 1 and isinstance(first, ast.GeneratorExp):
            elements = self._written_out(first)
            if elements is not None:
                return self.visit(_located(ast.Tuple(elements, ast.Load()), node))  # type: ignore[no-any-return]
        is_array = any(target is each for each in _ARRAYS) and not node.keywords
        if is_array and len(node.args) == 1 and isinstance(first, ast.ListComp) and (
            self._of_ports(first) is None
        ):  # fmt: skip
            return self._filled(first)
        if self._is_neutral(node.func, target):
            node.func = self.visit(node.func)
            node.args = [self._as_array(each) for each in node.args]
            for keyword in node.keywords:
                keyword.value = self.visit(keyword.value)
            return node
        return self.generic_visit(node)

    def _taker(self, node: ast.expr) -> tuple[FunctionType, list[str], str] | None:
        """Return a function of the user that is called, the names of the arguments that are passed
        before those written, and the name of its own first argument if that is self.
        """
        if isinstance(node, ast.Name) and node.id in self._known:
            names = self._known[node.id][1]
            is_passed = bool(names) and names[0] == self._first
            return (self.functions[node.id], names, self._first) if is_passed else None
        if self._is_of_self(node):
            method = method_of(self._owner, node.attr)  # type: ignore[attr-defined]
            if isinstance(method, FunctionType):
                first = next(iter(inspect.signature(method).parameters), "")
                return (method, [self._first], first) if first else None
            return None if method is None else (method.__func__, [], "")
        target = self._target(node)
        return (target, [], "") if is_own(target) else None

    def _is_of_self(self, node: ast.expr) -> bool:
        of = node.value if isinstance(node, ast.Attribute) else None
        return isinstance(of, ast.Name) and of.id == self._first

    def _specialised(self, node: ast.Call) -> ast.Call | None:
        """Return the call of a copy of a function for the functions that it is given, or None."""
        taker = self._taker(node.func)
        if taker is None or not self._may_be_function(node):
            return None
        function, before, first = taker
        tree = tree_of(function) or parsed(function)
        names = [each.arg for each in (*tree.args.posonlyargs, *tree.args.args)]
        placed = arguments(node, names[len(before) :])
        if placed is None or not is_plain(function, tree):
            return None
        given = {name: found for name, each in placed.items()
                 if (found := self._given(each, calls(tree, name))) is not None}  # fmt: skip
        if not given:
            return None
        if self._depth > _MOST:
            raise self._mistake(node, "functions are given to functions without end", "use a loop")
        for name in given:
            if any(_sets(each, name) for each in ast.walk(tree)):
                what = f"{function.__name__} sets {name}, which is a function"
                raise self._mistake(node, what, "use two names")
        own = first or (self._first if self._first not in everywhere(tree) else "rtcf_self")
        key = (function, self._owner, own, *((name, each.key) for name, each in given.items()))
        passed = [part for each in given.values() if each.nested
                  for part in self._known[each.nested][1] if part != self._first]  # fmt: skip
        if key not in _made:
            tree.name = "_".join([tree.name, "of", *(each.name for each in given.values())])
            _made[key] = self._copy(function, tree, own, given, is_method=bool(first))
        called = _made[key].__name__
        self.functions[called] = _made[key]
        if not first and self._first:
            before = [self._first, *before]
        own_names = [_name(each) for each in (*before[:1], *passed, *before[1:])]
        rest = [each for name, each in zip(names[len(taker[1]) :], node.args, strict=False)
                if name not in given]  # fmt: skip
        keywords = [each for each in node.keywords if each.arg not in given]
        return _located(ast.Call(_name(called), [*own_names, *rest], keywords), node)

    def _may_be_function(self, node: ast.Call) -> bool:
        """Tell whether an argument of a call may be a function: fast."""
        return any(
            isinstance(each, ast.Lambda | ast.Name) or self._is_of_self(each) or _is_dotted(each)
            for each in (*node.args, *(each.value for each in node.keywords))
        )

    def _given(self, node: ast.expr, is_called: bool) -> Given | None:
        """Return the function that an argument is, or None."""
        if isinstance(node, ast.Lambda):
            name = f"rtcf_lambda_{node.lineno}_{node.col_offset}"
            name = self._define(ast.copy_location(ast.Pass(), node), name, node)
            node = _located(_name(name), node)
        if isinstance(node, ast.Name) and node.id in self._known:
            name = "lambda" if node.id.startswith("rtcf_lambda") else node.id
            return Given(name, (self.functions[node.id], *self._known[node.id][1]), nested=node.id)
        if self._is_of_self(node):
            name = node.attr  # type: ignore[attr-defined]
            is_method = is_called and method_of(self._owner, name) is not None
            return Given(name, name, method=name) if is_method else None
        value = self._target(node) if is_called else None
        return Given(value.__name__, value, of_module=value) if is_function(value) else None

    def _copy(
        self,
        function: FunctionType,
        tree: ast.FunctionDef,
        own: str,
        given: dict[str, Given],
        is_method: bool,
    ) -> FunctionType:
        """Return a copy of a function for the functions that it is given.

        `own`: its first argument, which is that of the function around the call.
        """
        defaults = without(tree, set(given), defaults_of(function))
        while tree.name in _copies or tree.name in self._variables | set(self.functions):
            tree.name += "_"
        _copies.add(tree.name)
        tree.args, tree.returns, tree.decorator_list = _without_types(tree.args), None, []
        known = _lifted.get(function)
        lifted = _Lifted(tree, {}, {}, self._owner, 0) if known is None else known
        functions, nested = dict(lifted.functions), dict(lifted.known)
        scope = dict(function.__globals__)
        names: list[str] = []
        methods: dict[str, ast.expr] = {}
        for name, each in given.items():
            if each.nested:
                signature, taken = self._known[each.nested]
                functions[name] = self.functions[each.nested]
                new = {part: f"rtcf_{name}_{part}" for part in taken if part != self._first}
                nested[name] = signature, [new.get(part, own) for part in taken]
                names += new.values()
            elif each.method:
                called = ast.Attribute(_name(own), each.method, ast.Load())
                methods[name] = _located(called, tree)
            else:
                scope[name] = each.of_module
        body = ast.Module(tree.body, [])
        _Named(methods).visit(body)
        first = tree.args.posonlyargs or tree.args.args
        if is_method:
            first[1:1] = [ast.arg(each) for each in names]
        else:
            tree.args = _with_first([*([own] if self._first else []), *names], tree.args)
        tree = _located(tree, tree)
        new_scope: dict[str, Any] = {}
        compiled = ast.Module([without_defaults(tree)], [])
        exec(
            compile(compiled, function.__code__.co_filename, "exec", dont_inherit=True),
            scope,
            new_scope,
        )
        copied: FunctionType = new_scope[tree.name]
        copied.__qualname__ = function.__qualname__
        copied.__defaults__ = defaults
        _lifted[copied] = _Lifted(tree, functions, nested, self._owner, self._depth + 1)
        return copied

    def _without_star(self, node: ast.Call) -> ast.Call:
        """Return a call with the elements of `*values`, if their number is known."""
        target, known = self._target(node.func), self._known.get(ast.unparse(node.func))
        if target in (max, min) and len(node.args) == 1 and isinstance(node.args[0], ast.Starred):
            return _located(ast.Call(node.func, [node.args[0].value], node.keywords), node)
        stars = [each for each in node.args if isinstance(each, ast.Starred)]
        if known is not None:
            takes = known[0].parameters.values()
        elif isinstance(target, FunctionType):
            takes = inspect.signature(target).parameters.values()
        else:
            return node  # rejected, see checks.py
        named = {each.arg for each in node.keywords}
        left = [each for each in takes if each.name not in named]
        # With defaults, the number of values would decide which arguments are given.
        is_open = any(each.default is not each.empty or each.kind is each.VAR_POSITIONAL
                      for each in left)  # fmt: skip
        count = len(left) - len(node.args) + 1
        if len(stars) > 1 or count < 1 or is_open:
            return node
        names = [f"rtcf_of_{number}" for number in range(len(node.args) + count - 1)]
        before: list[ast.stmt] = []
        place = 0
        for each in node.args:
            target_of: ast.expr = ast.Name(names[place], ast.Store())
            value, size = each, 1
            if isinstance(each, ast.Starred):
                size, value = count, each.value
                parts: list[ast.expr] = [
                    ast.Name(name, ast.Store()) for name in names[place : place + count]
                ]
                target_of = ast.Tuple(parts, ast.Store())
            before.append(_located(ast.Assign([target_of], value), each))
            place += size
        call = ast.Call(node.func, [_name(each) for each in names], node.keywords)
        before.append(_located(ast.Return(_located(call, node)), node))
        return self._own_function(node, "star", before)

    def _is_neutral(self, called: ast.expr, target: Any) -> bool:
        """Tell whether a call takes a list and an array alike."""
        if any(target is each for each in _NEUTRAL) or isinstance(target, np.ufunc):
            return True
        if target is not None:
            return (getattr(target, "__module__", None) or "").startswith("numpy")
        return isinstance(called, ast.Attribute) and called.attr == "write"

    def _target(self, node: ast.AST) -> Any:
        """Return the object that a dotted name refers to in the module, or None."""
        if isinstance(node, ast.Attribute):
            owner = self._target(node.value)
            return None if owner is None else opened(getattr(owner, node.attr, None))
        if not isinstance(node, ast.Name) or node.id in self._variables | self._nested:
            return None
        builtins = self._outer.__globals__.get("__builtins__", {})
        known = builtins if isinstance(builtins, dict) else vars(builtins)
        return opened(self._outer.__globals__.get(node.id, known.get(node.id)))

    def _reduced(self, node: ast.Call, target: Any) -> ast.AST | None:
        """Return the call of a loop for `sum(x for x in …)` and its like, or None."""
        reduction = next((each for each in _REDUCTIONS if each.function is target), None)
        of = node.args[0] if node.args else None
        if isinstance(of, ast.ListComp | ast.GeneratorExp) and target in (sum, any, all, max, min):
            ports = self._of_ports(of)
            if ports is not None and not of.generators[0].ifs:
                if target in (any, all):
                    sign = ast.Or() if target is any else ast.And()
                    return self.visit(_located(ast.BoolOp(sign, ports), node))  # type: ignore[no-any-return]
                node.args[0] = _located(ast.Tuple(ports, ast.Load()), of)
                return self.generic_visit(node)
        if reduction is None or not isinstance(of, reduction.takes):
            return None
        given = [*node.args[1:], *(each.value for each in node.keywords)]
        if len(given) > 1 or not {each.arg for each in node.keywords} <= {reduction.option}:
            return None
        if not all(map(self._is_plain, given)):
            return None  # when it is computed, if at all, depends on the function
        if target is next and not given:
            raise self._mistake(node, "next without a default may raise", "write next(…, default)")
        text = reduction.text if not given else reduction.with_option
        start = given[0] if given else ast.Constant(0)
        return self._loop(of, target.__name__, (text, reduction.step), of.generators, START=start)

    # Comprehensions.

    def visit_ListComp(self, node: ast.ListComp) -> ast.AST:
        """Write the elements of a list one by one if they are few and known."""
        elements = self._written_out(node)
        if elements is None:
            return node  # rejected, see checks.py
        return self.visit(_located(ast.List(elements, ast.Load()), node))  # type: ignore[no-any-return]

    def visit_GeneratorExp(self, node: ast.GeneratorExp) -> ast.AST:
        """Keep others, which checks.py rejects."""
        return node

    visit_SetComp = visit_DictComp = visit_Lambda = visit_GeneratorExp  # type: ignore[assignment]

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        """Fill arrays for members, elements, unpacked names and lists that may be arrays."""
        one = node.targets[0] if len(node.targets) == 1 else None
        names = isinstance(one, ast.Tuple | ast.List)
        if isinstance(one, ast.Attribute | ast.Subscript) or names or (
            isinstance(one, ast.Name)
            and (one.id in self._lists or one.id.startswith(("rtcf_value", "rtcf_of_")))
        ):  # fmt: skip
            node.targets = [self.visit(each) for each in node.targets]
            if names and isinstance(node.value, ast.GeneratorExp):
                node.value = self._filled(node.value)
            else:
                node.value = self._as_array(node.value)
            return node
        return self.generic_visit(node)

    def visit_Dict(self, node: ast.Dict) -> ast.AST:
        """Replace a dict that is only looked up by the tuple of its values."""
        if not any(node is each for each in self._dicts.values()):
            return node  # rejected, see checks.py
        numbers = [each.value for each in node.values if isinstance(each, ast.Constant)]
        if len(numbers) == len(node.values) and {type(each) for each in numbers} == {int, float}:
            for each in node.values:
                each.value = float(each.value)  # type: ignore[attr-defined]
        values = [self.visit(each) for each in node.values]
        return _located(ast.Tuple(values, ast.Load()), node)

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        """Replace `table[key]` of a dict."""
        joined = self._joined(node)
        if joined is not None:
            return self.visit(_located(joined, node))  # type: ignore[no-any-return]
        table = self._table(node.value)
        if table is None:
            return self.generic_visit(node)
        return self._looked_up(node, table, [node.slice])

    def _joined(self, node: ast.Subscript) -> ast.Call | None:
        """Return `np.r_[a, b]` or `np.c_[a, b]` as a call of a function, or None."""
        of = self._target(node.value)
        name = "hstack" if of is np.r_ else "column_stack" if of is np.c_ else ""
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else []
        if not name or not parts or any(isinstance(each, ast.Slice) for each in parts):
            return None
        assert isinstance(node.value, ast.Attribute)
        called = ast.Attribute(node.value.value, name, ast.Load())
        return ast.Call(called, [node.slice], [])

    def _table(self, node: ast.expr) -> ast.Dict | None:
        return self._dicts.get(node.id) if isinstance(node, ast.Name) else None

    def _looked_up(self, node: ast.expr, table: ast.Dict, given: list[ast.expr]) -> ast.AST:
        """Return the call that looks up a key, perhaps with a default."""
        constants = [each.value for each in table.keys if isinstance(each, ast.Constant)]
        values: ast.expr = node.func.value if isinstance(node, ast.Call) else node.value  # type: ignore[attr-defined]
        is_known = len(given) == 1 or self._is_plain(given[1])
        if isinstance(given[0], ast.Constant) and len(constants) == len(table.keys) and is_known:
            if given[0].value in constants:
                place = ast.Constant(constants.index(given[0].value))
                return _located(ast.Subscript(values, place, ast.Load()), node)
            if len(given) > 1:
                return given[1]
            has = ", ".join(map(repr, constants))
            name = ast.unparse(values)
            raise self._mistake(node, f"{name} has no {given[0].value!r}", f"use one of {has}")
        keys = [
            ast.Call(_name("rtcf_number"), [copy.deepcopy(each)], []) for each in table.keys if each
        ]
        function = "rtcf_looked_up" if len(given) == 1 else "rtcf_looked_up_or"
        key, *default = [self.visit(each) for each in given]
        kind, first = self._kind_of_keys(table.keys), table.keys[0]
        if is_enum(kind) and isinstance(first, ast.Attribute):
            # Ints are no keys of a dict of enums that are no ints.
            key = ast.Call(_name("rtcf_stored_enum"), [key, copy.deepcopy(first.value)], [])
        parts = [ast.Tuple(keys, ast.Load()), values, key, *default]
        return _located(ast.Call(_name(function), parts, []), node)

    def _local_dicts(self) -> Iterator[tuple[str, ast.Dict]]:
        """Yield the variables that are set once, to a dict of constant keys, and only looked up."""
        for each in ast.walk(self._tree):
            if not isinstance(each, ast.Assign) or not isinstance(each.value, ast.Dict):
                continue
            target, keys = each.targets[0], each.value.keys
            if len(each.targets) > 1 or not isinstance(target, ast.Name) or not keys:
                continue
            inner = [of for of in ast.walk(self._tree) if isinstance(of, _SCOPES)]
            hidden = {id(part) for of in inner if of is not self._tree for part in ast.walk(of)}
            if any(id(of) in hidden for of in _uses_of(self._tree, target.id)) or (
                self._kind_of_keys(keys) is None
            ):
                continue
            is_constant = [isinstance(key, ast.Constant) or _is_dotted(key) for key in keys]
            names = [name for name in ast.walk(self._tree) if isinstance(name, ast.Name)
                     and name.id == target.id]  # fmt: skip
            uses = [of for of in ast.walk(self._tree) if _is_look_up(of, target.id)]
            if all(is_constant) and len(names) == 1 + len(uses):
                yield target.id, each.value

    def _is_plain(self, node: ast.expr) -> bool:
        """Tell whether an expression has no effect: no call and no property."""
        return not any(
            isinstance(each, ast.Call | ast.NamedExpr)
            or (
                isinstance(each, ast.Attribute)
                and isinstance(inspect.getattr_static(self._owner, each.attr, None), property)
            )
            for each in ast.walk(node)
        )

    def _kind_of_keys(self, keys: Sequence[ast.expr | None]) -> type | None:
        """Return the class of the keys of a dict that differ: int, text or an enum; else None."""
        values = [each.value if isinstance(each, ast.Constant) else self._target(each)
                  for each in keys if each is not None]  # fmt: skip
        kinds = {type(each) for each in values}
        is_whole = len(values) == len(keys) == len(set(values)) and len(kinds) == 1
        kind = kinds.pop() if is_whole else None
        return kind if kind in (int, str) or is_enum(kind) else None

    def visit_For(self, node: ast.For) -> ast.AST:
        """Fill an array that is iterated."""
        node.iter = self._as_array(node.iter)
        return self.generic_visit(node)

    def _as_array(self, node: ast.expr) -> ast.expr:
        """Return an expression whose list comprehensions fill arrays."""
        if isinstance(node, ast.ListComp):
            return self._filled(node)
        if isinstance(node, ast.List | ast.Tuple) and isinstance(node.ctx, ast.Load):
            node.elts = [self._as_array(each) for each in node.elts]
            return node
        return self.visit(node)  # type: ignore[no-any-return]

    def _filled(self, node: _Comprehension) -> ast.expr:
        """Return the call of a loop that fills an array; a list for a comprehension over ports."""
        if not node.generators[0].ifs and (ports := self._of_ports(node)) is not None:
            return self.generic_visit(_located(ast.List(ports, ast.Load()), node))  # type: ignore[return-value]
        if len(node.generators) > 1 or node.generators[0].ifs:
            if (elements := self._written_out(node)) is not None:
                return self.visit(_located(ast.List(elements, ast.Load()), node))  # type: ignore[no-any-return]
            remedy = (
                "use np.where, or a loop that counts" if node.generators[0].ifs else "use a loop"
            )
            raise self._mistake(node, "the size of this list is not fixed", remedy)
        first = node.generators[0]
        before: list[ast.stmt] = []
        count = self._count(first, before)
        return self._loop(node, "list", _FILLED, [first], before, COUNT=count)

    def _count(self, of: ast.comprehension, before: list[ast.stmt]) -> ast.expr:
        """Return the number of elements of an iterable, whose parts get names in statements."""

        def named(node: ast.expr) -> ast.expr:
            name = f"rtcf_of_{len(before)}"
            before.append(_located(ast.Assign([ast.Name(name, ast.Store())], node), node))
            return _located(ast.Name(name, ast.Load()), node)

        def counted(node: ast.expr) -> tuple[ast.expr, ast.expr]:
            """Return the iterable with names, and its size."""
            target = self._target(node.func) if isinstance(node, ast.Call) else None
            if isinstance(node, ast.Call) and any(target is each for each in _ITERATORS):
                parts = [counted(each) for each in node.args]
                if target is enumerate:  # the second argument is not iterated
                    parts[1:] = [(each, each) for each in node.args[1:]]
                sizes = [size for _, size in parts[: 1 if target is enumerate else None]]
                new = ast.Call(node.func, [each for each, _ in parts], node.keywords)
                size = sizes[0] if len(sizes) == 1 else ast.Call(_name("min"), sizes, [])
                return _located(new, node), _located(size, node)
            if isinstance(node, ast.Call) and target is range:
                if any(isinstance(each, ast.Call) for each in ast.walk(node) if each is not node):
                    node.args = [named(each) for each in node.args]
            else:
                node = named(node)
            size = ast.Call(_name("len"), [copy.deepcopy(node)], [])
            return node, _located(size, node)

        of.iter, size = counted(of.iter)
        return size

    def _loop(
        self,
        node: _Comprehension,
        kind: str,
        texts: tuple[str, str],
        generators: Sequence[ast.comprehension],
        before: Sequence[ast.stmt] = (),
        **given: ast.expr,
    ) -> ast.Call:
        """Return the call of a function with the loops of a comprehension."""
        for each in ast.walk(node):
            if isinstance(each, ast.NamedExpr):
                raise self._mistake(each, "a := in a comprehension", "write a loop")
        body = _placed(texts[1], node, {"VALUE": node.elt})
        for each in reversed(generators):
            for test in reversed(each.ifs):
                body = [_located(ast.If(test, body, []), test)]
            body = [_located(ast.For(each.target, each.iter, body, []), node)]
        return self._own_function(node, kind, [*before, *_placed(texts[0], node, given, loop=body)])

    def _own_function(self, node: ast.expr, kind: str, body: list[ast.stmt]) -> ast.Call:
        """Return the call of a function with these statements."""
        name = f"rtcf_{kind}_{node.lineno}_{node.col_offset}"
        tree = ast.FunctionDef(name, _arguments([]), body, [])
        tree = copy.deepcopy(_located(tree, node))
        names = self._taken(tree)
        tree.args = _arguments(names)
        name = self._add(name, ast.fix_missing_locations(tree), node)
        call = ast.Call(_name(name), [_name(each) for each in names], [])
        return _located(call, node)

    def _of_ports(self, node: _Comprehension) -> list[ast.expr] | None:
        """Return the elements of a comprehension over ports, or None."""
        first, conditions = node.generators[0], node.generators[0].ifs
        used = [ast.Expr(each) for each in (node.elt, *conditions)]
        rounds = by_port(first.target, self._ports(first.iter), used, self._is_port)
        if len(node.generators) > 1 or rounds is None or any(before for _, before in rounds):
            return None
        return [_Named(ports).visit(copy.deepcopy(node.elt)) for ports, _ in rounds]

    def drop_tuples(self) -> None:
        """Drop tuples of ports whose loops are written out."""
        read = {each.id for each in ast.walk(self._tree)
                if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)}  # fmt: skip
        for each in ast.walk(self._tree):
            if isinstance(each, ast.Assign) and any(
                isinstance(target, ast.Name) and target.id in set(self._port_tuples) - read
                for target in each.targets
            ):
                each.value = ast.copy_location(ast.Constant(0), each.value)

    def _is_port(self, node: ast.expr) -> bool:
        return is_port(node, self._owner)

    def _ports(self, node: ast.expr) -> ast.expr:
        """Return an iterable with variables that are tuples of ports replaced by these."""
        return _Named(dict(self._port_tuples)).visit(copy.deepcopy(node))  # type: ignore[no-any-return]

    def _tuples_of_ports(self) -> Iterator[tuple[str, ast.expr]]:
        """Yield the variables that are set once, to members, and only iterated."""
        for each in ast.walk(self._tree):
            target = each.targets[0] if isinstance(each, ast.Assign) else None
            if not isinstance(target, ast.Name) or not isinstance(each, ast.Assign):
                continue
            is_display = isinstance(each.value, ast.Tuple | ast.List)
            if not is_display or not all(map(self._is_port, each.value.elts)):  # type: ignore[attr-defined]
                continue
            loops = [
                of for of in ast.walk(self._tree) if isinstance(of, ast.For | ast.comprehension)
            ]
            uses = [name for of in loops for name in ast.walk(of.iter)]
            count = sum(isinstance(of, ast.Name) and of.id == target.id for of in uses)
            every = sum(
                isinstance(of, ast.Name) and of.id == target.id for of in ast.walk(self._tree)
            )
            if len(each.targets) == 1 and count and every == 1 + count:
                yield target.id, each.value

    def _written_out(self, node: _Comprehension) -> list[ast.expr] | None:
        """Return the elements of a comprehension over a few constants, names or ports, or None."""
        if not node.generators[0].ifs and (ports := self._of_ports(node)) is not None:
            return ports
        if any(isinstance(each, ast.NamedExpr) for each in ast.walk(node)):
            return None
        found: list[dict[str, ast.expr]] = [{}]
        for each in node.generators:
            if each.ifs:
                return None
            longer = []
            for known in found:
                values = self._values(_Named(known).visit(copy.deepcopy(each.iter)))
                if values is None or len(found) * len(values) > _MOST:
                    return None
                for value in values:
                    new = _unpacked(each.target, value)
                    if new is None:
                        return None
                    longer.append({**known, **new})
            found = longer
        inner = [each for each in ast.walk(node.elt) if isinstance(each, _COMPREHENSIONS)]
        if any(bound(each) & set(found[0] if found else ()) for each in inner):
            return None
        return [_Named(known).visit(copy.deepcopy(node.elt)) for known in found] or None

    def _values(self, node: ast.expr) -> list[ast.expr] | None:
        """Return the elements of an iterable of known size, or None."""
        if isinstance(node, ast.Tuple | ast.List):
            simple = (ast.Constant, ast.Name)
            signed = [each.operand if isinstance(each, ast.UnaryOp) else each for each in node.elts]
            parts = [each.elts if isinstance(each, ast.Tuple) else [each] for each in signed]
            is_simple = all(isinstance(each, simple) for part in parts for each in part)
            return list(node.elts) if is_simple else None
        if isinstance(node, ast.Call) and not node.keywords:
            target = self._target(node.func)
            if target is range:
                numbers = [self._whole(each) for each in node.args]
                if None in numbers or not 1 <= len(numbers) <= 3:
                    return None
                try:
                    steps = range(*(each for each in numbers if each is not None))
                except ValueError:
                    return None
                return [ast.Constant(each) for each in steps] if len(steps) <= _MOST else None
            if any(target is each for each in _ITERATORS):
                parts_of = [self._values(each) for each in node.args]
                known = [each for each in parts_of if each is not None]
                if len(known) < len(parts_of) or not known:
                    return None
                if target is reversed:
                    return known[0][::-1]
                if target is enumerate:
                    return [_pair(ast.Constant(k), each) for k, each in enumerate(known[0])]
                return [_pair(*each) for each in zip(*known, strict=False)]
            return None
        value = self._target(node)
        if isinstance(value, list | tuple | np.ndarray) and 0 < len(value) <= _MOST:
            places = range(len(value))
            return [ast.Subscript(node, ast.Constant(each), ast.Load()) for each in places]
        return None

    def _whole(self, node: ast.expr) -> int | None:
        value = node.value if isinstance(node, ast.Constant) else self._target(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            value = self._whole(node.operand)
            return None if value is None else -value
        return value if type(value) is int else None

    def _arrays_for_lists(self) -> set[str]:
        """Return the variables that are set once, to a list comprehension, and used only where a
        list and an array are the same.
        """
        found = set()
        for each in ast.walk(self._tree):
            if isinstance(each, ast.Assign) and isinstance(each.value, ast.ListComp):
                found |= {name.id for name in each.targets if isinstance(name, ast.Name)}
        for name in set(found):
            stores = [each for each in ast.walk(self._tree) if isinstance(each, ast.Name)
                      and each.id == name and isinstance(each.ctx, ast.Store)]  # fmt: skip
            reads = [each for each in ast.walk(self._tree) if isinstance(each, ast.Name)
                     and each.id == name and isinstance(each.ctx, ast.Load)]  # fmt: skip
            if len(stores) > 1 or len(reads) > len(list(self._neutral_uses(name))):
                found.discard(name)
        return found

    def _neutral_uses(self, name: str) -> Iterator[ast.expr]:
        """Yield the uses of a variable that are the same for a list and an array."""
        for each in ast.walk(self._tree):
            parts: list[ast.expr] = []
            if isinstance(each, ast.Subscript) and not isinstance(each.slice, ast.Slice):
                parts = [each.value]
            elif isinstance(each, ast.For | ast.comprehension):
                parts = [each.iter]
            elif isinstance(each, ast.Call):
                parts = each.args if self._is_neutral(each.func, self._target(each.func)) else []
            elif isinstance(each, ast.Assign):
                targets = (ast.Attribute, ast.Subscript, ast.Tuple)
                is_kept = all(isinstance(target, targets) for target in each.targets)
                parts = [each.value] if is_kept else []
            for part in parts:
                if isinstance(part, ast.Name) and part.id == name:
                    yield part


class _Named(ast.NodeTransformer):
    """Replaces names by expressions where they are read."""

    def __init__(self, known: dict[str, ast.expr]) -> None:
        self._known = known

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Replace a name."""
        if isinstance(node.ctx, ast.Load) and node.id in self._known:
            return _located(copy.deepcopy(self._known[node.id]), node)
        return node


def _nested(node: ast.AST) -> Iterator[tuple[str, ast.FunctionDef | ast.Lambda]]:
    """Yield the name and the function of a statement that defines one."""
    if isinstance(node, ast.FunctionDef):
        yield node.name, node
    elif (
        isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Lambda)
        and len(node.targets) == 1
        and isinstance(node.targets[0], ast.Name)
    ):
        yield node.targets[0].id, node.value


def _set_before(nested: ast.FunctionDef | ast.Lambda, node: ast.stmt) -> set[str]:
    """Return the arguments and variables that a function sets in other statements."""
    inner = copy.copy(nested)
    names = {each.id for each in ast.walk(inner) if isinstance(each, ast.Name)
             and isinstance(each.ctx, ast.Store) and each is not node.target}  # type: ignore[attr-defined]  # fmt: skip
    return names | {each.arg for each in ast.walk(inner.args) if isinstance(each, ast.arg)}


def _sets(node: ast.AST, name: str) -> bool:
    """Tell whether a node sets a variable or defines a function of this name."""
    if isinstance(node, ast.Name):
        return node.id == name and isinstance(node.ctx, ast.Store)
    return isinstance(node, ast.FunctionDef) and node.name == name


def _is_dotted(node: ast.AST | None) -> bool:
    """Tell whether a node is a name of the module, such as `Mode.RUN`."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return isinstance(node, ast.Name) and node.id != "self"


def _uses_of(tree: ast.AST, name: str) -> list[ast.Name]:
    """Return the places where a variable is read or set."""
    return [each for each in ast.walk(tree) if isinstance(each, ast.Name) and each.id == name]


def _is_look_up(node: ast.AST, name: str) -> bool:
    """Tell whether a node is `name[key]` or `name.get(key, default)`."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        is_whole = node.func.attr == "get" and len(node.args) == 2 and not node.keywords
        return is_whole and isinstance(node.func.value, ast.Name) and node.func.value.id == name
    return (
        isinstance(node, ast.Subscript)
        and isinstance(node.ctx, ast.Load)
        and isinstance(node.value, ast.Name)
        and node.value.id == name
    )


def _passed(node: ast.Call, known: Any, mistake: Any) -> ast.Call:
    """Return a call of a nested function that passes the function's variables."""
    assert isinstance(node.func, ast.Name)
    signature, names = known[node.func.id]
    if any(isinstance(each, ast.Starred) for each in node.args):
        raise mistake(node, "* unpacks a value that has no fixed size", "write the elements")
    given = [None] * len(node.args)
    try:
        signature.bind(*given, **{str(each.arg): None for each in node.keywords})
    except TypeError:
        takes = ", ".join(map(str, signature.parameters.values()))
        what = f"{node.func.id} takes {takes or 'no arguments'}"
        raise mistake(node, what, f"write {node.func.id}({takes})") from None
    arguments = [_located(_name(each), node.func) for each in names]
    return _located(ast.Call(node.func, [*arguments, *node.args], node.keywords), node)


def _signature_only(tree: ast.FunctionDef) -> ast.FunctionDef:
    """Return a function that does nothing."""
    new = copy.deepcopy(tree)
    new.body = [ast.Pass()]
    return ast.fix_missing_locations(new)


def _without_types(given: ast.arguments) -> ast.arguments:
    """Return arguments without annotations."""
    new = copy.deepcopy(given)
    for each in (*new.posonlyargs, *new.args, *new.kwonlyargs):
        each.annotation = None
    return new


def _with_first(names: Sequence[str], given: ast.arguments) -> ast.arguments:
    """Return arguments with others before them."""
    new = copy.deepcopy(given)
    first = [ast.arg(each) for each in names]
    if new.posonlyargs:
        new.posonlyargs[:0] = first
    else:
        new.args[:0] = first
    return new


def _arguments(names: Sequence[str]) -> ast.arguments:
    return ast.arguments([], [ast.arg(each) for each in names], None, [], [], None, [])


def _placed(
    text: str, node: ast.AST, given: dict[str, ast.expr], loop: list[ast.stmt] | None = None
) -> list[ast.stmt]:
    """Return the statements of a text with expressions, and a loop, in the places of names."""
    found: list[ast.stmt] = []
    for each in ast.parse(text).body:
        if (
            isinstance(each, ast.Expr)
            and isinstance(each.value, ast.Name)
            and each.value.id == "LOOP"
        ):
            found += loop or []
            continue
        for part in ast.walk(each):
            ast.copy_location(part, node)
        found.append(_Placed(given).visit(each))
    return found


class _Placed(_Named):
    """Replaces names by expressions that keep their own places."""

    def visit_Name(self, node: ast.Name) -> ast.AST:
        """Replace a name."""
        return self._known.get(node.id, node)


def _unpacked(target: ast.expr, value: ast.expr) -> dict[str, ast.expr] | None:
    """Return the values of the names of a target, or None."""
    if isinstance(target, ast.Name):
        return {target.id: value}
    if not isinstance(target, ast.Tuple | ast.List) or not isinstance(value, ast.Tuple):
        return None
    if len(target.elts) != len(value.elts):
        return None
    found: dict[str, ast.expr] = {}
    for each, part in zip(target.elts, value.elts, strict=True):
        new = _unpacked(each, part)
        if new is None:
            return None
        found |= new
    return found


def _pair(*parts: ast.expr) -> ast.expr:
    return ast.Tuple(list(parts), ast.Load())


def _name(name: str) -> ast.Name:
    return ast.Name(name, ast.Load())


def _located(new: _Node, node: ast.AST) -> _Node:
    """Return a new node with the place of another, also for its parts without one."""
    ast.copy_location(new, node)
    return ast.fix_missing_locations(new)
