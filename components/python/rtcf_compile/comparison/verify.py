"""Compares compiled code with a plain class in the interpreter on the same inputs, parameters and
state; see model.py.

Inputs are random values from a seed, including special values and numbers of the source. After each
cycle, both continue from the interpreter's state, so that differences do not accumulate. In the
interpreter, helpers replace `@` and np.linalg, for the same order of sums, and the division of
single numbers, because division of NumPy numbers does not raise. Other NumPy functions may round
differently. A difference no larger than the effect of the last place of the values that the hook
reads does not count.

A component whose update() raises in every cycle is rejected, too: it would end the loop.
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from rtcf.component import Component, Fault
from rtcf.component.declaration import (
    REALTIME_HOOKS,
    Derived,
    Input,
    Member,
    Output,
    Parameter,
    Queue,
    own_field,
)
from rtcf.component.interpreter import QueuePort, fresh_record
from rtcf.component.value_type import ValueType, number_of

from rtcf_compile.comparison.inside import Inside
from rtcf_compile.comparison.model import Branch, Model
from rtcf_compile.machine_code.compiled import Compiled
from rtcf_compile.source.mistake import display, source_line
from rtcf_compile.source.processor_time import HOOK_S, TimeLimitError, loop_line

LARGEST_ULP = 4
MOST_DIFFERENCES = 10
# The number of runs with changed last places, and the factor by which a difference may exceed their
# effect.
_TRIES, _ROUNDING = 16, 16.0
_ANEW = 200  # cycles between restarts
_EDGES = (0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 1e-3, 1e3, 1e12, -1e12, 1e300, np.inf, np.nan)
# Exceptions that only Python raises; IEEE 754 continues with infinity or NaN.
_PYTHONS_OWN = (OverflowError,)
_LINE = own_field("line")


@dataclass
class Comparison:
    """The result for one component."""

    name: str
    cycles: int = 0
    raised: int = 0
    pythons_own: int = 0
    rounded: int = 0
    largest_ulp: int = 0
    differences: list[str] = field(default_factory=list)
    problem: str = ""  # the first difference or the constant fault, with its file
    # How often each condition was false and true.
    branches: dict[Branch, list[int]] = field(default_factory=dict)

    def __str__(self) -> str:
        """Return the result in one line."""
        more = f", {self.raised} raised in both" if self.raised else ""
        if self.rounded:
            more += f", {self.rounded} explained by rounding"
        if self.pythons_own:
            more += f", {self.pythons_own} not compared: OverflowError only in Python"
        first = f"; {self.differences[0]}" if self.differences else ""
        verdict = f"{len(self.differences)} DIFFER{first}" if self.differences else "the same"
        if self.problem and not self.differences:
            verdict += ", BUT UPDATE ALWAYS RAISES"
        return f"{self.name}: {self.cycles} cycles, {self.largest_ulp} ulp{more}: {verdict}"

    def conditions(self) -> list[str]:
        """Return a line for each condition: how often it was true."""
        return [
            f"{display(file)}:{line}: `{text}`: true {counts[1]} times of {sum(counts)}"
            for (file, line, text), counts in sorted(self.branches.items())
        ]

    def differ(self, what: str, file: str, line: int = 0) -> None:
        """Record a difference."""
        self.differences.append(what)
        self._reject(what, file, line)

    def always_raises(self, said: str, file: str) -> None:
        """Record that update raises in every cycle; `said` is the line and the last exception."""
        line, _, exception = said.partition(": ")
        what = f"update raises in each of {self.cycles} cycles with random inputs: {exception}"
        self._reject(what, file, int(line))

    def _reject(self, what: str, file: str, line: int) -> None:
        if not self.problem:
            place = (
                f"{display(file)}:{line}: `{source_line(file, line)}`" if line else display(file)
            )
            self.problem = f"{place}: {self.name}: {what}"

    def endless(self, hook: str, cycle: int, where: str, file: str, line: int) -> None:
        """Record a hook that exceeds the time limit."""
        what = f"{hook}, cycle {cycle}: it did not end within {HOOK_S:g} s of processor time"
        what += f" {where}: bound its loops: for _ in range(…)"
        self.differ(what, file, line)


class Bounds(Protocol):
    """Limits the time of hooks."""

    def record(self, dtype: Any) -> Any:
        """Return the record that compiled code works on."""

    def python(self) -> Any:
        """Limit a hook in the interpreter; raises TimeLimitError."""

    def machine_code(self, hook: int, cycle: int) -> Any:
        """Limit a compiled hook, given by its index in `hooks`."""


class _Unbounded:
    def record(self, dtype: Any) -> Any:
        return np.zeros((), dtype)

    @contextmanager
    def python(self) -> Iterator[None]:
        yield

    @contextmanager
    def machine_code(self, hook: int, cycle: int) -> Iterator[None]:
        yield


def compare(
    cls: type[Component],
    compiled: Compiled,
    cycles: int,
    seed: int = 1,
    edges: float = 0.05,
    bounds: Bounds | None = None,
    enough: Callable[[int], bool] | None = None,
) -> Comparison:
    """Run compiled code and interpreter for a number of cycles, or until `enough` returns true.

    `edges`: the share of special values among inputs.
    """
    running = _Comparing(cls, compiled, bounds or _Unbounded())
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        with suppress(_EndError):
            running.run(enough or (lambda done: done >= cycles), np.random.default_rng(seed), edges)
    return running.result


class _EndError(Exception):
    """The comparison cannot continue."""


class _Comparing:
    """A running comparison."""

    def __init__(self, cls: type[Component], compiled: Compiled, bounds: Bounds) -> None:
        self.result = Comparison(cls.__name__)
        self._cls, self._compiled, self._bounds = cls, compiled, bounds
        self._inside = Inside(compiled)
        self._cycle = 0
        self._updates_raised = 0
        self._last_raised = ""
        self._mine = bounds.record(compiled.description.record)
        self._theirs = np.zeros((), compiled.description.record)
        self._model = Model(cls, compiled.description, compiled.narrow)
        # Without names that refer to arrays of earlier cycles.
        self._other = Model(cls, compiled.description, compiled.narrow)
        self.result.branches = self._model.branches
        members = compiled.description.members.values()
        self._optional = [each for each in members if each.type.optional]
        self._draw = np.random.default_rng(1)  # separate, so that inputs do not depend on it
        self._prepared: dict[bytes, Any] = {}  # records by parameter values

    def run(self, enough: Callable[[int], bool], draw: Any, edges: float) -> None:
        """Run hooks in the order of the loop."""
        hooks, result = self._compiled.hooks, self.result
        description = self._compiled.description
        self._record = record = fresh_record(description)
        if "prepare" in hooks and self._raised("prepare", self._model, record) is not None:
            # prepare() rejects the default parameters; loading reports it.
            self.result.raised += 1
            return
        fresh = record.copy()
        writes = [f"{each.name}__written" for each in description.of(Output)]
        inputs: list[_Inputs | _Messages] = []
        while len(result.differences) < MOST_DIFFERENCES and not enough(self._cycle):
            if self._cycle % _ANEW == 0:
                record[...] = fresh
                self._model.load(record, anew=True)
                if self._cycle:
                    _parameters(record, description.of(Parameter), draw)
                if "prepare" in hooks:
                    self._prepare()
                if "start" in hooks:
                    self._both("start")
                # Every other run has no special values: a NaN would stay in a filter's state.
                share = edges if self._cycle // _ANEW % 2 else 0.0
                values = _Values(draw, share, self._model.numbers)
                inputs = [_Inputs(each, values) for each in description.of(Input)]
                inputs += [_Messages(each, values) for each in description.of(Queue)]
            for each in inputs:
                each.put(record, self._cycle % _ANEW)
            for name in writes:
                record[name] = False
            self._both("update")
            record[own_field("iteration")] += 1
            record[own_field("time")] += record[own_field("period")]
            self._cycle += 1
            result.cycles = self._cycle
        if "safe" in hooks:
            self._both("safe")
        if 0 < self._cycle == self._updates_raised:
            result.always_raises(self._last_raised, self._compiled.file)

    def _prepare(self) -> None:
        """Compute Derived members, once for each set of parameters."""
        record, description = self._record, self._compiled.description
        given = b"".join(record[each.name].tobytes() for each in description.of(Parameter))
        if given not in self._prepared:
            self._both("prepare")
            self._prepared[given] = record.copy()
        for derived in description.of(Derived):
            record[derived.name] = self._prepared[given][derived.name]

    def _both(self, hook: str) -> None:
        """Run a hook both ways on copies of the record; continue with the interpreter's record."""
        result, record, mine, theirs = self.result, self._record, self._mine, self._theirs
        _bytes(theirs)[:] = _bytes(record)
        error = self._raised(hook, self._model, theirs)
        _bytes(mine)[:] = _bytes(record)
        with self._bounds.machine_code(self._compiled.hooks.index(hook), self._cycle):
            said = self._inside.call(hook, mine)
        if isinstance(error, _PYTHONS_OWN) and said is None:
            result.pythons_own += 1
            return
        if not _same_fault(said, error):
            what = f"{type(error).__name__}: {error}" if error else "no fault"
            self._differ(hook, f"{said or 'no fault'} compiled, {what} in the interpreter")
            return
        if said is not None:
            result.raised += 1
            if hook == "update":
                self._updates_raised += 1
                self._last_raised = said
            return
        mine[_LINE] = theirs[_LINE] = record[_LINE]
        for member in self._optional:
            if not mine[member.known] and not theirs[member.known]:
                mine[member.name] = theirs[member.name]  # None has no value
        if not np.array_equal(_bytes(mine), _bytes(theirs)):
            self._compare(hook, mine, theirs)
        _bytes(record)[:] = _bytes(theirs)

    def _compare(self, hook: str, mine: Any, theirs: Any) -> None:
        """Compare all members."""
        result = self.result
        nearby: list[Any] = []
        for name in mine.dtype.names:
            one, other = _floats(mine[name]), _floats(theirs[name])
            far = ulp(one, other)
            result.largest_ulp = max(result.largest_ulp, far if far <= LARGEST_ULP else 0)
            if far <= LARGEST_ULP:
                continue
            nearby = nearby or self._nearby(hook)
            if _is_rounding(one, other, [_floats(each[name]) for each in nearby]):
                result.rounded += 1
                continue
            element, ours, pythons = _farthest(one, other)
            distance = f" ({far} ulp)" if far < 2**62 else ""
            self._differ(
                hook,
                f"{name.replace('__', '.')}{element} is {ours} compiled, {pythons} in the "
                f"interpreter{distance}",
            )

    def _nearby(self, hook: str) -> list[Any]:
        """Return records of the interpreter for inputs changed by one unit in the last place."""
        found = []
        theirs = self._record.copy()
        names = [
            name
            for name in theirs.dtype.names
            if theirs[name].dtype.kind == "f" and not name.startswith(own_field(""))
        ]
        towards: dict[str, Any] = {}
        for number in range(_TRIES):
            _bytes(theirs)[:] = _bytes(self._record)
            for name in names:
                # Try both directions: one of them may round to the same float32.
                towards[name] = -towards[name] if number % 2 else self._towards(theirs[name])
                theirs[name] = np.nextafter(theirs[name], towards[name])
            if self._raised(hook, self._other, theirs) is None:
                found.append(theirs.copy())
        return found

    def _towards(self, values: Any) -> Any:
        """Return an infinity of random sign for each value."""
        return self._draw.choice((-np.inf, np.inf), values.shape).astype(values.dtype)

    def _raised(self, hook: str, model: Model, record: Any) -> Exception | None:
        """Run a hook of a model on a record; return its exception, or None."""
        model.load(record)
        try:
            with self._bounds.python():
                model.run(hook)
        except TimeLimitError as error:
            self._endless(hook, error)
            raise _EndError from None
        except Exception as error:
            return error
        model.store(record)
        return None

    def _differ(self, hook: str, what: str) -> None:
        self.result.differ(f"{hook}, cycle {self._cycle}: {what}", self._compiled.file)

    def _endless(self, hook: str, error: BaseException) -> None:
        file = self._compiled.file
        where = "in the interpreter"
        self.result.endless(
            hook, self._cycle, where + self._read(hook), file, loop_line(error, file)
        )

    def _read(self, hook: str) -> str:
        """Return the values of up to three scalar inputs, for the message."""
        inputs = [
            each.name
            for each in self._compiled.description.of(Input)
            if not each.message and not each.type.shape
        ]
        if hook not in REALTIME_HOOKS or not inputs:
            return ""
        return " with " + ", ".join(f"{each} = {self._record[each]:g}" for each in inputs[:3])


