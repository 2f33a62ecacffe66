"""Compares compiled code with the interpreter: the same inputs, parameters and state for both.

Inputs are drawn from a seed, values at the bounds among them. After each cycle the state goes on
from the interpreter's, so that a difference is of one cycle and does not add up. In the interpreter
`@` and np.linalg are the helpers, which sum in the same order.
"""

import ast
import warnings
from dataclasses import dataclass, field
from types import FunctionType
from typing import Any

import numpy as np
from rtcf.component import Component
from rtcf.component.declaration import Input, Member, Output, Parameter, Queue
from rtcf.component.interpreter import QueuePort
from rtcf.component.value_type import ValueType

from rtcf_compile.comparison.inside import Inside
from rtcf_compile.machine_code.lowering import Compiled
from rtcf_compile.rewriting import helpers
from rtcf_compile.rewriting.functions import made
from rtcf_compile.rewriting.products import Products
from rtcf_compile.source.modules import is_own, read

LARGEST_ULP = 4
_ANEW = 200  # cycles from one start to the next
_EDGES = (0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 1e-3, 1e3, 1e12, -1e12, 1e300, np.inf, np.nan)
# Python raises where IEEE 754 goes on to infinity or NaN.
_PYTHONS_OWN = (OverflowError,)


@dataclass
class Comparison:
    """What was found for one component."""

    name: str
    cycles: int = 0
    raised: int = 0
    pythons_own: int = 0
    largest_ulp: int = 0
    differences: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """Return the one line."""
        more = f", {self.raised} raised in both" if self.raised else ""
        if self.pythons_own:
            more += f", {self.pythons_own} not compared: Python's own overflow"
        first = f"; {self.differences[0]}" if self.differences else ""
        verdict = f"{len(self.differences)} DIFFER{first}" if self.differences else "the same"
        return f"{self.name}: {self.cycles} cycles, {self.largest_ulp} ulp{more}: {verdict}"


def compare(
    cls: type[Component], compiled: Compiled, cycles: int, seed: int = 1, edges: float = 0.05
) -> Comparison:
    """Run both for that many cycles; `edges` is the share of inputs that are special values."""
    draw = np.random.default_rng(seed)
    result = Comparison(cls.__name__)
    inside = Inside(compiled)
    component: Any = _interpreted(cls)()
    description = compiled.description
    fresh = component._record.copy()
    writes = [f"{each.name}__written" for each in description.of(Output)]
    record = fresh.copy()
    inputs: list[_Inputs | _Messages] = []
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        for cycle in range(cycles):
            if cycle % _ANEW == 0:
                record[...] = fresh
                if cycle:
                    _parameters(record, description.of(Parameter), draw)
                if "prepare" in compiled.hooks:
                    _both(result, inside, component, record, "prepare", cycle)
                if "start" in compiled.hooks:
                    _both(result, inside, component, record, "start", cycle)
                # Every other time without special values: one NaN stays in a filter's state.
                share = edges if cycle // _ANEW % 2 else 0.0
                inputs = [_Inputs(each, draw, share) for each in description.of(Input)]
                inputs += [_Messages(each, draw, share) for each in description.of(Queue)]
            for each in inputs:
                each.put(record, cycle % _ANEW)
            for name in writes:
                record[name] = False
            _both(result, inside, component, record, "update", cycle)
            record["_iteration"] += 1
            record["_time"] += record["_period"]
            result.cycles += 1
            if len(result.differences) >= 10:
                break
        if "safe" in compiled.hooks:
            _both(result, inside, component, record, "safe", cycles)
    return result


def _both(
    result: Comparison, inside: Inside, component: Any, record: Any, hook: str, cycle: int
) -> None:
    """Run a hook both ways on copies of the record, and take the interpreter's over."""
    mine = np.empty_like(record)
    _bytes(mine)[:] = _bytes(record)
    said = inside.call(hook, mine)
    _bytes(component._record)[:] = _bytes(record)
    error = _raised(component, hook)
    if isinstance(error, _PYTHONS_OWN) and said is None:
        result.pythons_own += 1
        return
    if said is not None and error is None and "division by zero" in said:
        # Elements of an array are NumPy's numbers to the interpreter, which divide to infinity.
        component._record[...] = record
        with np.errstate(divide="raise", invalid="raise"):
            error = _raised(component, hook)
    if (said is None) != (error is None):
        what = f"{type(error).__name__}: {error}" if error else "no fault"
        result.differences.append(
            f"cycle {cycle} {hook}: {what} in the interpreter, {said or 'no fault'} compiled"
        )
        return
    if said is not None:
        result.raised += 1
        return
    theirs = component._record
    mine["_line"] = theirs["_line"] = record["_line"]
    if not np.array_equal(_bytes(mine), _bytes(theirs)):
        for name in mine.dtype.names:
            far = ulp(mine[name], theirs[name])
            result.largest_ulp = max(result.largest_ulp, far if far <= LARGEST_ULP else 0)
            if far > LARGEST_ULP:
                result.differences.append(
                    f"cycle {cycle} {hook}: {name} is {theirs[name]} in the interpreter, "
                    f"{mine[name]} compiled ({far} ulp)"
                )
    _bytes(record)[:] = _bytes(theirs)


def _bytes(record: Any) -> Any:
    """Return a record's memory, with what lies between its fields."""
    return record.reshape(1).view(np.uint8)


