"""Finds where compiled code must copy an array to give the results of NumPy.

In NumPy, `self.a = value` binds the name to another array. Compiled, a member has one place in
memory, and the assignment copies the value there. Both agree unless a reference to the old array is
read afterwards, such as `old` in `old = self.a; self.a = 2 * self.a; self.a - old`.

This follows references through the hooks of a class, as NumPy binds them and as compiled code
places them: a reference is a pair of the array in NumPy (`thing`) and its memory in the component
(`place`). It finds, until nothing changes, the expressions whose values must be copied, so that no
reference that is read later has its place overwritten. It rejects a change of an array's elements
if another reference means the same array in NumPy, but another place.

The method is a points-to analysis with strong updates and recency (Balakrishnan and Reps, 2006):
types are not known here, so that any value may be an array unless its declaration is known.
"""

import ast
import functools
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from types import CodeType
from typing import Any, NamedTuple

import numpy as np
from rtcf.component.declaration import (
    HOOKS,
    PORTS,
    Derived,
    Description,
    Member,
    Output,
    Parameter,
    State,
)

from rtcf_compile.rewriting.live_names import LiveNames
from rtcf_compile.rewriting.methods import Method, Methods, nested
from rtcf_compile.rewriting.subscripts import Subscripts
from rtcf_compile.source.assigned import matches_all
from rtcf_compile.source.checks import check, resolve
from rtcf_compile.source.mistake import at, written
from rtcf_compile.source.modules import Source, read
from rtcf_compile.source.parsed import is_own
from rtcf_compile.source.records import NAMED, as_tuple
from rtcf_compile.source.spelling import defaults_of

# The name of an array, or of a place: its kind and what tells it from others of the kind.
Name = tuple[Any, ...]
# The place of an expression in a function, or the name of a parameter of the function.
Key = tuple[int, int, int, int, str] | str
Site = tuple[CodeType, Key]


class Ref(NamedTuple):
    """A reference to an array or to a part of one."""

    thing: Name  # the array in NumPy
    place: Name  # its memory in the component
    site: Site | None  # the expression that can be copied: a value, or an operand
    is_whole: bool = True
    dimensions: int | None = None
    bound: Site | None = None  # the value to which a variable was bound
    is_read_only: bool = False  # in NumPy


Refs = frozenset[Ref]
# What an expression may refer to. A tuple keeps its elements apart.
Value = Refs | tuple["Value", ...]
# A variable: a member, ("self", name); a local variable, (depth of calls, name); or a value that an
# expression holds while the rest of it is computed, ("held", number).
Cell = tuple[Any, Any]
Bindings = dict[Cell, Value]

NOTHING: Refs = frozenset()
# A new array that compiled code may compute as late as the expression that contains it.
_RESULT = ("result",)
_UNCHANGED = ("input", "read-only")  # places that a hook does not change
# What surely is an array, not a number.
_SURELY = ("begin", "own", "shared", "read", "read-only")
# One of the values that a condition selects: a number, or a new array.
_NEW = ("selected",)
# Different bindings at one place before they are merged, and statements to follow before that
# number is too large: nested loops and calls multiply both.
_EFFORT = ((12, 5000), (1, 8000))

# Functions and methods whose result refers to their first argument, in NumPy.
_SAME = (np.asarray, np.ascontiguousarray)
_VIEWS = (
    *(
        np.real,
        np.imag,
        np.reshape,
        np.ravel,
        np.transpose,
        np.flip,
        np.squeeze,
        np.flipud,
        np.fliplr,
    ),
    *(np.broadcast_to, np.expand_dims, np.atleast_1d, np.atleast_2d, np.atleast_3d),
)
_VIEW_METHODS = ("reshape", "ravel", "transpose", "squeeze", "view", "swapaxes")
_VIEW_ATTRIBUTES = ("T", "real", "imag", "flat")
# Views in NumPy, copies in compiled code.
_DIAGONALS, _DIAGONAL_METHODS = (np.diag, np.diagonal), ("diagonal",)
_CHANGING_METHODS = ("fill", "sort", "partition", "put", "itemset")
_ITERATORS = (enumerate, zip, reversed, iter)
_TUPLES = (tuple, list)


class _Exhausted(Exception):
    """Raised when there are too many statements to follow."""

    def __init__(self, mistake: Exception) -> None:
        super().__init__()
        self.mistake = mistake


class References:
    """The copies that the functions of a component need."""

    def __init__(self, description: Description, methods: Methods) -> None:
        """Follow the hooks of a class; raise Mistake for a change that would differ."""
        self.copies: set[Site] = set()
        # The largest absolute int that calls pass for an argument; None: also other values.
        self.constants: dict[tuple[CodeType, str], int | None] = {}
        found = -1
        effort = list(_EFFORT)
        while len(self.copies) > found:
            found = len(self.copies)
            try:
                _Followed(description, methods, self.copies, self.constants, *effort[0]).hooks()
            except _Exhausted as error:
                effort.pop(0)
                if not effort:
                    raise error.mistake from None
                found = -1

    def mark(self, source: Source) -> None:
        """Mark the expressions of a function that must be copied, see `is_copied`."""
        code = source.function.__code__
        keys = {key for owner, key in self.copies if owner is code}
        if not keys:
            return
        for node in ast.walk(source.tree):
            if isinstance(node, ast.expr) and key_of(node) in keys:
                vars(node)["rtcf_is_copied"] = True
        source.tree.body[:0] = [
            ast.parse(f"{name} = rtcf_copied({name})").body[0]
            for name in sorted(each for each in keys if isinstance(each, str))
        ]
        for each in source.tree.body:
            if not hasattr(each, "end_lineno"):
                ast.copy_location(each, source.tree)


def is_copied(node: ast.AST) -> bool:
    """Tell whether the value of an expression must be copied."""
    return "rtcf_is_copied" in vars(node)


def key_of(node: ast.expr) -> Key:
    """Return the place of an expression in its function."""
    end = (node.end_lineno or node.lineno, node.end_col_offset or 0)
    # Names of lifting.py have the place of what they stand for.
    kind = node.id if isinstance(node, ast.Name) else type(node).__name__
    return node.lineno, node.col_offset, *end, kind


def _flat(value: Value) -> Refs:
    """Return all references of a value."""
    if isinstance(value, frozenset):
        return value
    # Elements may have other dimensions than what contains them.
    return frozenset(ref._replace(dimensions=None) for each in value for ref in _flat(each))


def _computed(value: Value) -> Value:
    """Return a value without references that only its computation reads."""
    if isinstance(value, tuple):
        return tuple(map(_computed, value))
    rest = frozenset(each for each in value if each.thing != _RESULT)
    is_new = rest and len(rest) < len(value)
    return rest | {Ref(_NEW, _NEW, None)} if is_new else rest