def _same_fault(said: str | None, error: Exception | None) -> bool:
    """Tell whether compiled code and interpreter raised the same type of exception, or none."""
    if said is None or error is None:
        return said is None and error is None
    return isinstance(error, Fault) or any(
        said.partition(": ")[2].startswith(each.__name__) for each in type(error).__mro__
    )


def _is_rounding(mine: Any, theirs: Any, nearby: list[Any]) -> bool:
    """Tell whether a difference is within the effect of last places of the inputs."""
    if not nearby:
        return False
    ours, pythons = np.asarray(mine, np.float64), np.asarray(theirs, np.float64)
    others = np.asarray(nearby, np.float64)
    # Ignore equal elements, including infinity and NaN.
    pairs = zip(np.ravel(mine), np.ravel(theirs), strict=True)
    same = np.reshape([ulp(*pair) <= LARGEST_ULP for pair in pairs], ours.shape)
    finite = np.isfinite(ours) & np.isfinite(pythons) & np.isfinite(others).all(axis=0)
    with np.errstate(all="ignore"):
        spread = np.abs(others - pythons).max(axis=0)
        apart = np.abs(ours - pythons)
    near = finite & (apart <= _ROUNDING * spread)
    return bool((same | near).all())


def _floats(value: Any) -> Any:
    """Return complex numbers as pairs of floats, other numbers as they are."""
    is_complex = value.dtype.kind == "c"
    return np.stack([value.real, value.imag], axis=-1) if is_complex else value