def ulp(a: Any, b: Any) -> int:
    """Return by how many representable numbers two values, or arrays, are apart at most."""
    a, b = np.atleast_1d(a), np.atleast_1d(b)
    if a.dtype.kind != "f":
        return 0 if np.array_equal(a, b) else 2**63
    whole: Any = np.int64 if a.dtype.itemsize == 8 else np.int32
    far = 0
    for x, y in zip(a.ravel(), b.ravel(), strict=True):
        if x == y or (np.isnan(x) and np.isnan(y)):
            continue
        if np.isnan(x) or np.isnan(y):
            return 2**63
        numbers = [int(each.view(whole)) for each in (x, y)]
        least = int(np.iinfo(whole).min)
        p, q = (each if each >= 0 else least - each for each in numbers)
        far = max(far, abs(p - q))
    return far


def _raised(component: Any, hook: str) -> Exception | None:
    try:
        getattr(component, hook)()
    except Exception as error:
        return error
    return None


class _Inputs:
    """What an input gets in the cycles up to the next start."""

    def __init__(self, member: Member, draw: Any, edges: float) -> None:
        """Draw all at once, as NumPy is slow one by one."""
        name = member.name
        self._flags = [f"{name}__{flag}" for flag in ("new", "valid", "connected")]
        self._age_name = f"{name}__age"
        self._new = (draw.random(_ANEW) < 0.8).tolist()
        self._age = (draw.integers(0, 3, _ANEW) * 1_000_000).tolist()
        self._values: dict[str, Any] = {}
        for leaf in member.leaves:
            shape = (_ANEW, *leaf.type.shape)
            self._values[name + leaf.field] = _drawn(leaf.type, shape, draw, edges)
            if leaf.is_variable:
                counts = draw.integers(0, leaf.type.count, _ANEW, endpoint=True)
                # Most messages are whole.
                whole = draw.random(_ANEW) < 0.8
                self._values[name + leaf.count] = np.where(whole, leaf.type.count, counts)

    def put(self, record: Any, cycle: int) -> None:
        """Set the input's fields for a cycle."""
        new = self._new[cycle]
        record[self._flags[0]] = new
        if new:
            record[self._flags[1]] = record[self._flags[2]] = True
            record[self._age_name] = self._age[cycle]
            for name, values in self._values.items():
                record[name] = values[cycle]


class _Messages:
    """What a queue gets: none to three messages a cycle, now and then more than it keeps."""

    def __init__(self, member: Member, draw: Any, edges: float) -> None:
        """Draw all at once."""
        self._member = member
        self._counts = draw.choice((0, 0, 0, 1, 1, 2, 3, member.size + 1), _ANEW).tolist()
        shape = (_ANEW, member.size + 3, *member.type.shape)
        self._values = _drawn(member.type, shape, draw, edges)

    def put(self, record: Any, cycle: int) -> None:
        """Put the messages of a cycle."""
        port = QueuePort(record, self._member)
        for number in range(self._counts[cycle]):
            port.put(self._values[cycle][number])


def _drawn(kind: ValueType, shape: tuple[int, ...], draw: Any, edges: float) -> Any:
    """Draw values of a type, the first size by their own scale."""
    if kind.is_bool:
        values = draw.random(shape) < 0.5
    elif kind.enumeration:
        values = draw.choice([int(each) for each in kind.enumeration], shape)
    elif kind.is_float:
        scale = 10.0 ** draw.integers(-3, 4, (shape[0], *(1 for _ in shape[1:])))
        values = draw.normal(0.0, 1.0, shape) * scale
        values = np.where(draw.random(shape) < edges, draw.choice(_EDGES, shape), values)
    else:
        limits = np.iinfo(kind.scalar)
        low, high = max(limits.min, -1000), min(limits.max, 1000)
        values = draw.integers(low, high, shape, dtype=np.int64, endpoint=True)
    return values.astype(kind.scalar)


def _parameters(record: Any, parameters: list[Member], draw: Any) -> None:
    for member in parameters:
        low, high = (member.options.get(each) for each in ("min", "max"))
        if member.type.is_bool:
            record[member.name] = draw.random() < 0.5
        elif low is not None and high is not None and member.type.is_float:
            record[member.name] = draw.uniform(low, high, member.type.shape)
        elif low is not None and high is not None:
            record[member.name] = draw.integers(low, high, member.type.shape, endpoint=True)


def _interpreted(cls: type[Component]) -> type[Component]:
    """Return the class with helpers in the place of `@` and np.linalg."""
    changed: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        if base in (object, Component):
            continue
        for name, value in vars(base).items():
            if isinstance(value, FunctionType) and is_own(value):
                changed[name] = _with_helpers(value, {})
    return type(cls.__name__, (cls,), changed)


def _with_helpers(function: FunctionType, known: dict[FunctionType, FunctionType]) -> FunctionType:
    if function in known:
        return known[function]
    source = read(function)
    products = Products(source)
    body: list[ast.stmt] = []
    for statement in source.tree.body:
        new = products.visit(statement)
        body.extend(new if isinstance(new, list) else [new])
    source.tree.body = body
    source.tree.returns = None
    for each in source.tree.args.args:
        each.annotation = None
    scope = {**function.__globals__, **helpers.BY_NAME, **products.constants}
    known[function] = made(source.tree, scope, source)
    for name in function.__code__.co_names:
        value = scope.get(name)
        if isinstance(value, FunctionType) and is_own(value):
            scope[name] = _with_helpers(value, known)
    return known[function]