def _mapped(value: Value, change: Callable[[Ref], Ref]) -> Value:
    """Return a value with changed references."""
    if isinstance(value, frozenset):
        return frozenset(map(change, value))
    return tuple(_mapped(each, change) for each in value)


def _either(one: Value, other: Value) -> Value:
    """Return the references of one value or the other."""
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        return tuple(_either(*pair) for pair in zip(one, other, strict=True))
    if one == other:
        return one
    found = _flat(one) | _flat(other)
    is_new = NOTHING in (one, other) and found
    return found | {Ref(_NEW, _NEW, None)} if is_new else found


def _merged(states: Sequence[Bindings]) -> Bindings:
    """Return bindings that may be those of any of the states."""
    result: Bindings = {}
    for cell in {cell: None for state in states for cell in state}:
        # A member without a binding refers to its array of the beginning.
        missing = _begin(cell) if cell[0] == "self" else NOTHING
        result[cell] = states[0].get(cell, missing)
        for state in states[1:]:
            one, other = result[cell], state.get(cell, missing)
            if one != other:
                is_one = NOTHING in (one, other) and cell[0] != "self"
                result[cell] = _flat(one) | _flat(other) if is_one else _either(one, other)
    return result


def _plain(state: Bindings) -> Bindings:
    """Return bindings without those of members that share no array: they are as at the beginning.
    Different ways to the same bindings become the same.
    """
    owners: dict[Name, set[Cell]] = {}
    for cell, value in state.items():
        for ref in _flat(value):
            owners.setdefault(ref.thing, set()).add(cell)
    result: Bindings = {}
    for cell, value in state.items():
        is_alone = cell[0] == "self" and all(
            owners[ref.thing] == {cell} and ref.thing[0] != "read-only" and not ref.is_read_only
            for ref in _flat(value)
        )
        if not is_alone:
            result[cell] = value
        elif owners.get(("begin", cell[1]), set()) - {cell}:
            number = 0
            while owners.get(("own", cell[1], number), set()) - {cell}:
                number += 1
            result[cell] = frozenset({Ref(("own", cell[1], number), cell, None)})
    return result


def _begin(cell: Cell) -> Refs:
    return frozenset({Ref(("begin", cell[1]), cell, None)})