def _farthest(mine: Any, theirs: Any) -> tuple[str, Any, Any]:
    """Return the index of the element that differs most, such as `[1, 2]`, and its values."""
    if not np.shape(mine):
        return "", mine, theirs
    far = [ulp(a, b) for a, b in zip(np.ravel(mine), np.ravel(theirs), strict=True)]
    place = tuple(map(int, np.unravel_index(int(np.argmax(far)), np.shape(mine))))
    return f"[{', '.join(map(str, place))}]", mine[place], theirs[place]


def _bytes(record: Any) -> Any:
    """Return the memory of a record, including padding."""
    return record.reshape(1).view(np.uint8)


def ulp(a: Any, b: Any) -> int:
    """Return the largest distance between two values or arrays, in units in the last place."""
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


class _Inputs:
    """The values of an input in the cycles up to the next restart."""

    def __init__(self, member: Member, values: "_Values") -> None:
        """Draw all values at once: single calls of NumPy are slow."""
        name, draw = member.name, values.draw
        self._flags = [f"{name}__{flag}" for flag in ("new", "valid", "connected")]
        self._age_name = f"{name}__age"
        self._new = (draw.random(_ANEW) < 0.8).tolist()
        self._age = (draw.integers(0, 3, _ANEW) * 1_000_000).tolist()
        self._values: dict[str, Any] = {}
        for leaf in member.leaves:
            shape = (_ANEW, *leaf.type.shape)
            self._values[name + leaf.field] = values.of(leaf.type, shape)
            if leaf.is_variable:
                counts = draw.integers(0, leaf.type.count, _ANEW, endpoint=True)
                # Most messages have full length.
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
    """The messages of a queue: up to three per cycle, sometimes more than its size."""

    def __init__(self, member: Member, values: "_Values") -> None:
        """Draw all messages at once."""
        self._member = member
        self._counts = values.draw.choice((0, 0, 0, 1, 1, 2, 3, member.size + 1), _ANEW).tolist()
        shape = (_ANEW, member.size + 3, *member.type.shape)
        self._values = values.of(member.type, shape)

    def put(self, record: Any, cycle: int) -> None:
        """Put the messages of a cycle."""
        port = QueuePort(record, self._member)
        for number in range(self._counts[cycle]):
            port.put(self._values[cycle][number])