class _States:
    """Different bindings at one place, merged if they become more than `most`."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._seen: set[frozenset[tuple[Cell, Value]]] = set()
        self.all: list[Bindings] = []

    def add(self, states: Sequence[Bindings]) -> list[Bindings]:
        """Add bindings; return those that are new."""
        new: list[Bindings] = []
        for each in map(_plain, states):
            frozen = frozenset(each.items())
            if frozen not in self._seen:
                self._seen.add(frozen)
                new.append(each)
                self.all.append(each)
        if len(self.all) <= self._most:
            return new
        merged = _merged(self.all)
        self.all, frozen = [merged], frozenset(merged.items())
        if frozen in self._seen and not new:
            return []
        self._seen.add(frozen)
        return [merged]


class _Frame:
    """A call of a function."""

    def __init__(self, source: Source, own: str, depth: int) -> None:
        """`own`: the name of self, or empty."""
        self.source, self.own, self.depth = source, own, depth
        self.names = LiveNames(source.tree)
        self.live: frozenset[str] = frozenset()
        self.returned: list[tuple[Bindings, Value]] = []
        self.breaks: list[list[Bindings]] = []
        self.continues: list[list[Bindings]] = []
        # A call that is a statement, and the bindings at its ends.
        self.statement: ast.expr | None = None
        self.ends: list[Bindings] | None = None


class _Followed:
    """One pass through the hooks of a class."""

    def __init__(
        self,
        description: Description,
        methods: Methods,
        copies: set[Site],
        ints: dict[tuple[CodeType, str], int | None],
        most: int,
        left: int,
    ) -> None:
        """`most`: different bindings at one place before they are merged. Raises _Exhausted after
        `left` statements.
        """
        self._most, self._left = most, left
        self._members, self._constants = description.members, description.constants
        self._methods, self._copies, self._ints = methods, copies, ints
        self._names = {*description.members, *description.constants, *methods.names()}
        self._frames: list[_Frame] = []
        self._sources: dict[CodeType, Source] = {}
        self._owners: list[type] = []
        # The arrays that zip(…) and its like iterate.
        self._iterated: dict[ast.expr, Refs] = {}
        # How a binding is written: line, name and expression.
        self._written: dict[Site, tuple[int, str, str]] = {}

    def hooks(self) -> None:
        """Follow prepare and start, then update and safe until their bindings repeat."""
        begin: Bindings = {}
        self._hook("prepare", [begin])
        states = _States(self._most)
        new = states.add([begin])
        while new:
            ends = [
                self._between(each)
                for hook in HOOKS
                if hook != "prepare"
                for each in self._hook(hook, new)
            ]
            new = states.add(ends)

    def _hook(self, name: str, states: list[Bindings]) -> list[Bindings]:
        method = self._methods.find(name)
        if method is None or method.function is None:
            return []
        return [end for each in states for end, _ in self._call(method, [], {}, each)]

    def _between(self, state: Bindings) -> Bindings:
        """Return bindings of members after a hook, with names that do not grow from cycle to
        cycle: an array is named after the members that it belongs to.
        """
        members = {cell: value for cell, value in state.items() if cell[0] == "self"}
        owners: dict[Name, set[str]] = {}
        for (_, name), value in members.items():
            for ref in _flat(value):
                owners.setdefault(ref.thing, set()).add(name)
        return _plain(
            {
                cell: _mapped(value, lambda ref: _renamed_after(ref, owners[ref.thing]))
                for cell, value in members.items()
            }
        )

    # Calls.

    def _source(self, function: Any) -> Source:
        """Return the source of a function, read once: nodes are compared by identity."""
        code = function.__code__
        if code not in self._sources:
            self._sources[code] = read(function)
            check(self._sources[code], self._names)
        return self._sources[code]

    def _call(
        self, method: Method, values: list[Value], named: dict[str, Value], state: Bindings
    ) -> list[tuple[Bindings, Value]]:
        """Follow a method; return its ends: the bindings and the returned value of each."""
        if method.function is None:
            return []
        self._owners.append(method.owner)
        try:
            has_self = method.kind != "static method"
            return self._function(method.function, values, named, state, has_self)
        finally:
            self._owners.pop()

    def _function(
        self,
        function: Any,
        values: list[Value],
        named: dict[str, Value],
        state: Bindings,
        has_self: bool = False,
    ) -> list[tuple[Bindings, Value]]:
        code = function.__code__
        if any(each.source.function.__code__ is code for each in self._frames):
            return []  # a function that calls itself is rejected
        source = self._source(function)
        given = [each.arg for each in (*source.tree.args.posonlyargs, *source.tree.args.args)]
        if has_self and not given:
            return []  # rejected
        frame = _Frame(source, given[0] if has_self else "", len(self._frames))
        self._frames.append(frame)
        names = given[1:] if has_self else given
        frame.live = frozenset(names)
        state = dict(state)
        defaults = defaults_of(function) or ()
        for name, default in zip(reversed(names), reversed(defaults), strict=False):
            state[frame.depth, name] = self._constant(default, f"the default of {name}")
        for name, value in (*zip(names, values, strict=False), *named.items()):
            self._bind((frame.depth, name), value, (code, name), state, f"{name}", None)
        ends = self._statements(source.tree.body, [state])
        self._frames.pop()
        returned = [*frame.returned, *((each, NOTHING) for each in ends)]
        return [(_outside(each, frame.depth), value) for each, value in returned]

    @property
    def _frame(self) -> _Frame:
        return self._frames[-1]

    # Statements.

    def _distinct(self, states: Sequence[Bindings]) -> list[Bindings]:
        found = _States(self._most)
        found.add(states)
        return found.all

    def _statements(self, body: Sequence[ast.stmt], states: Sequence[Bindings]) -> list[Bindings]:
        current = list(states)
        for node in body:
            after = [end for each in current for end in self._statement(node, dict(each))]
            live = self._frame.names.after(node)
            depth = self._frame.depth
            current = self._distinct(
                [
                    {
                        cell: value
                        for cell, value in each.items()
                        if cell[0] != depth or cell[1] in live
                    }
                    for each in after
                ]
            )
        return current

    def _statement(self, node: ast.stmt, state: Bindings) -> list[Bindings]:
        """Follow a statement; return the bindings after it, none if it never ends here."""
        self._left -= 1
        if not self._left:
            what = "too many names of arrays in loops and calls to follow"
            raise _Exhausted(self._mistake(node, what, "bind copies, as in x = self.a.copy()"))
        frame = self._frame
        frame.live = frame.names.during(node)
        if isinstance(node, ast.Assign):
            self._assign(node, state)
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                value = self._value(node.value, state)
                frame.live = frame.names.after(node)
                self._set(node.target, value, node.value, state)
        elif isinstance(node, ast.AugAssign):
            self._change(node, state)
        elif isinstance(node, ast.Return):
            value = self._value(node.value, state) if node.value is not None else NOTHING
            frame.returned.append((state, _computed(value)))
            return []
        elif isinstance(node, ast.Raise):
            return []
        elif isinstance(node, ast.Break):
            frame.breaks[-1].append(state)
            return []
        elif isinstance(node, ast.Continue):
            frame.continues[-1].append(state)
            return []
        elif isinstance(node, ast.If):
            self._value(node.test, state)
            return [
                *self._statements(node.body, [dict(state)]),
                *self._statements(node.orelse, [state]),
            ]
        elif isinstance(node, ast.While):
            return self._loop(node, state)
        elif isinstance(node, ast.For):
            return self._for(node, state)
        elif isinstance(node, ast.Match):
            return self._match(node, state)
        elif isinstance(node, ast.Expr):
            frame.statement, frame.ends = node.value, None
            self._value(node.value, state)
            return [state] if frame.ends is None else frame.ends
        else:
            for each in ast.iter_child_nodes(node):
                if isinstance(each, ast.expr):
                    self._value(each, state)
        return [state]

    def _loop(
        self,
        node: ast.While | ast.For,
        state: Bindings,
        next_value: Value | None = None,
        held: Cell | None = None,
    ) -> list[Bindings]:
        """Follow a loop. `held`: the cell of the iterated value, absent in `else`."""
        frame = self._frame
        frame.breaks.append([])
        frame.continues.append([])
        states, ended = _States(self._most), []
        new = states.add([state])
        while new:
            begins = []
            for each in [dict(state) for state in new]:
                frame.live = frame.names.during(node)
                if isinstance(node, ast.While):
                    self._value(node.test, each)
                ended.append(dict(each))
                if isinstance(node, ast.For):
                    assert next_value is not None
                    self._set(node.target, next_value, node.iter, each)
                begins.append(each)
            ends = self._statements(node.body, begins)
            new = states.add([*ends, *frame.continues[-1]])
        frame.continues.pop()
        left = frame.breaks.pop()
        if isinstance(node, ast.While) and _is_true(node.test):
            return left
        for each in (*ended, *left):
            each.pop(held, None)  # type: ignore[arg-type]
        return [*self._statements(node.orelse, self._distinct(ended)), *left]

    def _for(self, node: ast.For, state: Bindings) -> list[Bindings]:
        iterated = self._value(node.iter, state)
        arrays = self._iterated.get(node.iter, NOTHING)
        held = self._hold((iterated, arrays) if arrays else iterated, node.iter, state)
        return self._loop(node, state, _elements(iterated), held)

    def _match(self, node: ast.Match, state: Bindings) -> list[Bindings]:
        subject = self._value(node.subject, state)
        ends: list[Bindings] = []
        for case in node.cases:
            inside = dict(state)
            for each in ast.walk(case.pattern):
                if isinstance(each, ast.MatchAs | ast.MatchStar) and each.name:
                    cell = (self._frame.depth, each.name)
                    self._bind(cell, _flat(subject), self._site(node.subject), inside, each.name,
                               node.subject)  # fmt: skip
            if case.guard is not None:
                self._frame.live = self._frame.names.during(node)
                self._value(case.guard, inside)
                state = _merged([state, inside])
            ends += self._statements(case.body, [inside])
            if case.guard is None and matches_all(case.pattern):
                return ends
        return [*ends, state]

    def _assign(self, node: ast.Assign, state: Bindings) -> None:
        frame, target = self._frame, node.targets[0]
        lists = (ast.Tuple, ast.List)
        if (
            isinstance(node.value, lists)
            and isinstance(target, lists)
            and len(node.targets) == 1
            and len(target.elts) == len(node.value.elts)
        ):
            # All values are computed before the first is set.
            values, held = [], []
            for each in node.value.elts:
                values.append(self._value(each, state))
                held.append(self._hold(values[-1], each, state))
            frame.live = frame.names.after(node) | _names(target)
            for part, each, cell in zip(target.elts, node.value.elts, held, strict=True):
                value = state.pop(cell)
                self._set(part, value, each, state)
            return
        value = self._value(node.value, state)
        if len(node.targets) > 1:
            value = self._filled(_computed(value), self._site(node.value), state)
        frame.live = frame.names.after(node) | frozenset(
            name for each in node.targets for name in _names(each)
        )
        cell = self._hold(value, node.value, state)
        for each in node.targets:
            self._set(each, state[cell], node.value, state)
        del state[cell]

    def _set(self, target: ast.expr, value: Value, given: ast.expr, state: Bindings) -> None:
        """Follow the assignment of a value to a target; `given`: the expression of the value."""
        frame = self._frame
        if isinstance(target, ast.Name):
            cell = (frame.depth, target.id)
            self._bind(cell, value, self._site(given), state, target.id, given)
        elif isinstance(target, ast.Tuple | ast.List):
            parts: Sequence[Value] = [_elements(value)] * len(target.elts)
            if isinstance(value, tuple) and len(value) == len(target.elts):
                parts = value
            for each, part in zip(target.elts, parts, strict=True):
                self._set(each, part, given, state)
        elif isinstance(target, ast.Subscript):
            base = self._value(target.value, state)
            held = self._hold(base, target.value, state, may_copy=False)
            self._value(target.slice, state)
            base = state.pop(held)
            self._changed(_flat(base), self._cell(target.value, state), target, state)
        elif isinstance(target, ast.Attribute):
            if (name := self._member_name(target)) is not None:
                self._store(name, value, given, ast.unparse(target), target, state)
            elif (path := self._message_path(target, state)) is not None:
                self._write_message(path, target, state)
            else:
                self._value(target.value, state)

    def _change(self, node: ast.AugAssign, state: Bindings) -> None:
        """Follow `target += value`."""
        frame, target = self._frame, node.target
        if isinstance(target, ast.Subscript):
            base = self._value(target.value, state)
            held = self._hold(base, target.value, state, may_copy=False)
            self._value(target.slice, state)
            self._value(node.value, state)
            frame.live = frame.names.after(node)
            self._changed(_flat(state.pop(held)), self._cell(target.value, state), target, state)
            return
        value = self._value(target, state)
        held = self._hold(value, target, state)
        self._value(node.value, state)
        value = state.pop(held)
        frame.live = frame.names.after(node)
        if isinstance(node.op, ast.MatMult):
            written = ast.unparse(target)
            raise self._mistake(
                node, "@= depends on the version of NumPy", f"write {written} = {written} @ …"
            )
        if isinstance(target, ast.Name) and (
            not _flat(value) or any(ref.thing == _NEW for ref in _flat(value))
        ):
            new = self._fresh(self._site(target), state)
            state[frame.depth, target.id] = _flat(state.get((frame.depth, target.id), ())) | new
        if not _flat(value):
            return
        self._changed(_flat(value), self._cell(target, state), target, state)
        if (name := self._member_name(target)) is not None:
            state["self", name] = self._placed(value, name)

    # Bindings.

    def _site(self, node: ast.expr) -> Site:
        return self._frame.source.function.__code__, key_of(node)

    def _text(self, node: ast.expr) -> str:
        """Return an expression as the user wrote it; empty for a long one with nested functions."""
        text = ast.unparse(node)
        return text if "rtcf_" not in text else written(self._frame.source.file, node)

    def _hold(self, value: Value, node: ast.expr, state: Bindings, may_copy: bool = True) -> Cell:
        """Hold the value of an operand while the rest of an expression is computed."""
        others = (name[1] for kind, name in state if kind == "held")
        cell = ("held", (self._frame.depth, max(others, default=0) + 1))
        if node in self._iterated:
            state[cell] = value  # its arrays are copied, not the iterator
            return cell
        site = self._site(node) if may_copy else None
        if site is not None and site not in self._written:
            self._written[site] = (node.lineno, "", self._text(node))
        self._bound(cell, value, site, state)
        return cell

    def _bind(
        self,
        cell: Cell,
        value: Value,
        site: Site,
        state: Bindings,
        name: str,
        given: ast.expr | None,
    ) -> None:
        """Bind a variable."""
        value = _computed(value)
        if given is not None and self._written.get(site, ())[:2] != (given.lineno, name):
            self._written[site] = (given.lineno, name, self._text(given))
        elif site not in self._written:
            self._written[site] = (self._frame.source.tree.lineno, name, name)
        if not isinstance(given, ast.Constant):
            value = self._filled(value, site, state)
        if given in self._iterated:  # arrays of its arguments, which are copied there
            state[cell] = _mapped(value, lambda ref: ref._replace(bound=ref.site))
            return
        self._bound(cell, value, site, state)

    def _bound(self, cell: Cell, value: Value, site: Site | None, state: Bindings) -> None:
        is_variable = cell[0] != "held"
        if site in self._copies:
            value = self._copied(value, ("copy", site), state)
        state[cell] = _mapped(
            value,
            lambda ref: ref._replace(site=site, bound=site if is_variable else ref.bound),
        )

    def _fresh(self, site: Site, state: Bindings, *path: int) -> Refs:
        """Return a reference to the new array that an expression, or a part of it, may make."""
        new = ("new", site, *path)
        self._renamed(new, ("old", new), state)
        return frozenset({Ref(new, new, site)})

    def _copied(self, value: Value, place: Name, state: Bindings) -> Value:
        """Return a value whose arrays are copied; those of a tuple one by one."""
        if isinstance(value, tuple):
            return tuple(
                self._copied(each, (*place, number), state) for number, each in enumerate(value)
            )
        self._renamed(place, ("old", place), state)
        return _mapped(value, lambda ref: ref._replace(place=place))

    def _filled(self, value: Value, site: Site, state: Bindings, *path: int) -> Value:
        """Return a value with a reference to a new array where it may be one."""
        if isinstance(value, tuple):
            return tuple(
                self._filled(each, site, state, *path, number) for number, each in enumerate(value)
            )
        old = frozenset(each for each in value if each.thing != _NEW)
        if old and old == value:
            return value
        return old | self._fresh(site, state, *path)

    def _renamed(self, name: Name, new: Name, state: Bindings) -> None:
        """Rename the arrays and places that an expression made before."""

        def change(ref: Ref) -> Ref:
            if ref.thing == name:
                ref = ref._replace(thing=new)
            return ref._replace(place=new) if ref.place == name else ref

        for cell, value in state.items():
            if any(name in (ref.thing, ref.place) for ref in _flat(value)):
                state[cell] = _mapped(value, change)

    def _live(self, state: Bindings) -> Iterator[tuple[Cell, Ref]]:
        """Yield the references that are read later, perhaps."""
        for cell, value in state.items():
            kind, name = cell
            if isinstance(kind, int) and name not in self._frames[kind].live:
                continue
            for ref in _flat(value):
                yield cell, ref

    def _placed(self, value: Value, name: str) -> Refs:
        """Return references to the same arrays in the place of a member."""
        return frozenset(
            each._replace(place=("self", name), dimensions=None) for each in _flat(value)
        )

    def _store(
        self,
        name: str,
        value: Value,
        given: ast.expr,
        target: str,
        node: ast.AST,
        state: Bindings,
        is_copy: bool = False,
    ) -> None:
        """Follow `self.name = value`. `is_copy`: it is a new array also in NumPy."""
        if not self._is_array(name):
            return
        place, refs, site = ("self", name), _flat(_computed(value)), self._site(given)
        if self._written.get(site, ())[:2] != (given.lineno, target):
            self._written[site] = (given.lineno, target, self._text(given))
        now = self._of_member(name, state)
        things = {ref.thing for ref in now}
        if (
            refs
            and not is_copy
            and all(ref.place == place and ref.is_whole and ref.thing in things for ref in refs)
        ):
            return  # the member itself
        self._overwritten(place, node, state)
        if isinstance(given, ast.Constant) and given.value is None:
            state["self", name] = NOTHING
            return
        refs = _flat(self._filled(NOTHING if is_copy else refs, site, state))
        refs = frozenset(ref._replace(site=site, bound=site) for ref in refs)
        state["self", name] = self._placed(refs, name)

    def _overwritten(self, place: Name, node: ast.AST, state: Bindings) -> None:
        """Copy the references whose place gets another array."""
        for cell, ref in self._live(state):
            if ref.place == place and cell != place:
                self._copy(ref, node)

    def _copy(self, ref: Ref, node: ast.AST) -> None:
        if ref.site is None:
            raise at(
                self._frame.source.file, node,
                "the array is replaced while it is changed",
                "call the method in a statement before",
            )  # fmt: skip
        self._copies.add(ref.site)

    def _changed(self, refs: Refs, own: Cell | None, node: ast.AST, state: Bindings) -> None:
        """Follow a change of elements; `own`: the variable through which they are changed."""
        for ref in refs:
            kind = ref.place[0]
            if ref.thing[0] == "read-only" and ref.place != ref.thing:
                self._reject(own, ref, None, ref, node, state)
            if kind == "input" and (site := ref.bound or ref.site) is not None:
                self._copies.add(site)
            elif kind == "input":
                what = f"{ast.unparse(node)} belongs to an Input, which is read-only"
                raise self._mistake(node, what, "set an Output, or copy it to a variable first")
            if ref.is_read_only:
                what = f"{self._named(own)} is a read-only view in NumPy"
                raise self._mistake(node, what, self._as_copy(*self._of(own, state), ref))
            if kind == "read-only" and ref.bound is not None:
                _, name, kind = ref.place
                raise self._mistake(node, f"changes {name}, {kind}", self._as_copy(ref))
            for cell, other in list(self._live(state)):
                if cell == own and not isinstance(state[cell], tuple):
                    continue
                if other.thing == ref.thing and other.place != ref.place:
                    self._reject(own, ref, cell, other, node, state)
                if other.place == ref.place and other.thing != ref.thing and cell[0] == "held":
                    self._copy(other, node)

    def _reject(
        self,
        own: Cell | None,
        ref: Ref,
        cell: Cell | None,
        other: Ref,
        node: ast.AST,
        state: Bindings,
    ) -> None:
        one, two = self._named(own), self._named(cell)
        if cell is None:
            two = other.thing[1]
        raise self._mistake(
            node,
            f"{one} and {two} are the same array in NumPy, and this changes both",
            self._as_copy(other, *self._of(own, state), ref),
        )

    def _of(self, cell: Cell | None, state: Bindings) -> Refs:
        return NOTHING if cell is None else _flat(state.get(cell, NOTHING))

    def _as_copy(self, *refs: Ref) -> str:
        """Return how to write one of the bindings as a copy."""
        known = [self._written[each.bound] for each in refs if each.bound in self._written]
        # A member that was bound to a variable is the place to copy.
        known.sort(key=lambda each: (each[2].endswith(".copy()"), not each[1].startswith("self.")))
        for line, name, text in known:
            if name and name != text:
                return f"write {name} = {_copy_of(text)} in line {line}"
        for line, _, text in known:
            return f"write {_copy_of(text)} in line {line}"
        return "copy one of them: .copy()"

    def _named(self, cell: Cell | None) -> str:
        if cell is None or cell[0] == "held":
            return "a value of this expression"
        return f"self.{cell[1]}" if cell[0] == "self" else str(cell[1])

    def _mistake(self, node: ast.AST, what: str, remedy: str) -> Exception:
        return at(self._frame.source.file, node, what, remedy)

    # Members.

    def _is_self(self, node: ast.AST) -> bool:
        return isinstance(node, ast.Name) and bool(node.id) and node.id == self._frame.own

    def _member(self, node: ast.AST) -> Member | None:
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            return self._members.get(node.attr)
        return None

    def _member_name(self, node: ast.AST) -> str | None:
        """Return the name of a State or Derived member that an expression is."""
        member = self._member(node)
        return member.name if member is not None and member.kind in (State, Derived) else None

    def _message_path(self, node: ast.AST, state: Bindings) -> str | None:
        """Return `port.value.path` of a part of a message."""
        names: list[str] = []
        while isinstance(node, ast.Attribute):
            member = self._member(node)
            if member is not None:
                is_message = member.message and names and names[-1] == "value"
                return ".".join((member.name, *reversed(names))) if is_message else None
            names.append(node.attr)
            node = node.value
        if isinstance(node, ast.Name) and names:
            for ref in _flat(state.get((self._frame.depth, node.id), NOTHING)):
                if ref.thing[0] == "message":
                    return ".".join((ref.thing[1], *reversed(names)))
        return None

    def _write_message(self, path: str, node: ast.AST, state: Bindings) -> None:
        """Follow an assignment to a part of a message, which copies."""
        for cell in [each for each in state if each[0] == "self"]:
            if f"{cell[1]}.".startswith(f"{path}.") or f"{path}.".startswith(f"{cell[1]}."):
                self._overwritten(cell, node, state)
                del state[cell]
        for cell, ref in self._live(state):
            if ref.place[0] == "self":
                name = str(ref.place[1])
                if f"{name}.".startswith(f"{path}.") and cell != ref.place:
                    self._copy(ref, node)

    def _dimensions(self, name: str) -> int | None:
        member = self._members.get(name)
        return len(member.type.shape) if member is not None and not member.message else None

    def _is_array(self, name: str) -> bool:
        return self._dimensions(name) != 0

    def _of_member(self, name: str, state: Bindings) -> Refs:
        """Return the array that a member, or a part of an output's message, is bound to."""
        if not self._is_array(name):
            return NOTHING
        cell = ("self", name)
        if cell not in state:
            state[cell] = _begin(cell)
        dimensions = self._dimensions(name)
        return frozenset(each._replace(dimensions=dimensions) for each in _flat(state[cell]))

    def _cell(self, node: ast.expr, state: Bindings) -> Cell | None:
        """Return the variable of the array that an element or a view belongs to."""
        while isinstance(node, ast.Subscript):
            node = node.value
        if isinstance(node, ast.Name):
            return self._frame.depth, node.id
        if (name := self._member_name(node)) is not None:
            return "self", name
        if isinstance(node, ast.Attribute) and node.attr == "value":
            port = self._member(node.value)
            return ("self", port.name) if port is not None else None
        path = self._message_path(node, state)
        return None if path is None else ("self", path)

    # Expressions.

    def _value(self, node: ast.expr, state: Bindings) -> Value:
        """Follow an expression; return its references."""
        if isinstance(node, ast.Name):
            if self._is_self(node):
                return NOTHING
            if node.id in self._frame.source.variables:
                return state.get((self._frame.depth, node.id), NOTHING)
            return self._constant(resolve(node, self._frame.source), node.id)
        if isinstance(node, ast.Constant):
            return NOTHING
        if isinstance(node, ast.Tuple | ast.List):
            return self._operands(node.elts, state)
        if isinstance(node, ast.NamedExpr):
            value = self._value(node.value, state)
            self._set(node.target, value, node.value, state)
            return value
        if isinstance(node, ast.IfExp):
            self._value(node.test, state)
            other = dict(state)
            value = _either(self._value(node.body, state), self._value(node.orelse, other))
            merged = _merged([state, other])
            state.update(merged)
            return value
        if isinstance(node, ast.Attribute):
            return self._attribute(node, state)
        if isinstance(node, ast.Subscript):
            return self._subscript(node, state)
        if isinstance(node, ast.Call):
            return self._called(node, state)
        if isinstance(node, ast.BoolOp):
            found = self._value(node.values[0], state)
            for each in node.values[1:]:
                before = dict(state)  # the operand may not be computed
                found = _either(found, self._value(each, state))
                state.update(_merged([state, before]))
            return found
        parts = [each for each in ast.iter_child_nodes(node) if isinstance(each, ast.expr)]
        values = self._operands(parts, state)
        if isinstance(node, ast.BinOp) and any(isinstance(each, tuple) for each in values):
            return self._of_tuples(node, values, state)
        return self._lazy(values)

    def _of_tuples(self, node: ast.BinOp, values: Value, state: Bindings) -> Value:
        """Return the value of `(a, b) + (c,)` and `[a] * 3`; of other operators a new array."""
        assert isinstance(values, tuple)
        left, right = values
        if isinstance(node.op, ast.Add) and isinstance(left, tuple) and isinstance(right, tuple):
            return (*left, *right)
        if not isinstance(node.op, ast.Mult):
            return self._lazy(values)
        of, times = (left, node.right) if isinstance(left, tuple) else (right, node.left)
        if not isinstance(of, tuple) or not isinstance(times, ast.Constant):
            return self._lazy(values)
        site = self._site(node)
        elements = self._filled(of, site, state)
        assert isinstance(elements, tuple)
        found: list[Value] = []
        # Compiled, the elements are computed once more for each repetition.
        for number in range(int(times.value)):
            again = partial(_repeated, site=site, number=number)
            found += [_mapped(each, again) for each in elements]
        return tuple(found)

    def _operands(self, nodes: Sequence[ast.expr], state: Bindings) -> Value:
        """Follow operands in order; each is held until the last is computed."""
        cells: list[Cell] = []
        for each in nodes:
            value = self._value(each, state)
            cells.append(self._hold(value, each, state))
        return tuple(state.pop(each) for each in cells)

    def _lazy(self, value: Value) -> Value:
        """Return the result of an operation: a new array, which compiled code may compute from its
        operands as late as the whole expression.
        """
        return frozenset(
            Ref(_RESULT, ref.place, None, False)
            for ref in _flat(value)
            if ref.place[0] not in _UNCHANGED
        )

    def _constant(self, value: Any, name: str) -> Value:
        value = as_tuple(value)
        if isinstance(value, tuple | list):
            parts = enumerate(value)
            return tuple(self._constant(each, f"{name}[{number}]") for number, each in parts)
        if not isinstance(value, np.ndarray):
            return NOTHING
        place = ("read-only", name, "a constant of the module")
        return frozenset({Ref(place, place, None, True, value.ndim)})

    def _table(self, node: ast.expr) -> dict[Any, Any] | None:
        """Return the dict of constants to which a name refers, or None."""
        found = resolve(node, self._frame.source)
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            found = self._constants.get(node.attr)
        return found if isinstance(found, dict) else None

    def _any_of(self, table: dict[Any, Any], name: str) -> Value:
        """Return the references of any value of a dict of constants."""
        values = [self._constant(each, name) for each in table.values()]
        return functools.reduce(_either, values) if values else NOTHING

    def _attribute(self, node: ast.Attribute, state: Bindings) -> Value:
        member = self._member(node)
        if member is not None:
            return self._read(member, state)
        if self._is_self(node.value):
            if node.attr in self._constants:
                return self._constant(self._constants[node.attr], ast.unparse(node))
            method = self._methods.find(node.attr)
            if method is not None and method.kind == "property":
                return self._own_call(method, [], {}, node, state)
            return NOTHING
        if is_super(node.value):
            method = self._methods.find(node.attr, behind=self._owners[-1])
            if method is not None and method.kind == "property":
                return self._own_call(method, [], {}, node, state)
            return NOTHING
        port = self._member(node.value)
        if port is not None and port.kind in PORTS:
            return self._port(port, node, state)
        if (path := self._message_path(node, state)) is not None:
            return self._message(path, node, state)
        resolved = resolve(node, self._frame.source)
        if resolved is not None:
            return self._constant(resolved, ast.unparse(node))
        value = self._value(node.value, state)
        if node.attr not in _VIEW_ATTRIBUTES:
            return NOTHING
        return _mapped(_flat(value), _view)

    def _read(self, member: Member, state: Bindings) -> Value:
        if member.kind in PORTS or not member.type.shape:
            return NOTHING
        is_own = member.kind is State or (
            member.kind is Derived and self._frames[0].source.tree.name == "prepare"
        )
        if is_own:
            return self._of_member(member.name, state)
        kind = "parameter" if member.kind is Parameter else "Derived member"
        place = ("read-only", f"self.{member.name}", f"a {kind}")
        return frozenset({Ref(place, place, None, True, len(member.type.shape))})

    def _port(self, port: Member, node: ast.Attribute, state: Bindings) -> Value:
        if port.message and node.attr == "value":
            return frozenset({_message_ref(f"{port.name}.value")})
        if port.message or node.attr not in ("value", "front") or not port.type.shape:
            return NOTHING
        if port.kind is Output:
            return self._of_member(port.name, state)
        return self._input(port.name, node, len(port.type.shape), state)

    def _input(self, name: str, node: ast.expr, dimensions: int, state: Bindings) -> Refs:
        """Return the value of an input: each read gives a new array."""
        new = ("read", self._site(node))
        self._renamed(new, ("old", new), state)
        return frozenset({Ref(new, ("input", name), None, True, dimensions)})

    def _message(self, path: str, node: ast.expr, state: Bindings) -> Value:
        """Return a part of a message."""
        port = self._members[path.partition(".")[0]]
        assert port.message is not None
        leaf = port.message.leaf(tuple(path.split(".")[2:]))
        if leaf is None:
            return frozenset({_message_ref(path)})
        if not leaf.type.shape:
            return NOTHING
        if port.kind is Output:
            return self._of_member(path, state)
        return self._input(path, node, 1, state)

    def _subscript(self, node: ast.Subscript, state: Bindings) -> Value:
        base = self._value(node.value, state)
        held = self._hold(base, node.value, state)
        index = self._value(node.slice, state)
        base = state.pop(held)
        if isinstance(base, tuple):
            return _element(base, node.slice)
        if (table := self._table(node.value)) is not None:
            if isinstance(node.slice, ast.Constant):
                return self._constant(table.get(node.slice.value), ast.unparse(node))
            return self._any_of(table, ast.unparse(node))
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        views = [each for each in parts if _keeps(each)]
        axes = sum(map(is_new_axis, parts))
        others = [each for each in parts if not is_ellipsis(each) and not is_new_axis(each)]
        if len(others) < len(parts) - axes and others and _flat(base):
            raise self._mistake(node, "... among other indices", "write : for each other index")
        if any(isinstance(each, ast.List | ast.Compare) for each in parts) or any(
            ref.thing[0] in _SURELY for ref in _flat(index)
        ):
            return NOTHING  # an array as an index: a copy of the selected elements
        found = set()
        for ref in base:
            left = None
            if ref.dimensions is not None:
                left = ref.dimensions + axes - (len(parts) - len(views))
                if left <= 0:
                    continue  # a number, or a copy of selected elements
            found.add(ref._replace(is_whole=False, dimensions=left))
        return frozenset(found)

    def _called(self, node: ast.Call, state: Bindings) -> Value:
        called, source = node.func, self._frame.source
        if isinstance(called, ast.Attribute):
            found = self._method_call(node, called, state)
            if found is not None:
                return found
        target = resolve(called, source)
        if is_own(target):
            values, named = self._arguments(node, state)
            if target in source.lifted.values() and node.args and self._is_self(node.args[0]):
                method = nested(target, self._owners[-1])
                return self._own_call(method, values[1:], named, node, state)
            return self._own_call(target, values, named, node, state)
        owner: Value = NOTHING
        held = None
        if isinstance(called, ast.Attribute) and target is None:
            owner = self._value(called.value, state)
            held = self._hold(owner, called.value, state)
        values, named = self._arguments(node, state)
        if held is not None:
            owner = state.pop(held)
        first: Value = values[0] if values else NOTHING
        everything = _flat((owner, *values, *named.values()))
        if isinstance(called, ast.Attribute) and called.attr == "get" and len(values) == 2:
            table = self._table(called.value)
            if table is not None:
                return _either(self._any_of(table, ast.unparse(called.value)), values[1])
        is_array = not isinstance(first, tuple)
        if is_array and any(target is each for each in (*_SAME, *_VIEWS, *_DIAGONALS)):
            return self._viewed(target, _flat(first), node)
        if target is np.einsum:
            of = NOTHING if _sums(node) else _flat(values[1])
            return frozenset(map(_view, of)) or self._lazy(everything)
        if target is np.linalg.matrix_power and not _is_other_power(node):
            # The first power is the matrix itself, compiled a copy.
            place = ("copy of power", self._site(node))
            return frozenset(each._replace(place=place, is_whole=False) for each in _flat(first))
        if any(target is each for each in _ITERATORS):
            inner = [self._iterated.get(each, NOTHING) for each in node.args]
            self._iterated[node] = everything.union(*inner)
        if target is enumerate:
            return ((NOTHING, _elements(first)),)
        if target is zip:
            return (tuple(map(_elements, values)),)
        if any(target is each for each in _ITERATORS):
            return (_elements(first),)
        if isinstance(called, ast.Name) and called.id == "rtcf_made":
            assert isinstance(first, tuple) and isinstance(node.args[1], ast.Name)
            return tuple(first[place] for place in NAMED[node.args[1].id].places)
        is_object = isinstance(called, ast.Name) and called.id == "rtcf_object"
        if is_object or any(target is each for each in _TUPLES):
            return first
        if isinstance(called, ast.Attribute) and target is None:
            if called.attr in _CHANGING_METHODS:
                self._changed(_flat(owner), self._cell(called.value, state), node, state)
                return NOTHING
            if called.attr in _VIEW_METHODS:
                return _mapped(_flat(owner), _view)
            if called.attr in _DIAGONAL_METHODS:
                return self._viewed(np.diagonal, _flat(owner), node)
        return self._lazy(everything)

    def _viewed(self, function: Any, refs: Refs, node: ast.expr) -> Refs:
        if any(function is each for each in _DIAGONALS):
            place = ("copy of diagonal", self._site(node))
            return frozenset(
                each._replace(place=place, is_whole=False, is_read_only=True, dimensions=1)
                for each in refs
                if function is np.diagonal or each.dimensions != 1
            )
        if any(function is each for each in _SAME):
            return refs
        return frozenset(map(_view, refs))

    def _arguments(self, node: ast.Call, state: Bindings) -> tuple[list[Value], dict[str, Value]]:
        """Follow arguments in order; each is held until the last is computed."""
        given = [*node.args, *(each.value for each in node.keywords)]
        values = self._operands(given, state)
        assert isinstance(values, tuple)
        count = len(node.args)
        names = [each.arg or "" for each in node.keywords]
        return list(values[:count]), dict(zip(names, values[count:], strict=True))

    def _own_call(
        self,
        called: Any,
        values: list[Value],
        named: dict[str, Value],
        node: ast.expr,
        state: Bindings,
    ) -> Value:
        """Follow a call of a method or a function, while the rest of the statement waits."""
        self._note_constants(called, values, node)
        frame = self._frame
        live = frame.live
        frame.live = frame.names.outside(node)
        if isinstance(called, Method):
            ends = self._call(called, values, named, state)
        else:
            self._owners.append(object)
            ends = self._function(called, values, named, state)
            self._owners.pop()
        frame.live = live
        if not ends:
            return NOTHING
        if frame.statement is node:
            frame.ends = self._distinct([each for each, _ in ends])
        result: Value = ends[0][1]
        for _, value in ends[1:]:
            result = _either(result, value)
        merged = _merged([each for each, _ in ends])
        state.clear()
        state.update(merged)
        return result

    def _note_constants(self, called: Any, values: list[Value], node: ast.expr) -> None:
        """Note which arguments of a function are constant ints in all of its calls."""
        if not isinstance(node, ast.Call):
            return
        is_method = isinstance(called, Method) and called.kind != "static method"
        function = called.function if isinstance(called, Method) else called
        if function is None:
            return
        code = function.__code__
        names = code.co_varnames[int(is_method) : code.co_argcount + code.co_kwonlyargcount]
        # The source does not contain self.
        given = dict(zip(names, node.args[len(node.args) - len(values) :], strict=False))
        given |= {str(each.arg): each.value for each in node.keywords}
        defaults = dict(zip(reversed(names), reversed(defaults_of(function) or ()), strict=False))
        for name in names:
            value = self._number(given[name]) if name in given else defaults.get(name)
            known = self._ints.get((code, name), 0)
            is_known = known is not None and isinstance(value, int | float)
            size = abs(value) if isinstance(value, int) else 0
            self._ints[code, name] = max(known or 0, size) if is_known else None

    def _number(self, node: ast.expr) -> Any:
        """Return the value of a constant, or None."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return self._number(node.operand)
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Attribute) and self._is_self(node.value):
            return self._constants.get(node.attr)
        return resolve(node, self._frame.source)

    def _method_call(self, node: ast.Call, called: ast.Attribute, state: Bindings) -> Value | None:
        """Follow `self.method(…)`, `self.x.write(…)`, `super().method(…)`; None for others."""
        if self._is_self(called.value):
            method = self._methods.find(called.attr)
            if method is None or called.attr == "fault":
                self._arguments(node, state)
                return NOTHING
            values, named = self._arguments(node, state)
            return self._own_call(method, values, named, node, state)
        if is_super(called.value):
            method = self._methods.find(called.attr, behind=self._owners[-1])
            values, named = self._arguments(node, state)
            if method is None:
                return NOTHING
            return self._own_call(method, values, named, node, state)
        owner = resolve(called.value, self._frame.source)
        method = self._methods.find_of(owner, called.attr) if isinstance(owner, type) else None
        if method is not None:
            values, named = self._arguments(node, state)
            values = values if method.kind == "static method" else values[1:]
            return self._own_call(method, values, named, node, state)
        port = self._member(called.value)
        if port is None or port.kind not in PORTS:
            return None
        values, _ = self._arguments(node, state)
        if port.kind is Output and called.attr == "write" and node.args:
            if port.message:
                self._write_message(f"{port.name}.value", node, state)
            else:
                self._frame.live = self._frame.names.outside(node)
                self._store(port.name, values[0], node.args[0], ast.unparse(called.value), node,
                            state, is_copy=True)  # fmt: skip
        return NOTHING


def _outside(state: Bindings, depth: int) -> Bindings:
    """Return the bindings that remain after a call at a depth."""
    return {
        (kind, name): value
        for (kind, name), value in state.items()
        if kind != depth and not (kind == "held" and name[0] == depth)
    }


def _renamed_after(ref: Ref, owners: set[str]) -> Ref:
    """Return a reference whose array is named after the members that it belongs to."""
    if ref.thing[0] == "read-only":
        return ref
    return ref._replace(thing=("shared", *sorted(owners)))


def _repeated(ref: Ref, site: Site, number: int) -> Ref:
    """Return a reference of an element of a repeated list, in a place of its own if it is new."""
    is_new = ref.place[:2] == ("new", site)
    return ref._replace(place=(*ref.place, number)) if is_new else ref


def _message_ref(path: str) -> Ref:
    return Ref(("message", path), ("message", path), None)


def _view(ref: Ref) -> Ref:
    return ref._replace(is_whole=False, dimensions=None)


def _elements(value: Value) -> Value:
    """Return the references of the elements of a value that is iterated or unpacked."""
    if isinstance(value, tuple):
        found: Value = value[0] if value else NOTHING
        for each in value[1:]:
            found = _either(found, each)
        return found
    parts = set()
    for ref in value:
        if ref.dimensions is None:
            parts.add(ref._replace(is_whole=False))
        elif ref.dimensions > 1:
            parts.add(ref._replace(is_whole=False, dimensions=ref.dimensions - 1))
    return frozenset(parts)


def _element(base: tuple[Value, ...], index: ast.expr) -> Value:
    """Return the element, or the part, of a tuple."""
    constant = ast.Expression(index)
    try:
        if not isinstance(index, ast.Slice):
            element: Value = base[ast.literal_eval(constant)]
            return element
        bounds = [None if each is None else ast.literal_eval(each)
                  for each in (index.lower, index.upper, index.step)]  # fmt: skip
        part: Value = base[slice(*bounds)]
        return part
    except (ValueError, TypeError, IndexError):
        return (_elements(base),) if isinstance(index, ast.Slice) else _elements(base)


def is_new_axis(index: ast.AST) -> bool:
    """Tell whether an index adds a dimension."""
    return ast.unparse(index) in ("None", "np.newaxis", "numpy.newaxis")


def is_ellipsis(index: ast.AST) -> bool:
    """Tell whether an index is `...`."""
    return isinstance(index, ast.Constant) and index.value is ...


def _keeps(index: ast.expr) -> bool:
    """Tell whether an index keeps its dimension."""
    return isinstance(index, ast.Slice) or is_ellipsis(index) or is_new_axis(index)


def _is_other_power(node: ast.Call) -> bool:
    exponent = node.args[1] if len(node.args) > 1 else None
    return isinstance(exponent, ast.Constant) and exponent.value != 1


def _sums(node: ast.Call) -> bool:
    """Tell whether np.einsum returns a new array, not a view of its operand."""
    text = node.args[0].value if node.args and isinstance(node.args[0], ast.Constant) else ""
    try:
        return len(node.args) != 2 or not Subscripts(str(text)).is_view
    except ValueError:
        return True  # rejected


def _copy_of(text: str) -> str:
    """Return an expression with .copy()."""
    if not text:
        return "….copy()"
    node = ast.parse(text, mode="eval").body
    if isinstance(node, ast.Tuple | ast.List):
        return f"({', '.join(_copy_of(ast.unparse(each)) for each in node.elts)})"
    simple = (ast.Name, ast.Attribute, ast.Subscript, ast.Call)
    return f"{text}.copy()" if isinstance(node, simple) else f"({text}).copy()"


def _is_true(test: ast.expr) -> bool:
    return isinstance(test, ast.Constant) and bool(test.value)


def _names(node: ast.AST) -> set[str]:
    return {
        each.id
        for each in ast.walk(node)
        if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Load)
    }


def is_super(node: ast.AST) -> bool:
    """Tell whether a node is `super()`."""
    return (
        isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "super"
    )