class _Values:
    """Draws values of inputs."""

    def __init__(self, draw: Any, edges: float, numbers: list[int]) -> None:
        """`edges`: the share of special values; `numbers`: ints of the source.

        In half of the runs most ints are of the source, such as the values of an enum.
        """
        self.draw, self._edges, self._numbers = draw, edges, numbers
        self._share = float(draw.choice((0.2, 0.95)))

    def of(self, kind: ValueType, shape: tuple[int, ...]) -> Any:
        """Return values of a type, with a random scale for each index of the first dimension."""
        draw = self.draw
        if kind.is_bool:
            values = draw.random(shape) < 0.5
        elif kind.enumeration:
            values = draw.choice([number_of(each) for each in kind.enumeration], shape)
        elif kind.is_float:
            scale = 10.0 ** draw.integers(-3, 4, (shape[0], *(1 for _ in shape[1:])))
            values = draw.normal(0.0, 1.0, shape) * scale
            values = np.where(draw.random(shape) < self._edges, draw.choice(_EDGES, shape), values)
        else:
            limits = np.iinfo(kind.scalar)
            low, high = max(limits.min, -1000), min(limits.max, 1000)
            values = draw.integers(low, high, shape, dtype=np.int64, endpoint=True)
            numbers = [each for each in self._numbers if limits.min <= each <= limits.max]
            if numbers:
                is_known = draw.random(shape) < self._share
                values = np.where(is_known, draw.choice(numbers, shape), values)
        return values.astype(kind.scalar)


def _parameters(record: Any, parameters: list[Member], draw: Any) -> None:
    for member in parameters:
        low, high = (member.options.get(each) for each in ("min", "max"))
        if member.type.is_bool:
            record[member.name] = draw.random(member.type.shape) < 0.5
        elif member.type.enumeration:
            record[member.name] = draw.choice([number_of(each) for each in member.type.enumeration])
        elif low is not None and high is not None and member.type.is_float:
            record[member.name] = draw.uniform(low, high, member.type.shape)
        elif low is not None and high is not None:
            record[member.name] = draw.integers(low, high, member.type.shape, endpoint=True)
